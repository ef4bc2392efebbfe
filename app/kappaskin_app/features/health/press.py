"""Press here: asks for one element after the other, and shows what answers."""

from PySide6.QtWidgets import QGridLayout, QProgressBar, QVBoxLayout, QWidget

from kappaskin.calibration import PressPhase, PressTest
from kappaskin.live import Status
from kappaskin_app.features.health.map_testing import MapTesting
from kappaskin_app.guard import guarded
from kappaskin_app.theme import Theme
from kappaskin_app.widgets.parts import button, sentence, text_label

_WHAT = (
    "<b>Press here</b> tests the channel map: it asks for one element after the other, framed in "
    "yellow in the heatmaps and on the skin, and sees by itself which one answers."
)
_DRAG = " The simulated skin you press by dragging the red arrow there."
_WAIT = {
    PressPhase.REST: "Wait for rest: take your hand off, or hold still.",
    PressPhase.PRESS: "Press it now.",
    PressPhase.RELEASE: "Pressed. Let go, or hold still for a moment.",
}


class PressPage(QWidget):
    """What to press, how far the test is, and its verdict."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.words, self.last, self.verdict = (text_label() for _ in range(3))
        self.progress = QProgressBar()
        self.progress.setFormat("%v of %m")
        self.progress.setToolTip("Elements that were asked for.")
        self.all = button("Ever&y element", "press-all", "Ask for each live element, row by row.")
        self.quick = button(
            "&Quick test",
            "press-quick",
            "Ask for two elements in each row and column: tells whether rows, columns or "
            "components are exchanged, but not every two elements.",
        )
        self.skip = button("Ski&p", "press-skip", "Go on without this element.")
        self.nothing = button(
            "N&othing came", "press-nothing", "You pressed it, but nothing was noticed."
        )
        self.back = button("&Back", "press-back", "Press the last one again.")
        self.stop = button("S&top", "press-stop", "End the test and forget what was pressed.")
        self._testing: MapTesting | None = None
        self._inside = False
        around = QVBoxLayout(self)
        around.setContentsMargins(0, 0, 0, 0)
        around.setSpacing(4)
        for widget in (self.words, self.progress, self.last, self.verdict):
            around.addWidget(widget)
        around.addStretch(1)
        grid = QGridLayout()
        grid.setSpacing(4)
        for place, widget in enumerate((self.all, self.quick, self.stop)):
            grid.addWidget(widget, 0, place)
        for place, widget in enumerate((self.skip, self.nothing, self.back)):
            grid.addWidget(widget, 1, place)
        around.addLayout(grid)

    def attend(self, testing: MapTesting) -> None:
        self._testing = testing
        testing.changed.connect(guarded(self._show))
        for widget, wish in (
            (self.all, lambda: testing.begin(quick=False)),
            (self.quick, lambda: testing.begin(quick=True)),
            (self.skip, testing.skip),
            (self.nothing, testing.nothing_came),
            (self.back, testing.back),
            (self.stop, testing.stop),
        ):
            widget.clicked.connect(guarded(lambda *_, wish=wish: wish()))
        self._show()

    def show_status(self, status: Status, inside: bool) -> None:
        connected = status.sensor is not None and status.state == "streaming"
        for widget in (self.all, self.quick):
            widget.setEnabled(connected)
        if inside != self._inside:
            self._inside = inside
            self._show()

    def show_theme(self, theme: Theme) -> None:
        self.verdict.setStyleSheet(f"color: {theme.text}; font-weight: 600;")
        self.last.setStyleSheet(f"color: {theme.faint};")

    def _show(self) -> None:
        testing = self._testing
        if testing is None:
            return
        test, running = testing.test, testing.running
        self.words.setText(sentence(testing.message) or self._asked(test, running))
        self.progress.setVisible(test is not None)
        if test is not None:
            self.progress.setRange(0, len(test.elements))
            self.progress.setValue(len(test.done))
        done = () if test is None else test.done
        self.last.setText(sentence(str(done[-1])) if done else "")
        verdict = testing.verdict
        self.verdict.setText("" if verdict is None else sentence(str(verdict)))
        for widget in (self.skip, self.nothing):
            widget.setVisible(running)
        self.back.setVisible(test is not None)
        self.back.setEnabled(bool(done))
        self.stop.setVisible(test is not None)
        for widget in (self.all, self.quick):
            widget.setVisible(not running)

    def _asked(self, test: PressTest | None, running: bool) -> str:
        if test is None or test.asked is None or not running:
            return _WHAT + (_DRAG if self._inside else "")
        x, y = test.sensor.layout.positions[test.asked] * 1e3
        return f"<b>Element {test.asked}</b>, at ({x:.0f}, {y:.0f}) mm. {_WAIT[test.phase]}"
