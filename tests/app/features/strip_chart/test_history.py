"""The history keeps a minute whole and an hour by tenths, and joins nothing across a gap."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin_app.features.strip_chart.history import LONG, WHOLE, StripHistory


def filled(times: np.ndarray, *columns: np.ndarray, at_once: int = 10) -> StripHistory:
    history, values = StripHistory(len(columns)), np.stack(columns, axis=1)
    for n in range(0, len(times), at_once):
        history.append(times[n : n + at_once], values[n : n + at_once])
    return history


def test_a_minute_is_whole() -> None:
    times = np.arange(0, 70, 0.01)
    history = filled(times, np.sin(times), np.cos(times))

    span = history.span(1, times[-1] - WHOLE, 10_000)

    assert len(span.times) == 6001
    np.testing.assert_allclose(span.mean, np.cos(span.times), atol=1e-6)
    assert np.array_equal(span.least, span.largest)


def test_a_peak_of_one_frame_is_seen_in_any_span() -> None:
    times = np.arange(0, 50, 0.001)
    values = np.zeros(len(times))
    values[12_345] = 7.0
    history = filled(times, values, at_once=500)

    span = history.span(0, 0.0, 300)

    assert 280 < len(span.times) < 320
    assert span.largest.max() == 7
    assert span.least.max() == 0
    x, y = span.outline
    assert (len(x), y.max()) == (2 * len(span.times), 7)


def test_an_hour_is_kept_by_tenths_of_a_second() -> None:
    times = np.arange(0, 5000, 0.05)
    history = filled(times, times, at_once=1000)

    span = history.span(0, times[-1] - LONG, 10**6)

    assert span.times[0] == pytest.approx(times[-1] - LONG, abs=0.3)
    early = span.times < times[-1] - 4000  # none: the minute is whole, at 20 frames/s much more
    assert not early.any()
    assert (np.diff(span.times) > 0).all()
    assert np.max(np.abs(span.mean - span.times)) < 0.1


def test_tenths_have_the_least_mean_and_largest_of_their_frames() -> None:
    times = np.arange(0, 300, 0.001) + 0.0005
    history = filled(times, np.arange(len(times)) % 100.0, at_once=777)

    span = history.span(0, 10.0, 10**6)
    tenths = span.times < 100  # the last 131,072 frames are whole

    assert tenths.sum() == 900
    assert set(span.least[tenths].tolist()) == {0}
    assert set(span.largest[tenths].tolist()) == {99}
    np.testing.assert_allclose(span.mean[tenths], 49.5)


def test_a_time_before_the_last_begins_anew() -> None:
    times = np.arange(0, 10, 0.01)
    history = filled(times, times)

    history.append(np.array([3.0, 3.01]), np.array([[1.0], [2.0]]))

    assert history.span(0, -1e9, 10**6).times.tolist() == [3.0, 3.01]
    history.append(np.array([3.02, 1.0, 1.01]), np.array([[1.0], [2.0], [3.0]]))
    assert history.span(0, -1e9, 10**6).times.tolist() == [1.0, 1.01]


def test_a_curve_is_broken_where_no_frames_came() -> None:
    history = filled(np.array([0.0, 0.1, 5.0, 5.1]), np.ones(4))

    span = history.span(0, -1.0, 100)

    assert np.isnan(span.mean).sum() == 1
    assert np.isnan(span.mean[span.times == 2.55])
    assert np.isfinite(span.mean[[0, -1]]).all()


def test_nothing_is_known_at_first_and_of_what_is_unknown() -> None:
    history = StripHistory(2)
    assert len(history.span(0, 0.0, 10).times) == 0
    history.append(np.empty(0), np.empty((0, 2)))

    history.append(np.arange(40) / 100, np.full((40, 2), np.nan))

    assert np.isnan(history.span(0, 0.0, 5).mean).all()


@given(
    st.lists(st.floats(0, 0.4), min_size=1, max_size=60),
    st.integers(1, 7),
    st.integers(1, 50),
)
def test_what_is_drawn_lies_between_what_was_kept(
    steps: list[float], at_once: int, parts: int
) -> None:
    times = np.cumsum(steps)
    values = np.sin(40 * times)
    span = filled(times, values, at_once=at_once).span(0, -1.0, parts)

    assert (np.diff(span.times) >= 0).all()
    assert (span.least <= span.mean + 1e-6).all()
    assert (span.mean <= span.largest + 1e-6).all()
    assert span.largest.max() == pytest.approx(values.max(), abs=1e-6)
    assert span.least.min() == pytest.approx(values.min(), abs=1e-6)
