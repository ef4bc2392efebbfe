"""Panels: titled boxes that show a state and request changes of settings."""

from PySide6.QtCore import QRectF, QSize, Qt, QTimer, Signal
from PySide6.QtGui import QGuiApplication, QPainter, QPaintEvent, QResizeEvent
from PySide6.QtWidgets import (
    QApplication,
    QGroupBox,
    QHBoxLayout,
    QStyle,
    QStyleOptionGroupBox,
    QStylePainter,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from kappaskin._text import printable
from kappaskin.live import Status
from kappaskin_app.guard import guarded
from kappaskin_app.shell.settings import Settings
from kappaskin_app.theme import ALERT, FAINT, current, follow_look
from kappaskin_app.widgets.layout import scroll_to
from kappaskin_app.widgets.parts import ELLIPSIS, Label
from kappaskin_app.widgets.text import COMMAND

_FOLDED, _UNFOLDED = (
    "\N{BLACK RIGHT-POINTING SMALL TRIANGLE}",
    "\N{BLACK DOWN-POINTING SMALL TRIANGLE}",
)
_PADDING, _ROUND = 7, 3  # px, beside the text of a button and of its edge
_GROWN = 20  # ms after which the page of a panel that grew has grown too
_LONGEST, _BEGINNING = 800, 500  # characters of a message, and how many from its beginning


class CornerButton(QToolButton):
    """A button without a frame until it has the mouse or the focus, or is checked.

    It is painted, as a style sheet takes 0.2 ms in each panel to follow a theme.
    """

    def sizeHint(self) -> QSize:
        wide, letters = self.fontMetrics().horizontalAdvance, self.fontMetrics().height()
        return QSize(wide(f" {self.text()} ") + 2 * _PADDING, letters + 2)

    def paintEvent(self, event: QPaintEvent) -> None:
        palette = self.palette()
        with QPainter(self) as painter:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            if seen := self.underMouse() or self.hasFocus() or self.isChecked():
                painter.setPen(palette.highlight().color())
                edge = QRectF(self.rect()).adjusted(0.5, 0.5, -0.5, -0.5)
                painter.drawRoundedRect(edge, _ROUND, _ROUND)
            painter.setPen(palette.color(palette.ColorRole.Text if seen else FAINT))
            painter.drawText(self.rect(), Qt.AlignmentFlag.AlignCenter, self.text())


class Panel(QGroupBox):
    """A titled box with a message below; `requested` brings the name and value of a setting.

    A button in its corner shows its purpose; `guide_requested` brings the name of a page of the
    guide. One on a page of settings is collapsed by a click on its title, `fold`.
    """

    purpose = ""
    """Its purpose, with the equation where there is one."""
    guide_page = ""
    """The page of the guide about it."""

    requested = Signal(str, object)
    guide_requested = Signal(str)

    def __init__(self, title: str, parent: QWidget | None = None) -> None:
        super().__init__(title, parent)
        self.fold = CornerButton(self, checkable=True, visible=False)  # pyright: ignore[reportCallIssue]
        self.fold.setObjectName("fold")
        self.fold.setAccessibleName(f"Collapse {title}")
        self.fold.setToolTip("Collapse or expand this group.")
        self.message = Label(wordWrap=True, visible=False)  # pyright: ignore[reportCallIssue]
        how = Qt.TextInteractionFlag
        self.message.setTextInteractionFlags(
            how.TextSelectableByMouse | how.TextSelectableByKeyboard
        )
        self._hint = False
        self._grown = QTimer(self, singleShot=True, interval=_GROWN)  # pyright: ignore[reportCallIssue]
        self._grown.timeout.connect(guarded(self._scroll_to_message))
        self.about = Label(rich=True, wordWrap=True, visible=False)  # pyright: ignore[reportCallIssue]
        self.about.setForegroundRole(FAINT)
        self.about.setTextInteractionFlags(how.TextBrowserInteraction)
        self.about.linkActivated.connect(self.guide_requested)
        self.help = CornerButton(text="?", checkable=True)  # pyright: ignore[reportCallIssue]
        self.help.setAccessibleName(f"About {title}")
        self.help.setToolTip(f"What this panel is for: {self.purpose}")
        self.help.toggled.connect(self.about.setVisible)
        self.help.setVisible(bool(self.purpose))
        self.corner = QWidget(self)
        self._corner = QHBoxLayout(self.corner)
        self._corner.setContentsMargins(0, 0, 0, 0)
        self._corner.addWidget(self.help)
        inside = QWidget()
        self.body = QVBoxLayout(inside)
        self.body.setContentsMargins(0, 0, 0, 0)
        self._around = QVBoxLayout(self)
        self._around.setContentsMargins(8, 6, 8, 8)
        self._around.addWidget(self.about)
        self._around.addWidget(inside)
        self._around.addWidget(self.message)
        self.fold.toggled.connect(inside.setHidden)
        self.fold.toggled.connect(self.update)
        follow_look(self.about, self._dress)

    def show_settings(self, settings: Settings) -> None:
        """Show the settings."""

    def show_status(self, status: Status, simulating: bool) -> None:
        """Show the engine's status, and whether the app's own simulation runs."""

    def show_message(self, text: str, hint: bool = False) -> None:
        """Show an alarm or a hint below, a very long one without its middle; nothing if empty."""
        if len(text) > _LONGEST:
            text = f"{text[:_BEGINNING]}{ELLIPSIS}{text[_BEGINNING - _LONGEST :]}"
        if (text, hint) != (self.message.text(), self._hint):
            self._hint = hint
            self.message.setText(printable(text, keep="\n"))
            self.message.setForegroundRole(FAINT if hint else ALERT)
        self.message.setVisible(bool(text))

    def _copy_command(self) -> None:
        """Copy the command in the message."""
        if command := COMMAND.search(self.message.text()):
            QGuiApplication.clipboard().setText(command[1])

    def _dress(self) -> None:
        style = f'style="color: {current().accent}"'
        self.about.setText(
            f'{self.purpose} <a href="{self.guide_page}" {style}>More in the guide</a>'
        )

    def place_corner(self) -> None:
        """Put the corner's buttons beside the title."""
        size = self.corner.sizeHint().boundedTo(QSize(self.width(), self.fontMetrics().height()))
        self.corner.setGeometry(self.width() - size.width(), 0, size.width(), size.height())
        group, title = QStyle.ComplexControl.CC_GroupBox, QStyle.SubControl.SC_GroupBoxLabel
        place = self.style().subControlRect(group, self._option(), title, self)
        self.fold.setGeometry(place.adjusted(0, 0, 3, 0))

    def _option(self) -> QStyleOptionGroupBox:
        """How the box is drawn: its title has an arrow where it can be collapsed."""
        option = QStyleOptionGroupBox()
        self.initStyleOption(option)
        if not self.fold.isHidden():
            arrow = _FOLDED if self.fold.isChecked() else _UNFOLDED
            option.text = f"{arrow} {option.text}"  # pyright: ignore[reportAttributeAccessIssue]
        return option

    def paintEvent(self, event: QPaintEvent) -> None:
        QStylePainter(self).drawComplexControl(QStyle.ComplexControl.CC_GroupBox, self._option())

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self.place_corner()
        if 0 < event.oldSize().height() < event.size().height():
            self._grown.start()

    def _scroll_to_message(self) -> None:
        """Scroll to a message that follows an input in this panel."""
        focused = QApplication.focusWidget()
        if focused is not None and self.isAncestorOf(focused):
            scroll_to(self)
            scroll_to(focused)
