"""Curvature to volts to counts and back, and what bounds the frame rate."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from kappaskin import Patch, Plate, Refusal, Sensor, SensorLayout, Transduction
from kappaskin.sensing import (
    FIRST_GENERATION,
    SECOND_GENERATION,
    Amplifier,
    Converter,
    HalfBridge,
    Multiplexer,
)

transductions = st.builds(
    Transduction,
    bridge=st.builds(HalfBridge, gage_factor=st.floats(1.5, 4)),
    amplifier=st.builds(Amplifier, gain=st.floats(10, 500)),
    converter=st.builds(Converter, bits=st.integers(8, 24), offset=st.floats(-1, 1)),
)
ROUND = Transduction(
    HalfBridge(2.0, 200e-6, 50e-6, 4.0), amplifier=Amplifier(150.0), converter=Converter(12, 2.0)
)


def sensor(elements=(10, 10), transduction=SECOND_GENERATION, rate=100.0, rigidity=1.0):
    layout = SensorLayout.regular(Patch(0.1, 0.1), *elements)
    plate = Plate(layout.patch, rigidity)
    return Sensor(layout, transduction, plate, "hinged", rate, "a skin", "1", "1.0", True)


def test_volts_per_curvature_are_those_of_equation_7():
    # V_in GF (t_s + t_g) Gain / 4 = 4 * 2 * 250e-6 * 150 / 4
    assert ROUND.sensitivity == pytest.approx(0.075, rel=1e-14)


def test_a_gage_strains_by_curvature_times_half_the_distance_between_the_gages():
    np.testing.assert_allclose(HalfBridge().strain([10.0, -80.0]), [1.25e-3, -0.01])


def test_counts_are_volts_over_the_step_of_the_converter():
    # 0.075 V m, 2 V / 2048 per count: 10 1/m is 0.75 V, 768 counts.
    assert ROUND.counts(np.array([10.0, -10.0, 0.0])).tolist() == [768, -768, 0]
    np.testing.assert_allclose(ROUND.curvature(np.array([768, -768])), [10.0, -10.0])


@given(transductions, st.floats(-0.99, 0.99))
def test_a_round_trip_is_true_within_half_a_count(transduction, share):
    converter = transduction.converter
    volts = share * (converter.full_scale - 2 * converter.step - abs(converter.offset))
    curvature = np.array([volts / transduction.sensitivity])

    back = transduction.curvature(transduction.counts(curvature))

    assert abs(back - curvature)[0] <= transduction.resolution * (0.5 + 1e-6)


@given(transductions, st.data())
def test_every_count_between_the_rails_comes_back_as_itself(transduction, data):
    low, high = transduction.limits
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
    with pytest.raises(Refusal, match="without NaN"):
        Transduction().counts(np.array([0.0, math.nan]))


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
@pytest.mark.parametrize(
    ("part", "name"),
    [
        (HalfBridge, "gage_factor"),
        (HalfBridge, "substrate_thickness"),
        (HalfBridge, "gage_thickness"),
        (HalfBridge, "excitation"),
        (HalfBridge, "gage_resistance"),
        (HalfBridge, "dummy_resistance"),
        (Amplifier, "gain"),
        (Amplifier, "rail"),
        (Converter, "full_scale"),
        (Converter, "conversion_time"),
    ],
)
def test_a_part_with_an_impossible_value_is_refused_by_its_name(part, name, value):
    with pytest.raises(Refusal, match=rf"{part.__name__}\.{name} above zero, got {value}"):
        part(**{name: value})


@pytest.mark.parametrize("value", [-1e-9, math.nan, math.inf])
@pytest.mark.parametrize("name", ["settling_time", "supply_resistance"])
def test_a_multiplexer_with_an_impossible_value_is_refused_by_its_name(name, value):
    with pytest.raises(Refusal, match=rf"Multiplexer\.{name} of at least zero, got {value}"):
        Multiplexer(**{name: value})


@pytest.mark.parametrize("mismatch", [1.0, -1.0, math.nan])
def test_gages_that_share_no_resistance_are_refused(mismatch):
    with pytest.raises(Refusal, match=f"gage_mismatch between -1 and 1.*got {mismatch}"):
        HalfBridge(gage_mismatch=mismatch)


@pytest.mark.parametrize("voltage", [0.0, 5.0, -1.0, math.nan, math.inf])
def test_a_balance_voltage_that_no_divider_makes_is_refused(voltage):
    with pytest.raises(Refusal, match=f"between 0 and the excitation of 5 V, got {voltage}"):
        HalfBridge(balance_voltage=voltage)


def test_electronics_beyond_what_numbers_hold_are_refused():
    with pytest.raises(Refusal, match="convert 1/m to volts, got inf"):
        Transduction(HalfBridge(excitation=1e300), amplifier=Amplifier(1e300))
    with pytest.raises(Refusal, match=r"got 0\.0 V per 1/m"):
        Transduction(HalfBridge(excitation=1e-300), amplifier=Amplifier(1e-300))


# The bridge of Fig. 4, by Ohm's law


def middle(bridge, curvature, supply_resistance=0.0):
    """Volts at the middle of a pair whose resistors are worked out one by one."""
    R_g, m = bridge.gage_resistance, bridge.gage_mismatch
    change = bridge.gage_factor * bridge.strain(curvature)
    upper, lower = R_g * (1 - m / 2) * (1 - change), R_g * (1 + m / 2) * (1 + change)
    return bridge.excitation * lower / (supply_resistance + upper + lower)


def read(transduction, curvature):
    """Volts at the converter for one curvature in 1/m, by the resistors."""
    bridge, series = transduction.bridge, transduction.multiplexer.supply_resistance
    upper, lower = bridge.dummy_arms
    dummy = bridge.excitation * lower / (upper + lower)
    out = transduction.amplifier.gain * (middle(bridge, curvature, series) - dummy)
    return out + transduction.converter.offset


@given(
    st.floats(-0.02, 0.02),
    st.floats(0, 300),
    st.floats(-1, 1),
    st.floats(-80, 80),
    st.floats(-0.1, 0.1),
)
def test_eq_7_is_what_the_resistors_of_fig_4_make(mismatch, series, offset, curvature, trim):
    bridge = HalfBridge(gage_mismatch=mismatch).balanced(series)
    bridge = replace(bridge, balance_voltage=bridge.v_bal + 1e-2 * trim)
    transduction = Transduction(
        bridge,
        Multiplexer(supply_resistance=series),
        Amplifier(rail=20.0),
        Converter(full_scale=20.0, offset=offset),
    )

    volts = transduction.sensitivity * curvature + transduction.offset

    # What is left out: a mismatch m bends the line by the share m GF strain / 2, and what feeds
    # the pair tilts it by m r / (4 + 2 r), with r its resistance in those of a gage.
    r, m = series / bridge.gage_resistance, abs(mismatch)
    left_out = m * (r / (4 + 2 * r) + 2.1 * 0.01 / 2 + m)
    bound = left_out * abs(transduction.sensitivity * curvature) + 1e-9
    assert abs(volts - read(transduction, curvature)) <= bound


def test_without_mismatch_the_half_bridge_is_linear_to_the_last_digit():
    bridge = HalfBridge()
    curvature = np.linspace(-200, 200, 9)  # 2.5 % strain: a quarter bridge is off by 2.6 %

    moved = middle(bridge, curvature) - 2.5

    np.testing.assert_allclose(moved, curvature * moved[-1] / 200, rtol=1e-12, atol=1e-15)


def test_the_line_bends_by_half_the_mismatch_times_the_change_of_resistance():
    bridge = HalfBridge(gage_mismatch=0.01)
    K = 0.01 / float(bridge.strain(1.0))  # 1 % strain

    up, rest, down = (middle(bridge, curvature) for curvature in (K, 0.0, -K))

    bent = (up + down - 2 * rest) / (up - down)
    assert bent == pytest.approx(-0.01 * 2.1 * 0.01 / 2, rel=1e-3)


def test_a_mismatch_shows_as_an_offset_and_the_null_voltage_takes_it_away():
    mismatched = Transduction(HalfBridge(gage_mismatch=2e-3))

    # Gain V_in m / 4 = 100 * 5 * 0.002 / 4
    assert mismatched.offset == pytest.approx(0.25, rel=1e-12)
    assert mismatched.counts(np.zeros(1)).tolist() == [round(0.25 / 2.5 * 2**15)]
    assert Transduction(mismatched.bridge.balanced()).offset == pytest.approx(0.0, abs=1e-12)
    assert mismatched.bridge.null_voltage() == pytest.approx(2.5025, rel=1e-12)


def test_the_dummys_arms_divide_the_excitation_to_the_balance_voltage():
    upper, lower = HalfBridge(balance_voltage=2.0, dummy_resistance=100.0).dummy_arms

    assert (upper, lower) == (pytest.approx(150.0), 100.0)


def test_an_offset_does_not_change_what_is_read():
    curvature = np.array([-20.0, 0.0, 20.0])
    mismatched = Transduction(HalfBridge(gage_mismatch=-5e-3), converter=Converter(offset=0.2))

    back = mismatched.curvature(mismatched.counts(curvature))

    np.testing.assert_allclose(back, curvature, atol=mismatched.resolution / 2)


@pytest.mark.parametrize(
    ("bridge", "null"),
    [(HalfBridge(gage_mismatch=0.02), "2.525"), (HalfBridge(balance_voltage=2.4), "2.5")],
)
def test_a_bridge_that_rails_the_amplifier_unbent_is_refused_with_the_voltage_that_nulls_it(
    bridge, null
):
    with pytest.raises(
        Refusal, match=rf"2\.5 V at the amplifier.*balance the bridge with {null} V"
    ):
        Transduction(bridge)


def test_an_offset_that_rails_the_converter_alone_is_refused_too():
    bridge = HalfBridge(gage_mismatch=0.01)  # 1.25 V at the amplifier
    with pytest.raises(Refusal, match=r"balance the bridge with 2\.5125 V"):
        Transduction(bridge, amplifier=Amplifier(rail=5.0), converter=Converter(full_scale=1.0))


def test_the_amplifiers_rails_are_the_limits_when_they_come_first():
    transduction = Transduction(
        amplifier=Amplifier(rail=1.25), converter=Converter(12, 2.5, offset=0.5)
    )

    counts = transduction.counts(np.array([1e3, -1e3, 0.0]))

    # 1.75 V, -0.75 V and 0.5 V in steps of 2.5 V / 2048
    assert counts.tolist() == [1434, -614, 410]
    assert np.isnan(transduction.curvature(counts)).tolist() == [True, True, False]


def test_the_converters_limits_hold_when_they_come_first():
    assert Transduction(amplifier=Amplifier(rail=10.0)).limits == Converter().limits


def test_a_multiplexer_of_the_supply_takes_its_share_of_the_excitation():
    bridge, series = HalfBridge(gage_resistance=100.0), 50.0
    fed_through = Transduction(bridge.balanced(series), Multiplexer(supply_resistance=series))

    assert bridge.fed(series) == pytest.approx(4.0)
    assert fed_through.sensitivity == pytest.approx(0.8 * Transduction(bridge).sensitivity)


# The strain limit


def test_the_strain_limit_is_one_percent_at_the_gages():
    limit = SECOND_GENERATION.strain_limit_curvature

    assert SECOND_GENERATION.bridge.strain(limit) == pytest.approx(0.01, rel=1e-12)
    assert limit == pytest.approx(2 * 0.01 / 125e-6, rel=1e-12)


def elements(*readings):
    return np.array(readings, float).T


def test_an_element_is_flagged_by_its_larger_principal_curvature():
    limit = Transduction().strain_limit_curvature  # 80 1/m
    K = elements(
        (0.99 * limit, 0, 0),
        (1.01 * limit, 0, 0),
        (0, -1.01 * limit, 0),
        (0, 0, 1.01 * limit),
        (0.8 * limit, 0.8 * limit, 0.25 * limit),  # a gage at 45 degrees sees 1.05 of the limit
        (0.8 * limit, -0.8 * limit, 0.5 * limit),  # principal +-0.943
    )

    assert Transduction().overstrained(K).tolist() == [False, True, True, True, True, False]


@given(st.lists(st.floats(-200, 200), min_size=3, max_size=3))
def test_the_flag_agrees_with_the_eigenvalues_of_the_curvature(readings):
    xx, yy, xy = readings
    largest = np.abs(np.linalg.eigvalsh([[xx, xy], [xy, yy]])).max()
    assume(largest > 1e-3)
    at_the_limit = elements(readings) * Transduction().strain_limit_curvature / largest

    assert not Transduction().overstrained(at_the_limit * (1 - 1e-6)).any()
    assert Transduction().overstrained(at_the_limit * (1 + 1e-6)).all()


def test_missing_readings_neither_flag_an_element_nor_hide_what_the_others_show():
    nan = math.nan
    K = elements((nan, nan, nan), (nan, 100, 0), (100, nan, nan), (nan, 0, 79), (nan, 70, 70))

    flagged = Transduction().overstrained(np.stack([K, -K]))

    assert flagged.tolist() == 2 * [[False, True, True, False, False]]
    assert Transduction().overstrained(elements((math.inf, -math.inf, 0))).tolist() == [True]


@pytest.mark.parametrize("shape", [(3,), (2, 5), (300,)])
def test_curvature_of_another_shape_is_refused(shape):
    with pytest.raises(Refusal, match=r"shape \(\.\.\., 3, P\)"):
        Transduction().overstrained(np.zeros(shape))


# The two prototypes


def test_the_prototypes_have_the_papers_layers():
    # 25 um of polyimide between 35 um of copper, and 30 um of gage.
    assert SECOND_GENERATION.bridge.thickness == pytest.approx(125e-6)
    # Twice 25 um of polyimide with 13 um of copper, 50 um of adhesive, and 30 um of gage.
    assert FIRST_GENERATION.bridge.thickness == pytest.approx(156e-6)


@pytest.mark.parametrize("prototype", [FIRST_GENERATION, SECOND_GENERATION])
def test_the_prototypes_resolve_the_noise_of_table_1_and_reach_beyond_its_peak(prototype):
    assert prototype.resolution < 0.231 / 4
    assert prototype.limits[1] * prototype.resolution > 50


@pytest.mark.parametrize(
    ("impossible", "match"),
    [
        ({"bits": 7}, "8 to 24 bits, got 7"),
        ({"bits": 25}, "8 to 24 bits, got 25"),
        ({"offset": 2.5}, r"inside \+-2\.5 V, got 2\.5 V; balance the bridge"),
        ({"offset": math.nan}, "got nan V"),
    ],
)
def test_an_impossible_converter_is_refused(impossible, match):
    with pytest.raises(Refusal, match=match):
        Converter(**impossible)


def test_the_papers_300_channels_take_6_ms_and_give_167_frames_per_second():
    assert SECOND_GENERATION.scan_time(300) == pytest.approx(6e-3, rel=1e-12)
    assert sensor(rate=166.6).channels == 300


def test_a_channel_takes_its_settling_and_its_conversion():
    slow = Transduction(multiplexer=Multiplexer(5e-6), converter=Converter(conversion_time=20e-6))

    assert slow.scan_time(300) == pytest.approx(7.5e-3, rel=1e-12)


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
