"""The scene that is played: chosen from pictures, edited as forms and as text, planned."""

import re

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QHideEvent, QShowEvent
from PySide6.QtWidgets import QHBoxLayout, QLabel, QSplitter, QTabWidget, QVBoxLayout, QWidget

from kappaskin_app.features.scene.effects import EffectsPanel
from kappaskin_app.features.scene.gallery import GalleryPanel
from kappaskin_app.features.scene.scene_form.form import SceneForm
from kappaskin_app.features.scene.source import SceneText
from kappaskin_app.theme import LIGHT, Theme
from kappaskin_app.widgets.parts import button, text_label

_LINE = re.compile(r"\bline (\d+)")
_FORM = 420  # px: the forms, at least
_EDIT, _EFFECTS = 1, 2  # the pages
_SHARES = (5, 6)  # of the width: the forms, and the text


class SceneEditor(QWidget):
    """Forms and text of the same scene; `edited` brings the text after a change of either."""

    edited = Signal(str)
    save_wanted = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.form, self.text = SceneForm(), SceneText()
        self.name, self.message = QLabel(), text_label()
        self.message.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.save = button(
            "Save as\N{HORIZONTAL ELLIPSIS}",
            "save-scene",
            "Write the scene into a file (Ctrl+Shift+S); `kappaskin plan` and `simulate` take it.",
        )
        self._theme = LIGHT
        above = QHBoxLayout()
        above.addWidget(self.name, 1)
        above.addWidget(self.save)
        right = QWidget()
        stack = QVBoxLayout(right)
        stack.setContentsMargins(6, 0, 0, 0)
        stack.addLayout(above)
        stack.addWidget(self.text, 1)
        stack.addWidget(self.message)
        both = QSplitter(Qt.Orientation.Horizontal)
        both.addWidget(self.form)
        both.addWidget(right)
        for index, share in enumerate(_SHARES):
            both.setStretchFactor(index, share)
        both.setChildrenCollapsible(False)
        self.form.setMinimumWidth(_FORM)
        QVBoxLayout(self).addWidget(both)
        self.form.edited.connect(self.edited)
        self.text.edited.connect(self.edited)
        self.save.clicked.connect(self.save_wanted)
        self.show_refusal("")

    def show_scene(self, text: str, name: str) -> None:
        """Show the text of the scene that is called `name`."""
        self.name.setText(name)
        self.text.show_text(text)
        self.form.show_text(text)

    def show_refusal(self, why: str) -> None:
        """Say why what is written cannot be played, and mark its line; or nothing when it can."""
        line = _LINE.search(why)
        self.text.show_wrong(int(line[1]) if line else 0)
        self.message.setText(f"The last scene stays: {why}" if why else "")
        self.message.setVisible(bool(why))

    def show_theme(self, theme: Theme) -> None:
        self.message.setStyleSheet(f"color: {theme.alert};")
        self.text.show_theme(theme)


class ScenePanel(QTabWidget):
    """The gallery, the editor and the plan, a page each; `seen` says when the plan is looked at."""

    seen = Signal(bool)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.gallery, self.editor, self.effects = GalleryPanel(), SceneEditor(), EffectsPanel()
        for page, title in (
            (self.gallery, "&Gallery"),
            (self.editor, "&Edit"),
            (self.effects, "E&ffects"),
        ):
            self.addTab(page, title)
        self.setDocumentMode(True)
        self.currentChanged.connect(self._tell_seen)

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        self._tell_seen()

    def hideEvent(self, event: QHideEvent) -> None:
        super().hideEvent(event)
        self._tell_seen()

    def _tell_seen(self) -> None:
        self.seen.emit(self.isVisible() and self.currentWidget() is self.effects)

    def show_refusal(self, why: str) -> None:
        """Say why what is written is not what is played; then nothing of it can be forced."""
        self.editor.show_refusal(why)
        self.setTabText(_EDIT, "&Edit (not played)" if why else "&Edit")
        self.effects.table.setEnabled(not why)

    def show_simulated(self, simulated: bool) -> None:
        """Leave but the gallery, which leads back, where the readings are no simulation's."""
        if simulated == self.isTabEnabled(_EDIT):
            return
        why = "" if simulated else "No scene is played: choose one, or press Ctrl+M."
        for page in (_EDIT, _EFFECTS):
            self.setTabEnabled(page, simulated)
            self.setTabToolTip(page, why)

    def show_theme(self, theme: Theme) -> None:
        self.gallery.show_theme(theme)
        self.editor.show_theme(theme)
        self.effects.show_theme(theme)
