"""Panel of the sensor design: form, predicted and simulated standard deviation."""

import math

import numpy as np
from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import (
    QHBoxLayout,
    QSlider,
    QVBoxLayout,
    QWidget,
)

from kappaskin.studies import Prospect
from kappaskin_app.features.design.prediction import DesignPrediction, noise_settings
from kappaskin_app.guard import guarded
from kappaskin_app.shell.form import Form, pass_window_keys
from kappaskin_app.shell.settings import Settings, form_field
from kappaskin_app.shell.settings.designed import DesignSettings
from kappaskin_app.shell.settings.form_fields import Range
from kappaskin_app.shell.settings.scene import SHAPES
from kappaskin_app.widgets.chart import Chart, ChartAxis, Series
from kappaskin_app.widgets.layout import row, scrolled
from kappaskin_app.widgets.parts import ELLIPSIS, button, sentence, text_label
from kappaskin_app.widgets.surface_map import SurfaceMap
from kappaskin_app.widgets.text import length, round_up

_NAMES = tuple(field for field in DesignSettings.__dataclass_fields__)
_LENGTHS = tuple(f"design_{length}" for shape in SHAPES.values() for length in shape.lengths)
_NOISE = ("design_noise", "design_height_noise", "design_slope_noise")
_STEPS = 200  # of a slider
_FACTOR = 4  # steps of a logarithmic slider, to the next number of two digits
_WIDE = 50  # ratio of the ends of a range, beyond which its slider is logarithmic
_PREDICTED = (
    "Standard deviation of the displacement due to noise, from the covariance "
    "s\N{SUPERSCRIPT TWO} (M'M)\N{SUPERSCRIPT MINUS}\N{SUPERSCRIPT ONE} of the fit, without a "
    "simulation. Points are the elements."
)
_SIMULATED = "Standard deviation of the estimated displacement in thousands of simulated frames."
_ALONG = "Standard deviation along x through the middle of the skin."


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
        shown = {f"design_{length}" for length in SHAPES[settings.design_shape].lengths}
        shown |= (noise := set(noise_settings(settings).values()))
        shown |= {"design_conversion"} if noise == {"design_noise"} else set()
        self.show_rows(shown | (set(_NAMES) - {*_LENGTHS, *_NOISE, "design_conversion"}))


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
        self.along = Chart(ChartAxis("Standard deviation", "mm"), ChartAxis("x", "mm"), _ALONG)
        self.words = text_label()
        self.simulate = button(
            "Check by simulation",
            "check-design",
            "Simulate up to 5000 frames of the design with a point load in the middle, and compare "
            "them with the prediction. Click again to stop.",
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
        check = self._prediction.check if self._prediction else None
        sides = (1.0, 1.0) if found is None else (float(found.x[-1]), float(found.y[-1]))
        shown = [each.sd for each in (found, check) if each is not None]
        limit = round_up(max((1e3 * float(np.nanmax(sd)) for sd in shown), default=0.0)) or 1.0
        curves = list[Series]()
        for number, (view, source, name) in enumerate(
            ((self.predicted, found, "predicted"), (self.simulated, check, "simulated"))
        ):
            sd = None if source is None else 1e3 * source.sd
            view.show_surface(sd, (0.0, limit), "sequential", np.full(2, np.nan), sides)
            view.map.show_points(None if sd is None or found is None else found.positions)
            if sd is not None and found is not None:
                curves.append(Series(name, 1e3 * found.x, sd[len(sd) // 2], number))
        self.along.show_series(curves, "No design yet.")

    def _show_words(self, found: Prospect | None) -> None:
        check = self._prediction.check if self._prediction else None
        self.predicted.words.show_text("" if found is None else f"RMS {length(found.rms)}")
        frames = "Not simulated yet" if check is None else f"{check.frames} frames"
        self.simulated.words.show_text(frames)
        if found is None:
            computing = self._prediction is not None and self._prediction.predicting
            why = self._prediction.refusal if self._prediction else ""
            self.words.setText(f"Computing{ELLIPSIS}" if computing else sentence(why))
            return
        rate = f", {found.rate:.0f} frames/s" if math.isfinite(found.rate) else ""
        words = [
            f"{len(found.positions)} elements{rate}. Due to noise: "
            f"{length(found.rms)} RMS over the skin, {length(found.worst)} at worst."
        ]
        if check is not None:
            ratio = check.rms_sd / found.rms
            words.append(
                f"Simulated: {ratio:.3f} times the prediction. With the error of the basis under a "
                f"point load in the middle: {length(check.rms)} RMS."
            )
        self.words.setText("\n".join(words))
