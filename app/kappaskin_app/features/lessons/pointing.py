"""The control pointer: reveals a control and draws a ring around it."""

from collections.abc import Callable, Iterator, Mapping

from PySide6.QtCore import QEvent, QObject, QRect, QRectF, Qt, QTimer
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QDockWidget, QScrollArea, QTabWidget, QWidget

from kappaskin_app.guard import guarded
from kappaskin_app.shell.form import Form
from kappaskin_app.shell.panel import Panel
from kappaskin_app.theme import current

_AROUND, _THICK, _ABOUT = 3, 2, 60  # px: of a ring, and of what is seen around it


class _Ring(QWidget):
    """A ring around `targets`, which have one parent, that follows their geometry."""

    def __init__(self, targets: list[QWidget]) -> None:
        super().__init__(targets[0].parentWidget())
        self._targets = targets
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        for target in targets:
            target.installEventFilter(self)
        self._follow()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        kinds = QEvent.Type
        if event.type() in (kinds.Move, kinds.Resize, kinds.Show, kinds.Hide):
            self._follow()
        return False

    def _follow(self) -> None:
        seen = [target for target in self._targets if not target.isHidden()]
        whole = QRect()
        for target in seen:
            whole = whole.united(target.geometry())
        grown = whole.adjusted(-_AROUND, -_AROUND, _AROUND, _AROUND)
        parent = self.parentWidget()
        self.setGeometry(grown.intersected(parent.rect()) if parent else grown)
        self.setVisible(bool(seen))
        self.raise_()

    def paintEvent(self, event: QPaintEvent) -> None:
        with QPainter(self) as painter:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            painter.setPen(QPen(QColor(current().accent), _THICK))
            inner = QRectF(self.rect()).adjusted(1, 1, -1, -1)
            painter.drawRoundedRect(inner, 2 * _AROUND, 2 * _AROUND)


class ControlPointer(QObject):
    """Finds the controls that a lesson points at among `forms` and `others`, and reveals them.

    `show_dock` brings a dock to the front, by its name.
    """

    def __init__(
        self,
        forms: Callable[[], list[Form]],
        others: Callable[[], Mapping[str, list[QWidget]]],
        show_dock: Callable[[str], None],
        parent: QObject,
    ) -> None:
        super().__init__(parent)
        self._forms, self._others, self._show_dock = forms, others, show_dock
        self.rings: list[_Ring] = []
        self._shown: list[QDockWidget] = []

    def targets(self, name: str) -> list[QWidget]:
        """The widgets called `name`: a control with its label, a dock or a number."""
        if name in (others := self._others()):
            return others[name]
        for form in self._forms():
            if name in form.names:
                editor = form.editor(name)
                label = form.form.labelForField(editor)
                return [editor, label] if label is not None else [editor]
        raise KeyError(f"expected a setting or a place, got {name!r}")

    def point(self, names: tuple[str, ...]) -> None:
        """Point at these, and at nothing else."""
        for ring in self.rings:
            ring.hide()
            ring.deleteLater()
        self.rings = []
        pointed = [self.targets(name) for name in names]
        self._put_away([one for targets in pointed for one in _around(targets[0])])
        for targets in pointed:
            self._reveal(targets[0])
            self.rings.append(_Ring(targets))
        # Once more when what was shown has its place.
        QTimer.singleShot(0, self, guarded(self._scroll))

    def _put_away(self, needed: list[QWidget]) -> None:
        """Hide docks that were shown for earlier controls."""
        for dock in [one for one in self._shown if one not in needed]:
            self._shown.remove(dock)
            dock.hide()

    def _scroll(self) -> None:
        for ring in reversed(self.rings):  # last the first one named, which must be visible
            for area in _around(ring):
                if isinstance(area, QScrollArea):
                    area.ensureWidgetVisible(ring, 0, _ABOUT)

    def _reveal(self, target: QWidget) -> None:
        around = list(_around(target))
        for area in around:
            if isinstance(area, QTabWidget):
                pages = [area.widget(index) for index in range(area.count())]
                area.setCurrentIndex([page in around for page in pages].index(True))
            if isinstance(area, Panel):
                area.fold.setChecked(False)
            if isinstance(area, QDockWidget):
                if area.isHidden():
                    self._shown.append(area)
                self._show_dock(area.objectName())


def _around(widget: QWidget) -> Iterator[QWidget]:
    """The ancestors of `widget`, up to the window."""
    parent = widget.parentWidget()
    while parent is not None:
        yield parent
        parent = parent.parentWidget()
