"""Channels that fail: found in time, named rightly, told with their figures, and trusted again."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from kappaskin import (
    DiscLoad,
    Frame,
    GaussianLoad,
    Patch,
    Plate,
    PointLoad,
    Region,
    Scene,
    SensorLayout,
    Simulator,
    Stimulus,
    load_scene,
)
from kappaskin.bases import basis_for
from kappaskin.estimation import FAULTS, Scanner
from kappaskin.health import HealthMonitor
from kappaskin.health.inconsistency import StatisticsWindow
from kappaskin.scenes import SCENES, Orbit, read_scene
from kappaskin.scenes.effects import GaussianNoise

pytestmark = pytest.mark.slow

ROUND = load_scene("circle")
TO_COUNTS = 1 / ROUND.transduction.resolution
RATE = 128.0  # frames/s: as many as are looked at twice over


@cache
def frames_of(name: str, seconds: float, **changes) -> list[Frame]:
    """Frames of a ready scene with `changes`, a few times fewer than it has."""
    scene = replace(load_scene(name), **changes)
    simulator, step = Simulator(scene), max(1, int(scene.rate / RATE))
    return [
        simulator.scanned(scene.sensor().scan(), n, n / scene.rate, lambda n=n: n / scene.rate)
        for n in range(0, int(seconds * scene.rate), step)
    ]


def watched(frames, spoil=None, sensor=None):
    """What a monitor says of frames that `spoil` changed: (time, kinds) of each look."""
    monitor, looks = HealthMonitor(sensor or ROUND.sensor()), []
    for frame in frames:
        counts = frame.counts.copy()
        if spoil is not None:
            spoil(counts, frame.device_time)
        if monitor(replace(frame, counts=counts)):
            looks.append((frame.device_time, monitor.kinds.copy()))
    return monitor, looks


def told(monitor):
    """What is found: {channel: kind}."""
    return {f.channel: f.kind for f in monitor.findings(np.zeros(len(monitor.kinds), bool))}


def found_at(looks, channels):
    """When the first look found all of `channels`, and what else was found in any."""
    channels = list(channels)
    at = next(time for time, kinds in looks if (kinds[channels] > 0).all())
    others = set(np.flatnonzero(np.any([kinds > 0 for _, kinds in looks], axis=0)))
    return at, others - set(channels)


def swap(a, b):
    def spoil(counts, time):
        counts[[*a, *b]] = counts[[*b, *a]]

    return spoil


def of(element):
    return [element, 100 + element, 200 + element]


def hold(channels, value):
    def spoil(counts, time):
        counts[channels] = np.rint(value * TO_COUNTS)

    return spoil


@pytest.mark.parametrize("at", [(0.095, 0.095), (0.005, 0.095)])
def test_a_point_held_on_the_element_in_a_corner_accuses_nobody(at) -> None:
    scene = load_scene("centre")
    pressed = replace(scene, stimuli=(Stimulus(PointLoad(*at, 0.5)),))
    free, held = Simulator(replace(scene, stimuli=())), Simulator(pressed)
    scan, monitor = scene.sensor().scan(), HealthMonitor(scene.sensor())
    for n in range(round(8 * RATE)):
        time = n / RATE
        simulator = held if 1.0 <= time < 6.0 else free
        monitor(simulator.scanned(scan, n, time, lambda time=time: time))
        assert not monitor.kinds.any()


def test_a_dead_element_is_found_once_the_load_comes_by() -> None:
    monitor, looks = watched(frames_of("circle", 8), hold(of(65), 0.0))

    at, others = found_at(looks, [65, 165])

    assert at <= 6.0
    assert others <= {265}
    assert {told(monitor)[c] for c in (65, 165)} == {"dead"}


@pytest.mark.parametrize("every", [1, 7, 40])
def test_each_look_ends_before_the_next_however_few_frames_come(every) -> None:
    frames, monitor = frames_of("circle", 8)[::every], HealthMonitor(ROUND.sensor())
    window, begun, ended = StatisticsWindow(ROUND.sensor()), 0, 0
    for frame in frames:
        begun += window(frame) is not None
        ended += monitor(frame)
        assert 0 <= begun - ended <= 1
    assert begun >= 4


def test_a_stuck_channel_is_found_by_itself() -> None:
    monitor, looks = watched(frames_of("circle", 8), hold([57], 1.7))

    at, others = found_at(looks, [57])

    assert at <= 6.0
    assert not others
    (finding,) = monitor.findings(np.zeros(300, bool))
    assert (finding.kind, finding.element, finding.component) == ("stuck", 57, "xx")
    assert finding.figure.startswith("reads +1.70 1/m while its neighbours predict ")


@pytest.mark.cases("tilts")
@pytest.mark.parametrize(
    ("name", "unit", "smallest"), [("camera", "\N{MICRO SIGN}m", 100), ("tilts", "mrad", 300)]
)
def test_faults_of_heights_and_slopes_are_found(name, unit, smallest) -> None:
    frames, sensor = frames_of(name, 12), load_scene(name).sensor()
    counts = np.array([frame.counts for frame in frames], float)
    moving = np.argsort(counts.std(axis=0))
    (worst, other), rng = moving[[-1, -8]], np.random.default_rng(0)
    noise = np.median(np.abs(np.diff(counts, 2, axis=0))) / 0.6745 / np.sqrt(6)

    def stuck(counts, time):
        counts[worst] = 900

    def noisy(counts, time):
        counts[worst] += int(rng.normal(0, 12 * noise))

    def offset(counts, time):
        counts[worst] += int(smallest * noise) * (time > 3)

    faults = {"stuck": stuck, "noisy": noisy, "offset": offset}
    for kind, spoil in faults.items():
        monitor, looks = watched(frames, spoil, sensor)
        at, others = found_at(looks, [worst])
        assert at <= 6.5
        assert not others
        (finding,) = monitor.findings(np.zeros(len(monitor.kinds), bool))
        assert finding.kind == kind
        assert f" {unit}" in finding.figure

    monitor, _ = watched(frames, swap([worst], [other]), sensor)
    assert told(monitor) == {worst: "swapped", other: "swapped"}


MIXED = """
format = 1
rate = 60.0
[skin]
size = [0.06, 0.06]
rigidity = 3.7e-3
[elements]
grid = [12, 12]
reads = ["height", "slope@30", "slope@120"]
[readings.height]
noise = 5e-6
[readings.slope]
noise = 5e-4
[[touch]]
what = "gaussian"
sd = 0.002
x = 0.03
y = 0.03
force = 0.1
orbit = { radius = 0.012, period = 6.0 }
"""


def test_readings_of_several_units_predict_each_other() -> None:
    scene = read_scene(MIXED, Path("mixed.toml"))
    simulator, sensor = Simulator(scene), scene.sensor()
    frames = [
        simulator.scanned(sensor.scan(), n, n / 60, lambda n=n: n / 60) for n in range(9 * 60)
    ]

    _, looks = watched(frames, None, sensor)
    assert not any(kinds.any() for _, kinds in looks)

    for channel, unit in ((70, "\N{MICRO SIGN}m"), (144 + 70, "mrad"), (288 + 70, "mrad")):
        held = frames[20].counts[channel]

        def stuck(counts, time, channel=channel, held=held):
            counts[channel] = held

        monitor, looks = watched(frames, stuck, sensor)
        _, others = found_at(looks, [channel])
        assert not others
        (finding,) = monitor.findings(np.zeros(432, bool))
        assert finding.kind == "stuck"
        assert f" {unit} while" in finding.figure


def test_a_noisy_channel_is_found_in_two_seconds() -> None:
    rng = np.random.default_rng(0)

    def spoil(counts, time):
        counts[142] += int(rng.normal(0, 1.5 * TO_COUNTS))

    monitor, looks = watched(frames_of("circle", 4), spoil)

    at, others = found_at(looks, [142])

    assert at <= 2.0
    assert not others
    assert told(monitor) == {142: "noisy"}


@pytest.mark.cases("centre")
@pytest.mark.parametrize(("name", "rate", "most"), [("circle", 0.3, 4.0), ("centre", 0.1, 1.3)])
def test_a_channel_that_drifts_is_found_sooner_where_little_moves(name, rate, most) -> None:
    def spoil(counts, time):
        counts[12] += int(rate * time * TO_COUNTS)

    monitor, looks = watched(frames_of(name, 16), spoil)

    at, others = found_at(looks, [12])

    assert rate * at <= most  # 1/m
    assert not others
    assert told(monitor) == {12: "drifting"}


@pytest.mark.parametrize("pair", [(57, 54), (33, 66), (25, 75)])
def test_swapped_elements_are_found_with_their_partners(pair) -> None:
    a, b = pair
    monitor, looks = watched(frames_of("circle", 12), swap(of(a), of(b)))

    at, others = found_at(looks, [a, b, 100 + a, 100 + b])

    assert at <= 8.0
    assert others <= {200 + a, 200 + b}
    kinds = told(monitor)
    assert {kinds[c] for c in (a, b, 100 + a, 100 + b)} == {"swapped"}
    figures = {f.channel: f.figure for f in monitor.findings(np.zeros(300, bool))}
    assert figures[a] == f"has the readings of xx of element {b}"


def test_of_elements_beside_each_other_that_are_swapped_what_differs_is_found() -> None:
    monitor, looks = watched(frames_of("circle", 12), swap(of(44), of(45)))

    at, others = found_at(looks, [44, 45])

    assert at <= 4.0
    assert others <= set(of(44) + of(45))
    assert {told(monitor)[c] for c in (44, 45)} == {"swapped"}


def test_two_components_of_an_element_that_are_swapped_are_found() -> None:
    # A load as wide as 15 x 15 functions tell it. Of one on a point, 57 is found to be stuck.
    wide = frames_of("circle", 12, reference=(15, 15))
    monitor, looks = watched(wide, swap([57], [157]))

    _, others = found_at(looks, [57, 157])

    assert not others
    assert told(monitor) == {57: "swapped", 157: "swapped"}


def test_a_channel_torn_off_to_a_rail_is_dead() -> None:
    low, high = ROUND.transduction.limits

    def spoil(counts, time):
        counts[[5, 177]] = low, high

    monitor, looks = watched(frames_of("circle", 3), spoil)

    assert found_at(looks, [5, 177]) == (pytest.approx(1.0, abs=0.6), set())
    assert told(monitor) == {5: "dead", 177: "dead"}


def test_elements_bent_too_far_are_saturated_while_they_are() -> None:
    scene = load_scene("saturation")
    _, looks = watched(frames_of("saturation", 5), None, scene.sensor())

    kinds = np.array([kinds for _, kinds in looks])

    assert set(np.unique(kinds)) == {0, FAULTS.index("saturated")}
    assert (kinds.max(axis=0) > 0).reshape(3, 100)[0, [44, 45, 54, 55]].all()
    assert not kinds[-1].any()


def test_the_failing_scene_is_told_as_it_was_written() -> None:
    scene = load_scene("failing-elements")
    monitor, _ = watched(frames_of("failing-elements", 12), None, scene.sensor())

    kinds = told(monitor)

    assert {kinds[c] for c in (44, 144, 244, 45, 145, 245)} == {"dead"}
    assert {kinds[c] for c in (27, 63, 127, 163)} == {"stuck"}
    assert {kinds[c] for c in (55, 155)} == {"noisy"}
    assert not {c % 100 for c in kinds} - {44, 45, 27, 63, 55}


def test_nothing_that_stands_still_on_a_skin_at_rest_is_called_dead() -> None:
    scene = replace(load_scene("creep-hold").touched_by(), effects=())
    simulator = Simulator(scene)
    still = [simulator.frame(n, lambda: 0.0) for n in range(0, 4000, 4)]

    monitor, _ = watched(still, hold([3, 50], 2.0), scene.sensor())

    assert not monitor.kinds.any()


@pytest.mark.parametrize(
    ("spoil", "until"),
    [
        (hold(of(65), 0.0), "dead"),
        (swap([57, 157], [54, 154]), "swapped"),
        (
            lambda counts, time: counts.__setitem__(20, counts[20] + 3000 * (int(time * 99) % 2)),
            "noisy",
        ),
        (lambda counts, time: counts.__setitem__(33, counts[33] + 5000), "offset"),
    ],
)
def test_a_channel_that_recovers_is_trusted_again_in_two_turns_of_the_load(spoil, until) -> None:
    def for_a_while(counts, time):
        if 1.0 <= time < 9.0:
            spoil(counts, time)

    _, looks = watched(frames_of("circle", 22), for_a_while)

    bad = np.array([kinds for time, kinds in looks if 7.0 < time < 9.0])
    assert FAULTS.index(until) in bad
    assert not looks[-1][1].any()


@pytest.mark.cases("demo", "fingertip", "line", "on-foam")
@pytest.mark.parametrize("name", [n for n in SCENES if n not in ("failing-elements", "saturation")])
def test_no_healthy_scene_has_a_finding(name) -> None:
    scene = load_scene(name)
    seconds = 8.0 if scene.indenter else 16.0

    _, looks = watched(frames_of(name, seconds), None, scene.sensor())

    assert not any(kinds.any() for _, kinds in looks)
    assert len(looks) >= 2 * seconds


def after_jumps(seed):
    """Which channels (300,) are ever found under a point that jumps anywhere and rests there."""
    rng = np.random.default_rng(seed)
    M = ROUND.layout.operator(ROUND.basis)
    time, frames = 0.0, []
    for _ in range(12):
        x, y = rng.uniform(0.004, 0.096, 2)
        if rng.random() < 0.5:  # on an element, at times in a corner
            x, y = ROUND.layout.positions[rng.choice([0, 9, 90, 99, *rng.integers(0, 100, 8)])]
        c = ROUND.plate.deflection([PointLoad(x, y, 1.0)], ROUND.basis).ravel()
        K = M @ c
        K *= rng.uniform(4, 16) / np.abs(K).max()
        for _ in range(round(rng.uniform(0.5, 4.0) * 128)):
            time += 1 / 128
            counts = np.rint((K + rng.normal(0, 0.1, 300)) * TO_COUNTS).astype(np.int32)
            frames.append(Frame(0, time, time, np.arange(300), counts))

    _, looks = watched(frames)
    return np.any([kinds > 0 for _, kinds in looks], axis=0)


@pytest.mark.full
def test_a_point_that_jumps_anywhere_and_rests_there_accuses_hardly_any_channel() -> None:
    assert sum(after_jumps(seed).sum() for seed in range(4)) <= 2  # of 1200


def test_what_the_device_calls_dead_is_told_at_once_and_on_a_strip_no_more_than_that() -> None:
    scene = load_scene("fingertip")
    sensor = replace(scene, layout=scene.layout.without([4])).sensor()

    monitor, _ = watched(frames_of("fingertip", 1), None, sensor)

    (finding,) = monitor.findings(np.zeros(30, bool))
    assert (finding.channel, finding.kind, finding.figure) == (4, "dead", "reported by the device")


@pytest.mark.full
def test_frames_that_hold_a_tenth_of_the_channels_in_turn_are_enough() -> None:
    parts = np.arange(300).reshape(10, 30)

    def part_of(frame, n):
        return replace(frame, channels=parts[n % 10], counts=frame.counts[parts[n % 10]])

    fine = replace(ROUND, rate=500.0)
    simulator = Simulator(fine)
    frames = (simulator.frame(n, lambda: 0.0) for n in range(6000))
    frames = [replace(f, counts=np.where(f.channels == 57, 1500, f.counts)) for f in frames]

    monitor, _ = watched([part_of(f, n) for n, f in enumerate(frames)])

    assert told(monitor) == {57: "stuck"}


@cache
def frames_around_the_contact(seconds):
    """Frames of a region of interest that moves with the contact, the rest in turn."""
    simulator, scanner = Simulator(ROUND), Scanner(ROUND.sensor(), Region("skin"))
    frames = []
    for n in range(round(seconds * RATE)):
        time = n / RATE
        scanner.follow(np.asarray(simulator.loads(time)[0].centre()))
        frames.append(simulator.scanned(scanner(), n, time, lambda time=time: time))
    return frames


def test_under_a_region_that_moves_with_the_contact_no_sound_channel_is_found() -> None:
    frames = frames_around_the_contact(20)

    _, looks = watched(frames)

    assert max(len(frame.channels) for frame in frames) < 150
    assert not any(kinds.any() for _, kinds in looks)
    assert len(looks) >= 40


def test_under_a_region_that_moves_with_the_contact_a_noisy_channel_is_found_alone() -> None:
    rng, frames = np.random.default_rng(0), []
    for frame in frames_around_the_contact(20):
        loud = np.where(frame.channels == 142, rng.normal(0, 1.5 * TO_COUNTS), 0).astype(int)
        frames.append(replace(frame, counts=frame.counts + loud))

    monitor, _ = watched(frames)

    assert told(monitor) == {142: "noisy"}


def test_a_clock_that_goes_back_begins_anew() -> None:
    frames = frames_of("circle", 8)
    monitor, _ = watched(frames, hold([57], 1.7))
    assert monitor.kinds.any()

    assert not monitor(frames[0])

    assert not monitor.kinds.any()


def test_a_frame_that_others_overtook_changes_nothing_that_is_found() -> None:
    frames = frames_of("circle", 8)
    monitor, _ = watched(frames, hold([57], 1.7))
    found = monitor.kinds.copy()
    assert found.any()

    monitor(frames[-2])

    np.testing.assert_array_equal(monitor.kinds, found)


PAD = load_scene("thumb-pad")
PLACES = ((9.0, 7.0), (12.0, 4.5), (6.0, 9.5), (12.5, 9.0), (5.0, 5.0))  # mm


@cache
def pad_frames(seed):
    """Frames of the thumb's pad, on which discs press one after the other for two seconds each."""
    rng, basis, frames = np.random.default_rng(seed), basis_for(PAD.plate.patch, PAD.edge, 8, 8), []
    M = PAD.layout.operator(basis, PAD.plate)
    for x, y in PLACES:
        K = M @ PAD.plate.deflection([DiscLoad(1e-3 * x, 1e-3 * y, 2e-3)], basis).ravel()
        K *= 12 / np.abs(K).max()
        for n in range(256):
            time, share = len(frames) / 128, min(n / 64, (255 - n) / 64, 1.0)
            read = share * K + rng.normal(0, 0.1, len(K))
            counts = np.rint(read / PAD.transduction.resolution).astype(np.int32)
            frames.append(Frame(0, time, time, np.arange(len(K)), counts))
    return frames


@pytest.mark.parametrize("seed", range(3))
def test_no_healthy_element_of_a_mesh_held_along_part_of_its_rim_is_accused(seed) -> None:
    _, looks = watched(pad_frames(seed), None, PAD.sensor())

    assert not any(kinds.any() for _, kinds in looks)
    assert len(looks) >= 35


def drift(channel, rate):
    def spoil(counts, time):
        counts[channel] += int(rate * time / PAD.transduction.resolution)

    return spoil


@pytest.mark.parametrize(
    ("spoil", "kind", "elements"),
    [
        (hold([0, 120, 240], 0.0), "dead", {0}),
        (hold([0, 120, 240], 2.0), "stuck", {0}),
        (drift(24, 1.0), "drifting", {24}),
        (swap([0, 120, 240], [35, 155, 275]), "swapped", {0, 35}),
    ],
    ids=["dead", "stuck", "drifting", "swapped"],
)
def test_a_fault_of_an_element_on_a_mesh_is_found_alone(spoil, kind, elements) -> None:
    monitor, _ = watched(pad_frames(0), spoil, PAD.sensor())

    found = told(monitor)

    assert {c % 120 for c in found} == elements
    assert set(found.values()) == {kind}


def test_one_element_or_two_are_watched_without_neighbours_to_ask() -> None:
    patch = Patch(0.1, 0.1)
    for m in (1, 2):
        scene = Scene(
            "few",
            Plate(patch),
            SensorLayout.regular(patch, m, 1),
            (Stimulus(GaussianLoad(0.05, 0.05, 0.006, 0.1), Orbit(0.02, 4.0)),),
            (GaussianNoise(0.1),),
        )
        simulator = Simulator(scene)
        frames = [simulator.frame(n, lambda: 0.0) for n in range(0, 2000, 4)]
        monitor, _ = watched(frames, None, scene.sensor())
        assert not monitor.kinds.any()
