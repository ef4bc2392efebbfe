"""Where on the skin the mouse points, and where it clicks: what is dragged turns the camera."""

from PySide6.QtCore import QEvent, QObject, QPointF, Qt, QTimer, Signal
from PySide6.QtGui import QMouseEvent
from pyvistaqt import QtInteractor

from kappaskin_app.features.membrane.sight import Sight
from kappaskin_app.guard import guarded
from kappaskin_app.shell.drawn_skin import NO_SKIN

_STILL = 4.0  # px that the mouse may move while it clicks
_LOOKS = 30  # ms between two looks at where it points


class SurfacePointer(QObject):
    """Watches the mouse over a plotter; places are (x, y) on the `skin` in m.

    `moved` brings None where it points beside the skin.
    """

    clicked = Signal(float, float)
    moved = Signal(object)

    def __init__(self, plotter: QtInteractor) -> None:
        super().__init__(plotter)
        self.skin, self._sight = NO_SKIN, Sight(plotter)
        self._pressed_at: QPointF | None = None
        self._moved_to: QPointF | None = None
        self._looked = QTimer(self, interval=_LOOKS, singleShot=True)  # pyright: ignore[reportCallIssue]
        self._looked.timeout.connect(guarded(self._look))
        plotter.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        kind, left = event.type(), Qt.MouseButton.LeftButton
        if kind == QEvent.Type.Leave:
            self._moved_to = None
            self.moved.emit(None)
        if isinstance(event, QMouseEvent):
            at = event.position()
            if kind == QEvent.Type.MouseButtonPress:
                self._pressed_at = at if event.button() == left else None
            elif kind == QEvent.Type.MouseButtonRelease:
                self._release(at)
            elif kind == QEvent.Type.MouseMove and not event.buttons():
                self._moved_to = at
                if not self._looked.isActive():
                    self._look()
        return False

    def _release(self, at: QPointF) -> None:
        pressed, self._pressed_at = self._pressed_at, None
        if pressed is None or (at - pressed).manhattanLength() > _STILL:
            return
        place = self.skin.hit(*self._sight.line(at))
        if place is not None:
            self.clicked.emit(*place.tolist())

    def _look(self) -> None:
        """Tell where the mouse is, unless it was told: also where it stops right after a look."""
        at, self._moved_to = self._moved_to, None
        if at is not None:
            self._looked.start()
            self.moved.emit(self.skin.hit(*self._sight.line(at)))
