"""What one point of a study says to all that is simulated, fitted and measured there."""

import json
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

from kappaskin.bases import basis_for
from kappaskin.errors import Refusal
from kappaskin.estimation import (
    METHODS,
    PLACEMENTS,
    Estimator,
    check_placement,
    elements_placed,
    estimator_for,
)
from kappaskin.scenes import Scene, TomlTable, scene_of
from kappaskin.studies.design.draws import Distribution, read_draw

_NAME = "the study"
_MOST_READINGS = 2**23  # in a block: 64 MB for each array of them
_ELSEWHERE = ("file", "recorded")  # keys of a touch that name files beside that of the scene


@dataclass(frozen=True)
class Reconstruction:
    """How shapes are told: a `method` of `METHODS` for Ni x Nj `functions`.

    With `compensate`, the loops of the scene's hysteresis are undone first, as by a calibration
    that found them exactly.
    """

    functions: tuple[int, int] = (8, 8)
    method: str = next(iter(METHODS))
    compensate: bool = False

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise Refusal(f"expected a method among {', '.join(METHODS)}, got {self.method!r}")
        if min(self.functions) < 1:
            raise Refusal(f"expected at least 1 x 1 functions, got {self.functions}")


@dataclass(frozen=True)
class Placing:
    """Where the elements are: `by` one of `PLACEMENTS`, at least `apart` in m from each other."""

    by: str = "scene"
    apart: float = 4e-3

    def __post_init__(self) -> None:
        if self.by not in PLACEMENTS:
            raise Refusal(f"expected by among {', '.join(PLACEMENTS)}, got {self.by!r}")
        if not 0 < self.apart < 1:
            raise Refusal(f"expected elements apart by a distance above zero in m, got {self}")


@dataclass(frozen=True)
class Measuring:
    """`what` to measure, in `frames` of each block."""

    what: tuple[str, ...]
    frames: int = 200

    def __post_init__(self) -> None:
        if not self.what:
            raise Refusal("expected at least one thing to measure, got none")
        if len(set(self.what)) < len(self.what):
            raise Refusal(f"expected to measure each thing once, got {', '.join(self.what)}")
        if self.frames < 1:
            raise Refusal(f"expected at least one frame in a block, got {self.frames}")


@dataclass(frozen=True)
class Setup:
    """One point: the scene, how its shapes are told, what is measured, what is drawn anew."""

    scene: Scene
    fit: Reconstruction
    place: Placing
    measure: Measuring
    draws: tuple[tuple[str, Distribution], ...]


def read_setup(top: TomlTable, file: Path, known: Iterable[str]) -> Setup:
    """The setup that a file says at its `top`, which measures things that are `known`."""
    tables = fit, place, measure = [top.table(name) for name in ("fit", "place", "measure")]
    drawing = top.tables("draw")
    scene = _scene(top, file)
    made = fit.make(Reconstruction), place.make(Placing), measure.make(Measuring)
    for table in tables:
        table.done()
    among = {name: name for name in known}
    for name in made[2].what:
        measure.stands_for(name, "what", among)
    with place.blamed():
        check_placement(scene.layout, made[1].by)
    if (readings := made[2].frames * 3 * len(scene.layout)) > _MOST_READINGS:
        raise measure.refusal(
            f"expected at most {_MOST_READINGS} readings in a block, got {made[2].frames} frames "
            f"of {3 * len(scene.layout)} = {readings}; take fewer frames and more blocks",
            "frames",
        )
    return Setup(scene, *made, tuple(read_draw(table) for table in drawing))


def _scene(top: TomlTable, file: Path) -> Scene:
    """The scene, of which a worker that has no other files can make all."""
    for touch in top.tables("touch"):
        for key in _ELSEWHERE:
            if key in touch:
                raise touch.refusal(
                    "expected nothing that is in a file of its own: workers have none; take a "
                    "sphere, a cylinder or another shape, and steps or an orbit",
                    key,
                )
    scene = scene_of(top, file)
    if not (scene.loads or scene.indenter):
        raise top.refusal("expected a scene with a load or an object to tell errors by, got none")
    return scene


def setup_of(said: dict[str, Any], known: Iterable[str]) -> Setup:
    """The setup of what a point says; its refusals name no file."""
    try:
        return read_setup(TomlTable(said, "", _NAME), Path("study.toml"), known)
    except Refusal as refusal:
        raise Refusal(str(refusal).removeprefix(f"{_NAME}, line 1: ")) from refusal


def estimator_of(said: dict[str, Any], setup: Setup) -> Estimator:
    """What tells the shapes of a point, remembered for points with the same sensor and fit."""
    if METHODS[setup.fit.method].remembers:
        return _estimator(setup)
    alike = {key: said.get(key) for key in ("skin", "elements", "fit", "place")}
    return _remembered(_Alike(json.dumps(alike, sort_keys=True), setup))


@dataclass(frozen=True)
class _Alike:
    """A setup, equal to those of which the same is `told` of sensor and fit."""

    told: str
    setup: Setup = field(compare=False)


@lru_cache(8)
def _remembered(alike: _Alike) -> Estimator:
    return _estimator(alike.setup)


def _estimator(setup: Setup) -> Estimator:
    scene, fit = setup.scene, setup.fit
    patch = scene.plate.patch
    Ni, Nj = fit.functions
    basis = basis_for(patch, scene.edge, Ni, 1 if patch.strip else Nj)
    layout = elements_placed(scene.layout, basis, setup.place.by, setup.place.apart)
    return estimator_for(fit.method, basis, layout)
