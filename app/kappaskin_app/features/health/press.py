"""The press test: elements pressed one after the other to verify the channel map."""

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QFont
from PySide6.QtWidgets import QGridLayout, QProgressBar, QVBoxLayout, QWidget

from kappaskin.calibration import MapVerdict, PressPhase, PressTest
from kappaskin.errors import Refusal
from kappaskin.frames import Estimate
from kappaskin.live import Status
from kappaskin_app.guard import guarded
from kappaskin_app.shell.session import Session
from kappaskin_app.theme import FAINT
from kappaskin_app.widgets.parts import button, sentence, text_label

_ENDED = "The test ended: the line was lost, or another skin answered. Begin anew."


class MapTesting(QObject):
    """A press-here test: `test` while one is done or was, with its `verdict` once it is over.

    `changed` tells of anything new, `asked` which element is to be pressed now, -1 for none, and
    `begun` that one begins; `message` says why there is none.
    """

    changed = Signal()
    asked = Signal(int)
    begun = Signal()

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._status, self._connection = Status(), 0
        self.test: PressTest | None = None
        self.verdict: MapVerdict | None = None
        self.message = ""
        self._phase: PressPhase | None = None

    @property
    def running(self) -> bool:
        return self.test is not None and self.verdict is None

    def begin(self, quick: bool) -> None:
        """Ask for all elements, or where `quick` for a few that tell of a grid's lines."""
        try:
            sensor = self._status.sensor
            if sensor is None or self._status.state != "streaming":
                raise Refusal("no sensor is connected; connect one, then begin")
            self.test = PressTest(sensor, PressTest.choose_elements(sensor.layout, quick))
        except Refusal as refusal:
            self._tell(str(refusal))
            return
        self.verdict, self._connection = None, self._status.connections
        self.begun.emit()
        self._tell("")

    def skip(self) -> None:
        if self.running and self.test is not None:
            self.test.skip()
            self._tell("")

    def nothing_came(self) -> None:
        if self.running and self.test is not None:
            self.test.nothing_came()
            self._tell("")

    def back(self) -> None:
        self.verdict = None
        self.follow(self._status)  # who read the verdict may have another skin by now
        if self.test is not None:
            self.test.back()
            self._tell("")

    def stop(self, why: str = "") -> None:
        """End the test and forget what was pressed."""
        self.test = self.verdict = None
        self._tell(why)

    def follow(self, status: Status) -> None:
        """End a test whose device has gone."""
        self._status = status
        gone = status.state != "streaming" or status.connections != self._connection
        if self.running and gone:
            self.stop(_ENDED)

    def receive(self, estimate: Estimate) -> None:
        """Take in the readings of an estimate, not the shape that trusts the map."""
        test = self.test
        if not self.running or test is None:
            return
        readings = estimate.curvature.ravel()
        if readings.size != test.sensor.channels:
            return  # a last one of the skin before
        if test.take(estimate.device_time, readings) or test.phase is not self._phase:
            self._tell("")

    def _tell(self, message: str) -> None:
        test, self.message = self.test, message
        self._phase = None if test is None else test.phase
        if test is not None and test.over and self.verdict is None:
            self.verdict = test.verdict()
        now = test.target if test is not None and self.running else None
        self.asked.emit(-1 if now is None else now)
        self.changed.emit()


class Resting:
    """Holds what a `session` simulates still while a `testing` of its channel map goes on."""

    def __init__(self, session: Session, testing: MapTesting) -> None:
        self._session, self._testing = session, testing
        self._held = False

    def hold(self) -> None:
        if self._session.inside and self._session.running:
            self._held = True
            self._session.run(False)

    def let_go(self) -> None:
        """Let it go on after the test."""
        if self._held and not self._testing.running:
            self._held = False
            self._session.run(True)


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
        self.last.setForegroundRole(FAINT)
        bold = self.verdict.font()
        bold.setWeight(QFont.Weight.DemiBold)
        self.verdict.setFont(bold)
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
        if test is None or test.target is None or not running:
            return _WHAT + (_DRAG if self._inside else "")
        x, y = test.sensor.layout.positions[test.target] * 1e3
        return f"<b>Element {test.target}</b>, at ({x:.0f}, {y:.0f}) mm. {_WAIT[test.phase]}"
