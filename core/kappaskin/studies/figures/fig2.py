"""The paper's Fig. 2: a curved n x m patch, and the curvature that one element measures."""

import math
from dataclasses import dataclass

import numpy as np

from kappaskin.bases import SineBasis
from kappaskin.estimation import LeastSquares
from kappaskin.frames import Array
from kappaskin.mechanics import Plate, PointLoad
from kappaskin.scenes import scaled_to
from kappaskin.scenes.effects import UniformNoise
from kappaskin.sensing import SensorLayout
from kappaskin.skin import Patch
from kappaskin.studies.figures import style

R0 = 12.9e-3
SKIN = Patch(math.pi * R0, 30e-3, R0)
COLUMNS, ROWS = 10, 8
ELEMENT = (6, 3)
"""Column and row of the element that is enlarged, counted from 0."""
_LOAD, _PRESSED = (22e-3, 18e-3), 1.0e-3
_NOISE = 1.0
_SEED = 3
_RAISED = 4  # how much higher than true the enlarged element is drawn
_CELL = np.array([SKIN.a / COLUMNS, SKIN.b / ROWS])
_COLOURS = (style.BLUE, style.ORANGE)
_NUMBER = ELEMENT[0] + COLUMNS * ELEMENT[1]


@dataclass(frozen=True, eq=False)
class _Run:
    """The shape fitted to the readings, every cell of the skin drawn as one tile.

    `tiles` (P, T, 3) in mm are their outlines and `tensor` (P, 2, 2) in 1/m the curvature at their
    centres; `covariance` (3, 3) that of xx, yy, xy of the element that is enlarged.
    """

    tiles: Array
    tensor: Array
    covariance: Array

    @property
    def principal(self) -> tuple[Array, Array]:
        """Principal curvatures (2,) in 1/m, the smaller first, and directions (2, 2) in columns."""
        values, vectors = np.linalg.eigh(self.tensor[_NUMBER])
        return values, vectors

    @property
    def principal_sd(self) -> Array:
        """Standard deviations (2,) of the principal curvatures in 1/m, to first order."""
        v = self.principal[1]
        by_component = np.stack([v[0] ** 2, v[1] ** 2, 2 * v[0] * v[1]])
        return np.sqrt(np.einsum("kp,kl,lp->p", by_component, self.covariance, by_component))


def run(noise: float = _NOISE) -> _Run:
    """A fingertip's skin pressed off its middle, read with noise.

    The truth has the 8 x 6 functions that are fitted: with more, the error of leaving them out
    would be ten times the noise's at an element, and no error bar would show it.
    """
    plate, basis = Plate(SKIN), SineBasis(SKIN, 8, 6)
    load = scaled_to(plate, PointLoad(*_LOAD), _PRESSED, basis)
    truth = plate.deflection([load], basis).ravel()
    layout = SensorLayout.regular(SKIN, COLUMNS, ROWS)
    curvature = (layout.curvature_operator(basis) @ truth).reshape(3, -1)
    spoil = UniformNoise(noise).start(curvature.shape, np.random.default_rng(_SEED))
    readings = spoil(curvature, 0.0)
    fit = LeastSquares(basis, layout, sigma=noise)(readings)
    c, M = fit.coefficients.ravel(), fit.estimator.M.reshape(3, len(layout), -1)
    xx, yy, xy = M @ c + np.array([SKIN.base_curvature, 0, 0])[:, None]
    outlines = layout.positions[:, None] + _outline()
    rest, outward = SKIN.at_rest(outlines)
    w = (basis.at(outlines.reshape(-1, 2)) @ c).reshape(*outlines.shape[:2], 1)
    return _Run(
        1e3 * (rest - w * outward),
        np.stack([xx, xy, xy, yy], axis=-1).reshape(-1, 2, 2),
        M[:, _NUMBER] @ fit.covariance @ M[:, _NUMBER].T,
    )


def _outline() -> Array:
    """The way round a cell from its centre, (T, 2) in m."""
    along, end = np.linspace(-1, 1, 9)[:-1], np.ones(8)
    corners = [(along, -end), (end, along), (-along, end), (-end, -along)]
    return np.concatenate([np.column_stack(side) for side in corners]) * _CELL / 2


def draw(figure: style.Figure) -> None:
    """The patch with its n x m elements left, one of them enlarged right."""
    found = run()
    style.resize(figure, style.DOUBLE, 80)
    style.letter(figure, 1, 79, "a", f"patch of {COLUMNS} × {ROWS} elements, pressed inward")
    style.letter(figure, 101, 79, "b", f"the element framed in a (heights × {_RAISED})")
    _draw_skin(figure, style.place(figure, (2, 3, 92, 80), projection="3d"), found)
    _draw_element(style.place(figure, (98, 20, 76, 58), projection="3d"), found)
    _write_values(figure, found)


def _draw_skin(figure: style.Figure, axes: style.Axes, found: _Run) -> None:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from mpl_toolkits.mplot3d.art3d import (  # pyright: ignore[reportMissingTypeStubs]
        Poly3DCollection,
    )

    mean = np.trace(found.tensor, axis1=1, axis2=2) / 2
    colours = ScalarMappable(Normalize(-100, 100), style.colour_map(style.DIVERGING))
    axes.add_collection3d(
        Poly3DCollection(found.tiles, facecolors=colours.to_rgba(mean), edgecolors="w", lw=0.5)
    )
    framed = np.vstack([found.tiles[_NUMBER], found.tiles[_NUMBER, :1]])
    axes.plot(*framed.T, color=style.INK, lw=1.4, zorder=5)
    low, high = found.tiles.min(axis=(0, 1)), found.tiles.max(axis=(0, 1))
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set(xlabel="x [mm]", ylabel="y [mm]", zlabel="z [mm]", xticks=(10, 20, 30))
    axes.set(yticks=(0, 10, 20, 30), zticks=(-10, -5, 0))
    style.space(axes, tuple(high - low))
    bar = style.place(figure, (8, 9, 30, 1.6))
    label = "mean curvature (κ₁ + κ₂)/2 [1/m]"
    figure.colorbar(colours, cax=bar, orientation="horizontal", label=label, ticks=(-100, 0, 100))


def _draw_element(axes: style.Axes, found: _Run) -> None:
    """The paraboloid that has the element's curvature, seen from outside, in mm."""
    half = 1e3 * _CELL / 2
    x, y = np.meshgrid(*np.linspace(-half, half, 9).T)

    def height(p: Array) -> Array:
        return -_RAISED * 1e-3 * np.einsum("...i,ij,...j->...", p, found.tensor[_NUMBER], p) / 2

    axes.plot_surface(x, y, height(np.stack([x, y], axis=-1)), color=style.FILL, shade=False,
                      edgecolor=style.FAINT, lw=0.3, rstride=1, cstride=1)  # fmt: skip
    for n, way in enumerate(found.principal[1].T):
        end: Array = way * np.min(half / np.abs(way))
        line = np.linspace(-end, end, 41)
        axes.plot(*line.T, height(line), color=_COLOURS[n], lw=2, zorder=5)
    for name, side, p in zip("xy", half, (np.array([0, -1.35]), np.array([1.25, 0])), strict=True):
        text = f"{name}: {2 * side:.1f} mm"
        axes.text(*(p * half), height(p * half), text, name, ha="center", va="center")
    axes.set(xlim=(-half[0], half[0]), ylim=(-half[1], half[1]), zlim=(-1.6, 1.6))
    style.space(axes, (2 * half[0], 2 * half[1], 3.2))
    axes.axis("off")


def _write_values(figure: style.Figure, found: _Run) -> None:
    (xx, xy), (_, yy) = found.tensor[_NUMBER]
    values, vectors = found.principal
    tensor = f"curvature xx {xx:.1f}, yy {yy:.1f}, xy {xy:.1f} 1/m"
    style.write(figure, 106, 17, tensor)
    for n, colour in enumerate(_COLOURS):
        limit = 1.96 * found.principal_sd[n]
        angle = np.degrees(np.arctan(vectors[1, n] / vectors[0, n]))
        text = f"κ{'₁₂'[n]} = {values[n]:.1f} ± {limit:.1f} 1/m at {angle:.0f}° from x"
        style.write(figure, 106, 12 - 5 * n, text, color=colour)
    style.write(figure, 106, 2, "positive: convex seen from outside; ± 1.96 sd", color=style.FAINT)
