"""The paper's Fig. 9: a fingertip's arc at rest, pressed, and as ten noisy readings give it."""

from dataclasses import dataclass

import numpy as np

from kappaskin.bases import basis_for
from kappaskin.estimation import LeastSquares
from kappaskin.frames import Array
from kappaskin.studies.figures import style
from kappaskin.studies.paper import APPLIED, RADIUS, fingertip_scene

NOISE = 4.5
"""RMS of a reading's noise in 1/m (Table 2)."""
SEED = 2
_ELEMENT = {"ls": "", "marker": "o", "color": style.BLUE, "mec": "white", "mew": 0.4}


@dataclass(frozen=True, eq=False)
class _Load:
    """One load: inward deflections in m at `theta` (181,), true, fitted, and its sd."""

    theta: Array
    true: Array
    fitted: Array
    sd: Array
    elements: Array
    fitted_at_elements: Array

    @property
    def band(self) -> tuple[Array, Array]:
        """The lower and upper edge (181,) in m of what 95 % of all draws lie in, point by point."""
        return self.fitted - 1.96 * self.sd, self.fitted + 1.96 * self.sd

    @property
    def found(self) -> str:
        """The deflection in the middle with its 95 % limits."""
        return f"{1e3 * self.fitted[90]:.2f} ± {1.96e3 * self.sd[90]:.2f} mm"

    @property
    def rms(self) -> float:
        return float(np.sqrt(np.mean((self.fitted - self.true) ** 2)))


def run(applied: float, rng: np.random.Generator) -> _Load:
    """Table 2's strip with a load that moves it by `applied` mm, 8 functions fitted to it."""
    scene = fingertip_scene(applied)
    patch, layout, (noise,) = scene.plate.patch, scene.layout, scene.reading_effects
    truth = scene.plate.deflection(scene.loads, scene.basis).ravel()
    curvature = (layout.curvature_operator(scene.basis) @ truth).reshape(3, -1)
    basis = basis_for(patch, scene.edge, 8, 1)
    readings = noise.start(curvature.shape, rng)(curvature, 0.0)
    fit = LeastSquares(basis, layout, sigma=NOISE)(readings)
    s = np.column_stack([np.linspace(0, patch.a, 181), np.full(181, patch.b / 2)])
    at, c = basis.at(s), fit.coefficients.ravel()
    return _Load(
        s[:, 0] / patch.radius,
        scene.basis.at(s) @ truth,
        at @ c,
        np.sqrt(np.einsum("pi,ij,pj->p", at, fit.covariance, at)),
        layout.positions[:, 0] / patch.radius,
        basis.at(layout.positions) @ c,
    )


def _arc(theta: Array, inward: Array) -> tuple[Array, Array]:
    """x, z in mm of the skin moved `inward` (in m) at `theta`, from the middle of its base."""
    r = 1e3 * (RADIUS - inward)
    return -r * np.cos(theta), r * np.sin(theta)


def draw(figure: style.Figure) -> None:
    """Three loads side by side: above the skin, true to scale, below its deflection inward."""
    rng = np.random.default_rng(SEED)
    style.resize(figure, style.DOUBLE, 88)
    for column, applied in enumerate(APPLIED):
        load = run(applied, rng)
        left = 12 + 55 * column
        shape = style.place(figure, (left, 50, 48, 30))
        shown = style.place(figure, (left, 16, 48, 25))
        _draw_shape(shape, load)
        _draw_deflection(shown, load)
        style.letter(figure, left - 11, 87, "abc"[column], f"{applied:.2f} mm applied")
        if column == 0:
            shape.set_ylabel("z [mm]")
            shown.set_ylabel("deflection u [mm]")
            style.key(figure, shape, 3)


def _draw_shape(axes: style.Axes, load: _Load) -> None:
    rest = _arc(load.theta, np.zeros_like(load.theta))
    axes.plot(*rest, color=style.FAINT, lw=0.7, ls=(0, (4, 2)), label="at rest")
    axes.plot(*_arc(load.theta, load.true), color=style.INK, lw=0.9, label="true")
    outer, inner = (_arc(load.theta, edge) for edge in load.band)
    band = (np.concatenate([o, i[::-1]]) for o, i in zip(outer, inner, strict=True))
    axes.fill(*band, color=style.BLUE, alpha=0.25, label="95 % band")
    axes.plot(*_arc(load.theta, load.fitted), color=style.BLUE, lw=0.9, label="reconstructed")
    at = _arc(load.elements, load.fitted_at_elements)
    axes.plot(*at, **_ELEMENT, label="elements")
    axes.set(aspect="equal", xlim=(-16, 16), ylim=(-1, 18.5), xlabel="x [mm]")
    axes.set(xticks=range(-15, 16, 5), yticks=range(0, 16, 5))
    top = 1e3 * (RADIUS - load.true[90]) + 0.35
    style.arrow(axes, (0, top + 4.5), (0, top))
    axes.text(0.8, top + 4.5, "Q", va="top", style="italic")
    text = f"found {load.found}\nRMS error {1e3 * load.rms:.2f} mm"
    axes.text(0, 5, text, ha="center", va="center", linespacing=1.5)


def _draw_deflection(axes: style.Axes, load: _Load) -> None:
    degrees, low, high = np.degrees(load.theta), *(1e3 * edge for edge in load.band)
    axes.axhline(0, color=style.LINE, lw=0.6)
    axes.fill_between(degrees, low, high, color=style.BLUE, alpha=0.25)
    axes.plot(degrees, 1e3 * load.true, color=style.INK, label="true")
    axes.plot(degrees, 1e3 * load.fitted, color=style.BLUE, label="reconstructed")
    axes.plot(np.degrees(load.elements), 1e3 * load.fitted_at_elements, **_ELEMENT)
    axes.set(xlim=(0, 180), xticks=range(0, 181, 45), ylim=(-1.7, 2.5), xlabel="angle θ [°]")
