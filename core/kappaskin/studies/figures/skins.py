"""Figures of skins: the paper's Figs. 1 and 2, the construction and the elements."""

import math
from dataclasses import dataclass

import numpy as np

from kappaskin._text import with_error
from kappaskin.frames import Array
from kappaskin.mechanics import PointLoad
from kappaskin.scenes import TABLE_1_NOISE
from kappaskin.sensing import SECOND_GENERATION
from kappaskin.skin import Patch
from kappaskin.studies.figures import style
from kappaskin.studies.paper import noisy_fit, pressed_scene

_STRIP = Patch(0.1, 0.01, strip=True)
ELEMENTS = 10
_STRIP_LOAD, _STRIP_PRESSED = 0.042, 4.7e-3
_STRIP_SEED = 1


@dataclass(frozen=True, eq=False)
class _StripRun:
    """Readings (10,) in 1/m at `elements` (10,) in mm; curves (201,) at `x` in mm, w in mm."""

    elements: Array
    readings: Array
    x: Array
    true_curvature: Array
    true: Array
    fitted: Array
    sd: Array


def strip_run() -> _StripRun:
    """A strip pressed off its middle, read with Table 1's noise, fitted by 8 functions of x."""
    load, elements = PointLoad(_STRIP_LOAD, _STRIP.b / 2), (ELEMENTS, 1)
    scene = pressed_scene("strip", _STRIP, load, _STRIP_PRESSED, elements, (15, 1), TABLE_1_NOISE)
    rng = np.random.default_rng(_STRIP_SEED)
    truth, readings, fit = noisy_fit(scene, (8, 1), rng, TABLE_1_NOISE)
    p = np.column_stack([np.linspace(0, _STRIP.a, 201), np.full(201, _STRIP.b / 2)])
    return _StripRun(
        1e3 * scene.layout.positions[:, 0],
        readings[0],
        1e3 * p[:, 0],
        scene.basis.at(p, 2, 0) @ truth,
        1e3 * scene.basis.at(p) @ truth,
        1e3 * fit.estimator.basis.at(p) @ fit.coefficients.ravel(),
        1e3 * fit.surface_sd(p).ravel(),
    )


def draw_strip(figure: style.Figure) -> None:
    """The construction and one gage pair left, curvature and deflection of a run right."""
    found = strip_run()
    style.resize(figure, style.DOUBLE, 92)
    style.letter(figure, 1, 91, "a", "skin over foam or fluid (thickness not to scale)")
    style.letter(figure, 1, 38, "b", "gage pair of the second prototype (thickness to scale)")
    style.letter(figure, 95, 91, "c", "curvature read by a linear sensor")
    style.letter(figure, 95, 44, "d", "deflection reconstructed from it")
    _draw_section(style.place(figure, (1, 42, 90, 45)), found)
    _draw_pair(style.place(figure, (1, 1, 90, 33)))
    _draw_curvature(style.place(figure, (106, 57, 64, 29)), found)
    _draw_deflection(style.place(figure, (106, 10, 64, 29)), found)


_THICK, _GAGE, _FOAM = 2.0, 0.9, 15.0  # drawn, in mm of the skin's length
_FLEX = "#d9b98c"


def _draw_section(axes: style.Axes, found: _StripRun) -> None:
    x, z = found.x, -found.fitted
    axes.fill((-5, -5, 105, 105), (1, -_FOAM - 5, -_FOAM - 5, 1), color=style.LINE)
    axes.fill_between(x, -_FOAM, z, color=style.FILL)
    axes.fill_between(x, z, z + _THICK, color=_FLEX)
    _draw_gages(axes, found.elements, x, z)
    at = 1e3 * _STRIP_LOAD
    touched = float(np.interp(at, x, z)) + _THICK + _GAGE
    axes.fill(*_disc(at, touched + 9), color=style.FAINT)
    style.arrow(axes, (at, touched + 27), (at, touched + 19))
    axes.text(at + 1.5, touched + 27, "Q", va="top", style="italic")
    axes.text(at, touched + 9, "object", ha="center", va="center", color="white")
    axes.text(50, -11.5, "foam or fluid", ha="center", va="center")
    axes.text(50, -_FOAM - 2.6, "rigid core", ha="center", va="center")
    left, right = found.elements[7:9]
    for end in (left, right):
        axes.plot((end, end), (3.4, 9), color=style.FAINT, lw=0.5)
    style.dimension(axes, (left, 8), (right, 8))
    axes.text((left + right) / 2, 9.4, f"{right - left:.0f} mm", ha="center", va="bottom")
    style.dimension(axes, (0, -_FOAM - 8), (100, -_FOAM - 8))
    axes.text(50, -_FOAM - 8.6, f"{1e3 * _STRIP.a:.0f} mm", ha="center", va="top")
    axes.set(aspect="equal", xlim=(-5.5, 105.5), ylim=(-_FOAM - 14, 27))
    axes.axis("off")


def _draw_gages(axes: style.Axes, elements: Array, x: Array, z: Array) -> None:
    height, slope = np.interp(elements, x, z), np.interp(elements, x, np.gradient(z, x))
    half = np.array([-2.6, 2.6])
    for side, colour in ((_THICK + _GAGE / 2, style.BLUE), (-_GAGE / 2, style.ORANGE)):
        for centre, middle, turn in zip(elements, height, slope, strict=True):
            along = middle + side + turn * half
            axes.plot(centre + half, along, color=colour, lw=2.0, solid_capstyle="butt")
    framed, low, high = elements[1], height[1] - 2.5, height[1] + _THICK + 2.5
    frame = np.array([[-4, low], [4, low], [4, high], [-4, high], [-4, low]]).T
    axes.plot(framed + frame[0], frame[1], color=style.INK, lw=0.7)
    axes.text(framed - 3.8, high + 0.6, "b", weight="bold")


def _disc(x: float, z: float) -> tuple[Array, Array]:
    turn = np.linspace(0, 2 * np.pi, 90)
    return x + 9 * np.cos(turn), z + 9 * np.sin(turn)


def _draw_pair(axes: style.Axes) -> None:
    """Across the skin true to scale, in units of the substrate's thickness; cut short along it."""
    bridge = SECOND_GENERATION.bridge
    t_s, t_g = 1e3 * bridge.substrate_thickness, 1e3 * bridge.gage_thickness
    top = 0.5 + t_g / t_s
    axes.fill_between((-2.6, 1.8), -0.5, 0.5, color=_FLEX)
    for sign, colour in ((1, style.BLUE), (-1, style.ORANGE)):
        axes.fill_between((-1.8, 1.0), sign * 0.5, sign * top, color=colour)
        strain = f"gage, strain {'+' if sign > 0 else '−'}ε"
        axes.text(-0.4, sign * (top + 0.17), strain, ha="center", va="center")
    axes.plot((-2.6, 1.8), (0, 0), color=style.FAINT, lw=0.6, ls=(0, (6, 2, 1, 2)))
    axes.text(-0.4, 0.18, "flex circuit", ha="center", va="center")
    for height in (-0.5, 0.5, top):
        axes.plot((1.1, 2.3), (height, height), color=style.FAINT, lw=0.5)
    style.dimension(axes, (2.1, -0.5), (2.1, 0.5))
    axes.text(2.2, 0, f"{t_s:.3f} mm", va="center")
    style.arrow(axes, (2.1, top + 0.32), (2.1, top), lw=0.6, mutation_scale=5)
    axes.text(2.2, top + 0.16, f"{t_g:.3f} mm", va="center")
    axes.text(2.2, -top - 0.17, f"ε = κ · {t_s + t_g:.3f} mm / 2", va="center")
    axes.set(aspect="equal", xlim=(-2.7, 4.2), ylim=(-1.15, 1.15))
    axes.axis("off")


def _draw_curvature(axes: style.Axes, found: _StripRun) -> None:
    axes.axhline(0, color=style.LINE, lw=0.6)
    axes.plot(found.x, found.true_curvature, color=style.INK, label="true")
    axes.errorbar(found.elements, found.readings, 1.96 * TABLE_1_NOISE, fmt="o", color=style.BLUE,
                  capsize=1.5, elinewidth=0.7, capthick=0.7, mec="white", mew=0.4,
                  label="read, ± 1.96 sd")  # fmt: skip
    axes.set(xlim=(0, 100), xlabel="x [mm]", ylabel="curvature κ [1/m]")
    axes.legend(loc="lower right")


def _draw_deflection(axes: style.Axes, found: _StripRun) -> None:
    low, high = found.fitted - 1.96 * found.sd, found.fitted + 1.96 * found.sd
    axes.fill_between(found.x, low, high, color=style.BLUE, alpha=0.25, label="95 % band")
    axes.plot(found.x, found.true, color=style.INK, label="true")
    axes.plot(found.x, found.fitted, color=style.BLUE, label="reconstructed")
    axes.set(xlim=(0, 100), ylim=(0, 5.5), xlabel="x [mm]", ylabel="deflection w [mm]")
    axes.legend(loc="lower center")


# The paper's Fig. 2: a curved n x m patch, and the curvature that one element measures

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
class _PatchRun:
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


def patch_run(noise: float = _NOISE) -> _PatchRun:
    """A fingertip's skin pressed off its middle, read with noise.

    The truth has the 8 x 6 functions that are fitted: with more, the error of leaving them out
    would be ten times the noise's at an element, and no error bar would show it.
    """
    load, elements = PointLoad(*_LOAD), (COLUMNS, ROWS)
    scene = pressed_scene("patch", SKIN, load, _PRESSED, elements, (8, 6), noise)
    _, _, fit = noisy_fit(scene, (8, 6), np.random.default_rng(_SEED), noise)
    layout, basis = scene.layout, scene.basis
    c, M = fit.coefficients.ravel(), fit.estimator.M.reshape(3, len(layout), -1)
    xx, yy, xy = M @ c + np.array([SKIN.arc_curvature, 0, 0])[:, None]
    outlines = layout.positions[:, None] + _outline()
    rest, outward = SKIN.at_rest(outlines)
    w = (basis.at(outlines.reshape(-1, 2)) @ c).reshape(*outlines.shape[:2], 1)
    return _PatchRun(
        1e3 * (rest - w * outward),
        np.stack([xx, xy, xy, yy], axis=-1).reshape(-1, 2, 2),
        M[:, _NUMBER] @ fit.covariance @ M[:, _NUMBER].T,
    )


def _outline() -> Array:
    """The way round a cell from its centre, (T, 2) in m."""
    along, end = np.linspace(-1, 1, 9)[:-1], np.ones(8)
    corners = [(along, -end), (end, along), (-along, end), (-end, -along)]
    return np.concatenate([np.column_stack(side) for side in corners]) * _CELL / 2


def draw_patch(figure: style.Figure) -> None:
    """The patch with its n x m elements left, one of them enlarged right."""
    found = patch_run()
    style.resize(figure, style.DOUBLE, 80)
    style.letter(figure, 1, 79, "a", f"patch of {COLUMNS} × {ROWS} elements, pressed inward")
    style.letter(figure, 101, 79, "b", f"the element framed in a (heights × {_RAISED})")
    _draw_tiles(figure, style.place(figure, (2, 3, 92, 80), projection="3d"), found)
    _draw_element(style.place(figure, (98, 20, 76, 58), projection="3d"), found)
    _write_values(figure, found)


def _draw_tiles(figure: style.Figure, axes: style.Axes, found: _PatchRun) -> None:
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


def _draw_element(axes: style.Axes, found: _PatchRun) -> None:
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


def _write_values(figure: style.Figure, found: _PatchRun) -> None:
    (xx, xy), (_, yy) = found.tensor[_NUMBER]
    values, vectors = found.principal
    tensor = f"curvature xx {xx:.1f}, yy {yy:.1f}, xy {xy:.1f} 1/m"
    style.write(figure, 106, 17, tensor)
    for n, colour in enumerate(_COLOURS):
        limit = 1.96 * found.principal_sd[n]
        angle = np.degrees(np.arctan(vectors[1, n] / vectors[0, n]))
        text = f"κ{'₁₂'[n]} = {with_error(values[n], limit, '1/m')} at {angle:.0f}° from x"
        style.write(figure, 106, 12 - 5 * n, text, color=colour)
    style.write(figure, 106, 2, "positive: convex seen from outside; ± 1.96 sd", color=style.FAINT)
