"""Sheets of a lesson: the hand-out, and the figure to hand in."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from datetime import datetime
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from PySide6.QtCore import QBuffer, QMarginsF, QPointF, QRectF, QSizeF, Qt, QUrl
from PySide6.QtGui import (
    QAbstractTextDocumentLayout,
    QColor,
    QGuiApplication,
    QImage,
    QPageSize,
    QPainter,
    QPdfWriter,
    QPen,
    QPixmap,
    QTextDocument,
)
from PySide6.QtWidgets import QLabel, QVBoxLayout, QWidget

from kappaskin._files import write_whole
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.pipeline import Pipeline, Setup
from kappaskin.scenes import Scene, Simulator, planned
from kappaskin.sensing import SensorLayout
from kappaskin_app.features.lessons.lesson import (
    ChoiceAnswer,
    Lesson,
    LessonTask,
    NumberAnswer,
    Question,
    Step,
    whole,
)
from kappaskin_app.features.lessons.lesson_file import SETTABLE
from kappaskin_app.features.lessons.progress import Progress
from kappaskin_app.shell.drawn_skin import FROM_THE_LEFT, MM, DrawnSkin
from kappaskin_app.shell.loads import loads_at
from kappaskin_app.shell.settings import Settings, form_field
from kappaskin_app.shell.settings.form_fields import Choice, Range, Several, Switch, setup_values
from kappaskin_app.shell.settings.shown import EstimatorSettings
from kappaskin_app.shell.simulation import scene_of
from kappaskin_app.theme import LIGHT, Colours, colours_in_use, palette
from kappaskin_app.widgets.parts import Label
from kappaskin_app.widgets.text import round_up
from kappaskin_app.widgets.tint import Tint

# The figure to hand in.

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


# The hand-out.

_DPI = 96  # px per inch of all that follows
_PAGE, _GAP = QRectF(72, 68, 650, 970), 18  # of the text of a page; between its parts
_IMAGE = int(QTextDocument.ResourceType.ImageResource)
_DOTS = 3.0  # of a picture for each px of it
_SMALL, _TEXT, _EQUATION = 11, 14, 17  # px
_QUOTED = "margin-left:40px;"  # in the style of an equation, which is a quotation in a lesson
_STYLE = (
    "h1 { font-size: 27px; } h2 { font-size: 17px; margin-bottom: 2px; } .line { margin: 4px 0; }"
)
_ROOM, _BOX = "<p>&nbsp;</p>", "\N{BALLOT BOX} &nbsp;"  # to write and to tick
_FRAME = (
    "<p class=line></p><table width='100%' border='1' cellspacing='0' cellpadding='8' "
    "style='border-style: solid; border-color: #b9bfc6'><tr><td>"
)
_INK, _PALE, _GREY = "#16191d", "#8a929b", "#b9bfc6"
_PICTURE, _SPACE = QSizeF(_PAGE.width(), 190), QRectF(0, 16, 300, 158)  # px
_MAPS = tuple(QRectF(left, 18, 135, 135) for left in (345, 515))
_TITLES = tuple(f"\N{GREEK SMALL LETTER KAPPA}{s}{s}, along {s}, in 1/m" for s in "xy")
_LAMP = np.array([-0.63, 0.25, 0.47])  # towards it; its length is its share of the light
_BACK, _ARROW, _LIFT = 0.55, 0.26, 0.012  # other light; arrow and lift of dots as shares of a side
_LOAD = "#c8321e"


def write_hand_out(lesson: Lesson, path: Path) -> Iterator[float]:
    """Write the hand-out of a lesson as a PDF; yields the share done, up to 1.

    It has the texts, the tasks with space for answers and a picture where the skin differs from the
    one before, and no solution. A `Refusal` where it cannot be written.
    """
    if path.suffix.lower() != ".pdf":
        raise Refusal(f"{path.name}: expected a file name that ends in .pdf")
    parts, drawn, image = [_title(lesson)], dict[str, Any](), QImage()
    for number, step in enumerate(lesson.steps):
        before, settings = image, drawn if step.sets is None else whole(step.sets)
        if settings != drawn:
            drawn = settings
            with suppress(Refusal):  # of a shape that is to be refused in the lesson
                image = skin_picture(replace(Settings(), **settings))
        parts.append(step_page(number, step, image if image != before else None))
        yield (number + 1) / (len(lesson.steps) + 1)
    write_whole(path, _pdf(lesson.title, parts))
    yield 1.0


def _title(lesson: Lesson) -> QTextDocument:
    document = _empty()
    document.setHtml(
        f"<h1>{escape(lesson.title)}</h1><p>{escape(lesson.learn)} About {lesson.minutes} minutes, "
        f"with the lesson open in the app.</p><p>Name: {'_' * 40} &nbsp; Date: {'_' * 16}</p>"
    )
    return document


def step_page(number: int, step: Step, image: QImage | None) -> QTextDocument:
    """A step with its picture, if there is one, and its question in a frame."""
    document, text = _empty(), QTextDocument()
    text.setMarkdown(step.text)
    text.setDefaultFont(document.defaultFont())
    words = text.toHtml().replace(_QUOTED, f"{_QUOTED} font-size: {_EQUATION}px;")
    parts = [f"<h2>{number + 1} &nbsp;{escape(step.title)}</h2>", words]
    parts += [
        f"<p class=line>Button in the app: {escape(button.label)}</p>" for button in step.buttons
    ]
    if image is not None:
        parts.append(f"<p class=line><img src='skin' width='{_PICTURE.width()}'></p>")
    if step.question is not None:
        parts.append(_asked(step.question))
    document.setHtml("".join(parts))
    document.addResource(_IMAGE, QUrl("skin"), image)
    return document


def _asked(question: Question) -> str:
    match question.how:
        case ChoiceAnswer(options=options):
            space = "".join(f"<p class=line>{_BOX}{escape(option)}</p>" for option in options)
        case NumberAnswer(unit=unit):
            space = f"{2 * _ROOM}Answer: {'_' * 18} {unit}"
        case LessonTask():
            done = "Done. What did you change, and what did you see?"
            space = f"<p class=line>{_BOX}{done}</p>{2 * _ROOM}"
    return f"{_FRAME}<b>{escape(question.text)}</b>{space}</td></tr></table>"


def _empty() -> QTextDocument:
    document, font = QTextDocument(), QGuiApplication.font()
    font.setPixelSize(_TEXT)
    document.setDefaultFont(font)
    document.setDefaultStyleSheet(_STYLE)
    document.setUseDesignMetrics(True)
    document.setDocumentMargin(0)
    document.setTextWidth(_PAGE.width())
    return document


def _pdf(title: str, parts: list[QTextDocument]) -> bytes:
    """The parts one below the other on A4 pages, none of them divided."""
    packed = QBuffer()
    packed.open(QBuffer.OpenModeFlag.WriteOnly)
    writer = QPdfWriter(packed)
    writer.setTitle(title)
    writer.setCreator("kappaskin")
    writer.setPageSize(QPageSize(QPageSize.PageSizeId.A4))
    writer.setPageMargins(QMarginsF())
    black = QAbstractTextDocumentLayout.PaintContext()
    black.palette = palette(LIGHT)
    with QPainter(writer) as painter:
        painter.scale(writer.logicalDpiX() / _DPI, writer.logicalDpiY() / _DPI)
        top, page = _PAGE.top(), 0
        for part in parts:
            high = part.size().height()
            if not page or top + high > _PAGE.bottom():
                top, page = _PAGE.top(), page + 1
                if page > 1:
                    writer.newPage()
                _number(painter, f"{title}, page {page}")
            painter.save()
            painter.translate(_PAGE.left(), top)
            painter.scale(*[min(1.0, _PAGE.height() / high)] * 2)
            part.documentLayout().draw(painter, black)
            painter.restore()
            top += high + _GAP
    return bytes(packed.data().data())


def _number(painter: QPainter, text: str) -> None:
    font = painter.font()
    font.setPixelSize(_SMALL)
    painter.setFont(font)
    painter.setPen(QColor(_PALE))
    painter.drawText(_PAGE.bottomLeft() + QPointF(0, 2 * _SMALL + 4), text)


def skin_picture(settings: Settings) -> QImage:
    """The simulated skin of the `settings`: its estimated shape, and maps of its readings.

    A `Refusal` where the readings do not determine the shape.
    """
    scene = planned(scene_of(settings))
    setup = replace(Setup(), **setup_values(settings, EstimatorSettings))
    estimate = Pipeline(scene.sensor(), setup)(Simulator(scene).frame(0, lambda: 0.0))
    image = QImage((_PICTURE * _DOTS).toSize(), QImage.Format.Format_RGB32)
    image.setDevicePixelRatio(_DOTS)
    image.fill(Qt.GlobalColor.white)
    with QPainter(image) as painter:
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        font = painter.font()
        font.setPixelSize(_SMALL)
        painter.setFont(font)
        skin = DrawnSkin(scene.plate.patch, setup.nx, setup.ny)
        _paint_skin(painter, skin, scene, estimate.surface, settings.exaggeration)
        readings = np.atleast_2d(estimate.curvature)[: 1 if scene.plate.patch.strip else 2]
        limit = round_up(float(np.nanmax(np.abs(readings))))
        tint = Tint("diverging", (-limit, limit), "1/m")
        for title, values, place in zip(_TITLES, readings, _MAPS, strict=False):
            _paint_map(painter, scene.layout, tint.rgb(values, _GREY), title, limit, place)
    return image


def _paint_skin(
    painter: QPainter, skin: DrawnSkin, scene: Scene, surface: Array, times: float
) -> None:
    """The surface (ny, nx) in m, with elements and loads, from the front and a little the left."""
    deepest = MM * float(np.nanmax(np.abs(surface)))
    times = min(times, skin.deepest / deepest) if deepest else times
    skin.height = -MM * times * np.nan_to_num(surface)
    centres = np.reshape([one.load.centre() for one in loads_at(scene, 0.0)], (-1, 2))
    tips, out = skin.place(centres)
    tails = tips + _ARROW * skin.size * out
    towards, up = np.array(FROM_THE_LEFT.towards), np.array(FROM_THE_LEFT.up)
    towards /= np.linalg.norm(towards)
    right = np.cross(up, towards) / np.linalg.norm(np.cross(up, towards))
    axes = np.array([right, np.cross(right, towards)])
    points = skin.points()
    flat = np.concatenate([points, tails]) @ axes.T
    low, high = flat.min(axis=0), flat.max(axis=0)
    scale = min(_SPACE.width() / (high - low)[0], _SPACE.height() / (high - low)[1])
    middle = np.array([_SPACE.center().x(), _SPACE.center().y()])

    def at(places: Array) -> list[QPointF]:
        return [QPointF(*p) for p in middle + scale * (places @ axes.T - (low + high) / 2)]

    faces, normals = skin.faces()[:, 1:], skin.shading()
    share = skin.values(np.abs(skin.height)) / max(float(np.abs(skin.height).max()), 1e-12)
    lit = _BACK + np.maximum(normals @ _LAMP, 0)
    rgb = np.minimum(
        colours_in_use().sequential[np.rint(255 * share).astype(int)] * lit[:, None], 255
    )
    colours, corners = rgb[faces].mean(axis=1).astype(int).tolist(), at(points)
    for k in np.argsort(points[faces].mean(axis=1) @ towards):
        colour = QColor(*colours[k])
        painter.setPen(QPen(colour, 0.5))
        painter.setBrush(colour)
        painter.drawPolygon([corners[p] for p in faces[k]])
    painter.setPen(QPen(QColor(_INK), 0.4))
    painter.setBrush(Qt.GlobalColor.white)
    alive = scene.layout.positions[scene.layout.alive]
    for point in at(skin.place(alive, _LIFT * skin.size)[0]):
        painter.drawEllipse(point, 1.6, 1.6)
    painter.setPen(QPen(QColor(_LOAD), 2))
    painter.setBrush(QColor(_LOAD))
    for tail, tip in zip(at(tails), at(tips), strict=True):
        painter.drawLine(tail, tip)
        painter.drawPolygon([tip, tip + QPointF(-4, -9), tip + QPointF(4, -9)])
    painter.setPen(QColor(_INK))
    painter.drawText(QPointF(0, 11), f"Estimated shape, drawn {times:.2g} times as deep")


def _paint_map(
    painter: QPainter, layout: SensorLayout, rgb: Colours, title: str, limit: float, room: QRectF
) -> None:
    """The readings of one quantity as squares at the elements, with the scale below."""
    patch, places = layout.patch, layout.positions
    apart = np.abs(places[:, None] - places).max(axis=-1) + np.diag(np.full(len(places), np.inf))
    px = min(room.width() / patch.a, room.height() / patch.b)
    side = 0.94 * px * min(float(apart.min()), patch.b)
    area = QRectF(room.left(), room.top(), px * patch.a, px * patch.b)
    painter.setPen(QPen(QColor(_GREY), 0.4))
    for (x, y), colour in zip(places.tolist(), rgb.tolist(), strict=True):
        painter.setBrush(QColor(*colour))
        corner = QPointF(area.left() + px * x - side / 2, area.bottom() - px * y - side / 2)
        painter.drawRect(QRectF(corner, QSizeF(side, side)))
    painter.setBrush(Qt.BrushStyle.NoBrush)
    painter.drawRect(area)
    scale = QRectF(room.left(), area.bottom() + 8, room.width(), 7)
    ramp = np.ascontiguousarray(colours_in_use().diverging[None]).tobytes()
    painter.drawImage(scale, QImage(ramp, 256, 1, QImage.Format.Format_RGB888))
    painter.setPen(QColor(_INK))
    painter.drawText(QPointF(room.left(), 11), title)
    texts = QRectF(room.left(), scale.bottom() + 1, room.width(), 16)
    for where, value in (("AlignLeft", -limit), ("AlignHCenter", 0.0), ("AlignRight", limit)):
        painter.drawText(
            texts, Qt.AlignmentFlag[where], f"{value:g}".replace("-", "\N{MINUS SIGN}")
        )
