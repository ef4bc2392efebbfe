"""Pictures of views as PNG or SVG files, with a caption."""

from collections.abc import Callable
from datetime import datetime
from importlib import metadata
from pathlib import Path

from PySide6.QtCore import QBuffer, QPoint, QRect, QSize, Qt
from PySide6.QtGui import QFont, QFontMetrics, QImage, QPainter
from PySide6.QtSvg import QSvgGenerator
from PySide6.QtWidgets import QFileDialog, QWidget

from kappaskin._files import write_whole
from kappaskin._text import printable
from kappaskin.errors import Refusal
from kappaskin.live import Status
from kappaskin_app.shell.badge import functions_of
from kappaskin_app.shell.folders import proposed
from kappaskin_app.shell.session import Session
from kappaskin_app.shell.work_dialog import has_suffix, with_ending

_MARGIN, _TEXT = 8, 11  # px
_MOST = 1000  # px of a caption
_WRAPPED = int(Qt.TextFlag.TextWordWrap)


def caption_of(status: Status, at: float, now: datetime) -> str:
    """The caption of a view at `at` s of the device's time: device, settings, version."""
    setup, sensor = status.setup, status.sensor
    parts = [f"kappaskin {metadata.version('kappaskin')}", f"{now:%Y-%m-%d %H:%M:%S}"]
    if sensor is not None:
        parts += [f"{sensor.name} {sensor.serial_number}", f"{at:.3f} s"]
        parts.append(f"{functions_of(setup, sensor)} functions, {setup.method}")
        for name, found in (("calibration", setup.calibration), ("tare", setup.tare)):
            if found is not None:
                parts.append(f"{name} of {found.date:%Y-%m-%d %H:%M} ({found.digest[:8]})")
    return printable("  \N{MIDDLE DOT}  ".join(parts))


def caption_now(session: Session) -> str:
    """The caption of what the window shows now."""
    estimate = session.estimate
    at = estimate.device_time if estimate is not None else float("nan")
    return caption_of(session.status, at, datetime.now())


def write_png(image: QImage, path: Path, quality: int = -1) -> None:
    """Write an `image`, in any thread, packed as Qt's `quality` says; a `Refusal` if that fails."""
    packed = QBuffer()
    packed.open(QBuffer.OpenModeFlag.WriteOnly)
    image.save(packed, "PNG", quality)  # pyright: ignore[reportArgumentType, reportCallIssue]
    write_whole(path, bytes(packed.data().data()))


def save_view(
    view: QWidget,
    path: Path,
    title: str,
    caption: str,
    flat: bool = True,
    write: Callable[[QImage, Path], None] = write_png,
) -> None:
    """Write `view` as a PNG, or if it is `flat` as an SVG; `title` and `caption` go into both.

    A `Refusal` where that fails.
    """
    if path.suffix.lower() == ".png":
        write(_png(view, title, caption), path)
    elif path.suffix.lower() == ".svg" and flat:
        _save_svg(view, path, title, caption)
    else:
        kinds = ".png or .svg" if flat else ".png, since it is in three dimensions"
        raise Refusal(f"{path.name}: expected a file name that ends in {kinds}")


def _png(view: QWidget, title: str, caption: str) -> QImage:
    # A 3-D view is only in the picture of the whole window.
    seen = view.window().grab(QRect(view.mapTo(view.window(), QPoint(0, 0)), view.size()))
    ratio = seen.devicePixelRatio()
    image = QImage(_size(view, caption) * ratio, QImage.Format.Format_RGB32)
    image.setDevicePixelRatio(ratio)
    image.fill(view.palette().window().color())
    with QPainter(image) as painter:
        painter.drawPixmap(0, 0, seen)
        _write(painter, view, caption)
    for key, text in (("Title", title), ("Description", caption), ("Software", "kappaskin")):
        image.setText(key, text)
    return image


def _save_svg(view: QWidget, path: Path, title: str, caption: str) -> None:
    drawing, drawn = QSvgGenerator(), QBuffer()
    drawing.setOutputDevice(drawn)
    size = _size(view, caption)
    drawing.setSize(size)
    drawing.setViewBox(QRect(QPoint(0, 0), size))
    drawing.setTitle(title)
    drawing.setDescription(caption)
    with QPainter(drawing) as painter:
        painter.fillRect(QRect(QPoint(0, 0), size), view.palette().window())
        view.render(painter, QPoint(0, 0))
        _write(painter, view, caption)
    write_whole(path, bytes(drawn.data().data()))


def _size(view: QWidget, caption: str) -> QSize:
    """The size of the view with the lines of the caption below it."""
    return QSize(view.width(), view.height() + _lines(view, caption).height() + 2 * _MARGIN)


def _font(view: QWidget) -> QFont:
    font = view.font()
    font.setPixelSize(_TEXT)
    return font


def _lines(view: QWidget, caption: str) -> QRect:
    room = QRect(_MARGIN, view.height() + _MARGIN, view.width() - 2 * _MARGIN, _MOST)
    return QFontMetrics(_font(view)).boundingRect(room, _WRAPPED, caption)


def _write(painter: QPainter, view: QWidget, caption: str) -> None:
    painter.setPen(view.palette().windowText().color())
    painter.setFont(_font(view))
    painter.drawText(_lines(view, caption), _WRAPPED, caption)


def chosen_file(parent: QWidget, title: str, flat: bool, name: str = "") -> Path | None:
    """The file selected for a picture, if any; `name` is proposed, else `title`.

    A `Refusal` as of `with_ending`.
    """
    kinds = "Picture (*.png);;Drawing (*.svg)" if flat else "Picture (*.png)"
    asked = str(proposed(f"{name or title}.png"))
    file, kind = QFileDialog.getSaveFileName(parent, f"Export {title}", asked, kinds)
    if not file:
        return None
    return Path(file) if has_suffix(Path(file)) else with_ending(file, kind[-5:-1])
