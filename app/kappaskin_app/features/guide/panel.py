"""The guide panel: contents, the text of a page, back and forward."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from importlib.resources import files
from pathlib import Path

from PySide6.QtCore import QSignalBlocker, Qt, QTimer, QUrl
from PySide6.QtGui import (
    QBrush,
    QColor,
    QFontDatabase,
    QPixmap,
    QResizeEvent,
    QShowEvent,
    QTextBlock,
    QTextBlockFormat,
    QTextCharFormat,
    QTextCursor,
    QTextDocument,
    QTextFormat,
    QTextFrameFormat,
    QTextTable,
)
from PySide6.QtWidgets import QComboBox, QTextBrowser, QVBoxLayout, QWidget

from kappaskin_app.guard import guarded
from kappaskin_app.theme import Theme, current, follow_look
from kappaskin_app.widgets.parts import button, in_a_row

FOLDER = Path(str(files("kappaskin_resources"))) / "guide"
_LISTED = re.compile(r"^\d+\. \[([^\]]+)\]\(([\w-]+\.md)\)", re.MULTILINE)
_HEADING = re.compile(r"^## (.+)$", re.MULTILINE)


@dataclass(frozen=True)
class Page:
    """A page of the guide, and its headings."""

    title: str
    file: Path
    headings: tuple[str, ...]


def page_called(name: str) -> Page:
    """The page whose file has this name, without the suffix."""
    return next(page for page in pages() if page.file.stem == name)


@cache
def pages() -> tuple[Page, ...]:
    """The contents, and the pages that they list."""
    contents = FOLDER / "README.md"
    listed = _LISTED.findall(contents.read_text("utf-8"))
    return tuple(
        Page(title, FOLDER / name, tuple(_HEADING.findall((FOLDER / name).read_text("utf-8"))))
        for title, name in [("Contents", contents.name), *listed]
    )


_PRINTED = ("text", "output")  # fences around what a command prints
_WIDEST = 88  # of the text, in letters M: longer lines are hard to follow
_MARGIN, _CODE, _CELL, _ABOVE = 14, 10, 4, 8  # px
_LATER = 100  # ms after which a page follows the look: once the rest of the window is drawn


class GuidePanel(QWidget):
    """A browser of the pages of the guide."""

    def __init__(self) -> None:
        super().__init__()
        self._due: tuple[Page, str] | None = (pages()[0], "")
        self.contents, self.text = QComboBox(), _Text()
        self.contents.setPlaceholderText("Another page")
        self.contents.setSizeAdjustPolicy(
            QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon
        )
        self.contents.setAccessibleName("Pages of the guide")
        self.contents.setToolTip("The pages of the guide; Ctrl+K finds every heading in them.")
        back, forward = (
            "Previous page (Alt+Left).",
            "Next page, after the previous one (Alt+Right).",
        )
        self.back = button("\N{LEFTWARDS ARROW}", "guide-back", back)
        self.forward = button("\N{RIGHTWARDS ARROW}", "guide-forward", forward)
        for way, name in ((self.back, "Back"), (self.forward, "Forward")):
            way.setAccessibleName(name)
            way.setFixedWidth(3 * way.sizeHint().height() // 2)
        for page in pages():
            self.contents.addItem(page.title)
        self._lay_out()
        self.contents.currentIndexChanged.connect(guarded(self._choose))
        self.text.sourceChanged.connect(guarded(self._show_where))
        for way, available, go in (
            (self.back, self.text.backwardAvailable, self.text.backward),
            (self.forward, self.text.forwardAvailable, self.text.forward),
        ):
            way.setEnabled(False)
            available.connect(way.setEnabled)
            way.clicked.connect(guarded(lambda *_, go=go: go()))

    def _lay_out(self) -> None:
        column = QVBoxLayout(self)
        column.setContentsMargins(6, 2, 6, 6)
        row = in_a_row(self.contents, self.back, self.forward)
        row.setStretch(0, 1)
        column.addLayout(row)
        column.addWidget(self.text, 1)

    def read(self, page: Page, heading: str = "") -> None:
        """Show a page, from a heading in it on; once the panel is shown, where it is hidden."""
        self._due = None if self.isVisible() else (page, heading)
        if self._due:
            return
        url = QUrl.fromLocalFile(str(page.file))
        url.setFragment(heading)
        self.text.setSource(url)

    def _choose(self, row: int) -> None:
        self.read(pages()[row])

    def _show_where(self, url: QUrl) -> None:
        """Select the page in the contents; none for another file."""
        listed = [str(page.file) for page in pages()]
        row = listed.index(url.toLocalFile()) if url.toLocalFile() in listed else -1
        with QSignalBlocker(self.contents):
            self.contents.setCurrentIndex(row)
        self.text.show_page(url.fragment())

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        if self._due:
            self.read(*self._due)


class _Text(QTextBrowser):
    """A page of Markdown, with a limited line length.

    It is formatted before Qt lays it out: that takes longer, and is done part by part when idle.
    """

    def __init__(self) -> None:
        super().__init__()
        self._loaded: QTextDocument | None = None
        self._sought: Callable[[], float] | None = None  # px to scroll to, once it is laid out
        self._left: dict[str, int] = {}  # where each page was scrolled to
        self._reading = QTimer(self, singleShot=True, interval=_LATER)  # pyright: ignore[reportCallIssue]
        self._reading.timeout.connect(guarded(self._read_again))
        self.setAccessibleName("The page of the guide")
        self.setOpenExternalLinks(True)
        self.setLineWrapMode(QTextBrowser.LineWrapMode.FixedPixelWidth)
        self.setDocument(QTextDocument(self))
        # Else the bar is hidden and shown again with each page, and the page laid out twice more.
        self.setVerticalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOn)
        self.verticalScrollBar().rangeChanged.connect(guarded(lambda *_: self._seek()))
        follow_look(self, self._reading.start)

    def loadResource(self, kind: int, name: QUrl) -> object:
        """A resource of a page; pictures no wider than its lines."""
        if kind == QTextDocument.ResourceType.ImageResource:
            picture = QPixmap(name.toLocalFile())
            wide = min(picture.width(), self.lineWrapColumnOrWidth() - 3 * _MARGIN)
            return picture.scaledToWidth(wide, Qt.TransformationMode.SmoothTransformation)
        found, self._sought = super().loadResource(kind, name), None
        before = self.document().baseUrl().toLocalFile()
        self._left[before] = self.verticalScrollBar().value()
        if kind != QTextDocument.ResourceType.MarkdownResource or not found:
            return found
        self._loaded = self._formatted(name, bytes(found).decode())
        return " "  # which Qt writes into the document of the page before

    def _formatted(self, name: QUrl, text: str) -> QTextDocument:
        """A page with formatted code, headings and tables."""
        document, theme, size = QTextDocument(self), current(), self.font().pointSizeF()
        document.setBaseUrl(name)
        document.setUndoRedoEnabled(False)
        document.setDocumentMargin(_MARGIN)
        document.setDefaultFont(self.font())
        document.setMarkdown(text)
        for frame in document.rootFrame().childFrames():
            if isinstance(frame, QTextTable):
                _rule(frame, theme)
        for block in _blocks(document):
            if _is_code(block):
                _ground(block, theme)
            elif block.blockFormat().headingLevel():
                _space(block)
            if size % 1:  # Qt rounds that of code
                _enlarge(block, size)
        return document

    def show_page(self, heading: str) -> None:
        """Show what was loaded, from a heading on if there is one of this text."""
        if self._loaded is not None:
            self.document().deleteLater()
            self.setDocument(self._loaded)
            self._loaded = None
        for block in _blocks(self.document()) if heading else ():
            if block.blockFormat().headingLevel() and block.text() == heading:
                self._sought = partial(self._top_of, block.blockNumber())
        self._seek()

    def _top_of(self, number: int) -> float:
        """The top of a block in px, as far as it is laid out; 0 until then."""
        return self.document().findBlockByNumber(number).layout().position().y()

    def backward(self) -> None:
        super().backward()
        self._scroll_back()

    def forward(self) -> None:
        super().forward()
        self._scroll_back()

    def _scroll_back(self) -> None:
        at = self._left.get(self.document().baseUrl().toLocalFile(), 0)
        self._sought = (lambda: at) if at else None
        self._seek()

    def _seek(self) -> None:
        """Scroll to what is sought; until it is laid out, the view stays as it was.

        What is above may still be laid out anew, so it is followed until the whole page is.
        """
        shown = self._sought is None
        if self._sought is not None:
            top, bar = round(self._sought()), self.verticalScrollBar()
            whole = self.document().lastBlock().layout().lineCount() > 0
            if shown := 0 < top <= bar.maximum() or whole:
                bar.setValue(top)
            if whole:
                self._sought = None
        self.viewport().setUpdatesEnabled(shown)

    def _read_again(self) -> None:
        """Format the page in the look of now."""
        if not self.source().isEmpty():
            self._fit()
            self.reload()  # links have the colour of the palette with which they were read
            self._scroll_back()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        widest = _WIDEST * self.fontMetrics().horizontalAdvance("M")
        wide = min(self.viewport().width(), widest)
        if wide != self.lineWrapColumnOrWidth():  # else Qt lays the page out once more
            self.setLineWrapColumnOrWidth(wide)


def _blocks(document: QTextDocument) -> list[QTextBlock]:
    found, block = list[QTextBlock](), document.begin()
    while block.isValid():
        found.append(block)
        block = block.next()
    return found


def _rule(table: QTextTable, theme: Theme) -> None:
    how = table.format()
    how.setBorderStyle(QTextFrameFormat.BorderStyle.BorderStyle_Solid)
    how.setBorderBrush(QBrush(QColor(theme.line)))
    how.setBorder(1)
    how.setBorderCollapse(True)
    how.setCellPadding(_CELL)
    table.setFormat(how)


def _is_code(block: QTextBlock) -> bool:
    return block.blockFormat().hasProperty(QTextFormat.Property.BlockCodeFence)


def _kind(block: QTextBlock) -> str:
    """The language of the fence around a line of code; empty outside code."""
    return str(block.blockFormat().property(QTextFormat.Property.BlockCodeLanguage) or "")


def _ground(block: QTextBlock, theme: Theme) -> None:
    """Format a line of code; output is fainter than input."""
    cursor, ground, letters = QTextCursor(block), QTextBlockFormat(), QTextCharFormat()
    ground.setBackground(QColor(theme.window))
    ground.setLeftMargin(_CODE)
    ground.setNonBreakableLines(False)  # a long line goes on below
    if _kind(block) != _kind(block.previous()):
        ground.setTopMargin(_ABOVE / 2)
    if not _is_code(block.next()):
        ground.setBottomMargin(_ABOVE)
    fixed = QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont).family()
    letters.setFontFamilies([fixed])
    letters.setForeground(QColor(theme.faint if _kind(block) in _PRINTED else theme.text))
    cursor.mergeBlockFormat(ground)
    cursor.select(QTextCursor.SelectionType.LineUnderCursor)
    cursor.mergeCharFormat(letters)


def _enlarge(block: QTextBlock, size: float) -> None:
    """Set the size of code in points."""
    larger, cursor, at = QTextCharFormat(), QTextCursor(block), block.begin()
    larger.setFontPointSize(size)
    while not at.atEnd():
        words = at.fragment()
        if _is_code(block) or words.charFormat().fontFixedPitch():
            cursor.setPosition(words.position())
            cursor.setPosition(words.position() + words.length(), QTextCursor.MoveMode.KeepAnchor)
            cursor.mergeCharFormat(larger)
        at += 1


def _space(block: QTextBlock) -> None:
    """Set the margins of a heading."""
    room = QTextBlockFormat()
    room.setTopMargin(2 * _ABOVE)
    room.setBottomMargin(_ABOVE)
    QTextCursor(block).mergeBlockFormat(room)
