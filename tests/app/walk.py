"""A walk through the app: pictures of its screens, and faults of their layouts.

Run `python tests/app/walk.py FOLDER` for pictures of every screen in each size and theme, and a
list of the faults found.
"""

import os
import re
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path

from PySide6.QtCore import QEvent, QRect, Qt
from PySide6.QtGui import QColor, QPalette
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractItemView,
    QAbstractScrollArea,
    QAbstractSpinBox,
    QApplication,
    QCheckBox,
    QComboBox,
    QDialog,
    QDockWidget,
    QGroupBox,
    QHeaderView,
    QLabel,
    QLineEdit,
    QMainWindow,
    QPushButton,
    QRadioButton,
    QScrollArea,
    QScrollBar,
    QSplitter,
    QStyle,
    QStyleOptionButton,
    QStyleOptionComboBox,
    QTabBar,
    QTabWidget,
    QToolButton,
    QWidget,
)

from kappaskin_app.features.guide.panel import pages as guide_pages
from kappaskin_app.shell.window import MainWindow
from kappaskin_app.widgets.line import Line

SIZES = ((1024, 700), (1440, 900), (2560, 1440))
"""Widths and heights in px of the window."""
SCENES = ("two-contacts", "failing-elements", "cylinder", "on-foam", "steep")
_DIALOGS = ("happenings", "new-sensor", "shortcuts", "report", "layout-save", "export")
_BELOW, _RIGHT = 2, 2  # px that frames of neighbours may share
_SETTLES = 0.5  # s until a fault that stays is one
_PATIENCE = 20.0  # s until a source has readings
_LEAST = 4.5  # contrast of text on its ground

Screen = tuple[str, QWidget]


# Screens.


def wait(seconds: float) -> None:
    """Let the windows live."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        QApplication.processEvents()
        time.sleep(0.005)
    QApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)


def screens(window: MainWindow, recording: Path, seconds: float = 0.4) -> Iterator[Screen]:
    """Each screen by its name, shown while it is yielded; the window is on the fingertip again.

    It has `seconds` to be drawn, and several times that where another source is connected.
    """
    yield from docks(window, seconds)
    yield from pages(window, seconds)
    yield from dialogs(window, seconds)
    yield from layouts(window, seconds)
    yield from reading(window, seconds)
    for scene in SCENES:
        yield from _source(window, f"sim:{scene}", f"scene-{scene}", seconds)
    yield from _source(window, f"replay:{recording}", "replay", seconds)


def docks(window: MainWindow, seconds: float) -> Iterator[Screen]:
    """Each dock, and each page of one that has pages."""
    for name, dock in window.docks.by_name().items():
        seen = not dock.visibleRegion().isEmpty()
        window.docks.reveal(name)
        shown = window.docks.widget(name)
        tabs = shown if isinstance(shown, QTabWidget) and name != "settings" else None
        for page in range(tabs.count() if tabs else 1):
            if tabs:
                tabs.setCurrentIndex(page)
            wait(seconds)
            yield f"dock-{name}{f'-{page + 1}' if tabs else ''}", window
        dock.setVisible(seen)


def pages(window: MainWindow, seconds: float) -> Iterator[Screen]:
    """Each page of settings, and its lower end, with the purposes of all panels shown."""
    panels = window.panels
    for page in filter(panels.isTabVisible, range(panels.count())):
        panels.setCurrentIndex(page)
        area = panels.currentWidget()
        wait(seconds)
        yield f"settings-{page + 1}", window
        for panel in panels.all():
            panel.help.setChecked(True)
        wait(seconds)
        area.verticalScrollBar().setValue(area.verticalScrollBar().maximum())
        wait(seconds)
        yield f"settings-{page + 1}-purposes", window
        for panel in panels.all():
            panel.help.setChecked(False)
    panels.setCurrentIndex(0)


def dialogs(window: MainWindow, seconds: float) -> Iterator[Screen]:
    """The finder, empty and with matches, and each dialog of an action."""
    for name in ("find", *_DIALOGS):
        if name not in window.actions_by_name.entries:
            continue
        window.actions_by_name[name].trigger()
        wait(seconds)
        opened = [w for w in QApplication.topLevelWidgets() if w.isVisible() and w is not window]
        for dialog in opened:
            if isinstance(dialog, QDialog):
                yield f"dialog-{name}", dialog
                for line in dialog.findChildren(QLineEdit) if name == "find" else ():
                    line.setText("noise")
                    wait(seconds)
                    yield f"dialog-{name}-noise", dialog
                dialog.reject()


def layouts(window: MainWindow, seconds: float) -> Iterator[Screen]:
    """Each ready layout, the presenter among them, and the banner of the first start."""
    for name in ("study", "calibrate", "teach", "presenter", "live"):
        window.actions_by_name[f"layout-{name}"].trigger()
        if name == "presenter":  # as large as the window was, not as the screen is
            size = window.size()
            window.showNormal()
            window.resize(size)
        wait(2 * seconds)
        yield f"layout-{name}", window
        window.layouts.leave_full_screen()
    window.menus.welcome.offer()
    wait(seconds)
    yield "welcome", window
    window.display.banner.hide()


def reading(window: MainWindow, seconds: float) -> Iterator[Screen]:
    """A step of each of some lessons, and some pages of the guide."""
    teaching = window.features["lessons"].teaching
    window.docks.reveal("lesson")
    teaching.look()
    for number, file in enumerate(list(teaching.taken)[::4]):
        teaching.take(file)
        for step in (0, 2):
            teaching.go(step)
            wait(2 * seconds)
            yield f"lesson-{4 * number + 1}-{step + 1}", window
    teaching.leave()
    window.docks["lesson"].hide()
    for page in guide_pages()[::4]:
        window.features["guide"].read(page)
        wait(seconds)
        yield f"guide-{page.file.stem}", window
    window.docks["guide"].close()
    _connect(window, "sim:")


def _source(window: MainWindow, source: str, name: str, seconds: float) -> Iterator[Screen]:
    _connect(window, source)
    wait(seconds)
    yield name, window
    _connect(window, "sim:")


def _connect(window: MainWindow, source: str) -> None:
    """Connect a source, and wait until its readings come."""
    if source == "sim:":  # alone, this continues the last scene
        window.session.simulate()
    else:
        window.session.request_source(source)
    end = time.monotonic() + _PATIENCE
    while time.monotonic() < end:
        status = window.session.status
        if status.source == source and status.state == "streaming" and not status.computing:
            return
        wait(0.1)


# Faults.


def faults(root: QWidget) -> list[str]:
    """What of a shown window is clipped, overlaps a neighbour or is hard to read."""
    found = _faults(root)
    if found:  # a layout may still be under way
        wait(_SETTLES)
        found &= _faults(root)
    return sorted(found)


def _faults(root: QWidget) -> set[str]:
    seen = [w for w in (root, *root.findChildren(QWidget)) if _seen(w, root)]
    found = [f"{fault}: {_named(w)}" for w in seen for fault in (*_clipped(w), *_pale(w))]
    return {*found, *(fault for w in seen for fault in _overlaps(w))}


def _seen(widget: QWidget, root: QWidget) -> bool:
    """Whether a widget is shown, if only after scrolling; docks behind a tab are not."""
    if not widget.isVisible() or widget.window() is not root.window():
        return False
    around = widget
    while around is not None and around is not root:
        if isinstance(around, QDockWidget) and around.visibleRegion().isEmpty():
            return False
        around = around.parentWidget()
    return True


def _named(widget: QWidget) -> str:
    text = _text(widget) or (widget.title() if isinstance(widget, QGroupBox) else "")
    within = widget.parentWidget()
    while within is not None and not isinstance(within, QGroupBox | QDockWidget | QDialog):
        within = within.parentWidget()
    where = type(within).__name__ if within is not None else ""
    name = f"{type(widget).__name__} {widget.objectName()} {text[:60]!r}".replace("  ", " ")
    return f"{name} in {where}"


def _text(widget: QWidget) -> str:
    if isinstance(widget, QComboBox):
        return widget.currentText()
    text = getattr(widget, "text", None)
    return text() if _has_text(widget) and callable(text) else ""


def _clipped(widget: QWidget) -> Iterator[str]:
    """What of the text of a widget has no room, or that the widget itself has none."""
    need, has = _need(widget)
    if need > has + 1:
        yield f"clipped, {has} of {need} px wide"
    lowest = _lowest(widget)
    if widget.height() < lowest - 1:
        yield f"clipped, {widget.height()} of {lowest} px high"
    parent = widget.parentWidget()
    if parent is None or widget.isWindow() or not _has_text(widget) or _scrolls(parent):
        return
    if not parent.rect().adjusted(-1, -1, 1, 1).contains(widget.geometry()):
        yield f"outside, {_place(widget.geometry())} in {_place(parent.rect())}"


def _place(at: QRect) -> str:
    return f"{at.x()},{at.y()} {at.width()}x{at.height()}"


def _scrolls(parent: QWidget) -> bool:
    return isinstance(parent.parentWidget(), QAbstractScrollArea) or isinstance(
        parent, QAbstractScrollArea | QTabBar
    )


def _has_text(widget: QWidget) -> bool:
    kinds = (QLabel, QAbstractButton, QComboBox, QAbstractSpinBox, QLineEdit, Line)
    return isinstance(widget, kinds)


def _need(widget: QWidget) -> tuple[int, int]:
    """The width in px that the text of a widget takes, and that it has."""
    wide, style, metrics = widget.width(), widget.style(), widget.fontMetrics()
    if isinstance(widget, QLabel):
        return (widget.minimumSizeHint().width() if widget.text() else 0), wide
    if isinstance(widget, QCheckBox | QRadioButton | QPushButton):
        option, part = QStyleOptionButton(), QStyle.SubElement
        widget.initStyleOption(option)
        kind = {QCheckBox: part.SE_CheckBoxContents, QRadioButton: part.SE_RadioButtonContents}
        of = next((v for k, v in kind.items() if isinstance(widget, k)), part.SE_PushButtonContents)
        rect = style.subElementRect(of, option, widget)
        flags = Qt.TextFlag.TextShowMnemonic
        return metrics.size(flags, widget.text()).width(), rect.width()
    if isinstance(widget, QToolButton):
        return (widget.minimumSizeHint().width() - 6 if widget.text() else 0), wide
    if isinstance(widget, QComboBox):
        option = QStyleOptionComboBox()
        widget.initStyleOption(option)
        field = QStyle.SubControl.SC_ComboBoxEditField
        rect = style.subControlRect(QStyle.ComplexControl.CC_ComboBox, option, field, widget)
        text = metrics.horizontalAdvance(widget.currentText())
        return (0 if widget.toolTip() and _elides(widget) else text), rect.width()
    if isinstance(widget, QAbstractSpinBox):
        line = widget.lineEdit()
        return metrics.horizontalAdvance(line.text()), line.width() - 4
    if isinstance(widget, QLineEdit) and not isinstance(widget.parent(), QAbstractSpinBox):
        shown = "" if widget.text() else widget.placeholderText()
        return metrics.horizontalAdvance(shown), wide - 8
    if isinstance(widget, QGroupBox):
        return metrics.horizontalAdvance(widget.title()), wide
    if isinstance(widget, Line):
        return (
            0 if widget.whole or widget.tip() else metrics.horizontalAdvance(widget.text())
        ), wide
    if isinstance(widget, QTabBar):
        texts = {
            n: metrics.size(Qt.TextFlag.TextShowMnemonic, widget.tabText(n)).width()
            for n in range(widget.count())
            if widget.isTabVisible(n)
        }
        # A bar with arrows shows those tabs that have room.
        lacks = [
            (t, widget.tabRect(n).width())
            for n, t in texts.items()
            if t + 8 > widget.tabRect(n).width() and not widget.tabToolTip(n)
        ]
        last = widget.tabRect(widget.count() - 1).right() + 1 if widget.count() else 0
        return (lacks or [(last, wide)])[0]
    if isinstance(widget, QScrollArea) and widget.widget() is not None:
        never = Qt.ScrollBarPolicy.ScrollBarAlwaysOff
        if widget.horizontalScrollBarPolicy() == never:
            return widget.widget().minimumSizeHint().width(), widget.viewport().width()
    if isinstance(widget, QHeaderView) and widget.orientation() == Qt.Orientation.Horizontal:
        model = widget.model()
        texts = [
            str(model.headerData(n, Qt.Orientation.Horizontal) or "") for n in range(widget.count())
        ]
        lacks = [
            (metrics.horizontalAdvance(t), widget.sectionSize(n))
            for n, t in enumerate(texts)
            if not widget.isSectionHidden(n)
            and max(map(metrics.horizontalAdvance, t.split("\n"))) > widget.sectionSize(n)
        ]
        return lacks[0] if lacks else (0, 0)
    return 0, 0


def _elides(box: QComboBox) -> bool:
    """Whether a box is made to cut a long choice, which its tooltip has."""
    return box.currentText() in box.toolTip()


def _lowest(widget: QWidget) -> int:
    """The height in px that the text of a widget takes."""
    if isinstance(widget, QLabel) and widget.text():
        if widget.wordWrap():
            return widget.heightForWidth(widget.width())
        return widget.minimumSizeHint().height()
    if isinstance(widget, QLabel | QAbstractButton) and not widget.text():
        return 0
    return widget.fontMetrics().height() if _has_text(widget) else 0


def _overlaps(parent: QWidget) -> Iterator[str]:
    """Which of the children of a widget lie on another."""
    if isinstance(
        parent,
        QAbstractScrollArea
        | QTabWidget
        | QTabBar
        | QComboBox
        | QSplitter
        | QAbstractItemView
        | QLineEdit
        | QAbstractSpinBox,
    ):
        return
    children = [
        child
        for child in parent.children()
        if isinstance(child, QWidget)
        and child.isVisible()
        and not child.isWindow()
        and not isinstance(child, QScrollBar)
        and not child.testAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        and not (isinstance(parent, QMainWindow) and child.visibleRegion().isEmpty())
    ]
    for one, other in combinations(children, 2):
        both = one.geometry() & other.geometry()
        if both.width() > _RIGHT and both.height() > _BELOW:
            size = f"{both.width()} x {both.height()} px"
            yield f"overlap of {size}: {_named(one)} and {_named(other)}"


# Contrast.


def contrast(one: QColor, other: QColor) -> float:
    """WCAG 2's contrast ratio of two colours."""
    light, dark = sorted((_luminance(one) + 0.05, _luminance(other) + 0.05), reverse=True)
    return light / dark


def _luminance(colour: QColor) -> float:
    shares = (colour.redF(), colour.greenF(), colour.blueF())
    r, g, b = (s / 12.92 if s <= 0.04045 else ((s + 0.055) / 1.055) ** 2.4 for s in shares)
    return 0.2126 * r + 0.7152 * g + 0.0722 * b


def _pale(widget: QWidget) -> Iterator[str]:
    """Which text of a widget is hard to read on its ground; what is disabled may be."""
    if not _has_text(widget) or not widget.isEnabled() or not _text(widget):
        return
    ground = _ground(widget)
    own = re.search(r"^color:\s*(#[0-9a-fA-F]{6})", widget.styleSheet())
    inks = {own[1] if own else widget.palette().color(widget.foregroundRole()).name()}
    if isinstance(widget, QLabel):
        inks |= set(re.findall(r"color:\s*(#[0-9a-f]{6})", widget.text()))
    for ink in inks:
        if (ratio := contrast(QColor(ink), ground)) < _LEAST:
            yield f"contrast {ratio:.1f} of {ink} on {ground.name()}"


def _ground(widget: QWidget) -> QColor:
    """The colour behind the text of a widget."""
    roles = QPalette.ColorRole
    if isinstance(widget, QLineEdit | QAbstractSpinBox):
        return widget.palette().color(roles.Base)
    if isinstance(widget, QPushButton | QComboBox):
        return widget.palette().color(roles.Button)
    around: QWidget = widget
    while True:
        sheet = re.search(r"background(?:-color)?:\s*(#[0-9a-fA-F]{6}|white)", around.styleSheet())
        if sheet:
            return QColor(sheet[1])
        if around.autoFillBackground() or around.isWindow():
            return around.palette().color(around.backgroundRole())
        around = around.parentWidget()


# Pictures.


def picture(screen: QWidget, file: Path) -> None:
    screen.grab().save(str(file))


def walk(folder: Path) -> None:
    """Save each screen in each size and theme in a folder, and print what is wrong with it."""
    from kappaskin.cli import main
    from kappaskin_app.launch import opened

    folder.mkdir(parents=True, exist_ok=True)
    recording = Path("press.mcap").absolute()
    if main(["record", "sim:centre", str(recording), "--seconds", "3"]) != 0:
        raise SystemExit("No recording was made")
    _, window = opened("sim:")
    wait(3.0)
    found = defaultdict[str, list[str]](list)
    for theme in ("dark", "light"):
        window.requests.set("theme", theme)
        for size in SIZES:
            window.resize(*size)
            wait(0.5)
            for name, screen in screens(window, recording):
                called = f"{size[0]}-{theme}-{name}"
                picture(screen, folder / f"{called}.png")
                wide = screen.width() - size[0], screen.height() - size[1]
                large = [f"the window is {wide} px too large"] if max(wide) > 0 else []
                for fault in (*faults(screen), *large):
                    found[fault].append(called)
    window.close()
    for fault, where in sorted(found.items()):
        print(f"{fault}  [{len(where)}: {', '.join(where[:3])}]")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        raise SystemExit("Expected a folder for the pictures: python tests/app/walk.py FOLDER")
    into = Path(sys.argv[1]).absolute()
    with tempfile.TemporaryDirectory() as scratch:
        os.environ["XDG_DOCUMENTS_DIR"] = scratch
        os.chdir(scratch)
        walk(into)
