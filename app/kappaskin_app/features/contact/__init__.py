"""Contact: readouts, recognised object, and tables."""

import time

import numpy as np

from kappaskin.frames import Estimate
from kappaskin.live import Status
from kappaskin_app.features.contact.numbers import NumbersPanel
from kappaskin_app.features.contact.readouts import Readouts
from kappaskin_app.features.contact.recognition import (
    ObjectRecognition,
    age_text,
    curvature_text,
)
from kappaskin_app.guard import guarded
from kappaskin_app.shell.window import MainWindow
from kappaskin_app.widgets.parts import capital
from kappaskin_app.widgets.text import Coverage

_FULL_SCREEN_PERIOD, _PERIOD = 0.25, 0.5  # s between two recognitions: in full screen, and else
_OBJECT = (
    "The object recognised from the readings, the 95 % interval of its radius and the probability "
    "of the second guess; the principal curvatures of the skin at the contact with error bars."
)

_TIP = "Tables of the contact, the object and every element, copied as CSV"


class ContactFeature:
    name = "contact"

    def install(self, shell: MainWindow) -> None:
        self._shell, self._next = shell, 0.0
        self._described: tuple[str, str, Estimate | None] = ("", "", None)
        display = shell.display
        self.readouts, self.numbers = Readouts(), NumbersPanel()
        self.recognition = ObjectRecognition(shell.tasks, shell)
        display.header.add(self.readouts)
        shell.docks.put_below("numbers", "Numbers", self.numbers, "Ctrl+Shift+T", _TIP)
        display.status_bar.object.setToolTip(_OBJECT)
        for name, parts in self.readouts.parts.items():
            display.places[f"readout-{name}"] = parts
        display.places["readouts"] = [self.readouts]
        display.numbers.connect(guarded(self._show))
        shell.settings_shown.connect(guarded(lambda _: self.readouts.show_bars(Coverage.now)))
        display.status_shown.connect(guarded(self._follow))
        self.recognition.described.connect(guarded(self._describe))
        self.recognition.found.connect(display.object_found)

    def _follow(self, status: Status) -> None:
        shell, now = self._shell, time.monotonic()
        shown = shell.display.estimate_shown()
        if now >= self._next:
            self._next = now + (_FULL_SCREEN_PERIOD if shell.layouts.filled else _PERIOD)
            self.recognition.start(status, shown)

    def _show(self, estimate: Estimate | None) -> None:
        display, status = self._shell.display, self._shell.session.status
        recent = [] if display.old else display.ages()
        counts = status.accounting
        self.readouts.show_health(
            status.rate,
            len(recent),
            float(np.median(recent)) if recent else float("nan"),
            display.age_sd,
            lost=counts.lost,
            discarded=counts.bytes_discarded,
            skipped=status.skipped,
        )
        self.readouts.show_estimate(estimate)
        self._show_object(estimate)
        self.numbers.show_estimate(estimate, status.sensor, display.status_bar.object.text())

    def _describe(self, words: str, more: str, recognised: Estimate | None) -> None:
        self._described = words, more, recognised
        self._show_object(self._shell.display.estimate_shown())

    def _show_object(self, estimate: Estimate | None) -> None:
        """Show the object, and the curvatures of the skin in the `estimate` shown."""
        words, more, recognised = self._described
        curvatures = "" if estimate is None else curvature_text(estimate)
        age = "" if estimate is None else age_text(recognised, estimate)
        if age is None:
            words, more, age = "", "", ""
        text = f"{words.removesuffix(more)}{age}{more}{curvatures}".removeprefix("; ")
        self._shell.display.status_bar.object.show_text(capital(text), curvatures, more)
