"""Figures of reconstruction: the paper's Figs. 6 and 9, a square skin and a fingertip."""

from dataclasses import dataclass

import numpy as np

from kappaskin._text import with_error
from kappaskin.frames import Array
from kappaskin.scenes import load_scene
from kappaskin.studies.accuracy import root_mean_square
from kappaskin.studies.figures import style
from kappaskin.studies.paper import APPLIED, FINGERTIP_NOISE, RADIUS, fingertip_scene, noisy_fit

_SIDE = 101  # points along each edge, as Table 1's RMS takes them
_MESH = 5  # of which every fifth is drawn as a line, with the load on one


@dataclass(frozen=True, eq=False)
class _SquareRun:
    """One draw of Table 1's noise: surfaces (101, 101) in mm on `x`, `y` (101,) in mm."""

    x: Array
    y: Array
    reference: Array
    fitted: Array
    elements: Array

    @property
    def error(self) -> Array:
        return self.fitted - self.reference

    @property
    def at_load(self) -> float:
        return float(self.error[_SIDE // 2, _SIDE // 2])

    @property
    def rms(self) -> float:
        return root_mean_square(self.error)


def square_run() -> _SquareRun:
    """10 x 10 elements with the scene's noise, 8 x 8 functions fitted to a truth of 15 x 15."""
    scene = load_scene("centre")
    truth, _, fit = noisy_fit(scene, (8, 8), np.random.default_rng(scene.seed))
    reference, grid = scene.basis, scene.plate.patch.grid(_SIDE, _SIDE)
    w = reference.on_grid(*grid)(truth.reshape(reference.shape))
    fitted = fit.estimator.basis.on_grid(*grid)(fit.coefficients)
    return _SquareRun(*(1e3 * part for part in (*grid, w, fitted, scene.layout.positions)))


def draw_square(figure: style.Figure) -> None:
    """Both surfaces on one scale, then their difference with the elements on it."""
    found = square_run()
    style.resize(figure, style.DOUBLE, 58)
    style.letter(figure, 1, 57, "a", "reference:\n15 × 15 functions")
    style.letter(figure, 58, 57, "b", "8 × 8 functions fitted to\n300 readings with noise")
    errors = f"{1e3 * found.at_load:+.0f} µm at the load, RMS {1e3 * found.rms:.1f} µm"
    style.letter(figure, 117, 57, "c", f"error of the fit:\n{errors}")
    for left, w in ((0, found.reference), (57, found.fitted)):
        _draw_surface(style.place(figure, (left, -2, 51, 54), projection="3d"), found, w)
    _draw_error(figure, style.place(figure, (126, 10, 33, 33)), found)


def _draw_surface(axes: style.Axes, found: _SquareRun, w: Array) -> None:
    x, y, z = (each[::_MESH, ::_MESH] for each in (*np.meshgrid(found.x, found.y), w))
    style.mesh(axes, np.stack([x, y, z], axis=-1), z, (0, 5))
    style.space(axes)
    axes.set(xlim=(0, 100), ylim=(0, 100), zlim=(0, 5), zticks=range(6))
    axes.set(xticks=(0, 50, 100), yticks=(50, 100))  # y = 0 is where x = 100 is
    axes.set(xlabel="x [mm]", ylabel="y [mm]", zlabel="w [mm]")


def _draw_error(figure: style.Figure, axes: style.Axes, found: _SquareRun) -> None:
    span = float(np.max(np.abs(found.error)))
    step = 1e-3 * (found.x[1] - found.x[0])
    extent = (-step / 2, 100 + step / 2, -step / 2, 100 + step / 2)
    image = axes.imshow(
        1e3 * found.error,
        cmap=style.colour_map(style.DIVERGING),
        vmin=-1e3 * span,
        vmax=1e3 * span,
        origin="lower",
        extent=extent,
    )
    axes.plot(*found.elements.T, ".", color=style.INK, ms=1.5, label="elements")
    axes.set(xlim=(0, 100), ylim=(0, 100), xticks=(0, 50, 100), yticks=(0, 50, 100))
    axes.set(xlabel="x [mm]", ylabel="y [mm]")
    axes.yaxis.labelpad = -2
    bar = style.place(figure, (161, 10, 1.6, 33))
    figure.colorbar(image, cax=bar, label="error [µm]")


# The paper's Fig. 9: a fingertip's arc at rest, pressed, and as ten noisy readings give it

SEED = 2
_ELEMENT = {"ls": "", "marker": "o", "color": style.BLUE, "mec": "white", "mew": 0.4}


@dataclass(frozen=True, eq=False)
class _FingertipRun:
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
        return with_error(1e3 * self.fitted[90], 1.96e3 * self.sd[90], "mm")

    @property
    def rms(self) -> float:
        return root_mean_square(self.fitted - self.true)


def fingertip_run(applied: float, rng: np.random.Generator) -> _FingertipRun:
    """Table 2's strip with a load that moves it by `applied` mm, 8 functions fitted to it."""
    scene = fingertip_scene(applied)
    patch, layout = scene.plate.patch, scene.layout
    truth, _, fit = noisy_fit(scene, (8, 1), rng, FINGERTIP_NOISE)
    s = np.column_stack([np.linspace(0, patch.a, 181), np.full(181, patch.b / 2)])
    basis, c = fit.estimator.basis, fit.coefficients.ravel()
    return _FingertipRun(
        s[:, 0] / patch.radius,
        scene.basis.at(s) @ truth,
        basis.at(s) @ c,
        fit.surface_sd(s).ravel(),
        layout.positions[:, 0] / patch.radius,
        basis.at(layout.positions) @ c,
    )


def _arc(theta: Array, inward: Array) -> tuple[Array, Array]:
    """x, z in mm of the skin moved `inward` (in m) at `theta`, from the middle of its base."""
    r = 1e3 * (RADIUS - inward)
    return -r * np.cos(theta), r * np.sin(theta)


def draw_fingertip(figure: style.Figure) -> None:
    """Three loads side by side: above the skin, true to scale, below its deflection inward."""
    rng = np.random.default_rng(SEED)
    style.resize(figure, style.DOUBLE, 88)
    for column, applied in enumerate(APPLIED):
        load = fingertip_run(applied, rng)
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


def _draw_shape(axes: style.Axes, load: _FingertipRun) -> None:
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


def _draw_deflection(axes: style.Axes, load: _FingertipRun) -> None:
    degrees, low, high = np.degrees(load.theta), *(1e3 * edge for edge in load.band)
    axes.axhline(0, color=style.LINE, lw=0.6)
    axes.fill_between(degrees, low, high, color=style.BLUE, alpha=0.25)
    axes.plot(degrees, 1e3 * load.true, color=style.INK, label="true")
    axes.plot(degrees, 1e3 * load.fitted, color=style.BLUE, label="reconstructed")
    axes.plot(np.degrees(load.elements), 1e3 * load.fitted_at_elements, **_ELEMENT)
    axes.set(xlim=(0, 180), xticks=range(0, 181, 45), ylim=(-1.7, 2.5), xlabel="angle θ [°]")
