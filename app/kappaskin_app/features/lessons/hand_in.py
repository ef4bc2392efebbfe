"""The figure to hand in: views of the window, the answers and the settings."""

from collections.abc import Iterator
from datetime import datetime
from html import escape

from PySide6.QtCore import Qt
from PySide6.QtGui import QPixmap
from PySide6.QtWidgets import QLabel, QVBoxLayout, QWidget

from kappaskin_app.features.lessons.lesson_file import SETTABLE
from kappaskin_app.features.lessons.progress import Progress
from kappaskin_app.shell.settings import Settings, form_field
from kappaskin_app.shell.settings.form_fields import Choice, Range, Several, Switch
from kappaskin_app.theme import LIGHT, palette
from kappaskin_app.widgets.parts import Label

_WIDTH, _MARGIN = 1000, 24  # px


def changed(settings: Settings) -> Iterator[str]:
    """Each setting that is not the default, as text."""
    usual = Settings()
    for name in (one for one in vars(usual) if one in SETTABLE):
        value, how = getattr(settings, name), form_field(name)
        if value == getattr(usual, name):
            continue
        text = name.replace("_", " ")
        if isinstance(how, Range):
            yield f"{text} {value * how.scale:.6g} {how.unit}".strip()
        elif isinstance(how, Choice):
            yield f"{text} {how.words(value).lower()}"
        elif isinstance(how, Several):
            yield f"{text} {', '.join(map(how.words, value))}"
        elif isinstance(how, Switch):
            yield f"{text} {'on' if value else 'off'}"
    if settings.written is not None:
        yield f"scene {settings.written.file.stem}"
    if settings.dead_elements:
        yield f"{len(settings.dead_elements)} dead elements"


def sheet(
    progress: Progress, student: str, views: list[QPixmap], settings: Settings, now: datetime
) -> QWidget:
    """The figure, to be saved as a picture: `views` one below the other, with texts."""
    made = QWidget()
    made.setPalette(palette(LIGHT))  # it is for paper
    made.setAutoFillBackground(True)
    stack = QVBoxLayout(made)
    stack.setContentsMargins(_MARGIN, _MARGIN, _MARGIN, _MARGIN)
    lesson = progress.lesson
    head = f"<h2>{escape(lesson.title)}</h2><b>{escape(student.strip())}</b>, {now:%Y-%m-%d %H:%M}"
    stack.addWidget(_words(head))
    for view in views:
        stack.addWidget(_picture(view))
    stack.addWidget(_words(_answers(progress)))
    text = "; ".join(changed(settings)) or "defaults"
    stack.addWidget(_words(f"<b>Settings:</b> {escape(text)}."))
    made.resize(_WIDTH, stack.totalHeightForWidth(_WIDTH))
    stack.activate()
    return made


def _words(text: str) -> QLabel:
    label = Label(text, rich=True, wordWrap=True)  # pyright: ignore[reportCallIssue]
    return label


def _picture(view: QPixmap) -> QLabel:
    width = _WIDTH - 2 * _MARGIN
    label = Label()
    ratio = view.devicePixelRatio()
    if view.width() > width * ratio:
        view = view.scaledToWidth(round(width * ratio), Qt.TransformationMode.SmoothTransformation)
    label.setPixmap(view)
    return label


def _answers(progress: Progress) -> str:
    rows = "".join(
        f"<tr><td>{escape(asked)}</td><td><b>{escape(given) or '&ndash;'}</b></td>"
        f"<td>{escape(outcome)}</td></tr>"
        for _, asked, given, outcome in progress.rows()
    )
    return f"<table cellpadding='4' width='100%'>{rows}</table>" if rows else "No questions."
