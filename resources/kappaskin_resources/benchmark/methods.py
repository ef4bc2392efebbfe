"""Methods on the presses of the benchmark: two simple ones, which need NumPy alone, and Kappaskin.

`python methods.py peak|sines|kappaskin RESULTS.npz` answers the open half that is beside this file;
`python methods.py METHOD RESULTS.npz PRESSES.npz` other presses.
"""

import sys
from pathlib import Path

import numpy as np

OPEN = Path(__file__).with_name("open.npz")


def load(file):
    """The arrays of a file."""
    with np.load(file, allow_pickle=False) as found:
        return {name: found[name] for name in found.files}


def peak(curvature, skin):
    """The middle and the sum of what bends inward around the element that bends most."""
    bent = -(curvature[0] + curvature[1]).reshape(10, 10)
    places = skin["elements"].reshape(10, 10, 2)
    contacts = []
    for _ in range(2):
        i, j = np.unravel_index(bent.argmax(), bent.shape)
        near = np.s_[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2]
        weights = np.maximum(bent[near], 0)
        middle = np.tensordot(weights**2, places[near], 2) / max(np.sum(weights**2), 1e-12)
        contacts.append((middle, weights.sum(), bent[i, j]))
        bent[max(i - 2, 0) : i + 3, max(j - 2, 0) : j + 3] = -np.inf  # not the same once more
    two = contacts[1][2] > 0.5 * contacts[0][2]
    return [(at, strength, strength) for at, strength, _ in contacts[: 1 + two]]


def sines(curvature, skin):
    """Where 8 x 8 sines, fitted by least squares as on a flat skin, go in most."""
    k = [np.pi * np.arange(1, 9) / side for side in skin["sides"]]
    (sx, sy), (cx, cy) = (
        [f(np.outer(skin["elements"][:, a], k[a])) for a in (0, 1)] for f in _WAVES
    )
    rows = [(-(k[0] ** 2) * sx, sy), (sx, -(k[1] ** 2) * sy), (k[0] * cx, k[1] * cy)]
    matrix = np.concatenate([(x[:, :, None] * y[:, None]).reshape(len(x), -1) for x, y in rows])
    c = np.linalg.lstsq(matrix, curvature.ravel(), rcond=None)[0].reshape(8, 8)
    x, y = (np.linspace(0, side, 81) for side in skin["sides"])
    surface = np.sin(np.outer(x, k[0])) @ c @ np.sin(np.outer(k[1], y))
    i, j = np.unravel_index(surface.argmax(), surface.shape)
    return [(np.array([x[i], y[j]]), surface[i, j], surface[i, j])]


_WAVES = np.sin, np.cos


def simple(method, presses):
    """Answers of `peak` or `sines`.

    Force and depth are what the method has for them times one number for each skin: the median of
    the open half's single contacts over that.
    """
    known = load(OPEN)
    found = blank(len(presses["skin"]))
    for name in np.unique(presses["skin"]):
        single = np.flatnonzero((known["skin"] == name) & (known["count"] == 1))
        first = [
            method(known["curvature"][i].astype(float), skin_of(known, name))[0] for i in single
        ]
        by = [
            np.median(known[what][single, 0] / [one[1 + column] for one in first])
            for column, what in enumerate(("force", "depth"))
        ]
        for i in np.flatnonzero(presses["skin"] == name):
            told = method(presses["curvature"][i].astype(float), skin_of(presses, name))
            found["count"][i] = len(told)
            for j, (place, force, depth) in enumerate(told):
                found["place"][i, j] = place
                found["force"][i, j], found["depth"][i, j] = by[0] * force, by[1] * depth
    return found


def skin_of(presses, name):
    """Sides (2,), radii (2,) and elements (100, 2) in m of the skin of a name."""
    return {what: presses[f"{name}_{what}"] for what in ("sides", "radii", "elements")}


def blank(count):
    """Results that tell nothing."""
    names = {"force": 2, "depth": 2, "force_sd": 2, "depth_sd": 2}
    arrays = {name: np.full((count, size), np.nan) for name, size in names.items()}
    places = {name: np.full((count, 2, 2), np.nan) for name in ("place", "place_sd")}
    return {"count": np.zeros(count, int)} | places | arrays


def kappaskin(presses):
    """Answers of Kappaskin's contacts, with the skin's material known."""
    from kappaskin import Patch, Plate, SensorLayout, basis_for, estimator_for
    from kappaskin.contact import Contacts

    found = blank(len(presses["skin"]))
    for name in np.unique(presses["skin"]):
        skin = skin_of(presses, name)
        along, across = skin["radii"].tolist()
        patch = Patch(*skin["sides"].tolist(), along if np.isinf(across) else (along, across))
        # A thickness says that a flat skin stretches, which that of the benchmark does not.
        plate = Plate(patch, rigidity=float(presses["rigidity"]))
        layout = SensorLayout.regular(patch, 10, 10)
        fit = estimator_for("least-squares", basis_for(patch, "hinged", 8, 8), layout)
        contacts = Contacts(plate, layout)
        for i in np.flatnonzero(presses["skin"] == name):
            curvature = presses["curvature"][i].astype(float)
            for told in contacts(curvature, fit(curvature)):
                if told.present:
                    j = found["count"][i]
                    found["count"][i] += 1
                    found["place"][i, j], found["place_sd"][i, j] = told.position, told.position_sd
                    found["force"][i, j], found["force_sd"][i, j] = told.force, told.force_sd
                    found["depth"][i, j] = told.displacement
                    found["depth_sd"][i, j] = told.displacement_sd
    return found


def main(method, results, presses=OPEN):
    """Write the answers of one method."""
    presses = load(presses)
    simple_ones = {"peak": peak, "sines": sines}
    found = simple(simple_ones[method], presses) if method in simple_ones else kappaskin(presses)
    np.savez_compressed(results, **found)


if __name__ == "__main__":
    main(*sys.argv[1:])
