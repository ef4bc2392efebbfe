"""What a device says it is: understood whole, or refused with a reason."""

import json
import math
import re
import tracemalloc
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin import Cap, Patch, Plate, Sensor, SensorLayout, SourceError, Transduction
from kappaskin._toml import REQUIRED
from kappaskin.sensing import Amplifier, Converter, HalfBridge, Multiplexer
from kappaskin.sources import sensor_from_json, sensor_to_json
from kappaskin.sources.information import SENSOR

PATCH = Patch(0.1, 0.08)


def sensor_on(layout: SensorLayout, **changes: Any) -> Sensor:
    transduction = Transduction(
        HalfBridge(gage_mismatch=1e-3, balance_voltage=2.501),
        Multiplexer(3e-6, 0.25),
        Amplifier(51.5, 2.25),
        Converter(bits=12, offset=-0.01),
    )
    sensor = Sensor(
        layout,
        transduction,
        Plate(layout.patch, 2e-3),
        "hinged",
        10.0,
        "skin",
        "A-7",
        "1.2",
        simulated=False,
    )
    return replace(sensor, **changes)


def same(one: Sensor, other: Sensor) -> bool:
    names = (
        "transduction",
        "plate",
        "edge",
        "rate",
        "name",
        "serial_number",
        "firmware",
        "simulated",
    )
    a, b = one.layout, other.layout
    return (
        all(getattr(one, name) == getattr(other, name) for name in names)
        and (a.patch, a.shape) == (b.patch, b.shape)
        and np.array_equal(a.positions, b.positions)
        and np.array_equal(a.live, b.live)
    )


def said(**changes: Any) -> dict[str, Any]:
    regular = SensorLayout.regular(PATCH, 3, 2)
    return {**json.loads(sensor_to_json(sensor_on(regular))), **changes}


def scattered(positions: Any, **changes: Any) -> dict[str, Any]:
    found = said(positions=positions, **changes)
    del found["grid"]
    return found


# Round trips


def test_all_that_holds_the_skin_survives() -> None:
    patch = Patch(0.04, 0.03, 0.0129)
    plate = Plate(patch, 0.0, 5.0, 1e4, fluid=True, poisson=0.4, axial_stiffness=300.0)
    sensor = sensor_on(SensorLayout.regular(patch, 3, 2), plate=plate)

    assert same(sensor_from_json(sensor_to_json(sensor)), sensor)


def test_how_the_skin_stretches_survives() -> None:
    plate = Plate(PATCH, thickness=0.3e-3, inplane="diaphragm")
    sensor = sensor_on(SensorLayout.regular(PATCH, 3, 2), plate=plate)

    assert same(sensor_from_json(sensor_to_json(sensor)), sensor)
    with pytest.raises(SourceError, match="expected inplane among held, diaphragm, free"):
        sensor_from_json(json.dumps(said(inplane="hoop")))


@pytest.mark.parametrize("radii", [(0.4, 0.5), (-0.4, 0.5), (math.inf, 0.4), (0.4, math.inf)])
def test_the_radii_of_a_shallow_skin_survive(radii) -> None:
    sensor = sensor_on(SensorLayout.regular(Patch(0.1, 0.08, radii), 3, 2))

    assert same(sensor_from_json(sensor_to_json(sensor)), sensor)


@pytest.mark.parametrize("cap", [Cap(0.008), Cap(0.008, 1.2, 1.3)], ids=["sphere", "spheroid"])
def test_a_cap_survives(cap) -> None:
    layout = SensorLayout.in_spiral(cap, 20)
    sensor = sensor_on(layout, edge="clamped")

    found = sensor_from_json(sensor_to_json(sensor))

    assert same(found, sensor)
    assert json.loads(sensor_to_json(sensor))["base_curvature"] == 0


def test_every_outline_and_edge_survives(held_skin) -> None:
    layout = SensorLayout.regular(held_skin.patch, 3, 1 if held_skin.patch.strip else 3)
    sensor = sensor_on(layout, edge=held_skin.edge)

    found = sensor_from_json(sensor_to_json(sensor))

    assert same(found, sensor)
    assert type(found.layout.patch) is type(held_skin.patch)


SIDES = st.floats(1e-3, 10, allow_subnormal=False)


@given(SIDES, SIDES, st.integers(1, 9), st.integers(1, 9), st.data())
def test_a_regular_sensor_comes_back(a, b, m, n, data) -> None:
    dead = data.draw(st.sets(st.integers(0, m * n - 1)))
    sensor = sensor_on(SensorLayout.regular(Patch(a, b), m, n).without(dead))
    assert same(sensor_from_json(sensor_to_json(sensor)), sensor)


@given(st.lists(st.tuples(st.floats(0, 0.1), st.floats(0, 0.08)), min_size=1, max_size=30))
def test_a_scattered_sensor_comes_back_to_the_last_digit(positions) -> None:
    sensor = sensor_on(SensorLayout.scattered(PATCH, positions))
    assert same(sensor_from_json(sensor_to_json(sensor)), sensor)


def test_a_channel_map_comes_back_and_none_stays_none() -> None:
    layout = SensorLayout.regular(PATCH, 3, 2)
    wired = np.roll(np.arange(18), 5)
    back = sensor_from_json(sensor_to_json(sensor_on(layout, channel_map=wired)))
    assert back.channel_map is not None
    assert np.array_equal(back.channel_map, wired)
    assert sensor_from_json(sensor_to_json(sensor_on(layout))).channel_map is None


def test_a_single_dead_channel_comes_back() -> None:
    layout = SensorLayout.regular(PATCH, 2, 2)
    live = layout.live.copy()
    live[1, 3] = False
    sensor = sensor_on(replace(layout, live=live))

    assert json.loads(sensor_to_json(sensor))["dead_channels"] == [7]
    assert same(sensor_from_json(sensor_to_json(sensor)), sensor)


def test_names_in_any_script_come_back() -> None:
    sensor = sensor_on(SensorLayout.regular(PATCH, 1, 1), name='Haut "№ 7" 皮膚', simulated=True)
    assert same(sensor_from_json(sensor_to_json(sensor)), sensor)


def test_whole_numbers_may_be_written_with_a_point() -> None:
    text = json.dumps(said())
    [bits] = re.findall(r'"bits": (\d+)', text)
    with_point = text.replace(f'"bits": {bits}', f'"bits": {bits}.0')

    assert with_point != text
    assert same(sensor_from_json(with_point), sensor_from_json(text))


def test_keys_of_later_firmware_are_passed_over() -> None:
    assert sensor_from_json(json.dumps(said(colour="blue"))).name == "skin"


# Refusals


PARTS = ("bridge", "multiplexer", "amplifier", "converter")


@pytest.mark.parametrize("key", [key for key in said() if SENSOR.key(key).default is REQUIRED])
def test_a_missing_key_is_named(key: str) -> None:
    found = said()
    del found[key]
    first = next(iter(said()[key])) if key in PARTS else key
    with pytest.raises(SourceError, match=rf"expected {first} = .*, got none; its firmware"):
        sensor_from_json(json.dumps(found))


def test_neither_grid_nor_positions_is_refused() -> None:
    found = said()
    del found["grid"]
    with pytest.raises(SourceError, match=r"expected the grid or the positions .*, got neither"):
        sensor_from_json(json.dumps(found))


def part(group: str, **changes: Any) -> dict[str, Any]:
    return said(**{group: {**said()[group], **changes}})


def test_the_default_electronics_come_back() -> None:
    sensor = sensor_on(SensorLayout.regular(PATCH, 2, 2), transduction=Transduction())
    assert same(sensor_from_json(sensor_to_json(sensor)), sensor)


@pytest.mark.parametrize("value", [True, "5", None, [5], {}])
@pytest.mark.parametrize("group", PARTS)
def test_no_part_of_the_electronics_is_anything_but_a_number(group: str, value: Any) -> None:
    for key in said()[group]:
        if (key, value) == ("balance_voltage", None):
            continue  # two equal dummy resistors
        with pytest.raises(SourceError, match=rf"{group}\.{key}: expected a .*number, got "):
            sensor_from_json(json.dumps(part(group, **{key: value})))


@pytest.mark.parametrize("group", PARTS)
def test_a_missing_part_of_the_electronics_is_never_guessed(group: str) -> None:
    for key in said()[group]:
        found = said()
        del found[group][key]
        with pytest.raises(SourceError, match=f"{group}: expected {key} = .*, got none"):
            sensor_from_json(json.dumps(found))


BAD = {
    "no JSON": ("", "Expecting value"),
    "a text": ('"skin"', "expected an object"),
    "a list": ("[]", "expected an object"),
    "null": ("null", "expected an object"),
    "number too long": ('{"rate":' + "9" * 5000 + "}", "digits"),
    "deep": ("[" * 100_000 + "]" * 100_000, "recursion"),
    "Infinity": (json.dumps(said(rigidity=float("inf"))), "expected a number, got Infinity"),
    "-Infinity": (json.dumps(said(rate=float("-inf"))), "expected a number, got -Infinity"),
    "NaN": (json.dumps(said(size=[float("nan"), 0.1])), "expected a number, got NaN"),
    "infinite by overflow": (
        json.dumps(said()).replace('"rigidity": 0.002', '"rigidity": 1e999'),
        "expected a number, got 1e999",
    ),
    "grid beyond reason": (said(grid=[10**9, 10**9]), "at most 21845 elements"),
    "grid of 10^400": (said(grid=[10**400, 1]), "at most 21845 elements"),
    "grid negative": (said(grid=[-(10**9), -1]), "at most 21845 elements"),
    "grid half negative": (said(grid=[10**9, -1]), "at least 1 x 1"),
    "grid zero": (said(grid=[0, 10**9]), "at least 1 x 1"),
    "grid of one side": (said(grid=[4]), "grid: expected a list of 2 whole numbers, got .4."),
    "grid of fractions": (said(grid=[3.5, 2]), "grid: expected a whole number, got 3.5"),
    "grid of texts": (said(grid=["3", "2"]), "grid: expected a whole number, got '3'"),
    "grid a text": (said(grid="32"), "grid: expected a list of 2 whole numbers, got '32'"),
    "size zero": (said(size=[0, 0.1]), "two sides above zero"),
    "size negative": (said(size=[-0.1, 0.1]), "two sides above zero"),
    "size huge": (said(size=[10**400, 0.1]), "size: expected a number, got 1000"),
    "size of nothing": (
        said(size=[1e-300, 0.1]),
        "1e-09 to 1e.09, got 1e-300 x 0.1",
    ),
    "size of a grain": (said(size=[1e-5, 0.1]), "sides of 0.0001 to 10 m, got 1e-05 x 0.1 m"),
    "size of a star": (said(size=[0.1, 1e300]), "1e-09 to 1e.09, got 0.1 x 1e.300"),
    "three sides": (
        said(size=[0.1, 0.1, 0.1]),
        "size: expected a list of 2 numbers, got",
    ),
    "size a text": (said(size="12"), "size: expected a list of 2 numbers, got '12'"),
    "positions outside": (scattered([[0.05, 0.09]]), "outside the patch"),
    "positions in three": (
        scattered([[0.05, 0.01, 0.0]]),
        "positions: expected a list of 2 numbers",
    ),
    "positions ragged": (
        scattered([[0.05, 0.01], [0.02]]),
        "positions: expected a list of 2 .*0.02",
    ),
    "no positions": (scattered([]), "expected positions"),
    "positions null": (scattered([[None, 0.01]]), "positions: expected a number, got None"),
    "outline unknown": (
        said(outline="star"),
        "the outline 'disk' or a list of corners, got 'star'",
    ),
    "outline null": (said(outline=None), "outline: expected a text or a list of .*, got None"),
    "outline of 2 corners": (said(outline=[[0, 0], [1, 1]]), r"V from 3 to 256, got \(2, 2\)"),
    "outline of texts": (
        said(outline=["a", "b", "c"]),
        "outline: expected a list of 2 .*'a'",
    ),
    "outline huge": (
        said(outline=[[0, 0], [10**400, 0], [0, 1]]),
        "outline: expected a number, got",
    ),
    "outline of another size": (
        said(outline=[[0, 0], [0.1, 0], [0, 0.1]]),
        r"size \[0.1, 0.1\], got size \[0.1, 0.08\]",
    ),
    "disk longer than wide": (said(outline="disk"), r"size \[0.1, 0.1\], got size \[0.1, 0.08\]"),
    "disk bent": (
        said(outline="disk", size=[0.1, 0.1], base_curvature=5),
        "expected a flat disk .* curvature 5",
    ),
    "cap of another size": (
        said(cap=[0.008, 1.2, 1]),
        r"cap of radius 0.008 m with its rim at 68.7549 degrees, of size \[0.0192, 0.0192\]",
    ),
    "cap beyond a hemisphere": (said(cap=[0.008, 2, 1]), "at most pi/2 .a hemisphere."),
    "base curvature of three": (
        said(base_curvature=[1, 2, 3]),
        "base_curvature: expected a number or a list of 2 numbers, got",
    ),
    "too steep for a shallow skin": (
        said(base_curvature=[10, 10]),
        r"1/\(R k\)\^2, 3\.95% .* radii of at least 0.199 m",
    ),
    "disk with a rim that gives": (
        said(outline="disk", size=[0.1, 0.1], edge="elastic", grid=[3, 3]),
        "among hinged, clamped; got 'elastic'",
    ),
    "cantilever with two sides": (
        said(edge="cantilever"),
        r"an edge of a patch of 0\.1 x 0\.08 m among hinged, .*, elastic; got 'cantilever'",
    ),
    "edge unknown": (
        said(edge="glued"),
        "edge: expected one of hinged, .*, got 'glued'",
    ),
    "edge a number": (said(edge=1), "edge: expected a text, got 1"),
    "dead -1": (said(dead_channels=[-1]), r"from 0 to 17, got \[-1\]"),
    "dead beyond": (said(dead_channels=[3, 18]), r"from 0 to 17, got \[18\]"),
    "dead huge": (said(dead_channels=[10**400]), "from 0 to 17"),
    "dead fraction": (said(dead_channels=[1.5]), "dead_channels: expected a whole number, got 1.5"),
    "dead nested": (said(dead_channels=[[1]]), "dead_channels: expected a whole number, got .1."),
    "map short": (said(channel_map=[0]), "with each number from 0 to 17 once, got 1 numbers"),
    "map twice": (said(channel_map=[0, 0, *range(2, 18)]), "with each number from 0 to 17 once"),
    "map beyond": (said(channel_map=[18, *range(1, 18)]), "with each number from 0 to 17 once"),
    "map huge": (said(channel_map=[10**400] * 18), "cannot be used"),
    "map fraction": (said(channel_map=[0.5] * 18), "channel_map: expected a whole number, got 0.5"),
    "map a text": (said(channel_map="1"), "channel_map: expected a list of whole numbers, got '1'"),
    "dead a text": (
        said(dead_channels="1"),
        "dead_channels: expected a list of .*'1'",
    ),
    "rigidity zero": (said(rigidity=0), "rigidity above zero"),
    "rigidity of a star": (
        said(rigidity=1e300),
        "rigidity: expected 1e-12 to 1e.06 N m",
    ),
    "tension of nothing": (
        said(tension=1e-300),
        "tension: expected 1e-09 to 1e.06 N/m",
    ),
    "rigidity a text": (said(rigidity="stiff"), "rigidity: expected a number, got 'stiff'"),
    "rate too high": (said(rate=1e9), "rate of at most"),
    "rate zero": (said(rate=0.0), "rate of at most"),
    "rate null": (said(rate=None), "rate: expected a number, got None"),
    "name a number": (said(name=7), "name: expected a text, got 7"),
    "simulated a text": (said(simulated="false"), "simulated: expected true or false, got 'false'"),
    "bridge a list": (said(bridge=[1]), "bridge: expected a table"),
    "rate true": (said(rate=True), "rate: expected a number, got True"),
    "multiplexer a list": (said(multiplexer=[1]), "multiplexer: expected a table"),
    "amplifier a text": (said(amplifier="big"), "amplifier: expected a table"),
    "gage resistance zero": (part("bridge", gage_resistance=0), "gage_resistance above zero"),
    "mismatch": (part("bridge", gage_mismatch=-2), "between -1 and 1"),
    "balance voltage": (part("bridge", balance_voltage=9), "between 0 and the excitation"),
    "unbalanced": (part("bridge", balance_voltage=1), "balance the bridge with 2.50"),
    "settling": (part("multiplexer", settling_time=-1e-6), "settling_time of at least zero"),
    "settling that slows": (part("multiplexer", settling_time=1), "rate of at most"),
    "gain zero": (part("amplifier", gain=0), "Amplifier.gain above zero"),
    "gages of a star": (part("bridge", gage_factor=1e300), "with a range of 0.001 to 1e.09 1/m"),
    "gain of nothing": (part("amplifier", gain=1e-300), "with a range of 0.001 to 1e.09 1/m"),
    "gain huge": (part("amplifier", gain=10**400), "amplifier.gain: expected a number, got 1000"),
    "rail": (part("amplifier", rail=-1), "Amplifier.rail above zero"),
    "bits": (part("converter", bits=99), "8 to 24 bits"),
    "bits a fraction": (
        part("converter", bits=12.5),
        "bits: expected a whole number, got 12.5",
    ),
    "offset": (part("converter", offset=9), "balance the bridge"),
    "conversion time zero": (part("converter", conversion_time=0), "conversion_time above zero"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_cannot_be_a_device_is_refused_at_once(case: str) -> None:
    what, reason = BAD[case]
    text = what if isinstance(what, str) else json.dumps(what)

    tracemalloc.start()
    try:
        with pytest.raises(SourceError, match=reason) as refusal:
            sensor_from_json(text)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()

    assert str(refusal.value).startswith("the device's information ")
    assert peak < 4e6


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=8,
)


@pytest.mark.slow
@given(st.sampled_from([*said(), "positions"]), JSON)
def test_any_value_of_any_key_is_understood_or_refused(key: str, value: Any) -> None:
    found = scattered([[0.01, 0.02]]) if key == "positions" else said()
    try:
        sensor = sensor_from_json(json.dumps({**found, key: value}))
    except SourceError:
        return
    assert sensor.layout.live.shape == (3, len(sensor.layout))


@given(JSON)
def test_any_json_is_refused(value: Any) -> None:
    with pytest.raises(SourceError):
        sensor_from_json(json.dumps(value))


def test_a_sensor_without_a_rigidity_has_an_unknown_material() -> None:
    layout = SensorLayout.regular(PATCH, 4, 3)
    plate = Plate(PATCH, unknown_material=True)
    text = sensor_to_json(sensor_on(layout, plate=plate))

    assert "rigidity" not in json.loads(text)
    assert sensor_from_json(text).plate == plate
    assert not sensor_from_json(sensor_to_json(sensor_on(layout))).plate.unknown_material
