"""Gallery of the built-in scenes, and of recordings of what others measured."""

import tomllib
from functools import cache, partial
from importlib.resources import files
from pathlib import Path

from PySide6.QtCore import (
    QEvent,
    QModelIndex,
    QPersistentModelIndex,
    QPointF,
    QRectF,
    QSize,
    Qt,
    Signal,
)
from PySide6.QtGui import (
    QColor,
    QFontMetricsF,
    QKeyEvent,
    QLinearGradient,
    QPainter,
    QPen,
    QPixmap,
    QResizeEvent,
    QShowEvent,
)
from PySide6.QtWidgets import (
    QFrame,
    QHBoxLayout,
    QListView,
    QListWidget,
    QListWidgetItem,
    QStyle,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QVBoxLayout,
    QWidget,
)

from kappaskin.scenes import SCENES, read_scene_text, scene_file
from kappaskin_app.guard import guarded
from kappaskin_app.theme import FAINT, current, follow_look, grown
from kappaskin_app.widgets.layout import Flow, scrolled
from kappaskin_app.widgets.lettering import RIGHT
from kappaskin_app.widgets.parts import ELLIPSIS, Label, button, in_a_row, text_label

PICTURE, PLAYING = int(Qt.ItemDataRole.UserRole), int(Qt.ItemDataRole.UserRole) + 1
"""Roles of an item: the path of its picture, and whether it is simulated."""

_GAP, _PAD = 4, 6  # px outside and inside a card
_FLAT = 0.63  # height of a picture over its width
_LINES = 2  # of a title

_Index = QModelIndex | QPersistentModelIndex


@cache
def _picture(path: str) -> QPixmap:
    """A picture, read when it is first painted."""
    return QPixmap(path)


def picture_size(cell: int) -> QSize:
    """Size in px of the picture on a card in a cell so many px wide."""
    width = max(cell - 2 * (_GAP + _PAD), 16)
    return QSize(width, round(_FLAT * width))


class CardPainter(QStyledItemDelegate):
    """Draws the items of a list as cards in cells `cell` px wide."""

    def __init__(self) -> None:
        super().__init__()
        self.cell = 160

    def sizeHint(self, option: QStyleOptionViewItem, index: _Index) -> QSize:
        return self.size(option.fontMetrics.height())

    def size(self, line: int) -> QSize:
        """Size in px of a cell whose title has lines `line` px high."""
        height = picture_size(self.cell).height() + _LINES * line + 2 * _GAP + 3 * _PAD
        return QSize(self.cell, height)

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: _Index) -> None:
        painter.save()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        card = QRectF(option.rect).adjusted(_GAP, _GAP, -_GAP, -_GAP)
        self._paint_ground(painter, card, option.state)
        size = picture_size(self.cell)
        place = QRectF(card.left() + _PAD, card.top() + _PAD, size.width(), size.height())
        self._paint_picture(painter, place, index.data(PICTURE))
        if index.data(PLAYING):
            self._paint_playing(painter, place)
        words = card.adjusted(_PAD, size.height() + 2 * _PAD, -_PAD, -_PAD)
        self._paint_title(painter, words, str(index.data()))
        painter.restore()

    def _paint_ground(self, painter: QPainter, card: QRectF, state: QStyle.StateFlag) -> None:
        theme, flags = current(), QStyle.StateFlag
        width, colour = 1.0, theme.line
        if state & flags.State_Selected:
            width, colour = 2.0, theme.accent if state & flags.State_Active else theme.faint
        elif state & flags.State_MouseOver:
            colour = theme.faint
        painter.setPen(QPen(QColor(colour), width))
        painter.setBrush(QColor(theme.base))
        half = width / 2
        painter.drawRoundedRect(card.adjusted(half, half, -half, -half), 7, 7)

    def _paint_picture(self, painter: QPainter, place: QRectF, path: str) -> None:
        ground = QLinearGradient(place.topLeft(), place.bottomLeft())
        ground.setColorAt(0, QColor(current().scene_top))
        ground.setColorAt(1, QColor(current().scene))
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(ground)
        painter.drawRoundedRect(place, 5, 5)
        picture = _picture(path)
        painter.drawPixmap(place, picture, QRectF(picture.rect()))

    def _paint_playing(self, painter: QPainter, place: QRectF) -> None:
        theme, words = current(), "Simulated"
        metrics = QFontMetricsF(painter.font())
        height = metrics.height() + 2
        width = metrics.horizontalAdvance(words) + 1.5 * height + 4
        pill = QRectF(place.left() + 5, place.top() + 5, width, height)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(theme.accent))
        painter.drawRoundedRect(pill, height / 2, height / 2)
        painter.setBrush(QColor(theme.base))
        left, middle, half = pill.left() + height / 2, pill.center().y(), height / 4
        painter.drawConvexPolygon(
            [
                QPointF(left, middle - half),
                QPointF(left + 1.6 * half, middle),
                QPointF(left, middle + half),
            ]
        )
        painter.setPen(QColor(theme.base))
        painter.drawText(pill.adjusted(0, 0, -height / 2 + 1, 0), RIGHT, words)

    def _paint_title(self, painter: QPainter, place: QRectF, title: str) -> None:
        metrics, flags = QFontMetricsF(painter.font()), Qt.AlignmentFlag
        how = int(flags.AlignCenter) | int(Qt.TextFlag.TextWordWrap)
        if metrics.boundingRect(place, how, title).height() > _LINES * metrics.height() + 1:
            title = metrics.elidedText(title, Qt.TextElideMode.ElideRight, 1.7 * place.width())
        painter.setPen(QColor(current().text))
        painter.drawText(place, how, title)


# Demonstrations, then the paper's scenes, those of one effect, and those of other readings.
_DEMONSTRATIONS = (
    "sphere pencil coin bolt tapping two-contacts fingertip-cap thumb-pad fingertip dome saddle "
    "circle exploring cylinder edge slipping demo"
)
_PAPER = "centre off-centre line calibration"
_EFFECTS = "failing-elements creep-hold steep saturation long-gages on-foam stretching hot-room hum"
_READINGS = "camera tilts"
ORDER = tuple(f"{_DEMONSTRATIONS} {_PAPER} {_EFFECTS} {_READINGS}".split())

_FOLDER = Path(str(files("kappaskin_resources")))
_THUMBNAILS, _MEASURED = _FOLDER / "scenes" / "thumbnails", _FOLDER / "measured"
MEASURED = {
    "&Ball in a gel": _MEASURED / "ball" / "ball.mcap",
    "C&lamped plate": _MEASURED / "plate" / "slopes.mcap",
    "Fibre": _MEASURED / "fibre" / "fibre.mcap",
}
"""Recordings of what others measured, by their titles."""
_SOURCES = (
    "Replay the heights that a camera saw of a gel, pressed by a ball of 4.0 mm radius (9DTact).",
    "Replay the shape of a plate by its slopes, which a finite-element program computed (recolo).",
    "Replay the shapes of a fibre held at one end, by the heights of 15 markers (motion capture).",
)

_CARD = 176  # px, approximate width of a cell: the columns fill the width
_TEXT_WIDTH = (190, 340)  # px of the text next to the cards, least and most


def in_order(names: tuple[str, ...]) -> list[str]:
    """`names` in the order of `ORDER`; names not in it come last."""
    known = [name for name in ORDER if name in names]
    return known + [name for name in names if name not in ORDER]


@cache
def _words(name: str) -> tuple[str, str]:
    """The title and the text of a built-in scene."""
    read = tomllib.loads(read_scene_text(scene_file(name)))
    return read["title"], read["text"].strip()


class _Cards(QListWidget):
    """Cards in as many columns as fit; `played` requests a scene."""

    played = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.painter = CardPainter()
        self.setItemDelegate(self.painter)
        self.setViewMode(QListView.ViewMode.IconMode)
        self.setMovement(QListView.Movement.Static)
        self.setResizeMode(QListView.ResizeMode.Adjust)
        self.setVerticalScrollMode(QListView.ScrollMode.ScrollPerPixel)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setUniformItemSizes(True)
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.viewport().setAutoFillBackground(False)
        self.setMouseTracking(True)
        self.setMinimumSize(200, 150)
        self.setAccessibleName("Scenes")
        self.itemDoubleClicked.connect(self.played)

    def resizeEvent(self, event: QResizeEvent) -> None:
        self._fit()
        super().resizeEvent(event)

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.FontChange:
            self._fit()

    def _fit(self) -> None:
        """Set columns that fill the width, with space for the scroll bar."""
        width = self.width() - self.verticalScrollBar().sizeHint().width() - 1
        self.painter.cell = width // max(1, round(width / _CARD))
        size = self.painter.size(self.fontMetrics().height())
        self.setGridSize(size)
        self.verticalScrollBar().setSingleStep(size.height() // 4)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            self.played.emit()
        else:
            super().keyPressEvent(event)


class GalleryPanel(QWidget):
    """Cards of the built-in scenes; `chosen` requests a scene by name, `open_wanted` a file.

    Below them are recordings of what others `measured`; `replay_wanted` requests one by its file.
    """

    chosen = Signal(str)
    replay_wanted = Signal(Path)
    open_wanted = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.cards = _Cards()
        self.items = {name: QListWidgetItem() for name in in_order(SCENES)}
        for name, item in self.items.items():
            item.setData(PICTURE, str(_THUMBNAILS / f"{name}.png"))
            self.cards.addItem(item)
        self.title, self.text, self.file = text_label(), text_label(), text_label()
        self.play = button(
            "&Simulate", "play-scene", "Simulate this scene (Enter, or double-click)."
        )
        self.open = button(f"&Open file{ELLIPSIS}", "open-scene", "Simulate a scene from a file.")
        self.measured = [
            button(title, f"measured-{number}", tip)
            for number, (title, tip) in enumerate(zip(MEASURED, _SOURCES, strict=True))
        ]
        self._lay_out()
        self._playing = ""
        self.cards.currentItemChanged.connect(guarded(self._show_words))
        self.cards.played.connect(guarded(self._play))
        self.play.clicked.connect(guarded(self._play))
        self.open.clicked.connect(guarded(lambda *_: self.open_wanted.emit()))
        for recorded, file in zip(self.measured, MEASURED.values(), strict=True):
            recorded.clicked.connect(guarded(partial(self._replay, file)))
        self.cards.setCurrentRow(0)
        follow_look(self, self._fit)

    def _lay_out(self) -> None:
        self.file.setForegroundRole(FAINT)
        heading = Label("Measured")
        bold = self.title.font()
        bold.setBold(True)
        self.title.setFont(bold)
        heading.setFont(bold)
        details = QWidget()
        self._details = details
        column = QVBoxLayout(details)
        column.setContentsMargins(0, 4, 0, 4)
        words = scrolled(self.title, self.text, self.file)
        words.setMinimumWidth(0)
        column.addWidget(words, 1)
        column.addLayout(in_a_row(self.play, self.open))
        row = QHBoxLayout(self)
        row.setContentsMargins(4, 2, 8, 4)
        scenes = QVBoxLayout()
        scenes.addWidget(self.cards, 1)
        measured = Flow()
        for widget in (heading, *self.measured):
            measured.addWidget(widget)
        scenes.addLayout(measured)
        row.addLayout(scenes, 7)
        row.addWidget(details, 3)

    # Requests

    @property
    def selected(self) -> str:
        """The name of the scene whose card is selected."""
        row = self.cards.currentRow()
        return list(self.items)[row] if row >= 0 else ""

    def _play(self, *_: object) -> None:
        if self.selected:
            self.chosen.emit(self.selected)

    def _replay(self, file: Path, *_: object) -> None:
        self.replay_wanted.emit(file)

    # State

    def showEvent(self, event: QShowEvent) -> None:
        for name, item in self.items.items():  # not before: all files are read in 25 ms
            item.setText(_words(name)[0])
        super().showEvent(event)

    def show_playing(self, name: str) -> None:
        """Mark the built-in scene `name` as simulated; none for another name."""
        if name != self._playing:
            self._playing = name
            for other, item in self.items.items():
                item.setData(PLAYING, other == name)
            self._show_words()

    def _fit(self) -> None:
        self._details.setMinimumWidth(grown(_TEXT_WIDTH[0]))
        self._details.setMaximumWidth(grown(_TEXT_WIDTH[1]))

    def _show_words(self, *_: object) -> None:
        name = self.selected
        if not name:
            return
        for label, text in zip((self.title, self.text), _words(name), strict=True):
            label.setText(text)
        playing = ", simulated now" if name == self._playing else ""
        self.file.setText(f"{name}.toml{playing}")
