"""A file of readings to a file of shapes."""

import sys
from pathlib import Path

from kappaskin.cli.common import Pair, Switch, pair, save_arrays
from kappaskin.estimation import METHODS
from kappaskin.pipeline import reconstruct as reconstructed


def reconstruct(
    readings: Path,
    *,
    out: Path,
    basis: Pair = "8x8",
    grid: Pair | None = None,
    edge: str = "hinged",
    method: str = next(iter(METHODS)),
    contact: Switch = False,
    objects: Switch = False,
) -> None:
    """Turn a file of curvature readings into a file of shapes.

    READINGS is an NPZ with `size` (2,) m, `positions` (P, 2) m, `curvature` (T, 3, P) or (3, P) in
    1/m with NaN for a missing reading, and optionally `sigma` in 1/m and `radius` in m, the base
    radius along x (infinite when flat). A `size` (1,) with `positions` (P, 1) is a strip, of whose
    curvature only xx is read. An `outline` (V, 2) m is that of a polygon, one number the radius of
    a disk; a `rigidity` in N m tells forces.

    Example: `kappaskin reconstruct in.npz --basis 8x8 --out out.npz --grid 101x101`

    Parameters
    ----------
    readings
        The NPZ to read.
    out
        The NPZ to write: coefficients, sd, residual and, with a grid, the surface w.
    basis
        Number of functions along x and y.
    grid
        Number of points of the surface along x and y; none when left out.
    edge
        How the skin is held: hinged, sliding, clamped or elastic.
    method
        How the coefficients are found: least-squares, as-printed, direct, fast, bayes,
        finite-slope, tracking or robust.
    contact
        Write the contact of each frame too, and the skin's geometry there.
    objects
        Write the contact and what it is: plane, cylinder, sphere or edge; some 50 ms a frame.
    """
    points = pair(grid, "a grid") if grid else None
    functions = pair(basis, "a basis")
    found = reconstructed(readings, functions, points, edge, method, contact, objects)
    save_arrays(out, found)
    print(f"{out}: {len(found['coefficients'])} shapes", file=sys.stderr)
