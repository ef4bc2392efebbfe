"""What dialogs have in common whose work goes on beside the window: a bar, words, an end."""

from collections.abc import Callable
from pathlib import Path

from PySide6.QtWidgets import (
    QDialog,
    QFormLayout,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QProgressBar,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from kappaskin.errors import Refusal
from kappaskin_app.guard import guarded
from kappaskin_app.shell.background import BackgroundTask, Tasks, Work

_WIDTH = 560  # px


class WorkDialog(QDialog):
    """Asks in a `form`, begins the `work` made of it, and shows how far that is.

    `work` tells the shares that are done and something else at its end, which `said` puts into
    words; it raises a `Refusal` where it cannot begin. It can be cancelled, and is, when it closes.
    `doing` says at the foot of the window what goes on.
    """

    def __init__(
        self,
        tasks: Tasks,
        title: str,
        verb: str,
        doing: str,
        work: Callable[[], Work],
        said: Callable[[object], str],
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self._work, self._said = work, said
        cancelled = "Cancelled; nothing was written."
        self.task = BackgroundTask(tasks, doing, self._take, self._refuse, cancelled=cancelled)
        self.setWindowTitle(title)
        self.setMinimumWidth(_WIDTH)
        self.form, self.bar, self.words = QFormLayout(), QProgressBar(), QLabel()
        self.bar.setRange(0, 1000)
        keeping = self.bar.sizePolicy()
        keeping.setRetainSizeWhenHidden(True)
        self.bar.setSizePolicy(keeping)
        self.bar.hide()  # while there is nothing to tell, or what was told came to nothing
        self.words.setWordWrap(True)
        self.begin_button, self.cancel_button = QPushButton(verb), QPushButton("&Cancel")
        self.cancel_button.setAutoDefault(False)
        self.begin_button.setToolTip("Begin, beside the window; what is in the way is told below.")
        self.begin_button.clicked.connect(guarded(lambda *_: self._begin()))
        self.cancel_button.clicked.connect(guarded(lambda *_: self.cancel()))

    def _add_buttons(self) -> None:
        """Lay out what is below the form, once that is there: Tab goes from above to below."""
        layout, buttons = QVBoxLayout(self), QHBoxLayout()
        buttons.addStretch()
        for button in (self.begin_button, self.cancel_button):
            buttons.addWidget(button)
        layout.addLayout(self.form)
        for widget in (self.bar, self.words):
            layout.addWidget(widget)
        layout.addLayout(buttons)

    def _allow(self) -> None:
        """Ask only for what makes sense."""
        self.cancel_button.setText("&Cancel" if self.busy else "C&lose")
        tip = "End it; nothing half done is left." if self.busy else "Put this away (Esc)."
        self.cancel_button.setToolTip(tip)

    @property
    def busy(self) -> bool:
        return self.task.running

    def ask(self) -> None:
        """Show it, as new unless it is at work."""
        if not self.busy:
            self.words.clear()
            self.bar.hide()
        self.show()
        self.raise_()

    def _begin(self) -> None:
        self.words.setText("Writing\N{HORIZONTAL ELLIPSIS}")
        self.bar.setValue(0)
        self.bar.show()
        self.task.begin(self._work)
        self._allow()

    def _take(self, told: object) -> None:
        if isinstance(told, float):
            self.bar.setValue(round(self.bar.maximum() * told))
        else:
            self.bar.setValue(self.bar.maximum())
            self._end(self._said(told))

    def _refuse(self, error: Exception) -> None:
        self.bar.hide()
        self._end(str(error) or type(error).__name__)

    def cancel(self) -> None:
        """End what is at work, or close."""
        self.task.cancel() if self.busy else self.reject()

    def _end(self, words: str) -> None:
        """Be done, in `words`."""
        self.task.stop()
        self.words.setText(words)
        high = self.heightForWidth(self.width())
        self.resize(self.width(), max(self.height(), high))  # or the fields would be pressed flat
        self._allow()

    def done(self, result: int) -> None:
        if self.busy:
            self.cancel()
        super().done(result)


def path_in(line: QLineEdit) -> Path:
    """The file that is named in a line."""
    return Path(line.text().strip())


def says_kind(path: Path) -> bool:
    """Whether a file's name ends in what could say its kind: `force 0.5 N` does not."""
    return path.suffix[1:2].isalpha()


def ended(name: str, ending: str) -> Path:
    """The file called `name`, with an `ending` if that lacks it: `force 0.5 N` has none."""
    path = Path(name)
    return path if path.suffix.lower() == ending else path.with_name(path.name + ending)


def with_ending(name: str, ending: str) -> Path:
    """The file that a person chose by its `name`, with an `ending` if that lacks it.

    Refused where that is another one, which is there: nobody was asked whether to write over it.
    """
    path = ended(name, ending)
    if path != Path(name) and path.exists():
        raise Refusal(f"{path} is there already: choose it by its whole name to write over it")
    return path


def named(words: str, line: QLineEdit) -> QLabel:
    label = QLabel(words)
    label.setBuddy(line)
    return label


def choosing(choose: Callable[[], None]) -> QPushButton:
    """A button that lets one choose a file."""
    button = QPushButton("Choose\N{HORIZONTAL ELLIPSIS}")
    button.setToolTip("Look for the file, instead of typing its name.")
    button.setAutoDefault(False)  # or Enter in a line would press the first of them
    button.clicked.connect(guarded(lambda *_: choose()))
    return button


def beside(line: QLineEdit, button: QPushButton) -> QHBoxLayout:
    layout = QHBoxLayout()
    layout.addWidget(line, 1)
    layout.addWidget(button)
    return layout
