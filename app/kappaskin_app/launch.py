"""Start of the engine, Qt and the window, and their end.

The library is imported only after the splash screen is shown.
"""

import gc
import logging
import os
import signal
import sys
import tomllib
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from importlib import import_module
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from kappaskin._files import user_folder
from kappaskin._plugins import found_plug_ins
from kappaskin._processes import preload_library
from kappaskin._text import printable
from kappaskin.errors import Refusal

if TYPE_CHECKING:
    from PySide6.QtWidgets import QApplication

    from kappaskin.hand import HandDescription
    from kappaskin.live import Engine, Fingers
    from kappaskin_app.shell.log_files import LogFiles
    from kappaskin_app.shell.recovery import Recovery
    from kappaskin_app.shell.splash import Splash
    from kappaskin_app.shell.window import MainWindow
    from kappaskin_app.theme import Theme

log = logging.getLogger("kappaskin")

_LOADED = {
    "pyvistaqt": "Loading 3-D graphics (VTK)",
    "kappaskin_app.features": "Loading panels and views",
}
"""Modules that take long to import, in this order, with the texts of the splash screen."""

_ELSEWHERE, _TOKEN = "engine:", "KAPPASKIN_TOKEN"
_IDLE = 1500  # ms from the window's start until what only charts need is loaded
_BEHIND = 5  # of 19 steps that drawing stands behind the engine when both want a core


def opened(
    source: str | Mapping[str, str],
    kept: Path | None = None,
    trusted: frozenset[Path] = frozenset(),
    hand: "HandDescription | None" = None,
) -> "tuple[QApplication, MainWindow]":
    """The application and its window, shown, on `source` or on what the last window left.

    Or on the source of each finger of a hand, by their names; `hand` describes it, if known.

    The `trusted` scenes, absolute paths, may name files outside their folders.

    Where the window is `kept` in a file it begins as it was, and until the skin is drawn a splash
    says what is being loaded; a script that opens a window for some seconds needs neither.
    """
    with _all_stays():
        preload_library()  # by the time it is wanted here, the engine's process has loaded its part
        application = _application()
        splash = _splash(kept) if kept is not None else None
        # Beside: the engine's process starts while this one loads VTK.
        fingers = {"": source} if isinstance(source, str) else source
        first = next(iter(fingers.values()))
        token = _token(first)
        with ThreadPoolExecutor(1) as beside:
            starting = beside.submit(_connected, fingers, _scene_of(first) in trusted, token)
            try:
                for module, words in _LOADED.items():
                    if splash is not None:
                        splash.say(words)
                    import_module(module)
            except BaseException:
                starting.result().close()
                raise
        engine = starting.result()
    if token:
        fingers = {finger: each.source or "" for finger, each in engine.engines.items()}
        first = next(iter(fingers.values()))
    _stand_behind()
    try:
        from PySide6.QtCore import QTimer

        from kappaskin_app.features import all_features
        from kappaskin_app.shell.background import BackgroundTask, collect_garbage_here
        from kappaskin_app.shell.recovery import settings_left
        from kappaskin_app.shell.window import MainWindow
        from kappaskin_app.widgets.chart import load_charts

        if splash is not None:
            splash.say("Building the window")
        window = MainWindow(all_features(), first, engine, trusted)
        engines = engine.engines.items()
        used = {finger: settings_left(each.resumed) for finger, each in engines if each.resumed}
        window.session.begin_fingers(fingers, hand, used)
    except BaseException:
        engine.close()
        raise
    collect_garbage_here(window)
    window.closed.connect(gc.enable)
    charts = BackgroundTask(window.tasks, "", lambda _: None)
    QTimer.singleShot(_IDLE, window, lambda: charts.run(load_charts))
    window.show()
    for plug_in in found_plug_ins():
        if plug_in.trouble:
            log.warning("plug-in %s", plug_in.text)
            window.notify(f"Plug-in {plug_in.text}.")
    if kept is not None:
        window.saver.begin(kept)
    if splash is not None:
        splash.finish(window)
    return application, window


@contextmanager
def _all_stays() -> Iterator[None]:
    """No garbage collection of loaded modules: it takes 0.3 s of a start, and 50 ms each later."""
    gc.disable()
    try:
        yield
        gc.freeze()
    finally:
        gc.enable()


def _application() -> "QApplication":
    from PySide6.QtGui import QIcon
    from PySide6.QtWidgets import QApplication

    from kappaskin.errors import Refusal

    application = QApplication.instance() or QApplication(sys.argv[:1])
    if not isinstance(application, QApplication):
        raise Refusal("expected a Qt application with widgets, got one without")
    application.setApplicationName("Kappaskin")
    application.setStyle("Fusion")
    # A desktop that shows windows by their program finds icon and name in its desktop entry.
    application.setDesktopFileName("kappaskin")
    application.setWindowIcon(QIcon(str(files("kappaskin_resources") / "icons" / "kappaskin.svg")))
    return application


def _splash(kept: Path) -> "Splash":
    from kappaskin_app.shell.splash import Splash
    from kappaskin_app.theme import apply_look

    apply_look(_theme_in(kept))
    splash = Splash()
    splash.show()
    splash.say("Loading the library")
    return splash


def _stand_behind() -> None:
    """Let this process, which draws, give way to the engine's, which must be in time."""
    if sys.platform.startswith("linux"):
        os.nice(_BEHIND)


def _scene_of(source: str) -> Path:
    """The scene file that a source may name, absolute."""
    return Path(source.removeprefix("sim:").strip()).absolute()


def _token(source: str) -> str:
    """The token for an engine in another room, asked for if need be; empty for other sources."""
    if not source.startswith(_ELSEWHERE):
        return ""
    if token := os.environ.get(_TOKEN):
        return token
    from PySide6.QtWidgets import QInputDialog, QLineEdit

    place = printable(source.removeprefix(_ELSEWHERE))
    asked = f"Token of the engine at {place}, which kappaskin serve printed there:"
    token, given = QInputDialog.getText(
        None, "Connect to an engine", asked, QLineEdit.EchoMode.Password
    )
    if not (given and token):
        raise Refusal(f"expected the token of the engine at {place} in {_TOKEN}, got none")
    return token.strip()


def _connected(sources: Mapping[str, str], trust: bool, token: str) -> "Engine | Fingers":
    """Engines that read `sources`, or one that still records for an earlier window.

    With a `token` those that already run at another machine.
    """
    from kappaskin.live import Engine, Fingers, remote_engines, resume_folder

    if token:
        return remote_engines(next(iter(sources.values())), token)
    if "" not in sources:
        fingers = Fingers(sources)
        fingers.connect(sources, trust)
        return fingers
    engine = Engine(resume_from=resume_folder())
    if engine.resumed is None:
        engine.connect(sources[""], trust)
    return engine


def launch(
    sources: Mapping[str, str],
    seconds: float | None = None,
    screenshot: Path | None = None,
    presenting: bool = False,
    file: Path | None = None,
    trust: bool = False,
    hand: "HandDescription | None" = None,
) -> None:
    """Show the window on `sources`; after `seconds` save `screenshot`, if any, and close.

    They are those of the fingers of a `hand` by their names, or one without a name.

    While it is `presenting`, what is felt fills the screen. A `file` is opened as one dropped is.
    With `trust` the scene of either may name files outside its folder.
    """
    # A signal may come in the middle of loading or of a drawing, where closing or raising would
    # leave things behind: it is only noted, and the loop closes the window.
    asked: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda got, _: asked.append(got))
    log_files = _logbook()
    # What a script opens for some seconds is the same whatever was before.
    scenes = [*map(_scene_of, sources.values()), Path(file or "").absolute()] if trust else []
    window_file = _kept_file() if seconds is None else None
    application, window = opened(sources.get("", sources), window_file, frozenset(scenes), hand)
    recovering = _recovering(window)
    full_screen = window.layouts.full_screen
    if presenting and full_screen is not None and not window.session.engine.resumed:
        full_screen.enter()
    elif seconds is None:
        window.menus.welcome.begin()
    if file is not None:
        window.opening.begin_with(file)
    from PySide6.QtCore import QTimer

    watch = QTimer(window, interval=50)  # pyright: ignore[reportCallIssue]
    watch.timeout.connect(lambda: asked and window.close())
    watch.start()
    refused: list[Refusal] = []

    def end() -> None:
        try:
            if screenshot is not None:
                window.picture(screenshot)
        except Refusal as reason:
            refused.append(reason)
        window.close()

    if seconds is not None:
        QTimer.singleShot(round(seconds * 1e3), end)
    application.exec()
    for kept in (recovering, log_files):
        if kept is not None:
            kept.close()
    if refused:
        raise refused[0]


def _kept_file() -> Path:
    """Where this user's window is kept."""
    import platformdirs

    return user_folder(platformdirs.user_config_path) / "window.toml"


def _theme_in(path: Path) -> "Theme":
    """The theme that is kept at `path`; that of a first start where none can be read.

    Errors in the file are reported when all of it is read.
    """
    from kappaskin_app.theme import DARK, THEMES

    try:
        with path.open("rb") as file:
            return THEMES[tomllib.load(file)["window"]["theme"]]
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        return DARK


def _logbook() -> "LogFiles | None":
    """What goes wrong to files, or nothing where none can be written."""
    from kappaskin_app.shell.log_files import LogFiles, log_folder

    try:
        return LogFiles(log_folder())
    except OSError as error:
        log.warning("no log file is written: %s", error)
        return None


def _recovering(window: "MainWindow") -> "Recovery | None":
    """What helps the next window after a crash of this one, or nothing where it cannot be kept."""
    from kappaskin_app.shell.recovery import Recovery, state_folder

    try:
        return Recovery(window, state_folder())
    except OSError as error:
        log.warning("the state of this window is not saved: %s", error)
        return None
