"""The end of a lesson: what came of it, and the figure to hand in."""

from html import escape

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QLineEdit, QVBoxLayout, QWidget

from kappaskin_app.features.lessons.progress import Progress
from kappaskin_app.guard import guarded
from kappaskin_app.shell.form import well_behaved
from kappaskin_app.widgets.columns import scrolled
from kappaskin_app.widgets.parts import ELLIPSIS, button, text_label


class EndPage(QWidget):
    """Tells what came of each question; `hand_in_wanted` brings the name of who hands it in."""

    hand_in_wanted = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.text = text_label()
        self.text.setTextFormat(Qt.TextFormat.RichText)
        asked = text_label("Your name, as it is to stand on the figure:")
        self.name = QLineEdit()
        self.name.setObjectName("student")
        self.name.setMaxLength(80)
        self.name.setAccessibleName("Your name")
        self.name.setToolTip("It stands below the figure, and is kept nowhere else.")
        asked.setBuddy(self.name)
        well_behaved(self.name)
        self.save = button(
            f"&Save the figure{ELLIPSIS}",
            "hand-in",
            "One picture to hand in: the window as it is now, your answers and the settings.",
        )
        whole = QVBoxLayout(self)
        whole.setContentsMargins(0, 0, 0, 0)
        whole.addWidget(scrolled(self.text), 1)
        for widget in (asked, self.name, self.save):
            whole.addWidget(widget)
        self.name.textChanged.connect(guarded(self._allow))
        self.name.returnPressed.connect(guarded(self.save.click))
        self.save.clicked.connect(guarded(lambda *_: self.hand_in_wanted.emit(self.name.text())))
        self._allow()

    def _allow(self, *_: object) -> None:
        self.save.setEnabled(bool(self.name.text().strip()))

    def show_progress(self, progress: Progress) -> None:
        rows = "<br>".join(
            f"{escape(title)}: <b>{escape(outcome)}</b>" for title, _, _, outcome in progress.rows()
        )
        self.text.setText(
            f"<p><b>The end.</b> {escape(progress.lesson.learn)}</p><p>{rows}</p><p>Bring the "
            "window to what you would like to show, then save the figure to hand in.</p>"
        )
