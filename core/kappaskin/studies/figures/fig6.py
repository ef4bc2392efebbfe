"""The paper's Fig. 6: the centred load's reference surface, the fit to noisy data, its error."""

from dataclasses import dataclass

import numpy as np

from kappaskin.bases import SineBasis
from kappaskin.estimation import LeastSquares
from kappaskin.frames import Array
from kappaskin.scenes import load_scene
from kappaskin.studies.figures import style

_SIDE = 101  # points along each edge, as Table 1's RMS takes them
_MESH = 5  # of which every fifth is drawn as a line, with the load on one


@dataclass(frozen=True, eq=False)
class _Run:
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
        return float(np.sqrt(np.mean(self.error**2)))


def run() -> _Run:
    """10 x 10 elements with the scene's noise, 8 x 8 functions fitted to a truth of 15 x 15."""
    scene = load_scene("centre")
    patch, layout, reference = scene.plate.patch, scene.layout, scene.basis
    truth = scene.plate.deflection(scene.loads, reference)
    curvature = (layout.curvature_operator(reference) @ truth.ravel()).reshape(3, -1)
    rng = np.random.default_rng(scene.seed)
    for effect in scene.reading_effects:
        curvature = effect.start(curvature.shape, rng)(curvature, 0.0)
    basis, grid = SineBasis(patch, 8, 8), patch.grid(_SIDE, _SIDE)
    c = LeastSquares(basis, layout)(curvature).coefficients
    w, fitted = reference.on_grid(*grid)(truth), basis.on_grid(*grid)(c)
    return _Run(*(1e3 * part for part in (*grid, w, fitted, layout.positions)))


def draw(figure: style.Figure) -> None:
    """Both surfaces on one scale, then their difference with the elements on it."""
    found = run()
    style.resize(figure, style.DOUBLE, 58)
    style.letter(figure, 1, 57, "a", "reference:\n15 × 15 functions")
    style.letter(figure, 58, 57, "b", "8 × 8 functions fitted to\n300 readings with noise")
    errors = f"{1e3 * found.at_load:+.0f} µm at the load, RMS {1e3 * found.rms:.1f} µm"
    style.letter(figure, 117, 57, "c", f"error of the fit:\n{errors}")
    for left, w in ((0, found.reference), (57, found.fitted)):
        _draw_surface(style.place(figure, (left, -2, 51, 54), projection="3d"), found, w)
    _draw_error(figure, style.place(figure, (126, 10, 33, 33)), found)


def _draw_surface(axes: style.Axes, found: _Run, w: Array) -> None:
    x, y, z = (each[::_MESH, ::_MESH] for each in (*np.meshgrid(found.x, found.y), w))
    style.mesh(axes, np.stack([x, y, z], axis=-1), z, (0, 5))
    style.space(axes)
    axes.set(xlim=(0, 100), ylim=(0, 100), zlim=(0, 5), zticks=range(6))
    axes.set(xticks=(0, 50, 100), yticks=(50, 100))  # y = 0 is where x = 100 is
    axes.set(xlabel="x [mm]", ylabel="y [mm]", zlabel="w [mm]")


def _draw_error(figure: style.Figure, axes: style.Axes, found: _Run) -> None:
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
