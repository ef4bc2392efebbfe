"""Curvature to volts to counts and back, and what bounds the frame rate."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin import (
    Converter,
    HalfBridge,
    Patch,
    Plate,
    Refusal,
    Sensor,
    SensorLayout,
    Transduction,
)
from kappaskin.transduction import PAPER

transductions = st.builds(
    Transduction,
    st.builds(HalfBridge, gage_factor=st.floats(1.5, 4), gain=st.floats(10, 500)),
    st.builds(Converter, bits=st.integers(8, 24), offset=st.floats(-1, 1)),
)


def sensor(elements=(10, 10), transduction=PAPER, rate=100.0, rigidity=1.0):
    layout = SensorLayout.regular(Patch(0.1, 0.1), *elements)
    plate = Plate(layout.patch, rigidity)
    return Sensor(layout, transduction, plate, "hinged", rate, "a skin", "1", "1.0", True)


def test_volts_per_curvature_are_those_of_equation_7():
    bridge = HalfBridge(2.0, 200e-6, 50e-6, 4.0, 150.0)

    # V_in GF (t_s + t_g) Gain / 4 = 4 * 2 * 250e-6 * 150 / 4
    assert bridge.sensitivity == pytest.approx(0.075, rel=1e-14)


def test_a_gage_strains_by_curvature_times_half_the_distance_between_the_gages():
    np.testing.assert_allclose(HalfBridge().strain([10.0, -80.0]), [1.25e-3, -0.01])


def test_counts_are_volts_over_the_step_of_the_converter():
    transduction = Transduction(HalfBridge(2.0, 200e-6, 50e-6, 4.0, 150.0), Converter(12, 2.0))

    # 0.075 V m, 2 V / 2048 per count: 10 1/m is 0.75 V, 768 counts.
    assert transduction.counts(np.array([10.0, -10.0, 0.0])).tolist() == [768, -768, 0]
    np.testing.assert_allclose(transduction.curvature(np.array([768, -768])), [10.0, -10.0])


@given(transductions, st.floats(-0.99, 0.99))
def test_a_round_trip_is_true_within_half_a_count(transduction, share):
    converter = transduction.converter
    volts = share * (converter.full_scale - 2 * converter.step - abs(converter.offset))
    curvature = np.array([volts / transduction.bridge.sensitivity])

    back = transduction.curvature(transduction.counts(curvature))

    assert abs(back - curvature)[0] <= transduction.resolution * (0.5 + 1e-6)


@given(transductions, st.data())
def test_every_count_between_the_rails_comes_back_as_itself(transduction, data):
    low, high = transduction.converter.limits
    counts = np.array([data.draw(st.integers(low + 1, high - 1))])

    assert transduction.counts(transduction.curvature(counts)).tolist() == counts.tolist()


def test_a_reading_on_a_rail_has_no_curvature():
    transduction = Transduction()
    low, high = transduction.converter.limits

    curvature = transduction.curvature(np.array([low, low + 1, 0, high - 1, high]))

    assert np.isnan(curvature).tolist() == [True, False, False, False, True]


@pytest.mark.parametrize("curvature", [1e6, math.inf])
def test_curvature_beyond_the_range_stands_on_the_rails(curvature):
    transduction = Transduction()

    counts = transduction.counts(np.array([curvature, -curvature]))

    assert counts.tolist() == [32767, -32768]
    assert transduction.saturated(counts).all()


def test_zero_curvature_reads_the_offset():
    transduction = Transduction(converter=Converter(bits=16, full_scale=2.5, offset=0.5))

    counts = transduction.counts(np.zeros(1))

    assert counts.tolist() == [round(0.5 / 2.5 * 2**15)]
    assert abs(transduction.curvature(counts)[0]) <= transduction.resolution / 2


def test_nan_curvature_is_refused_since_a_converter_always_reads_a_number():
    with pytest.raises(Refusal, match="got NaN"):
        Transduction().counts(np.array([0.0, math.nan]))


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
@pytest.mark.parametrize(
    "name", ["gage_factor", "substrate_thickness", "gage_thickness", "excitation", "gain"]
)
def test_a_bridge_with_an_impossible_value_is_refused_by_its_name(name, value):
    with pytest.raises(Refusal, match=rf"expected HalfBridge\.{name} above zero, got {value}"):
        HalfBridge(**{name: value})


@pytest.mark.parametrize(
    ("impossible", "match"),
    [
        ({"bits": 7}, "8 to 24 bits, got 7"),
        ({"bits": 25}, "8 to 24 bits, got 25"),
        ({"full_scale": 0.0}, r"Converter\.full_scale above zero, got 0\.0"),
        ({"conversion_time": -1e-6}, r"Converter\.conversion_time above zero"),
        ({"offset": 2.5}, r"inside \+-2\.5 V, got 2\.5 V; balance the bridge"),
        ({"offset": math.nan}, "got nan V"),
    ],
)
def test_an_impossible_converter_is_refused(impossible, match):
    with pytest.raises(Refusal, match=match):
        Converter(**impossible)


def test_the_papers_300_channels_take_6_ms_and_give_167_frames_per_second():
    assert PAPER.scan_time(300) == pytest.approx(6e-3, rel=1e-12)
    assert sensor(rate=166.6).channels == 300


@pytest.mark.parametrize("rate", [166.7, 0.0, -1.0, math.nan, math.inf])
def test_a_sensor_refuses_a_rate_that_its_converter_cannot_scan(rate):
    with pytest.raises(Refusal, match=r"300 channels at 20 us take 6 ms.*at most 166\.7 frames/s"):
        sensor(rate=rate)


def test_fewer_elements_may_be_scanned_faster():
    assert sensor((5, 5), rate=660.0).rate == 660.0


@pytest.mark.parametrize("rigidity", [0.0, -1.0, math.nan])
def test_a_sensor_refuses_a_skin_without_rigidity(rigidity):
    with pytest.raises(Refusal, match=f"rigidity above zero in N m, got {rigidity}"):
        sensor(rigidity=rigidity)
