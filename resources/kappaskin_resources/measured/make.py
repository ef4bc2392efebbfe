"""Sensor lines and recordings of measurements of others: a pressed gel, a plate, and a fibre.

`python make.py FOLDER` makes the files here from FOLDER/ball, FOLDER/plate and FOLDER/fibre, copies
of https://github.com/linchangyi1/9DTact (of its sensor 1 `rectify_crop_ref.png`,
`rectify_crop_sample.png`, `Pixel_to_Depth.npy`, `position_scale.npy`), of
https://github.com/PolymerGuy/recolo (`fields_frame10.rpt`) and of
https://github.com/SamanehManavi/deep-learning-model-for-fiber-shape-sensing (`label.txt`). The
first two are one moment each: a recording holds their line more than once.
"""

import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.ndimage import gaussian_filter

from kappaskin.bases import basis_for
from kappaskin.estimation.bayes import MarginalLikelihood, prior_root
from kappaskin.live import LOST, Engine
from kappaskin.pipeline import Setup
from kappaskin.skin import Patch
from kappaskin.sources import described_source

HERE = Path(__file__).parent
FRAMES = 4  # of a recording
SETUPS = {
    "ball/ball": replace(Setup(), method="fast", Ni=30, Nj=22),
    "plate/slopes": replace(Setup(), Ni=16, Nj=16, edge="clamped"),
    "fibre/fibre": replace(Setup(), method="bayes", Ni=20),
}
SMOOTHING = 1.5  # px
CELL = 0.5e-3  # m


def ball(folder: Path) -> None:
    """Heights of the gel in um, the mean in each cell of 0.5 mm, x by x."""
    before, during = (
        np.asarray(Image.open(folder / f"rectify_crop_{name}.png").convert("L"), float)
        for name in ("ref", "sample")
    )
    table = np.load(folder / "Pixel_to_Depth.npy")  # mm, for each grey level
    pixel = np.load(folder / "position_scale.npy")[2] * 1e-3  # m
    darker = gaussian_filter(before - during, SMOOTHING)
    depth = np.interp(darker, np.arange(table.size), np.maximum(table, 0.0))
    m, n = (round(pixel * count / CELL) for count in depth.T.shape)
    write("ball/ball", np.round(1e3 * means(means(depth, n).T, m)).ravel())


def means(a: np.ndarray, cells: int) -> np.ndarray:
    """The means (cells, ...) of `a` (n, ...) over equal cells along its first axis."""
    n = len(a)
    sums = np.concatenate([np.zeros((1, *a.shape[1:])), np.cumsum(a, axis=0)])
    at = np.linspace(0, n, cells + 1)
    whole = np.minimum(at.astype(int), n - 1)
    sums = sums[whole] + (at - whole)[:, None] * a[whole]
    return np.diff(sums, axis=0) * cells / n


def plate(folder: Path) -> None:
    """Slopes in 0.1 nrad and heights in 0.01 nm at every second node, x by x.

    The descriptions make them a thousand times as large, as if the pulse were.
    """
    lines = (folder / "fields_frame10.rpt").read_text().splitlines()
    rows = [line.split() for line in lines]
    nodes = np.array([row for row in rows if len(row) == 7 and row[0].isdigit()], float)
    nodes = nodes.reshape(61, 61, 7)[1::2, 1::2].swapaxes(0, 1)  # in the middles of 30 x 30 cells
    height, along_x, along_y = -nodes[..., 3] * 1e-3, nodes[..., 6], -nodes[..., 5]
    write("plate/slopes", np.round(np.stack([along_x, along_y]) / 1e-10).ravel())
    write("plate/heights", np.round(height / 1e-11).ravel())


PREDICTED = [2, 6, 10, 14, 18]  # markers whose heights the others predict
STRAIGHTEST = 100


def fibre(folder: Path) -> None:
    """Heights in um of the 20 markers of the straightest shapes, each in its own plane."""
    shapes = 1e-3 * np.loadtxt(folder / "label.txt").reshape(-1, 20, 3)
    steps = np.linalg.norm(np.diff(shapes, axis=1), axis=2)
    straight = np.linalg.norm(shapes[:, -1] - shapes[:, 0], axis=1) / steps.sum(axis=1)
    chosen = np.sort(np.argsort(-straight)[:STRAIGHTEST])
    along = np.append(0.0, steps[chosen].mean(axis=0).cumsum())
    read = np.delete(np.arange(20), PREDICTED)
    write("fibre/fibre", np.round([in_own_plane(shapes[n], along, read) / 1e-6 for n in chosen]))


# The shape is r(s) = r0 + t s + sum_k c_k phi_k(s) along the fibre: phi_k are a cantilever's
# functions, so that t is the tangent at the base. c has the prior of `bayes`, r0 and t none: with
# the c expected under the most likely scale, they are the line through what c leaves.
def in_own_plane(shape: np.ndarray, along: np.ndarray, read: np.ndarray) -> np.ndarray:
    """Heights (20,) in m of markers `shape` (20, 3) above the tangent at the base.

    In the plane through that tangent which is nearest to the markers that are `read`, from which
    alone both are found; `along` (20,) in m is where the markers are on the fibre.
    """
    basis = basis_for(Patch(along[-1], along[-1], strip=True), "cantilever", 20, 1)
    modes = basis.at(np.column_stack([along, along])[read]) @ prior_root(basis)
    line = np.column_stack([np.ones(len(read)), along[read]])
    lines = np.linalg.qr(line)[0]
    seen, left = (M - lines @ (lines.T @ M) for M in (modes, shape[read]))
    likelihood = MarginalLikelihood(seen, False, np.finfo(float).eps ** 2, 2)
    y, gamma, _ = likelihood(left.T)
    s = np.sqrt(likelihood.s2[: y.shape[1]])
    expected = y * gamma[:, None] * s / (1 + gamma[:, None] * s**2)
    bent = modes @ likelihood.V[:, : y.shape[1]] @ expected.T
    base, tangent = np.linalg.lstsq(line, shape[read] - bent)[0]
    tangent /= np.linalg.norm(tangent)
    off = shape - base
    off -= np.outer(off @ tangent, tangent)
    heights = off @ np.linalg.svd(off[read])[2][0]
    return heights * np.sign(heights[-1])


def write(name: str, numbers: np.ndarray) -> None:
    """One line of text for each row of the numbers."""
    text = "".join(",".join(f"{n:.0f}" for n in row) + "\n" for row in np.atleast_2d(numbers))
    (HERE / f"{name}.csv").write_text(text, "ascii")


def record(name: str, setup: Setup) -> None:
    """Record the lines of a sensor, a single one as that many frames, with estimates by a setup."""
    out = HERE / f"{name}.mcap"
    out.unlink(missing_ok=True)
    with tempfile.TemporaryDirectory() as folder, Engine() as engine:
        played = Path(folder, "played.csv")
        text = (HERE / f"{name}.csv").read_text("ascii")
        played.write_text(text * (FRAMES if text.count("\n") == 1 else 1), "ascii")
        engine.set_up(setup)
        engine.record(out)
        engine.connect(described_source(HERE / f"{name}.toml", str(played)))
        while not (status := engine.status()).ended:
            if status.state == LOST:
                raise SystemExit(status.message)
            time.sleep(0.1)
        engine.record(None)
        while engine.status().recording.active:
            time.sleep(0.1)


if __name__ == "__main__":
    for make in (ball, plate, fibre):
        make(Path(sys.argv[1], make.__name__))
    for each in SETUPS.items():
        record(*each)
