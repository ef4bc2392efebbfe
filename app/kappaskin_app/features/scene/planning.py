"""The plan of the scene that is played, measured beside the window while somebody looks."""

from typing import Any

from PySide6.QtCore import QObject, Signal

from kappaskin._processes import BackgroundProcess
from kappaskin.errors import Refusal
from kappaskin.live import Status
from kappaskin.scenes import Scene
from kappaskin.studies import plan_updates
from kappaskin_app.shell.session import Session


class Planning(QObject):
    """Has every effect of the scene sized and timed; `changed` tells when there is news.

    `rows` are what `plan_updates` told last, of `scene` or, while `waiting`, of the one before it;
    `refusal` says why there are none.
    """

    changed = Signal()

    def __init__(self, session: Session, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._session = session
        self.scene: Scene | None = None
        self.rows: list[dict[str, Any]] = []
        self.refusal = ""
        self._measuring: BackgroundProcess[list[dict[str, Any]]] | None = None
        self._watched = False

    @property
    def waiting(self) -> bool:
        """Whether not everything is known yet of the scene that is played."""
        return self._measuring is not None

    def watch(self, watched: bool) -> None:
        """Plan while somebody looks, and only then."""
        self._watched = watched
        if watched:
            if self.refusal:
                self.scene = None  # it may have been cancelled: begin anew
            self.follow(self._session.status)
        elif self._measuring is not None:
            self._end(self._measuring)
            self.scene = None  # to be begun anew

    def follow(self, _: Status) -> None:
        """Take up what was measured meanwhile; begin anew when another scene is played."""
        if not self._watched:
            return
        if self._measuring is not None:
            self._take_up(self._measuring)
        elif self._session.inside and self._session.scene is not self.scene:
            self.scene, self.refusal = self._session.scene, ""
            self._measuring = BackgroundProcess("kappaskin-plan", plan_updates, self.scene)
            self.changed.emit()

    def cancel(self) -> None:
        """Plan this scene no more, until somebody looks again."""
        if self._measuring is not None:
            self.rows, self.refusal = [], "Cancelled; it is planned when this is shown again."
            self._end(self._measuring)

    def close(self) -> None:
        self.watch(False)

    def _take_up(self, measuring: BackgroundProcess[list[dict[str, Any]]]) -> None:
        try:
            for rows in measuring.poll():
                self.rows = rows
                self.changed.emit()
        except Refusal as refusal:
            self.rows, self.refusal = [], str(refusal)
        if measuring.done:
            self._end(measuring)

    def _end(self, measuring: BackgroundProcess[list[dict[str, Any]]]) -> None:
        measuring.close()
        self._measuring = None
        self.changed.emit()
