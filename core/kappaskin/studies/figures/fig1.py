"""The paper's Fig. 1: how a skin is built, and what a linear sensor of ten elements measures."""

from dataclasses import dataclass

import numpy as np

from kappaskin.bases import SineBasis
from kappaskin.estimation import LeastSquares
from kappaskin.frames import Array
from kappaskin.mechanics import Plate, PointLoad
from kappaskin.scenes import TABLE_1_NOISE, scaled_to
from kappaskin.scenes.effects import UniformNoise
from kappaskin.sensing import SECOND_GENERATION, SensorLayout
from kappaskin.skin import Patch
from kappaskin.studies.figures import style

SKIN = Patch(0.1, 0.01, strip=True)
ELEMENTS = 10
_LOAD, _PRESSED = 0.042, 4.7e-3
_SEED = 1


@dataclass(frozen=True, eq=False)
class _Run:
    """Readings (10,) in 1/m at `elements` (10,) in mm; curves (201,) at `x` in mm, w in mm."""

    elements: Array
    readings: Array
    x: Array
    true_curvature: Array
    true: Array
    fitted: Array
    sd: Array


def run() -> _Run:
    """A strip pressed off its middle, read with Table 1's noise, fitted by 8 functions of x."""
    plate, reference = Plate(SKIN), SineBasis(SKIN, 15, 1)
    load = scaled_to(plate, PointLoad(_LOAD, SKIN.b / 2), _PRESSED, reference)
    truth = plate.deflection([load], reference).ravel()
    layout, basis = SensorLayout.regular(SKIN, ELEMENTS, 1), SineBasis(SKIN, 8, 1)
    curvature = (layout.curvature_operator(reference) @ truth).reshape(3, -1)
    spoil = UniformNoise(TABLE_1_NOISE).start(curvature.shape, np.random.default_rng(_SEED))
    readings = spoil(curvature, 0.0)
    fit = LeastSquares(basis, layout, sigma=TABLE_1_NOISE)(readings)
    p = np.column_stack([np.linspace(0, SKIN.a, 201), np.full(201, SKIN.b / 2)])
    at = basis.at(p)
    return _Run(
        1e3 * layout.positions[:, 0],
        readings[0],
        1e3 * p[:, 0],
        reference.at(p, 2, 0) @ truth,
        1e3 * reference.at(p) @ truth,
        1e3 * at @ fit.coefficients.ravel(),
        1e3 * np.sqrt(np.einsum("pi,ij,pj->p", at, fit.covariance, at)),
    )


def draw(figure: style.Figure) -> None:
    """The construction and one gage pair left, curvature and deflection of a run right."""
    found = run()
    style.resize(figure, style.DOUBLE, 92)
    style.letter(figure, 1, 91, "a", "skin over foam or fluid (thickness not to scale)")
    style.letter(figure, 1, 38, "b", "gage pair of the second prototype (thickness to scale)")
    style.letter(figure, 95, 91, "c", "curvature read by a linear sensor")
    style.letter(figure, 95, 44, "d", "deflection reconstructed from it")
    _draw_skin(style.place(figure, (1, 42, 90, 45)), found)
    _draw_pair(style.place(figure, (1, 1, 90, 33)))
    _draw_curvature(style.place(figure, (106, 57, 64, 29)), found)
    _draw_deflection(style.place(figure, (106, 10, 64, 29)), found)


_THICK, _GAGE, _FOAM = 2.0, 0.9, 15.0  # drawn, in mm of the skin's length
_FLEX = "#d9b98c"


def _draw_skin(axes: style.Axes, found: _Run) -> None:
    x, z = found.x, -found.fitted
    axes.fill((-5, -5, 105, 105), (1, -_FOAM - 5, -_FOAM - 5, 1), color=style.LINE)
    axes.fill_between(x, -_FOAM, z, color=style.FILL)
    axes.fill_between(x, z, z + _THICK, color=_FLEX)
    _draw_gages(axes, found.elements, x, z)
    at = 1e3 * _LOAD
    touched = float(np.interp(at, x, z)) + _THICK + _GAGE
    axes.fill(*_disc(at, touched + 9, 9), color=style.FAINT)
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
    axes.text(50, -_FOAM - 8.6, f"{1e3 * SKIN.a:.0f} mm", ha="center", va="top")
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


def _disc(x: float, z: float, r: float) -> tuple[Array, Array]:
    turn = np.linspace(0, 2 * np.pi, 90)
    return x + r * np.cos(turn), z + r * np.sin(turn)


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


def _draw_curvature(axes: style.Axes, found: _Run) -> None:
    axes.axhline(0, color=style.LINE, lw=0.6)
    axes.plot(found.x, found.true_curvature, color=style.INK, label="true")
    axes.errorbar(found.elements, found.readings, 1.96 * TABLE_1_NOISE, fmt="o", color=style.BLUE,
                  capsize=1.5, elinewidth=0.7, capthick=0.7, mec="white", mew=0.4,
                  label="read, ± 1.96 sd")  # fmt: skip
    axes.set(xlim=(0, 100), xlabel="x [mm]", ylabel="curvature κ [1/m]")
    axes.legend(loc="lower right")


def _draw_deflection(axes: style.Axes, found: _Run) -> None:
    low, high = found.fitted - 1.96 * found.sd, found.fitted + 1.96 * found.sd
    axes.fill_between(found.x, low, high, color=style.BLUE, alpha=0.25, label="95 % band")
    axes.plot(found.x, found.true, color=style.INK, label="true")
    axes.plot(found.x, found.fitted, color=style.BLUE, label="reconstructed")
    axes.set(xlim=(0, 100), ylim=(0, 5.5), xlabel="x [mm]", ylabel="deflection w [mm]")
    axes.legend(loc="lower center")
