"""Sensor lines and recordings of measurements of others: a pressed gel, and a plate.

`python make.py FOLDER` makes the files here from FOLDER/ball and FOLDER/plate, copies of
https://github.com/linchangyi1/9DTact (of its sensor 1 `rectify_crop_ref.png`,
`rectify_crop_sample.png`, `Pixel_to_Depth.npy`, `position_scale.npy`) and of
https://github.com/PolymerGuy/recolo (`fields_frame10.rpt`). Each is one moment: a recording holds
its line more than once.
"""

import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.ndimage import gaussian_filter

from kappaskin.live import LOST, Engine
from kappaskin.pipeline import Setup
from kappaskin.sources import described_source

HERE = Path(__file__).parent
FRAMES = 4  # of a recording
SETUPS = {
    "ball/ball": replace(Setup(), method="fast", Ni=30, Nj=22),
    "plate/slopes": replace(Setup(), Ni=16, Nj=16, edge="clamped"),
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
    write("ball/ball", np.round(1e3 * means(means(depth, n).T, m)))


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
    write("plate/slopes", np.round(np.stack([along_x, along_y]) / 1e-10))
    write("plate/heights", np.round(height / 1e-11))


def write(name: str, numbers: np.ndarray) -> None:
    """One line of text with all numbers."""
    text = ",".join(f"{n:.0f}" for n in numbers.ravel())
    (HERE / f"{name}.csv").write_text(text + "\n", "ascii")


def record(name: str, setup: Setup) -> None:
    """Record the line of a sensor as that many frames, with estimates by a setup."""
    out = HERE / f"{name}.mcap"
    out.unlink(missing_ok=True)
    with tempfile.TemporaryDirectory() as folder, Engine() as engine:
        played = Path(folder, "played.csv")
        played.write_text(FRAMES * (HERE / f"{name}.csv").read_text("ascii"), "ascii")
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
    for make in (ball, plate):
        make(Path(sys.argv[1], make.__name__))
    for each in SETUPS.items():
        record(*each)
