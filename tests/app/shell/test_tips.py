"""Every action and every control explains itself, and not in the words that it shows anyway."""

from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractItemView,
    QAbstractSlider,
    QAbstractSpinBox,
    QComboBox,
    QLineEdit,
    QPlainTextEdit,
    QScrollBar,
    QTabBar,
    QWidget,
)

from kappaskin_app.shell.actions import plain
from kappaskin_app.shell.window import MainWindow

_ASKS = (QAbstractButton, QAbstractSlider, QAbstractSpinBox, QComboBox, QLineEdit)
_SHOWS = (QAbstractItemView, QPlainTextEdit)  # what they are in may explain them
_WHOLES = (QAbstractSpinBox, QComboBox, QAbstractItemView, QLineEdit, QTabBar)


def bare(text: str) -> str:
    return "".join(c for c in text.lower() if c.isalnum())


def explains(tip: str, *labels: str) -> bool:
    return bool(tip) and bare(tip) not in [bare(plain(label)) for label in labels]


def within_another(control: QWidget) -> bool:
    """Whether Qt made it a part of a control: a line in a box, a list that drops down."""
    parent = control.parentWidget()
    while parent is not None and not parent.isWindow():
        if isinstance(parent, _WHOLES):
            return True
        parent = parent.parentWidget()
    return parent is not None and isinstance(parent.parentWidget(), QComboBox)


def tip_of(control: QWidget) -> str:
    """Its tooltip, or as Qt shows it that of what it is in."""
    tip, around = control.toolTip(), control.parentWidget()
    while not tip and around is not None and isinstance(control, _SHOWS):
        tip, around = around.toolTip(), around.parentWidget()
    return tip


def test_every_action_and_every_control_explains_itself(window: MainWindow) -> None:
    for action in ("export", "report", "happenings"):
        window.actions_by_name[action].trigger()
    controls = [c for kind in (*_ASKS, *_SHOWS) for c in window.findChildren(kind)]
    asked = [c for c in controls if not isinstance(c, QScrollBar) and not within_another(c)]
    assert len(asked) > 150
    silent = [
        (type(c).__name__, c.objectName(), c.accessibleName(), c.parentWidget())
        for c in asked
        if c.objectName()[:3] != "qt_"
        and not explains(tip_of(c), c.accessibleName(), getattr(c, "text", str)())
    ]
    entries = window.actions_by_name.entries.items()
    told = [(name, entry.action) for name, entry in entries]
    silent += [name for name, a in told if not explains(a.toolTip(), a.text())]
    silent += [name for name, a in told if a.isEnabled() and not explains(a.statusTip(), a.text())]
    for dialog in (window.exports.dialog, window.errors.report, window.event_log):
        dialog.close()
    assert silent == []
