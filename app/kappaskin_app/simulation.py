"""What a person chose, as a scene to simulate."""

import math
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from kappaskin import (
    FIRST_GENERATION,
    FIRST_GENERATION_LOOPS,
    SECOND_GENERATION,
    SECOND_GENERATION_LOOPS,
    Basis,
    Compliance,
    Creep,
    GaussianNoise,
    HalfBridge,
    Hysteresis,
    LineLoad,
    Load,
    Orbit,
    Plate,
    PointLoad,
    Refusal,
    Region,
    Scene,
    SensorLayout,
    Tolerance,
    Transduction,
    UniformNoise,
    basis_for,
    load_scene,
)
from kappaskin_app.settings import FREE_CASES, LOAD_CASES, Settings
from kappaskin_app.skins import SHAPES

_THICKNESS = HalfBridge().thickness
_TABLE_1 = ("shape", "side_x", "side_y", "edge", "tension", "foam", "fluid")
_MARGIN = 0.03  # share of the patch along each edge that a dragged load keeps out of
_REFERENCE = (15, 15)  # functions of the true shape, by which Table 1 defines its truth
_MOST_BENT = 27.0  # 1/m, under the load: a moving one bends more in places, and 38 is a rail
_LEAST = 1e-12  # m/N that a skin gives where it is free to move
_DRAWN = 0.28  # of the shorter side or the radius that a skin is drawn deep, as at first
_REMEMBERED = 8  # skins whose compliance need not be computed again


_CHAINS = {
    "modern": Transduction(),
    "second": SECOND_GENERATION,
    "first": FIRST_GENERATION,
}
_LOOPS = {"second": SECOND_GENERATION_LOOPS, "first": FIRST_GENERATION_LOOPS}
_CREEPING = 5.0  # s, the time constant of the creep
_OFFSET = 10.0  # 1/m of offset for a gain that is off by 1

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
    return Region(s.region, s.region_elements, s.region_radius, s.region_share)


def _free_loads(settings: Settings) -> tuple[PointLoad | LineLoad, ...]:
    s = settings
    if s.load_case == "free-line":
        return (LineLoad(s.x, s.y, s.x_end, s.y_end, s.force),)
    if s.load_case == "two-points":
        return PointLoad(s.x, s.y, s.force / 2), PointLoad(s.x_end, s.y_end, s.force / 2)
    return (PointLoad(s.x, s.y, s.force),)


def plate_of(settings: Settings) -> Plate:
    """The skin that `settings` describe, without its elements; a bent one is an even sheet."""
    shape = SHAPES[settings.shape]
    patch = shape.make(*(getattr(settings, name) for name in shape.begins))
    plate = Plate(patch, tension=settings.tension, foundation=settings.foam, fluid=settings.fluid)
    if not patch.base_curvature:
        return plate
    stretch = 12 * (1 - plate.poisson**2) * plate.rigidity / _THICKNESS**2  # E h, of D
    return replace(plate, axial_stiffness=stretch)


def is_table_1(settings: Settings) -> bool:
    """Whether the skin is that of Table 1, where its cases are what they are called."""
    paper = Settings()
    return all(getattr(settings, name) == getattr(paper, name) for name in _TABLE_1)


@lru_cache(_REMEMBERED)
def _compliance(plate: Plate, edge: str) -> Compliance:
    """How the true shape gives; raises `Refusal` for a skin that nothing holds."""
    return plate.compliance(basis_for(plate.patch, edge, *_REFERENCE))


def _moved(load: Load, basis: Basis, compliance: Compliance) -> float:
    """How far the skin moves in m where the load presses."""
    return float(basis.at(load.centre()[None])[0] @ compliance(load.modal(basis)).ravel())


def _stretched(load: Load, along_x: float, along_y: float) -> PointLoad | LineLoad:
    """The load on a skin whose sides are so many times longer."""
    if isinstance(load, LineLoad):
        x0, y0, x1, y1 = load.x0, load.y0, load.x1, load.y1
        return LineLoad(x0 * along_x, y0 * along_y, x1 * along_x, y1 * along_y)
    x, y = load.centre()
    return PointLoad(x * along_x, y * along_y)


@lru_cache(len(LOAD_CASES) * _REMEMBERED)
def _ready(case: str, plate: Plate, edge: str) -> tuple[tuple[Load, ...], Orbit | None]:
    """Loads and motion of a ready scene; on another skin, at the same shares of its sides.

    What moves by W on the patch of side L moves by W s there, whose shorter side is s L: the slopes
    stay as they are. It moves less where it would bend so much that elements stand on a rail.
    """
    paper = load_scene(case)
    compliance, patch = _compliance(plate, edge), plate.patch
    if (plate, edge) == (paper.plate, paper.edge):
        return paper.loads, paper.motion
    along_x, along_y = patch.a / paper.plate.patch.a, patch.b / paper.plate.patch.b
    size = min(along_x, along_y)
    moved = _moved(paper.loads[0], paper.basis, _compliance(paper.plate, paper.edge))
    load, basis = _stretched(paper.loads[0], along_x, along_y), basis_for(patch, edge, *_REFERENCE)
    gives = abs(_moved(load, basis, compliance))
    if not gives > _LEAST:
        raise Refusal(
            f"the skin does not move where the load presses, at {load.centre()} m: expected it "
            "further inside; choose a free load and drag it there"
        )
    load = load.scaled(size * moved / gives)
    bent = SensorLayout.regular(patch, 21, 21).curvature_operator(basis)
    most = float(np.abs(bent @ compliance(load.modal(basis)).ravel()).max())
    motion = paper.motion and replace(paper.motion, radius=paper.motion.radius * size)
    return (load.scaled(min(1.0, _MOST_BENT / most)),), motion


def scene_of(settings: Settings) -> Scene:
    """The scene that `settings` describe; raises `Refusal` for a skin that cannot be."""
    plate = plate_of(settings)
    layout = SensorLayout.regular(plate.patch, settings.elements_x, settings.elements_y)
    if settings.load_case in FREE_CASES:
        _compliance(plate, settings.edge)  # for its refusal
        loads, motion = _free_loads(settings), None
    else:
        loads, motion = _ready(settings.load_case, plate, settings.edge)
    scene = Scene(
        settings.load_case,
        plate,
        layout,
        loads,
        motion,
        _effects(settings),
        _transduction(settings),
        seed=settings.noise_seed,
        reference=_REFERENCE,
        edge=settings.edge,
    )
    fastest = math.floor(1 / scene.transduction.scan_time(3 * len(layout)))
    return replace(scene, rate=min(scene.rate, fastest))


def settings_for(source: str) -> Settings:
    """The settings to begin with on `source`: a simulated scene's load case, else as they are."""
    case = source.removeprefix("sim:")
    ready = source.startswith("sim:") and case in dict(LOAD_CASES)
    return Settings(load_case=case) if ready else Settings()


def with_consequences(settings: Settings, scene: Scene, name: str, value: Any) -> dict[str, Any]:
    """The settings that change when a person changes `name` while `scene` is played.

    A shape brings its usual size, force and height. Where the skin gets longer, loads move to keep
    their share of it. A free load presses as the one did that it follows.
    """
    changed: dict[str, Any] = {name: value}
    if name == "shape":
        changed |= SHAPES[value].begins
        changed |= _usual(replace(settings, **changed))
    if name == "electronics":
        converter = _CHAINS[value].converter
        changed |= {"bits": converter.bits, "conversion_time": converter.conversion_time}
    if name in ("elements_x", "elements_y"):
        changed["region_elements"] = ()  # they were chosen among others
    for side, places in (("side_x", ("x", "x_end")), ("side_y", ("y", "y_end"))):
        if side in changed:
            longer = changed[side] / getattr(settings, side)
            changed |= {place: getattr(settings, place) * longer for place in places}
    if name == "load_case" and value in FREE_CASES and settings.load_case not in FREE_CASES:
        changed["force"] = scene.loads[0].force
    return changed


def _usual(settings: Settings) -> dict[str, float]:
    """The force of a ready load in the middle, and the height that shows well what it does."""
    plate = plate_of(settings)
    try:
        (load,), _ = _ready("centre", plate, settings.edge)
    except Refusal:
        return {}  # the scene says why
    patch = plate.patch
    basis = basis_for(patch, settings.edge, *_REFERENCE)
    moved = abs(_moved(load, basis, _compliance(plate, settings.edge)))
    times = round(_DRAWN * min(patch.a, patch.b, patch.radius) / moved)
    return {"force": float(f"{load.force:.3g}"), "exaggeration": float(min(max(times, 1), 50))}


def dragged(
    settings: Settings, scene: Scene, x: float, y: float, grabbed_end: bool
) -> dict[str, Any]:
    """The settings that change when a load of `scene` is dragged to (x, y) in m.

    It becomes a free one of the same force. A line moves as a whole, of two points the one that
    was grabbed.
    """
    patch, load = scene.plate.patch, scene.loads[0]

    def inside(value: float, side: float) -> float:
        return min(max(value, _MARGIN * side), (1 - _MARGIN) * side)

    x, y = inside(x, patch.a), inside(y, patch.b)
    if settings.load_case == "two-points":
        return {"x_end": x, "y_end": y} if grabbed_end else {"x": x, "y": y}
    kept = {} if settings.load_case in FREE_CASES else {"force": load.force}
    if not isinstance(load, LineLoad):
        return {"load_case": "point", "x": x, "y": y, **kept}
    half_x, half_y = (load.x1 - load.x0) / 2, (load.y1 - load.y0) / 2
    x = min(max(x, abs(half_x)), patch.a - abs(half_x))
    y = min(max(y, abs(half_y)), patch.b - abs(half_y))
    ends = {"x": x - half_x, "y": y - half_y, "x_end": x + half_x, "y_end": y + half_y}
    return {"load_case": "free-line", **ends, **kept}
