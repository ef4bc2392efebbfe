"""Panel of the sensor design: form, predicted and simulated standard deviation."""

import math

import numpy as np
from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QHBoxLayout,
    QSlider,
    QVBoxLayout,
    QWidget,
)

from kappaskin.frames import Array
from kappaskin.mechanics import DiscLoad, PointLoad
from kappaskin.skin import MeshSkin
from kappaskin.studies import Design, Prospect
from kappaskin_app.features.design.prediction import (
    ROUND,
    DesignPrediction,
    noise_settings,
    pattern_of,
)
from kappaskin_app.guard import guarded
from kappaskin_app.shell.form import Form, pass_window_keys
from kappaskin_app.shell.selection import SkinMap
from kappaskin_app.shell.settings import Settings, form_field
from kappaskin_app.shell.settings.designed import OPEN, DesignSettings
from kappaskin_app.shell.settings.form_fields import Range
from kappaskin_app.shell.settings.scene import SHAPES
from kappaskin_app.widgets.chart import Chart, ChartAxis, Series
from kappaskin_app.widgets.layout import row, scrolled
from kappaskin_app.widgets.parts import ELLIPSIS, button, sentence, text_label
from kappaskin_app.widgets.surface_map import SurfaceMap
from kappaskin_app.widgets.text import length
from kappaskin_app.widgets.tint import Tint

_NAMES = tuple(field for field in DesignSettings.__dataclass_fields__)
_LENGTHS = tuple(f"design_{length}" for shape in SHAPES.values() for length in shape.lengths)
_NOISE = ("design_noise", "design_height_noise", "design_slope_noise")
_STEPS = 200  # of a slider
_FACTOR = 4  # steps of a logarithmic slider, to the next number of two digits
_WIDE = 50  # ratio of the ends of a range, beyond which its slider is logarithmic
_PATTERNS = {"grid": ("design_x", "design_y"), "rings": ("design_rings",)}
_PATTERNS["spiral"] = ("design_count",)
_PREDICTED = (
    "Standard deviation of the displacement due to noise, from the covariance "
    "s\N{SUPERSCRIPT TWO} (M'M)\N{SUPERSCRIPT MINUS}\N{SUPERSCRIPT ONE} of the fit, without a "
    "simulation. Of contact position and force, the error to expect of a load at each place, away "
    "from the rim by a fifteenth of the skin. Points are the elements."
)
_SIMULATED = (
    "Standard deviation of the estimated displacement in thousands of simulated frames, or the "
    "errors of contact position or force in thousands of presses all over the skin."
)
_MAPS = {
    "displacement": "Standard deviation",
    "contact": "RMS error of the place",
    "force": "RMS error of the force",
}
_FROM_ZERO = 0.2  # of the largest: a map of smaller values begins at 0
_SMALL = 2e-5  # m: what is at most as large is shown in micrometres
_FINE = 161  # points along the longer side of the map of a mesh
_ALONG = "Through the middle of the skin, along x."


class DesignForm(Form):
    """The form of the design; each number has a slider."""

    purpose = (
        "A sensor before it is built. Its standard deviation follows from the covariance "
        "s\u00b2 (M\u1d40M)\u207b\u00b9 with the noise s and the matrix M of the fit, without a "
        "simulation."
    )
    guide_page = "build"

    def __init__(self) -> None:
        self.sliders: dict[str, QSlider] = {}
        super().__init__("Design", _NAMES)

    def field(self, name: str, editor: QWidget) -> QWidget:
        how = form_field(name)
        if not isinstance(how, Range):
            return editor
        slider = self.sliders[name] = QSlider(Qt.Orientation.Horizontal)
        slider.setObjectName(f"{name}-slider")
        slider.setAccessibleName(f"{how.label}, slider")
        slider.setToolTip(editor.toolTip())
        slider.setRange(0, _STEPS)
        # An arrow key must reach another value, or the slider would not move.
        step = (
            _FACTOR if _logarithmic(how) else math.ceil(_STEPS * how.step / (how.most - how.least))
        )
        slider.setSingleStep(step)
        slider.setPageStep(4 * step)
        pass_window_keys(slider)
        slider.setMinimumWidth(70)
        slider.valueChanged.connect(
            guarded(lambda at: self.requested.emit(name, _value_at(at, how)))
        )
        return row(slider, editor)

    def show_settings(self, settings: Settings) -> None:
        super().show_settings(settings)
        for name, slider in self.sliders.items():
            how = form_field(name)
            if isinstance(how, Range):
                with QSignalBlocker(slider):
                    slider.setValue(_place(getattr(settings, name), how))
        shape, shown = SHAPES.get(settings.design_shape), set[str]()
        hidden = {*_LENGTHS, *_NOISE, "design_conversion", *sum(_PATTERNS.values(), ())}
        hidden |= set() if shape and shape.make in ROUND else {"design_pattern"}
        if shape is None:  # the open scene has them
            hidden |= {"design_reads"}
        else:
            shown = {f"design_{length}" for length in shape.lengths}
            shown |= (noise := set(noise_settings(settings).values()))
            shown |= {"design_conversion"} if noise == {"design_noise"} else set()
            shown |= {*_PATTERNS[pattern_of(settings)]}
        self.show_rows(shown | (set(_NAMES) - hidden))


def _logarithmic(how: Range) -> bool:
    """Whether the slider of a range is logarithmic."""
    return how.least > 0 and how.most / how.least > _WIDE


def _value_at(at: int, how: Range) -> float:
    """The value of a slider in SI units, rounded to two digits or to a whole number of steps."""
    share = at / _STEPS
    if _logarithmic(how):
        return float(f"{how.least * (how.most / how.least) ** share:.2g}")
    value = how.least + round((how.most - how.least) * share / how.step) * how.step
    return int(value) if isinstance(how.step, int) else value


def _place(value: float, how: Range) -> int:
    """The position of the slider at a value."""
    if _logarithmic(how):
        return round(_STEPS * math.log(value / how.least) / math.log(how.most / how.least))
    return round(_STEPS * (value - how.least) / (how.most - how.least))


class DesignPanel(QWidget):
    """The form, the predicted and the simulated standard deviation, and both along the middle."""

    save_wanted = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.form = DesignForm()
        self.predicted = SurfaceMap("Predicted", "mm", _PREDICTED)
        self.simulated = SurfaceMap("Simulated", "mm", _SIMULATED)
        self.on_skin = QCheckBox("Show on the skin")
        self.on_skin.setChecked(True)
        self.on_skin.setToolTip(
            "Colour the skin by the predicted map of the open scene while this panel is visible, "
            "and draw its elements where they are placed."
        )
        self.along = Chart(ChartAxis("Standard deviation", "mm"), ChartAxis("x", "mm"), _ALONG)
        self.words = text_label()
        self.simulate = button(
            "Check by simulation",
            "check-design",
            "Simulate thousands of frames of the design, and compare them with the prediction. The "
            "load is in the middle; of contact position and force, it presses everywhere in turn. "
            "Click again to stop.",
        )
        self.save = button(
            f"Save as a scene{ELLIPSIS}",
            "save-design",
            "Write the design into a scene file, which can be simulated, edited and studied.",
        )
        self.words.setAlignment(Qt.AlignmentFlag.AlignTop)
        self._prediction: DesignPrediction | None = None
        self._lay_out()

    def _lay_out(self) -> None:
        around, right = QHBoxLayout(self), QVBoxLayout()
        around.setContentsMargins(8, 4, 8, 6)
        around.setSpacing(10)
        around.addWidget(scrolled(self.form))
        around.addWidget(self.predicted, 3)
        around.addWidget(self.simulated, 3)
        right.addWidget(self.words)
        right.addWidget(self.along, 1)
        right.addWidget(self.on_skin)
        right.addWidget(row(self.simulate, self.save))
        around.addLayout(right, 3)

    def connect_to(self, prediction: DesignPrediction) -> None:
        """Show the results of `prediction`, and pass on the requests of the user."""
        self._prediction = prediction
        prediction.changed.connect(guarded(self._show))
        self.simulate.clicked.connect(guarded(lambda *_: prediction.simulate()))
        self.save.clicked.connect(guarded(lambda *_: self.save_wanted.emit()))
        self._show()

    def show_settings(self, settings: Settings) -> None:
        self.form.show_settings(settings)
        self.on_skin.setVisible(settings.design_shape == OPEN)

    def _show(self) -> None:
        prediction = self._prediction
        if prediction is None:
            return
        busy, found = prediction.predicting, prediction.prospect
        ready = found is not None and not busy
        self.simulate.setEnabled(ready)
        self.simulate.setText("Stop the check" if prediction.checking else "Check by simulation")
        self.save.setEnabled(ready)
        for view in (self.predicted, self.simulated):
            view.map.show_faded(busy)
        self._show_maps(found)
        self._show_words(found)

    def _show_maps(self, found: Prospect | None) -> None:
        prediction, placed = self._prediction, self._prediction and self._prediction.placed
        check = prediction.check if prediction else None
        patch = placed.scene.plate.patch if placed else None
        on_mesh = isinstance(patch, MeshSkin)
        self.form.show_functions("design_functions_x", "design_functions_y", on_mesh)
        sides = (1.0, 1.0) if patch is None else (patch.a, patch.b)
        shown = [] if found is None else [found.sd]
        if found is not None and check is not None and found.of == "displacement":
            shown.append(check.sd)  # of presses, a few at a place, the errors scatter
        tint, title = tint_of(found, shown), _MAPS["displacement" if found is None else found.of]
        scale, unit, curves = scale_of(found), tint.unit, list[Series]()
        for number, (view, source, name) in enumerate(
            ((self.predicted, found, "predicted"), (self.simulated, check, "simulated"))
        ):
            sd, x = None, np.empty(0)
            if source is not None and found is not None and patch is not None:
                sd, x = scale * source.sd, found.x
                if sd.ndim == 1:  # at the nodes of a mesh
                    nx, ny = (round(_FINE * side / max(sides)) for side in sides)
                    sd, x = scale * found.surface(patch, nx, ny, source.sd), patch.grid(nx, ny)[0]
                curves.append(Series(name, 1e3 * x, sd[len(sd) // 2], number))
            view.unit = unit
            view.show_surface(sd, tint.limits, "sequential", np.full(2, np.nan), sides)
            outline = np.array(patch.vertices) if isinstance(patch, MeshSkin) else None
            view.map.show_points(None if sd is None or found is None else found.positions, outline)
        if (title, unit) != (self.along.y_axis.title, self.along.y_axis.unit):
            self.along.show_axes(ChartAxis(title, unit), self.along.x_axis, _ALONG)
        self.along.show_series(curves, "No design yet.")

    def _show_words(self, found: Prospect | None) -> None:
        check = self._prediction.check if self._prediction else None
        frames = "Not simulated yet" if check is None else f"{check.frames} frames"
        self.simulated.words.show_text(frames)
        if found is None:
            self.predicted.words.show_text("")
            computing = self._prediction is not None and self._prediction.predicting
            why = self._prediction.refusal if self._prediction else ""
            self.words.setText(f"Computing{ELLIPSIS}" if computing else sentence(why))
            return
        rate = f", {found.rate:.0f} frames/s" if math.isfinite(found.rate) else ""
        words = [f"{len(found.positions)} elements{rate}."]
        if found.load is None:
            self.predicted.words.show_text(f"RMS {length(found.rms)}")
            words[0] += (
                f" Due to noise: {length(found.rms)} RMS over the skin, {length(found.worst)} at "
                "worst."
            )
        else:
            unit = tint_of(found, [found.sd]).unit
            median, worst = (
                f"{scale_of(found) * value:.2g} {unit}" for value in (found.median, found.worst)
            )
            self.predicted.words.show_text(f"Median {median}")
            words[0] += (
                f" Due to noise under {found.load.force:.2g} N{_size(found.load)}: {median} in the "
                f"median over the skin, {worst} at worst."
            )
        if check is not None:
            all_errors = ", all errors included" if found.load else ""
            words.append(f"Simulated{all_errors}: {check.over(found):.3f} times the prediction.")
            if found.load is None:
                words[1] += (
                    " With the error of the basis under the load in the middle: "
                    f"{length(check.rms)} RMS."
                )
        self.words.setText("\n".join(words))


def scale_of(found: Prospect | None) -> float:
    """What the errors of a prospect are multiplied with to be shown."""
    if found is not None and found.of == "force":
        return 1e2
    small = found is not None and found.of == "contact" and found.worst <= _SMALL
    return 1e6 if small else 1e3


def tint_of(found: Prospect | None, shown: list[Array]) -> Tint:
    """The colours of the errors `shown`, from the least to the largest."""
    scale = scale_of(found)
    unit = {1e2: "%", 1e3: "mm", 1e6: "\N{MICRO SIGN}m"}[scale]
    most = max((scale * float(np.nanmax(sd)) for sd in shown), default=1.0) or 1.0
    least = min((scale * float(np.nanmin(sd)) for sd in shown), default=0.0)
    step = 10.0 ** (math.floor(math.log10(most)) - 1)
    least = step * math.floor(least / step) if least > _FROM_ZERO * most else 0.0
    return Tint("sequential", (least, step * math.ceil(most / step)), unit)


def skin_map(placed: Design, found: Prospect, nx: int, ny: int) -> SkinMap:
    """The map on nx x ny points of the skin."""
    values = scale_of(found) * found.surface(placed.scene.plate.patch, nx, ny)
    load = f" under {found.load.force:.2g} N{_size(found.load)}" if found.load else ""
    words = f"Colours: {_MAPS[found.of]}{load}, predicted, no measurement"
    return SkinMap(values, tint_of(found, [found.sd]), words, _MAPS[found.of], found.positions)


def _size(load: PointLoad | DiscLoad) -> str:
    return f" on a disc of {length(load.radius)} radius" if isinstance(load, DiscLoad) else ""
