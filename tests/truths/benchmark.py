"""The presses of the benchmark, by truths that share no code with the library.

`python tests/truths/benchmark.py` writes the open half; with a seed as its argument the held-out
half, whose answers go to `held-out-answers.npz` in the present folder.
"""

import sys
from collections.abc import Iterator
from dataclasses import astuple, dataclass
from functools import cache
from math import inf, pi
from pathlib import Path

import numpy as np

from koiter import Panel
from navier import HingedPlate, Load
from objects import Press, drawn, on_plate
from sanders import CylinderShell

FOLDER = Path(__file__).parents[2] / "resources" / "kappaskin_resources" / "benchmark"
OPEN_SEED = 35
NOISES = 0.05, 0.231, 0.5  # 1/m RMS, in turn
OBJECTS = "sphere", "ellipsoid", "cone", "flat round face", "flat square face"


@dataclass(frozen=True)
class Skin:
    """Sides and radii (along x, along y) in m; the range of forces in N and of discs' radii in m.

    Two contacts are at least `apart` in m.
    """

    name: str
    sides: tuple[float, float]
    radii: tuple[float, float]
    force: tuple[float, float]
    disc: tuple[float, float]
    apart: float

    @property
    def elements(self):
        """Places (100, 2) in m of 10 x 10 elements in the middles of equal cells, x the faster."""
        share = (np.arange(10) + 0.5) / 10
        return np.stack(np.meshgrid(*(share * side for side in self.sides)), -1).reshape(-1, 2)


FLAT = Skin("flat", (0.1, 0.1), (inf, inf), (0.04, 0.25), (2e-3, 5e-3), 0.03)
BENT = Skin("bent", (pi * 12.9e-3, 40e-3), (12.9e-3, inf), (0.5, 3.0), (3e-3, 4e-3), 0.013)
DOME = Skin("dome", (0.04, 0.04), (0.1, 0.1), (0.3, 1.5), (1e-3, 3e-3), 0.013)
SKINS = FLAT, BENT, DOME
GROUPS = {  # how many of a half
    (FLAT, "point"): 10,
    (FLAT, "disc"): 10,
    (FLAT, "object"): 20,
    (FLAT, "two"): 10,
    (BENT, "disc"): 15,
    (BENT, "two"): 10,
    (DOME, "disc"): 15,
    (DOME, "two"): 10,
}


@cache
def truth(skin):
    """What reads a load's curvature (3, P) in 1/m, and its displacement (G,) in m at places."""
    if skin is FLAT:
        return lambda load: HingedPlate().readings(load, skin.elements), HingedPlate().displacement
    if skin is BENT:
        shell = CylinderShell(*skin.sides, skin.radii[0], polynomials=130, waves=240)
        return shell.reader(skin.elements), lambda load, at: shell.displacement(load, at)[0]
    panel = Panel(*skin.sides, *skin.radii, polynomials=36, modes=300)
    return panel.reader(skin.elements), lambda load, at: panel.displacement(load, at)[2]


def loads(skin, kind, rng) -> list[Load]:
    """The loads of a press other than an object's."""
    count = 2 if kind == "two" else 1
    while True:
        places = rng.uniform(0.2, 0.8, (count, 2)) * skin.sides
        if count == 1 or np.hypot(*(places[0] - places[1])) > skin.apart:
            break
    low, high = np.log(skin.force)
    radii = rng.uniform(*skin.disc, count) * (kind != "point")
    forces = np.exp(rng.uniform(low, high, count))
    return [Load(*at, f, r) for at, f, r in zip(places.tolist(), forces, radii, strict=True)]


def object_loads(press: Press) -> list[Load]:
    """The nodes on which an object bears."""
    places, forces, radius = on_plate().forces(press)
    return [Load(*at, f, radius) for at, f in zip(places.tolist(), forces, strict=True)]


def press(seed, number, skin, kind):
    """Curvature (3, P) in 1/m with noise, its RMS, and contacts (N, 4): x, y, force, depth."""
    rng = np.random.default_rng([seed, number])
    read, displaced = truth(skin)
    if kind == "object":
        made = object_loads(drawn(OBJECTS[number % len(OBJECTS)], rng))
        force = np.array([load.force for load in made])
        contacts = [(*(force @ [(load.x, load.y) for load in made] / force.sum()), force.sum())]
    else:
        made = loads(skin, kind, rng)
        contacts = [astuple(load)[:3] for load in made]
    found = np.array(contacts)
    depth = sum(displaced(load, found[:, :2]) for load in made)
    noise = NOISES[number % len(NOISES)]
    curvature = sum(read(load) for load in made) + rng.normal(0, noise, (3, 100))
    return curvature, noise, np.column_stack([found, depth])


def presses() -> Iterator[tuple[int, Skin, str]]:
    """Number, skin and kind of each press of a half."""
    kinds = [group for group, count in GROUPS.items() for _ in range(count)]
    return ((number, *group) for number, group in enumerate(kinds))


def half(seed) -> dict[str, np.ndarray]:
    """The arrays of one half, with the answers."""
    listed = list(presses())
    np.random.default_rng(seed).shuffle(listed)  # or the order would tell the kind
    made = [press(seed, *each) for each in listed]
    answers = np.full((len(made), 2, 4), np.nan)
    for answer, (_, _, contacts) in zip(answers, made, strict=True):
        contacts = contacts[np.argsort(-contacts[:, 2])]  # the larger force first
        answer[: len(contacts)] = contacts
    return skin_arrays() | {
        "skin": np.array([skin.name for _, skin, _ in listed]),
        "kind": np.array([kind for _, _, kind in listed]),
        "noise": np.array([noise for _, noise, _ in made]),
        "curvature": np.array([curvature for curvature, _, _ in made], np.float32),
        "count": np.array([len(contacts) for _, _, contacts in made]),
        "place": answers[:, :, :2],
        "force": answers[:, :, 2],
        "depth": answers[:, :, 3],
    }


def skin_arrays() -> dict[str, np.ndarray]:
    """What the skins are."""
    plate = HingedPlate()
    found = {"rigidity": plate.rigidity, "thickness": 0.25e-3, "poisson": 0.3}
    for skin in SKINS:
        found[f"{skin.name}_sides"], found[f"{skin.name}_radii"] = skin.sides, skin.radii
        found[f"{skin.name}_elements"] = skin.elements
    return {name: np.array(value) for name, value in found.items()}


ANSWERS = "kind", "count", "place", "force", "depth"


def main(seed: str = "") -> None:
    """Write one half."""
    made = half(int(seed or OPEN_SEED))
    if seed:
        np.savez_compressed("held-out-answers.npz", **made)
        made = {name: made[name] for name in made if name not in ANSWERS}
    np.savez_compressed(FOLDER / ("held-out.npz" if seed else "open.npz"), **made)


if __name__ == "__main__":
    main(*sys.argv[1:])
