"""Simulated scenes, made from the settings."""

import math
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

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
    DigitalReadings,
    Sensor,
    SensorLayout,
    Transduction,
)
from kappaskin.skin import Patch
from kappaskin_app.shell.loads import (
    Cache,
    compliance_of,
    free_loads,
    inside_rim,
    load_case_stimuli,
    reference_on,
)
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.settings.scene import FREE_CASES, READY_CASES, SHAPES, Written

_BOXED = ("shape", "rim_radius", "cap_radius", "cap_angle", "cap_stretch")
"""Settings that determine the bounding rectangle of a round skin."""
_PLACING = ("load_case", "size", "size_y", "side_x", "side_y", *_BOXED)
"""Settings whose change can move a free load over the rim."""
_TABLE_1 = ("shape", "side_x", "side_y", "edge", "tension", "foam", "fluid", "thickness")
NO_ELEMENTS: dict[str, Any] = {"region_elements": (), "dead_elements": ()}
"""Selections of elements by number, cleared when the elements change."""

_CHAINS = {
    "modern": Transduction(),
    "second": SECOND_GENERATION,
    "first": FIRST_GENERATION,
}
_LOOPS = {"second": SECOND_GENERATION_LOOPS, "first": FIRST_GENERATION_LOOPS}
_LEAST_SCANNED = 0.05  # of the channels, where the most informative are scanned
_CREEP_TIME = 5.0  # s, the time constant of the creep
_OFFSET = 10.0  # 1/m of offset for a gain that is off by 1

OWN = Path("own.scene.toml")
"""The file name of a scene written from the panels."""
_LARGEST = 1_000_000  # bytes of a scene: a longer text would block the editor
_RATE = 100.0  # frames/s
_CACHED = 64  # scenes, so that undo is quick

_Effect = UniformNoise | GaussianNoise | Hysteresis | Creep | Tolerance


def _effects(settings: Settings) -> tuple[_Effect, ...]:
    """The effects on a reading, in physical order: gage, bridge, noise."""
    s, kinds = settings, {"uniform": UniformNoise, "gaussian": GaussianNoise}
    found: list[_Effect] = []
    if s.loops in _LOOPS:
        found.append(_LOOPS[s.loops])
    if s.creep:
        found.append(Creep(s.creep, _CREEP_TIME))
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
    """The elements scanned in each frame; all of them while none is selected."""
    s = settings
    if s.region == "elements" and not s.region_elements:
        return Region()
    share = max(s.region_share, _LEAST_SCANNED) if s.region == "adaptive" else s.region_share
    return Region(s.region, s.region_elements, s.region_radius, share)


def patch_of(settings: Settings) -> Patch:
    shape = SHAPES[settings.shape]
    return shape.make(*(getattr(settings, name) for name in shape.lengths))


def plate_of(settings: Settings) -> Plate:
    """The plate of the `settings`, without elements."""
    s = settings
    return Plate(
        patch_of(s),
        tension=s.tension,
        foundation=s.foam,
        fluid=s.fluid,
        poisson=s.poisson,
        thickness=s.thickness or None,
        inplane=s.inplane,
    )


def elements_of(settings: Settings) -> tuple[int, int]:
    """The numbers m and n of elements along x and y."""
    return settings.elements_x, settings.elements_y


def is_table_1(settings: Settings) -> bool:
    """Whether the skin is that of Table 1."""
    paper = Settings()
    return all(getattr(settings, name) == getattr(paper, name) for name in _TABLE_1)


def scene_of(settings: Settings) -> Scene:
    """The scene of the `settings`; raises `Refusal` for an invalid one."""
    if settings.written is not None:
        return _read(settings.written)
    plate = plate_of(settings)
    layout = SensorLayout.regular(plate.patch, *elements_of(settings))
    layout = layout.without(settings.dead_elements)
    if settings.load_case in FREE_CASES:
        compliance_of(plate, settings.edge)  # raises the refusal
        loads = free_loads(settings)
        _check_on(loads, plate)
        stimuli = tuple(map(Stimulus, loads))
    else:
        stimuli = load_case_stimuli(settings.load_case, plate, settings.edge)
    scene = Scene(
        settings.load_case,
        plate,
        layout,
        stimuli,
        _effects(settings),
        _transduction(settings),
        seed=settings.noise_seed,
        reference=reference_on(plate, settings.edge, settings.load_case),
        edge=settings.edge,
    )
    fastest = math.floor(1 / scene.transduction.scan_time(3 * len(layout)))
    return replace(scene, rate=min(SHAPES[settings.shape].rate, fastest))


def _read(written: Written) -> Scene:
    """The scene of a text, read and planned once."""
    scene = scene_or_refusal(written)
    if isinstance(scene, str):
        raise Refusal(scene)
    return scene


def _scene_or_refusal(written: Written) -> Scene | str:
    try:
        scene = read_scene(written.text, written.file, written.trust)
        planned_scene(scene)
    except Refusal as refusal:
        return str(refusal).replace(str(written.file), written.file.name)
    return scene


scene_or_refusal = Cache(_scene_or_refusal, _CACHED)
"""The scene of a text, if it can be read and planned; else the message of the refusal."""
planned_scene = Cache(planned, _CACHED)
"""The scene with its effects selected, in the window's process instead of the engine's."""


def scene_of_sensor(sensor: Sensor, noise: float) -> Scene:
    """A scene on a real `sensor` with a point load in its middle and the `noise` of a reading.

    That is in the unit of its readings, or where they have several in units of what they state.
    """
    plate, edge, chain = sensor.plate, sensor.edge, sensor.transduction
    layout, several = _in_order(sensor.layout), sensor.sigma is not None
    if isinstance(chain, DigitalReadings):
        stated = tuple((name, noise * each) for name, each in chain.noise) if several else ()
        digital = replace(chain, noise=stated)
        chain = Transduction() if layout.senses_curvature_only and not several else digital
    return Scene(
        sensor.name,
        plate,
        layout,
        load_case_stimuli("centre", plate, edge),
        effects=() if several else (GaussianNoise(noise),),
        transduction=chain,
        rate=min(sensor.rate, _rate_of(chain, sensor.channels)),
        reference=reference_on(plate, edge, "centre"),
        edge=edge,
    )


def _in_order(layout: SensorLayout) -> SensorLayout:
    """The layout with its readings as a scene has them, element by element of one kind each."""
    reads, which = layout.reads, layout.by_kind(np.arange(layout.channels, dtype=float)).ravel()
    if reads is None or len(which) != layout.channels or not np.isfinite(which).all():
        return layout
    order = which.astype(int)
    element, quantity = reads.element[order], reads.quantity[order]
    ordered = layout.reading(element, quantity, reads.direction[order], reads.free)
    return replace(ordered, live=layout.live[order])


def _rate_of(chain: Transduction | DigitalReadings, channels: int) -> float:
    """The fastest rate in frames/s; that of a scene where the electronics set none."""
    taken = chain.scan_time(channels)
    return 1 / taken if taken else _RATE


def _check_on(loads: tuple[Load, ...], plate: Plate) -> None:
    """Refuse `loads` that extend over the rim, with a message for the user."""
    try:
        for load in loads:
            load.check(plate.patch)
    except Refusal as refusal:
        raise Refusal(
            "expected a load completely on the skin, got one that extends over the rim; move "
            "it inwards or make it smaller"
        ) from refusal


def source_settings(source: str, trust: bool = False) -> dict[str, Any]:
    """The settings that change when the simulation `source` is started.

    With `trust` its scene may name files outside its folder. The name of a load case selects it in
    the panel; any other name is that of a scene file. An unknown name is reported by the engine.
    Without a name the last scene is simulated.
    """
    name = source.removeprefix("sim:")
    if not name:
        return {}
    if name in READY_CASES:
        return {"written": None, "load_case": name}
    try:
        return {"written": written(scene_file(name), trust)}
    except Refusal:
        return {"written": None}


def written(file: Path, trust: bool = False) -> Written:
    """The text of the scene in `file`; raises `Refusal` for a file that is no scene."""
    if file.is_file() and (size := file.stat().st_size) > _LARGEST:
        raise Refusal(
            f"{file}: expected a scene of at most {_LARGEST} bytes, got {size}; check its name"
        )
    return Written(read_scene_text(file), file, trust)


def text_of(settings: Settings) -> str:
    """The text of the present scene, also of one that is made in the panels."""
    return settings.written.text if settings.written else write_scene(scene_of(settings))


def settings_for(source: str, trust: bool = False) -> Settings:
    """The initial settings on `source`."""
    simulated = source.startswith("sim:")
    return replace(Settings(), **(source_settings(source, trust) if simulated else {}))


def with_consequences(settings: Settings, scene: Scene, name: str, value: Any) -> dict[str, Any]:
    """The settings that change when the user changes `name` while `scene` is simulated.

    A shape sets its default size, force and vertical exaggeration, and its default boundary
    condition if it does not have the present one. Loads keep their position and size relative to
    the skin. A free load takes the force of the previous one and moves until it is completely on
    the skin.
    """
    changed: dict[str, Any] = {name: value}
    if name == "shape":
        changed |= {**SHAPES[value].lengths, **SHAPES[value].defaults}
    if name == "design_shape" and value in SHAPES:
        changed |= {f"design_{name}": length for name, length in SHAPES[value].lengths.items()}
        changed |= {"design_pattern": "spiral" if value == "cap" else "grid"}
        changed |= {"design_place": "scene"} if value == "strip" else {}
    if name in _BOXED and "side_x" not in changed:
        patch = patch_of(replace(settings, **changed))
        changed |= {"side_x": patch.a, "side_y": patch.b}
    if name == "shape":
        offered = edges_of(patch_of(replace(settings, **changed)))
        edge = changed.get("edge", settings.edge)
        changed |= {"edge": edge if edge in offered else offered[0]}
        changed |= {"fit_edge": ""} if settings.fit_edge not in offered else {}
        changed |= {"inplane": ""}  # a bent skin and a flat one are held in other ways
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
        with suppress(Refusal):  # an invalid skin is reported by the scene
            changed |= inside_rim(after, patch_of(after))
    return changed
