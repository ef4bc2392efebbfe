"""The commands `app`, `demo` and `replay`, which open the window, and `handout`."""

import ctypes
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from cyclopts import App

from kappaskin.cli import (
    DescribedFingers,
    Limit,
    ProgressLine,
    Sources,
    Switch,
    allow,
    check_output,
    fingers_of,
)
from kappaskin.errors import Refusal, lacking
from kappaskin_app import DEFAULT_SOURCE

if TYPE_CHECKING:
    from kappaskin.hand import HandDescription

app = App(name="app", help_format="markdown")
demo = App(name="demo", help_format="markdown")

_LONGEST = 1e6  # s, which Qt's timers can still count
_SETTLE = 5.0  # s before a picture is taken when no time is given


def _require_display() -> None:
    shown = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if sys.platform.startswith("linux") and not shown:
        raise Refusal(
            "expected a display (DISPLAY or WAYLAND_DISPLAY), found none; "
            "`xvfb-run kappaskin app`, or `python3 packaging/start.py` in the project's folder, "
            "opens the app on a virtual one"
        )
    other = os.environ.get("WAYLAND_DISPLAY") or os.environ.get("QT_QPA_PLATFORM", "xcb") != "xcb"
    if shown and not other and not _answers(shown):
        raise Refusal(
            f"expected a display at {shown} (DISPLAY), got no connection; start it, or try "
            "`xvfb-run -a kappaskin app`"
        )


def _answers(display: str) -> bool:
    """Whether an X server lets this process connect, or Qt would end it; True if unknown."""
    try:
        xcb = ctypes.CDLL("libxcb.so.1")
    except OSError:  # another system, or one on which `doctor` finds it missing
        return True
    xcb.xcb_connect.restype = ctypes.c_void_p
    connection = ctypes.c_void_p(xcb.xcb_connect(display.encode(), None))
    refused = bool(xcb.xcb_connection_has_error(connection))
    xcb.xcb_disconnect(connection)
    return not refused


@app.default
def run(
    file: Path | None = None,
    /,
    *,
    source: Sources = None,
    seconds: float | None = None,
    screenshot: Path | None = None,
    limit: Limit = "",
    sensor: DescribedFingers = None,
    trust: Switch = False,
) -> None:
    """Open the desktop app on a source of readings, or on a file.

    Example: `kappaskin app --source /dev/ttyACM0`

    Parameters
    ----------
    file
        A recording or a scene to play, a calibration of the sensor, a mesh as the object, or the
        description of a hand.
    source
        `sim:`, `sim:SCENE`, `replay:FILE`, `feed:NAME`, or a port or URL for pyserial; of a hand
        NAME=SOURCE for each finger, `hand:NAME`, or the file of its description. `engine:HOST` is
        what `kappaskin serve` runs in another room; its token is in KAPPASKIN_TOKEN, or asked for.
    seconds
        Close after this many seconds; the window opens with the default theme and layout.
    screenshot
        Save a picture of the window just before it closes.
    trust
        Let the scene named here, by FILE or the source, name files outside its folder.
    """
    from kappaskin.hand import is_hand, named_hand

    allow(limit)
    if file is not None and not file.is_file():
        raise Refusal(f"{file}: no such file; check its name")
    if file is not None and is_hand(file):
        if source:
            raise Refusal(f"expected {file}, which describes a hand, or --source; got both")
        source, file = [str(file)], None
    sources = fingers_of(None if source else DEFAULT_SOURCE, source, sensor)
    hand = named_hand(source[0]) if source else None
    _open(sources, seconds, screenshot, file=file, trust=trust, hand=hand)


@demo.default
def present(*, seconds: float | None = None, screenshot: Path | None = None) -> None:
    """Demonstrate telemanipulation with no hardware: a hand presses and rolls an object.

    The mouse moves and presses the object. The app shows the estimated force, radius and
    position, each with its error bar, readable from three metres. Drag on the skin moves the
    object, the wheel changes the force, the buttons select another object; Esc shows the whole
    window, F11 the full screen.

    Example: `kappaskin demo`

    Parameters
    ----------
    seconds
        Close after this many seconds; the window opens with the default theme and layout.
    screenshot
        Save a picture of the window just before it closes.
    """
    _open({"": "sim:demo"}, seconds, screenshot, presenting=True)


def _open(
    sources: Mapping[str, str],
    seconds: float | None,
    screenshot: Path | None,
    presenting: bool = False,
    file: Path | None = None,
    trust: bool = False,
    hand: "HandDescription | None" = None,
) -> None:
    if seconds is not None and not 0 < seconds <= _LONGEST:
        raise Refusal(f"expected seconds above zero, {_LONGEST:g} at most, got {seconds}")
    _require_display()
    if screenshot is not None:
        named = [source.partition(":")[2] for source in sources.values()]
        check_output(screenshot, *filter(None, [file, *named]))
        seconds = _SETTLE if seconds is None else seconds
    from kappaskin_app.launch import launch

    try:
        launch(sources, seconds, screenshot, presenting, file, trust, hand)
    except ImportError as error:
        raise lacking("app", "the desktop app", error) from error


def replay(
    file: Path,
    *,
    seconds: float | None = None,
    screenshot: Path | None = None,
    limit: Limit = "",
) -> None:
    """Open the desktop app on a recording.

    Example: `kappaskin replay press.mcap`

    Parameters
    ----------
    file
        The recording.
    seconds
        Close after this many seconds; the window opens with the default theme and layout.
    screenshot
        Save a picture of the window just before it closes.
    """
    from kappaskin.recording import Recording

    allow(limit)
    with Recording(file):  # or refused here
        _open({"": f"replay:{file.absolute()}"}, seconds, screenshot)


def handout(lesson: str, *, out: Path) -> None:
    """Write the hand-out of a lesson: texts, pictures, tasks with space for answers, no solutions.

    Example: `kappaskin handout 3 --out why-sines.pdf`

    Parameters
    ----------
    lesson
        The number of a lesson of the app, or a lesson file.
    out
        The PDF to write.
    """
    check_output(out, lesson)
    if sys.platform.startswith("linux"):
        os.environ["QT_QPA_PLATFORM"] = "offscreen"  # it needs no display
    try:
        from PySide6.QtGui import QGuiApplication

        from kappaskin_app.features.lessons.lesson_file import lesson_called
        from kappaskin_app.features.lessons.sheets import write_hand_out
    except ImportError as error:
        raise lacking("app", "the desktop app", error) from error
    application = QGuiApplication.instance() or QGuiApplication(sys.argv[:1])
    with ProgressLine() as show_progress:
        for share in write_hand_out(lesson_called(lesson), out):
            show_progress(f"{share:4.0%}")
    del application
