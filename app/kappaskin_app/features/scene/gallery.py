"""The ready scenes as pictures to choose from, each with what there is to see in it."""

from PySide6.QtCore import QEvent, Qt, Signal
from PySide6.QtGui import QHideEvent, QImage, QKeyEvent, QPixmap, QResizeEvent, QShowEvent
from PySide6.QtWidgets import (
    QFrame,
    QHBoxLayout,
    QListView,
    QListWidget,
    QListWidgetItem,
    QVBoxLayout,
    QWidget,
)

from kappaskin.scenes import SCENES, Scene
from kappaskin_app.features.scene.card import PICTURE, PLAYING, CardPainter, picture_size
from kappaskin_app.features.scene.picturing import Look, Picturing
from kappaskin_app.guard import guarded
from kappaskin_app.theme import LIGHT, Theme, grown
from kappaskin_app.widgets.columns import scrolled
from kappaskin_app.widgets.parts import ELLIPSIS, button, in_a_row, text_label

# What is pleasant to watch, then what the paper has, then what one effect does.
_WATCHED = (
    "sphere pencil coin bolt tapping two-contacts fingertip circle exploring cylinder edge "
    "slipping demo"
)
_PAPER = "centre off-centre line calibration"
_EFFECTS = "failing-elements creep-hold steep saturation long-gages on-foam hot-room hum"
ORDER = tuple(f"{_WATCHED} {_PAPER} {_EFFECTS}".split())

_SETTLED = 200  # ms after the last change of size: only then are pictures made anew
_CARD = 176  # px that a cell is wide, more or less, so that the columns fill the width
_WORDS = (190, 340)  # px of what stands beside the cards at least and at most


def in_order(names: tuple[str, ...]) -> list[str]:
    """`names` in the order of `ORDER`; those that it does not have come last."""
    known = [name for name in ORDER if name in names]
    return known + [name for name in names if name not in ORDER]


def _titled(name: str) -> str:
    """What a scene is called until its file is read."""
    return name.replace("-", " ").capitalize()


class _Cards(QListWidget):
    """Cards in as many columns as fit; says that one is to be played, and when they are resized."""

    played = Signal()
    resized = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
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
        self.resized.emit()

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.FontChange:
            self._fit()

    def _fit(self) -> None:
        """Columns that fill the width, beside the scroll bar whether it is there or not."""
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
    """Cards of the ready scenes; `chosen` names the one to play, `open_wanted` asks for a file."""

    chosen = Signal(str)
    open_wanted = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.cards = _Cards()
        self.items = {name: QListWidgetItem(_titled(name)) for name in in_order(SCENES)}
        for item in self.items.values():
            self.cards.addItem(item)
        self.title, self.text, self.file = text_label(), text_label(), text_label()
        self.play = button(
            "&Play", "play-scene", "Play this scene on the simulated skin (Enter, or double-click)."
        )
        self.open = button(
            f"&Open file{ELLIPSIS}", "open-scene", "Play a scene from a file of your own."
        )
        self._lay_out()
        self._scenes: dict[str, Scene | str] = {}
        self._theme, self._playing = LIGHT, ""
        self._picturing = Picturing(list(self.items), self)
        self._picturing.read.connect(guarded(self._take_scenes))
        self._picturing.painted.connect(guarded(self._take_picture))
        self.cards.resized.connect(guarded(lambda: self._begin(_SETTLED)))
        self.cards.currentItemChanged.connect(guarded(self._show_words))
        self.cards.played.connect(guarded(self._play))
        self.play.clicked.connect(guarded(self._play))
        self.open.clicked.connect(guarded(lambda *_: self.open_wanted.emit()))
        self.cards.setCurrentRow(0)

    def _lay_out(self) -> None:
        for label in (self.title, self.text, self.file):
            label.setTextFormat(Qt.TextFormat.PlainText)
        bold = self.title.font()
        bold.setBold(True)
        self.title.setFont(bold)
        beside = QWidget()
        self._beside = beside
        column = QVBoxLayout(beside)
        column.setContentsMargins(0, 4, 0, 4)
        words = scrolled(self.title, self.text, self.file)
        words.setMinimumWidth(0)
        column.addWidget(words, 1)
        column.addLayout(in_a_row(self.play, self.open))
        row = QHBoxLayout(self)
        row.setContentsMargins(4, 2, 8, 4)
        row.addWidget(self.cards, 7)
        row.addWidget(beside, 3)

    # What a person asks.

    @property
    def selected(self) -> str:
        """The name of the scene whose card is selected."""
        row = self.cards.currentRow()
        return list(self.items)[row] if row >= 0 else ""

    def _play(self, *_: object) -> None:
        if self.selected:
            self.chosen.emit(self.selected)

    # What is so.

    def show_playing(self, name: str) -> None:
        """Mark the ready scene `name` as the one that is played; none for any other name."""
        if name != self._playing:
            self._playing = name
            for other, item in self.items.items():
                item.setData(PLAYING, other == name)
            self._show_words()

    def show_theme(self, theme: Theme) -> None:
        self._beside.setMinimumWidth(grown(_WORDS[0]))
        self._beside.setMaximumWidth(grown(_WORDS[1]))
        self._theme = self.cards.painter.theme = theme
        self.file.setStyleSheet(f"color: {theme.faint};")
        self.cards.viewport().update()
        self._begin()

    def _show_words(self, *_: object) -> None:
        name = self.selected
        if not name:
            return
        scene = self._scenes.get(name)
        self.title.setText(self.items[name].text())
        text = scene.text.strip() if isinstance(scene, Scene) else scene or ""
        self.text.setText(text)
        playing = ", played now" if name == self._playing else ""
        self.file.setText(f"{name}.toml{playing}")

    # What is made beside the window.

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        self._begin()

    def hideEvent(self, event: QHideEvent) -> None:
        self.rest()
        super().hideEvent(event)

    def event(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.DevicePixelRatioChange:
            self._begin()
        return super().event(event)

    def close(self) -> bool:
        """End what makes the pictures, at most a picture later, and close."""
        self._picturing.close()
        return super().close()

    @property
    def painting(self) -> bool:
        """Whether pictures are still to be made."""
        return self._picturing.busy

    def rest(self) -> None:
        """Make no more pictures until it is shown again."""
        self._picturing.rest()

    def _begin(self, after: int = 0) -> None:
        """Have what is missing made where it is seen, beginning `after` so many ms."""
        if self.isVisible():
            size, ratio = picture_size(self.cards.painter.cell), self.devicePixelRatioF()
            look = Look(self._theme, size.width(), size.height(), ratio)
            self._picturing.paint(look, after)

    def _take_scenes(self, scenes: dict[str, Scene | str]) -> None:
        self._scenes = scenes
        for name, scene in scenes.items():
            if isinstance(scene, Scene):
                self.items[name].setText(scene.title or _titled(name))
        self._show_words()

    def _take_picture(self, name: str, image: QImage) -> None:
        self.items[name].setData(PICTURE, QPixmap.fromImage(image))
