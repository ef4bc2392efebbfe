"""What a person chose, as a scene to simulate."""

import math
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from kappaskin.bases import edges_of
from kappaskin.errors import Refusal
from kappaskin.estimation import Region
from kappaskin.mechanics import Load, Plate
from kappaskin.scenes import (
    Scene,
    Stimulus,
    planned,
    read_scene,
    read_scene_text,
    scene_file,
    write_scene,
)
from kappaskin.scenes.effects import (
    FIRST_GENERATION_LOOPS,
    SECOND_GENERATION_LOOPS,
    Creep,
    GaussianNoise,
    Hysteresis,
    Tolerance,
    UniformNoise,
)
from kappaskin.sensing import (
    FIRST_GENERATION,
    SECOND_GENERATION,
    Sensor,
    SensorLayout,
    Transduction,
)
from kappaskin.skin import Patch
from kappaskin_app.shell.loads import Memo, compliance_of, free_loads, ready, reference_on, whole_on
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.settings.scene import FREE_CASES, READY_CASES, SHAPES, Written

_PLACING = ("load_case", "size", "size_y", "shape", "side_x", "side_y", "rim_radius")
"""What, when it changes, may leave a free load over the rim."""
_TABLE_1 = ("shape", "side_x", "side_y", "edge", "tension", "foam", "fluid")
NO_ELEMENTS: dict[str, Any] = {"region_elements": (), "dead_elements": ()}
"""What follows from other elements: those chosen by number were chosen among the last ones."""

_CHAINS = {
    "modern": Transduction(),
    "second": SECOND_GENERATION,
    "first": FIRST_GENERATION,
}
_LOOPS = {"second": SECOND_GENERATION_LOOPS, "first": FIRST_GENERATION_LOOPS}
_LEAST_SCANNED = 0.05  # of the channels, where they are scanned as they tell most
_CREEPING = 5.0  # s, the time constant of the creep
_OFFSET = 10.0  # 1/m of offset for a gain that is off by 1

OWN = Path("own.scene.toml")
"""What a scene is called that was begun from the panels' own."""
_LARGEST = 1_000_000  # bytes of a scene: a longer text would hold up the editor
_REMEMBERED = 64  # scenes, so that undoing is quick

_Effect = UniformNoise | GaussianNoise | Hysteresis | Creep | Tolerance


def _effects(settings: Settings) -> tuple[_Effect, ...]:
    """What spoils a reading, in the order in which it comes about: gage, bridge, noise."""
    s, kinds = settings, {"uniform": UniformNoise, "gaussian": GaussianNoise}
    found: list[_Effect] = []
    if s.loops in _LOOPS:
        found.append(_LOOPS[s.loops])
    if s.creep:
        found.append(Creep(s.creep, _CREEPING))
    if s.tolerance:
        found.append(Tolerance(s.tolerance, _OFFSET * s.tolerance))
    if s.noise_kind in kinds and s.noise_rms:
        found.append(kinds[s.noise_kind](s.noise_rms))
    return tuple(found)


def _transduction(settings: Settings) -> Transduction:
    chain = _CHAINS[settings.electronics]
    converter = replace(
        chain.converter, bits=settings.bits, conversion_time=settings.conversion_time
    )
    return replace(chain, converter=converter)


def region_of(settings: Settings) -> Region:
    """Which elements every frame scans; all of them until some are chosen."""
    s = settings
    if s.region == "elements" and not s.region_elements:
        return Region()
    share = max(s.region_share, _LEAST_SCANNED) if s.region == "adaptive" else s.region_share
    return Region(s.region, s.region_elements, s.region_radius, share)


def patch_of(settings: Settings) -> Patch:
    shape = SHAPES[settings.shape]
    return shape.make(*(getattr(settings, name) for name in shape.lengths))


def plate_of(settings: Settings) -> Plate:
    """The skin that `settings` describe, without its elements."""
    s = settings
    return Plate(patch_of(s), tension=s.tension, foundation=s.foam, fluid=s.fluid)


def elements_of(settings: Settings) -> tuple[int, int]:
    """The m x n elements asked for."""
    return settings.elements_x, settings.elements_y


def is_table_1(settings: Settings) -> bool:
    """Whether the skin is that of Table 1, where its cases are what they are called."""
    paper = Settings()
    return all(getattr(settings, name) == getattr(paper, name) for name in _TABLE_1)


def scene_of(settings: Settings) -> Scene:
    """The scene that `settings` describe; raises `Refusal` for one that cannot be."""
    if settings.written is not None:
        return _read(settings.written)
    plate = plate_of(settings)
    layout = SensorLayout.regular(plate.patch, *elements_of(settings))
    layout = layout.without(settings.dead_elements)
    if settings.load_case in FREE_CASES:
        compliance_of(plate, settings.edge)  # for its refusal
        loads = free_loads(settings)
        _check_on(loads, plate)
        stimuli = tuple(map(Stimulus, loads))
    else:
        stimuli = ready(settings.load_case, plate, settings.edge)
    scene = Scene(
        settings.load_case,
        plate,
        layout,
        stimuli,
        _effects(settings),
        _transduction(settings),
        seed=settings.noise_seed,
        reference=reference_on(plate.patch),
        edge=settings.edge,
    )
    fastest = math.floor(1 / scene.transduction.scan_time(3 * len(layout)))
    return replace(scene, rate=min(SHAPES[settings.shape].rate, fastest))


def _read(written: Written) -> Scene:
    """The scene that is written, read and planned once."""
    scene = scene_or_why(written)
    if isinstance(scene, str):
        raise Refusal(scene)
    return scene


def _scene_or_why(written: Written) -> Scene | str:
    try:
        scene = read_scene(written.text, written.file)
        played(scene)
    except Refusal as refusal:
        return str(refusal).replace(str(written.file), written.file.name)
    return scene


scene_or_why = Memo(_scene_or_why, _REMEMBERED)
"""The scene that is written and can be planned, or why there is none."""
played = Memo(planned, _REMEMBERED)
"""The scene as it is played: what its effects are is decided, here and not in the engine."""


def scene_of_sensor(sensor: Sensor, noise: float) -> Scene:
    """A scene on a real `sensor`: a point load in its middle, and `noise` in 1/m as it has."""
    plate, edge = sensor.plate, sensor.edge
    return Scene(
        sensor.name,
        plate,
        sensor.layout,
        ready("centre", plate, edge),
        effects=(GaussianNoise(noise),),
        transduction=sensor.transduction,
        rate=sensor.rate,
        reference=reference_on(plate.patch),
        edge=edge,
    )


def _check_on(loads: tuple[Load, ...], plate: Plate) -> None:
    """Refuse `loads` that are not wholly on the skin, in the words of who placed them."""
    try:
        for load in loads:
            load.check(plate.patch)
    except Refusal as refusal:
        raise Refusal(
            "expected a load that lies wholly on the skin, got one that reaches over the rim; move "
            "it inwards or make it smaller"
        ) from refusal


def named(source: str) -> dict[str, Any]:
    """The settings that change when the simulation called `source` is to be played.

    One of the panels' load cases is chosen; any other scene is played as it is written. One that
    there is not is not played: the engine says so. None named is the one that was played last.
    """
    name = source.removeprefix("sim:")
    if not name:
        return {}
    if name in READY_CASES:
        return {"written": None, "load_case": name}
    try:
        return {"written": written(scene_file(name))}
    except Refusal:
        return {"written": None}


def written(file: Path) -> Written:
    """The scene in `file`, as it is written there; raises `Refusal` for a file of no scene."""
    if file.is_file() and (size := file.stat().st_size) > _LARGEST:
        raise Refusal(
            f"{file}: expected a scene of at most {_LARGEST} bytes, got {size}; check its name"
        )
    return Written(read_scene_text(file), file)


def text_of(settings: Settings) -> str:
    """The scene that is written, or that of the panels as one would write it."""
    return settings.written.text if settings.written else write_scene(scene_of(settings))


def settings_for(source: str) -> Settings:
    """The settings to begin with on `source`."""
    return replace(Settings(), **named(source)) if source.startswith("sim:") else Settings()


def with_consequences(settings: Settings, scene: Scene, name: str, value: Any) -> dict[str, Any]:
    """The settings that change when a person changes `name` while `scene` is played.

    A shape brings its usual size, force and height, and its usual edge if it cannot be held as the
    last one was. Where the skin gets longer, loads move and grow to keep their share of it. A free
    load presses as the one did that it follows, and moves until all of it is on the skin.
    """
    changed: dict[str, Any] = {name: value}
    if name == "shape":
        changed |= {**SHAPES[value].lengths, **SHAPES[value].defaults}
    if name == "design_shape":
        changed |= {f"design_{length}": asked for length, asked in SHAPES[value].lengths.items()}
        changed |= {"design_place": "scene"} if value == "strip" else {}
    if name in ("shape", "rim_radius") and "side_x" not in changed:
        patch = patch_of(replace(settings, **changed))
        changed |= {"side_x": patch.a, "side_y": patch.b}  # of the rectangle around it
    if name == "shape":
        offered = edges_of(patch_of(replace(settings, **changed)))
        changed |= {"edge": offered[0]} if settings.edge not in offered else {}
        changed |= {"fit_edge": ""} if settings.fit_edge not in offered else {}
    if name == "electronics":
        converter = _CHAINS[value].converter
        changed |= {"bits": converter.bits, "conversion_time": converter.conversion_time}
    if name in ("shape", "elements_x", "elements_y"):
        changed |= NO_ELEMENTS
    for side, places in (("side_x", ("x", "x_end", "size")), ("side_y", ("y", "y_end", "size_y"))):
        if side in changed:
            longer = changed[side] / getattr(settings, side)
            changed |= {place: getattr(settings, place) * longer for place in places}
    freed = value in FREE_CASES and settings.load_case not in FREE_CASES
    if name == "load_case" and freed and scene.loads:
        changed["force"] = scene.loads[0].force
    after = replace(settings, **changed)
    if after.load_case in FREE_CASES and name in _PLACING:
        with suppress(Refusal):  # no such skin: the scene says so
            changed |= whole_on(after, patch_of(after))
    return changed
