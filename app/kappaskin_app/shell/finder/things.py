"""What can be found in a window: actions, settings, scenes, panels, files, pages of the guide."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial

from PySide6.QtCore import Qt
from PySide6.QtGui import QStandardItemModel
from PySide6.QtWidgets import QComboBox, QDockWidget, QTabWidget, QWidget

from kappaskin_app.shell.actions import plain
from kappaskin_app.shell.form import Form
from kappaskin_app.shell.panel import Panel
from kappaskin_app.shell.parts import Parts
from kappaskin_app.shell.settings import form_field
from kappaskin_app.shell.settings.form_fields import Choice
from kappaskin_app.widgets.layout import scroll_to

_NOT_NOW = "not with what is chosen now"


@dataclass(frozen=True)
class FinderEntry:
    """Something to find and do: what it is called, where it stands, and why it cannot be done."""

    name: str
    title: str
    place: str
    act: Callable[[], object]
    keys: str = ""
    why_not: str = ""


Things = Callable[[], Iterable[FinderEntry]]


def things_in(window: Parts, others: Iterable[Things]) -> list[FinderEntry]:
    """All that can be found in the window now, with what `others` tell."""
    return [
        *_actions(window),
        *_panels(window),
        *_settings(window),
        *_layouts(window),
        *_files(window),
        *(thing for things in others for thing in things()),
    ]


def reveal(widget: QWidget) -> None:
    """Show a widget, whichever dock and page it is on, and give it the focus."""
    for around in _around(widget):
        if isinstance(around, QTabWidget):
            around.setCurrentIndex(_page(around, widget))
        else:
            around.show()
            around.raise_()
    scroll_to(widget)
    widget.setFocus(Qt.FocusReason.ShortcutFocusReason)


def _around(widget: QWidget) -> Iterator[QTabWidget | QDockWidget]:
    """The pages and docks that a widget is in, the nearest first."""
    around = widget.parentWidget()
    while around is not None:
        if isinstance(around, QTabWidget | QDockWidget):
            yield around
        around = around.parentWidget()


def _page(pages: QTabWidget, widget: QWidget) -> int:
    """Which of the pages a widget is on."""
    page: QWidget | None = widget
    while page is not None and pages.indexOf(page) < 0:
        page = page.parentWidget()
    return -1 if page is None else pages.indexOf(page)


def _where(widget: QWidget) -> str:
    """The page or dock that a widget is on."""
    around = next(_around(widget))
    if isinstance(around, QTabWidget):
        return f"{plain(around.tabText(_page(around, widget)))} page"
    return around.windowTitle()


def _actions(window: Parts) -> Iterator[FinderEntry]:
    for name, entry in window.actions_by_name.entries.items():
        if entry.action.menu() is None:
            yield FinderEntry(
                f"action:{name}",
                plain(entry.action.text()),
                f"{plain(entry.menu)} menu",
                entry.action.trigger,
                entry.action.shortcut().toString(),
                window.actions_by_name.why_not(name),
            )


def _panels(window: Parts) -> Iterator[FinderEntry]:
    for panel in window.findChildren(Panel):
        title = panel.title()
        yield FinderEntry(f"panel:{title}", f"{title} panel", _where(panel), partial(enter, panel))


def enter(panel: QWidget) -> None:
    """Show a panel, with the focus on the first of its widgets that takes it."""
    reveal(panel)
    takes = (w for w in panel.findChildren(QWidget) if w.focusPolicy() & Qt.FocusPolicy.TabFocus)
    if (first := next((w for w in takes if w.isEnabled() and w.isVisible()), None)) is not None:
        reveal(first)


def _settings(window: Parts) -> Iterator[FinderEntry]:
    for form in window.findChildren(Form):
        for editor in form.editors():
            yield from _setting(window, form, editor)


def _setting(window: Parts, form: Form, editor: QWidget) -> Iterator[FinderEntry]:
    """The setting that `editor` is for, and each value of a choice."""
    name = editor.objectName()
    how, place = form_field(name), f"{_where(form)}, {form.title()}"
    why_not = "" if form.form.isRowVisible(editor) else _NOT_NOW
    if not editor.isEnabled():
        why_not = form.message.text() or _NOT_NOW
    title = how.label if how.label == form.title() else f"{form.title()}: {how.label}"
    yield FinderEntry(f"setting:{name}", title, place, partial(reveal, editor), "", why_not)
    if isinstance(how, Choice):
        for value, words in how.options:
            refused = why_not or _refused(editor, value)
            wish = partial(window.requests.set, name, value)
            yield FinderEntry(
                f"setting:{name}={value}", f"{title}: {words}", place, wish, "", refused
            )


def _refused(box: QWidget, value: str) -> str:
    """Why a choice cannot have a value now, if so."""
    model = box.model() if isinstance(box, QComboBox) else None
    if isinstance(box, QComboBox) and isinstance(model, QStandardItemModel):
        return "" if model.item(box.findData(value)).isEnabled() else _NOT_NOW
    return ""


def _files(window: Parts) -> Iterator[FinderEntry]:
    for file in window.opening.last_ones():
        why_not = "" if file.is_file() else "not there any more: moved or deleted"
        act = partial(window.opening.open, file)
        yield FinderEntry(f"file:{file}", f"Open {file.name}", f"{file.parent}", act, "", why_not)


def _layouts(window: Parts) -> Iterator[FinderEntry]:
    for name in window.layouts.own:
        yield FinderEntry(
            f"layout:{name}", name, "Layout menu, Your own", partial(window.layouts.choose, name)
        )
