"""Designs a sensor before it is built: sliders, and how sure it would be of the skin's shape."""

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
from kappaskin_app.features.design.designing import Designing
from kappaskin_app.guard import guarded
from kappaskin_app.shell.form import Form, well_behaved
from kappaskin_app.shell.settings import Settings, form_field
from kappaskin_app.shell.settings.designed import DesignSettings
from kappaskin_app.shell.settings.form_fields import Range
from kappaskin_app.shell.settings.scene import SHAPES
from kappaskin_app.theme import SEQUENTIAL
from kappaskin_app.widgets.layout import row, scrolled
from kappaskin_app.widgets.parts import ELLIPSIS, button, sentence, text_label
from kappaskin_app.widgets.plots import Curve, CurvePlot
from kappaskin_app.widgets.surface_map import SurfaceMap
from kappaskin_app.widgets.text import round_up

_NAMES = tuple(field for field in DesignSettings.__dataclass_fields__)
_LENGTHS = ("side_x", "side_y", "base_radius", "rim_radius")
_STEPS = 200  # of a slider
_FACTOR = 4  # steps of a slider that goes by factors, to the next number of two digits
_WIDE = 50  # times as much at its end as at its beginning: it goes by factors
_MICRO = 1e6
_PREDICTED = (
    "Standard deviation of the displacement that noise alone leaves, from the covariance "
    "s\N{SUPERSCRIPT TWO} (M'M)\N{SUPERSCRIPT MINUS}\N{SUPERSCRIPT ONE} of the fit: nothing is "
    "simulated. Points are the elements."
)
_SIMULATED = "The same, by simulating thousands of frames: what the displacement told varied by."
_ALONG = "Along x through the middle of the skin, on the scale of both maps."


class DesignForm(Form):
    """Asks for what is designed, each number with a slider."""

    purpose = (
        "A sensor that is not built yet. How sure it would be follows at once from the covariance "
        "s\u00b2 (M\u1d40M)\u207b\u00b9 of noise s and the fit's matrix M; nothing is simulated."
    )
    guide_page = "build"

    def __init__(self, parent: QWidget | None = None) -> None:
        self.sliders: dict[str, QSlider] = {}
        super().__init__("To be built", _NAMES, parent)

    def field(self, name: str, editor: QWidget) -> QWidget:
        how = form_field(name)
        if not isinstance(how, Range):
            return editor
        slider = self.sliders[name] = QSlider(Qt.Orientation.Horizontal)
        slider.setObjectName(f"{name}-slider")
        slider.setAccessibleName(f"{how.label}, slider")
        slider.setToolTip(editor.toolTip())
        slider.setRange(0, _STEPS)
        # With an arrow key it must come to another value, or it would stand still.
        step = _FACTOR if _wide(how) else math.ceil(_STEPS * how.step / (how.most - how.least))
        slider.setSingleStep(step)
        slider.setPageStep(4 * step)
        well_behaved(slider)
        slider.setMinimumWidth(70)
        slider.valueChanged.connect(guarded(lambda at: self.wished.emit(name, _meant(at, how))))
        return row(slider, editor)

    def show_settings(self, settings: Settings) -> None:
        super().show_settings(settings)
        for name, slider in self.sliders.items():
            how = form_field(name)
            if isinstance(how, Range):
                with QSignalBlocker(slider):
                    slider.setValue(_place(getattr(settings, name), how))
        asks = SHAPES[settings.design_shape].lengths
        for length in _LENGTHS:
            editor = self.editor(f"design_{length}").parentWidget()
            if editor is not None:
                self.form.setRowVisible(editor, length in asks)


def _wide(how: Range) -> bool:
    """Whether a range is so wide that its slider goes by factors."""
    return how.least > 0 and how.most / how.least > _WIDE


def _meant(at: int, how: Range) -> float:
    """The value, in SI units, that a slider means: with two digits, or a whole number of steps."""
    share = at / _STEPS
    if _wide(how):
        return float(f"{how.least * (how.most / how.least) ** share:.2g}")
    value = how.least + round((how.most - how.least) * share / how.step) * how.step
    return int(value) if isinstance(how.step, int) else value


def _place(value: float, how: Range) -> int:
    """Where the slider of a value stands."""
    if _wide(how):
        return round(_STEPS * math.log(value / how.least) / math.log(how.most / how.least))
    return round(_STEPS * (value - how.least) / (how.most - how.least))


class DesignPanel(QWidget):
    """The form, what is predicted, what a simulation makes of it, and both along the middle."""

    save_wanted = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.form = DesignForm()
        self.predicted = SurfaceMap("Predicted", "\N{MICRO SIGN}m", _PREDICTED)
        self.simulated = SurfaceMap("Simulated", "\N{MICRO SIGN}m", _SIMULATED)
        self.along = CurvePlot("Error bar along x", "\N{MICRO SIGN}m", False, _ALONG)
        self.words = text_label()
        self.simulate = button(
            "Check by simulation",
            "check-design",
            "Simulate up to 5000 frames of the design, with a point that presses in the middle, "
            "and lay what comes of it over the prediction. Again to end it.",
        )
        self.save = button(
            f"Save as a scene{ELLIPSIS}",
            "save-design",
            "Write the design into a file that can be played, edited and studied.",
        )
        self.words.setAlignment(Qt.AlignmentFlag.AlignTop)
        self._designing: Designing | None = None
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

    def attend(self, designing: Designing) -> None:
        """Show what `designing` brings, and pass on what the user requests."""
        self._designing = designing
        designing.changed.connect(guarded(self._show))
        self.simulate.clicked.connect(guarded(lambda *_: designing.simulate()))
        self.save.clicked.connect(guarded(lambda *_: self.save_wanted.emit()))
        self._show()

    def show_settings(self, settings: Settings) -> None:
        self.form.show_settings(settings)

    def _show(self) -> None:
        designing = self._designing
        if designing is None:
            return
        busy, found = designing.predicting, designing.prospect
        ready = found is not None and not busy
        self.simulate.setEnabled(ready)
        self.simulate.setText("End the check" if designing.checking else "Check by simulation")
        self.save.setEnabled(ready)
        for view in (self.predicted, self.simulated):
            view.map.show_faded(busy)
        self._show_maps(found)
        self._show_words(found)

    def _show_maps(self, found: Prospect | None) -> None:
        check = self._designing.check if self._designing else None
        sides = (1.0, 1.0) if found is None else (float(found.x[-1]), float(found.y[-1]))
        seen = [each.sd for each in (found, check) if each is not None]
        limit = round_up(max((_MICRO * float(np.nanmax(sd)) for sd in seen), default=0.0)) or 1.0
        curves = list[Curve]()
        for number, (view, source, name) in enumerate(
            ((self.predicted, found, "predicted"), (self.simulated, check, "simulated"))
        ):
            sd = None if source is None else _MICRO * source.sd
            view.show_surface(sd, (0.0, limit), SEQUENTIAL, np.full(2, np.nan), sides)
            view.map.show_points(None if sd is None or found is None else found.positions)
            if sd is not None:
                curves.append(Curve(name, number, sd[len(sd) // 2]))
        x = np.empty(0) if found is None else 1e3 * found.x
        span = (0.0, 1.0) if found is None else (0.0, float(x[-1]))
        self.along.show_curves(x, curves, span, "mm", "No design yet.")

    def _show_words(self, found: Prospect | None) -> None:
        check = self._designing.check if self._designing else None
        self.predicted.words.show_text("" if found is None else f"RMS {_told(found.rms)}")
        frames = "Not simulated yet" if check is None else f"{check.frames} frames"
        self.simulated.words.show_text(frames)
        if found is None:
            computing = self._designing is not None and self._designing.predicting
            why = self._designing.refusal if self._designing else ""
            self.words.setText(f"Computing{ELLIPSIS}" if computing else sentence(why))
            return
        words = [
            f"{len(found.positions)} elements, {found.rate:.0f} frames/s. Noise alone: "
            f"{_told(found.rms)} RMS over the skin, {_told(found.worst)} at worst."
        ]
        if check is not None:
            ratio = check.rms_sd / found.rms
            words.append(
                f"Simulated: {ratio:.3f} times as predicted. With what the functions cannot follow "
                f"of a point in the middle, {_told(check.rms)} RMS."
            )
        self.words.setText("\n".join(words))


def _told(metres: float) -> str:
    return f"{_MICRO * metres:.3g} \N{MICRO SIGN}m"
