"""Dialogs of background tasks: a form, a progress bar, a result."""

from collections.abc import Callable
from pathlib import Path

from PySide6.QtWidgets import (
    QDialog,
    QFormLayout,
    QHBoxLayout,
    QLineEdit,
    QProgressBar,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from kappaskin._text import printable
from kappaskin.errors import Refusal
from kappaskin_app.guard import guarded
from kappaskin_app.shell.background import BackgroundTask, Tasks, Work
from kappaskin_app.widgets.parts import Label

_WIDTH = 560  # px


class WorkDialog(QDialog):
    """A `form` that starts `work`, which writes the file `to`, and shows its progress.

    `work` yields shares from 0 to 1 and at last a result, which `result_text` describes; it
    raises a `Refusal` where it cannot start. Closing the dialog cancels it. `task` is its name
    in the status bar. It can start when none of the lines `needed` is empty; while it runs the
    `inputs` cannot be changed.
    """

    def __init__(
        self,
        tasks: Tasks,
        title: str,
        verb: str,
        task: str,
        work: Callable[[], Work],
        result_text: Callable[[object], str],
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self._work, self._result_text = work, result_text
        cancelled = "Cancelled; nothing was written."
        self.task = BackgroundTask(tasks, task, self._take, self._refuse, cancelled=cancelled)
        self.setWindowTitle(title)
        self.setMinimumWidth(_WIDTH)
        self.form, self.bar, self.words = QFormLayout(), QProgressBar(), Label()
        self.bar.setRange(0, 1000)
        keeping = self.bar.sizePolicy()
        keeping.setRetainSizeWhenHidden(True)
        self.bar.setSizePolicy(keeping)
        self.bar.hide()  # while there is no progress to show
        self.words.setWordWrap(True)
        self.to = QLineEdit()
        self.choose_file = browse_button(self._choose_file)
        self.needed, self.inputs = [self.to], list[QWidget]((self.to, self.choose_file))
        self.to.textChanged.connect(guarded(lambda *_: self._allow()))
        self.begin_button, self.cancel_button = QPushButton(verb), QPushButton("&Cancel")
        self.begin_button.setDefault(True)
        self.cancel_button.setAutoDefault(False)
        self.begin_button.setToolTip("Start in the background; an error is shown below.")
        self.begin_button.clicked.connect(guarded(lambda *_: self._start()))
        self.cancel_button.clicked.connect(guarded(lambda *_: self.cancel()))

    def _add_file(self, words: str, line: QLineEdit, button: QPushButton) -> None:
        """Add a line for a path, called `words`, with a button to choose it."""
        label, row = Label(words), QHBoxLayout()
        label.setBuddy(line)
        row.addWidget(line, 1)
        row.addWidget(button)
        self.form.addRow(label, row)

    def _add_buttons(self) -> None:
        """Lay out the form and what is below it, in the order of Tab."""
        layout, buttons = QVBoxLayout(self), QHBoxLayout()
        buttons.addStretch()
        for button in (self.begin_button, self.cancel_button):
            buttons.addWidget(button)
        layout.addLayout(self.form)
        for widget in (self.bar, self.words):
            layout.addWidget(widget)
        layout.addLayout(buttons)
        self._allow()

    def _allow(self) -> None:
        """Enable what can be used now."""
        self.cancel_button.setText("&Cancel" if self.busy else "C&lose")
        tip = "Cancel; no partial file is left." if self.busy else "Close (Esc)."
        self.cancel_button.setToolTip(tip)
        for widget in self.inputs:
            widget.setEnabled(not self.busy)
        complete = all(line.text().strip() for line in self.needed)
        self.begin_button.setEnabled(complete and not self.busy)

    def _choose_file(self) -> None:
        """Ask for the file to write."""

    @property
    def busy(self) -> bool:
        return self.task.running

    def ask(self) -> None:
        """Show it, without the last result unless it is running."""
        if not self.busy:
            self.words.clear()
            self.bar.hide()
        self.show()
        self.raise_()

    def _start(self) -> None:
        self.words.setText("Writing\N{HORIZONTAL ELLIPSIS}")
        self.bar.setValue(0)
        self.bar.show()
        self.task.begin(self._work)
        self._allow()

    def _take(self, item: object) -> None:
        if isinstance(item, float):
            self.bar.setValue(round(self.bar.maximum() * item))
        else:
            self.bar.setValue(self.bar.maximum())
            self._end(self._result_text(item))

    def _refuse(self, error: Exception) -> None:
        self.bar.hide()
        self._end(str(error) or type(error).__name__)

    def cancel(self) -> None:
        """Cancel the task, or close."""
        self.task.cancel() if self.busy else self.reject()

    def _end(self, words: str) -> None:
        """End the task, and show `words`."""
        self.task.stop()
        self.words.setText(printable(words, keep="\n"))
        self._allow()
        self._grow()

    def _grow(self) -> None:
        """Make room for all words, or the fields would be pressed flat."""
        self.resize(self.width(), max(self.height(), self.heightForWidth(self.width())))

    def done(self, result: int) -> None:
        if self.busy:
            self.cancel()
        super().done(result)


def path_in(line: QLineEdit) -> Path:
    """The path in a line."""
    return Path(line.text().strip())


def has_suffix(path: Path) -> bool:
    """Whether a file's name has a suffix of letters: `force 0.5 N` has none."""
    return path.suffix[1:2].isalpha()


def with_suffix(name: str, ending: str) -> Path:
    """The path `name`, with `ending` added if it lacks it: `force 0.5 N` has none."""
    path = Path(name)
    return path if path.suffix.lower() == ending else path.with_name(path.name + ending)


def with_ending(name: str, ending: str) -> Path:
    """The selected path `name`, with `ending` added if it lacks it.

    Refused where that is another file, which exists: nobody confirmed that it be overwritten.
    """
    path = with_suffix(name, ending)
    if path != Path(name) and path.exists():
        raise Refusal(f"{path} exists already: select it by its full name to overwrite it")
    return path


def browse_button(choose: Callable[[], None]) -> QPushButton:
    """A button that opens a file dialog."""
    button = QPushButton("Choose\N{HORIZONTAL ELLIPSIS}")
    button.setToolTip("Select the file in a dialog.")
    button.setAutoDefault(False)  # or Enter in a line would press the first of them
    button.clicked.connect(guarded(lambda *_: choose()))
    return button
