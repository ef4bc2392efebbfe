"""Numbers at the edge: lines, gains and offsets that no electronics have are refused."""

from datetime import UTC, datetime

import numpy as np
import pytest

from kappaskin import Calibration, Refusal
from kappaskin.calibration import Tare
from kappaskin.calibration.identification import fit_lines

DATE = datetime(2026, 1, 1, tzinfo=UTC)
X = np.linspace(-50.0, 50.0, 21)
Y = 2 * X[:, None] + 1 + np.random.default_rng(0).normal(0, 0.1, (21, 6))


def calibration(**numbers):
    names = {"gain": 1.0, "offset": 0.0, "gain_sd": 0.01, "offset_sd": 0.01} | numbers
    parts = [np.full(5, value) for value in names.values()]
    return Calibration("a", "b", "c", "d", DATE, *parts)


def tare(**numbers):
    names = {"offset": 0.0, "offset_sd": 0.01} | numbers
    return Tare("a", "b", "d", DATE, None, 500, 1.0, *(np.full(5, v) for v in names.values()))


@pytest.mark.parametrize("gain", [0.0, -1.0, 5e-324, 1e-300, 1e-10, 1e10, 1e300, np.inf])
def test_a_gain_of_no_electronics_is_refused(gain):
    with pytest.raises(Refusal, match=r"above zero, from 1e-09 to 1e.09|a reason for"):
        calibration(gain=gain)


@pytest.mark.parametrize("offset", [-1e13, 1e13, 1e160, 1e300, -np.inf])
def test_an_offset_of_no_electronics_is_refused(offset):
    with pytest.raises(Refusal, match=r"offsets of at most 1e.12 1/m"):
        calibration(offset=offset)
    with pytest.raises(Refusal, match=r"offsets of at most 1e.12 1/m"):
        tare(offset=offset)


@pytest.mark.parametrize("value", [5e-324, 1e-300, 1e-3])
def test_what_is_next_to_nothing_is_an_offset(value):
    assert calibration(offset=value).offset[0] == value
    assert tare(offset=-value).offset[0] == -value


@pytest.mark.parametrize("kx", [-1074, -1000, -400, -325, -50, 0, 50, 325, 400, 1000])
@pytest.mark.parametrize("ky", [-1000, -320, 0, 320, 1000])
def test_lines_scale_with_curvatures_and_readings_or_are_refused(kx, ky):
    x, y, known = np.ldexp(X, kx), np.ldexp(Y, ky), fit_lines(X, Y)

    if max(abs(kx), abs(ky)) >= 340:
        with pytest.raises(Refusal, match="expected curvatures and readings of 0, or 1e-100 to"):
            fit_lines(x, y)
        return

    lines = fit_lines(x, y)
    for name, k in (("gain", ky - kx), ("offset", ky), ("gain_sd", ky - kx), ("offset_sd", ky)):
        expected = np.ldexp(getattr(known, name), k)
        np.testing.assert_allclose(getattr(lines, name), expected, rtol=1e-9)
    np.testing.assert_allclose(lines.rms, np.ldexp(known.rms, kx), rtol=1e-9)


def test_a_channel_that_reads_nothing_has_no_line_but_does_not_spoil_the_others():
    y = np.hstack([Y, np.zeros((21, 1)), np.full((21, 1), np.nan)])

    lines = fit_lines(X, y)

    np.testing.assert_allclose(lines.gain[:6], fit_lines(X, Y).gain, rtol=1e-12)
    assert lines.gain[6] == 0
    assert np.isnan(lines.gain[7])
