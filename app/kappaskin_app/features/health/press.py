"""Press test: elements pressed one by one to verify the channel map."""

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

_ENDED = "The test ended: connection lost, or another sensor connected. Start again."


class ChannelMapTest(QObject):
    """A press test of the channel map.

    `test` is the current or last one, None without; `verdict` its result once it is over, and
    `message` the reason why none runs. `changed` reports any change, `target_changed` the element
    to be pressed now (-1 for none), and `started` the start of a test.
    """

    changed = Signal()
    target_changed = Signal(int)
    started = Signal()

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
        """Start a test of all elements, or where `quick` of two in each row and column."""
        try:
            sensor = self._status.sensor
            if sensor is None or self._status.state != "streaming":
                raise Refusal("no sensor is connected; connect one, then start")
            self.test = PressTest(sensor, PressTest.choose_elements(sensor.layout, quick))
        except Refusal as refusal:
            self._update(str(refusal))
            return
        self.verdict, self._connection = None, self._status.connections
        self.started.emit()
        self._update("")

    def skip(self) -> None:
        if self.running and self.test is not None:
            self.test.skip()
            self._update("")

    def nothing_came(self) -> None:
        if self.running and self.test is not None:
            self.test.nothing_came()
            self._update("")

    def back(self) -> None:
        self.verdict = None
        self.follow(self._status)  # another sensor may be connected by now
        if self.test is not None:
            self.test.back()
            self._update("")

    def stop(self, why: str = "") -> None:
        """End the test and discard its results."""
        self.test = self.verdict = None
        self._update(why)

    def follow(self, status: Status) -> None:
        """End the test if its device is disconnected."""
        self._status = status
        lost = status.state != "streaming" or status.connections != self._connection
        if self.running and lost:
            self.stop(_ENDED)

    def receive(self, estimate: Estimate) -> None:
        """Pass the readings of an estimate to the test; its shape relies on the channel map."""
        test = self.test
        if not self.running or test is None:
            return
        readings = estimate.curvature.ravel()
        if readings.size != test.sensor.channels:
            return  # a late one of the previous sensor
        if test.take(estimate.device_time, readings) or test.phase is not self._phase:
            self._update("")

    def _update(self, message: str) -> None:
        test, self.message = self.test, message
        self._phase = None if test is None else test.phase
        if test is not None and test.over and self.verdict is None:
            self.verdict = test.verdict()
        now = test.target if test is not None and self.running else None
        self.target_changed.emit(-1 if now is None else now)
        self.changed.emit()


class LoadHold:
    """Pauses the simulated loads of a `session` during a `press_test`."""

    def __init__(self, session: Session, press_test: ChannelMapTest) -> None:
        self._session, self._press_test = session, press_test
        self._holding = False

    def hold(self) -> None:
        if self._session.inside and self._session.running:
            self._holding = True
            self._session.run(False)

    def release(self) -> None:
        """Resume the loads after the test."""
        if self._holding and not self._press_test.running:
            self._holding = False
            self._session.run(True)


_WHAT = (
    "<b>Press here</b> tests the channel map: press the elements one by one as they are framed in "
    "yellow in the heatmaps and on the skin; the element that responds is detected."
)
_DRAG = " To press the simulated skin, click there in the 3-D view."
_WAIT = {
    PressPhase.REST: "Wait until the readings settle: take your hand off, or hold still.",
    PressPhase.PRESS: "Press it now.",
    PressPhase.RELEASE: "Pressed. Release it, or hold still.",
}


class PressPage(QWidget):
    """Page of the press test: instruction, progress and verdict."""

    def __init__(self) -> None:
        super().__init__()
        self.words, self.last, self.verdict = (text_label(rich=True) for _ in range(3))
        self.last.setForegroundRole(FAINT)
        bold = self.verdict.font()
        bold.setWeight(QFont.Weight.DemiBold)
        self.verdict.setFont(bold)
        self.progress = QProgressBar()
        self.progress.setFormat("%v of %m")
        self.progress.setToolTip("Elements tested.")
        self.all = button("Ever&y element", "press-all", "Test each live element, row by row.")
        self.quick = button(
            "&Quick test",
            "press-quick",
            "Test two elements in each row and column: detects exchanged rows, columns and "
            "components, but not every exchange of two elements.",
        )
        self.skip = button("Ski&p", "press-skip", "Omit this element.")
        self.nothing = button(
            "N&o response", "press-nothing", "You pressed it, but no element responded."
        )
        self.back = button("&Back", "press-back", "Repeat the last element.")
        self.stop = button("S&top", "press-stop", "End the test and discard its results.")
        self._press_test: ChannelMapTest | None = None
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

    def connect_to(self, press_test: ChannelMapTest) -> None:
        self._press_test = press_test
        press_test.changed.connect(guarded(self._show))
        for widget, request in (
            (self.all, lambda: press_test.begin(quick=False)),
            (self.quick, lambda: press_test.begin(quick=True)),
            (self.skip, press_test.skip),
            (self.nothing, press_test.nothing_came),
            (self.back, press_test.back),
            (self.stop, press_test.stop),
        ):
            widget.clicked.connect(guarded(lambda *_, request=request: request()))
        self._show()

    def show_status(self, status: Status, inside: bool) -> None:
        connected = status.sensor is not None and status.state == "streaming"
        for widget in (self.all, self.quick):
            widget.setEnabled(connected)
        if inside != self._inside:
            self._inside = inside
            self._show()

    def _show(self) -> None:
        press_test = self._press_test
        if press_test is None:
            return
        test, running = press_test.test, press_test.running
        self.words.setText(sentence(press_test.message) or self._instruction(test, running))
        self.progress.setVisible(test is not None)
        if test is not None:
            self.progress.setRange(0, len(test.elements))
            self.progress.setValue(len(test.done))
        done = () if test is None else test.done
        self.last.setText(sentence(str(done[-1])) if done else "")
        verdict = press_test.verdict
        self.verdict.setText("" if verdict is None else sentence(str(verdict)))
        for widget in (self.skip, self.nothing):
            widget.setVisible(running)
        self.back.setVisible(test is not None)
        self.back.setEnabled(bool(done))
        self.stop.setVisible(test is not None)
        for widget in (self.all, self.quick):
            widget.setVisible(not running)

    def _instruction(self, test: PressTest | None, running: bool) -> str:
        if test is None or test.target is None or not running:
            return _WHAT + (_DRAG if self._inside else "")
        x, y = test.sensor.layout.positions[test.target] * 1e3
        return f"<b>Element {test.target}</b>, at ({x:.0f}, {y:.0f}) mm. {_WAIT[test.phase]}"
