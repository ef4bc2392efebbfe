"""Teaching: the lesson in progress, its steps as undoable settings, its answers judged."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QPixmap
from PySide6.QtWidgets import QFileDialog, QWidget

from kappaskin.errors import Refusal
from kappaskin.frames import Estimate
from kappaskin_app.features.lessons.figures import RecentEstimates
from kappaskin_app.features.lessons.lesson import Lesson, LessonTask, whole
from kappaskin_app.features.lessons.lesson_file import READY, read_lesson
from kappaskin_app.features.lessons.progress import Progress
from kappaskin_app.features.lessons.sheets import sheet, write_hand_out
from kappaskin_app.guard import guarded
from kappaskin_app.shell.background import BackgroundTask, Tasks, open_another_window
from kappaskin_app.shell.display import Display
from kappaskin_app.shell.folders import proposed, recordings_folder
from kappaskin_app.shell.history import History
from kappaskin_app.shell.pictures import caption_now, chosen_file, save_view
from kappaskin_app.shell.session import Session
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.window_file import WindowSaver
from kappaskin_app.shell.work_dialog import with_ending

_FILES, _PDF = "Lesson (*.md)", "PDF (*.pdf)"


@dataclass(frozen=True)
class _Place:
    """A `step` of a lesson in progress, with its `settings`.

    `before` are the settings and the source from before the lesson.
    """

    progress: Progress | None
    step: int
    settings: Settings
    before: tuple[Settings, str] | None


class Teaching(QObject):
    """The lessons by file, with their progress; `changed` reports a change.

    `progress` is that of the present lesson, None without one; `message` says why an answer could
    not be judged, or a file not be read. `notified` brings the result of a request, `pointed` the
    controls to point at, `taken_up` reports that a lesson is resumed by undo. `connect` changes the
    source, `views` returns pictures for the figure to hand in, `tasks` writes hand-outs and
    `saver` the progress.
    """

    changed = Signal()
    notified = Signal(str)
    pointed = Signal(tuple)
    taken_up = Signal()

    def __init__(
        self,
        history: History,
        session: Session,
        display: Display,
        window: QWidget,
        connect: Callable[[str], None],
        views: Callable[[], list[QPixmap]],
        tasks: Tasks,
        saver: WindowSaver,
    ) -> None:
        super().__init__(window)
        self._history, self._session, self._display = history, session, display
        self._window, self._connect = window, connect
        self._views, self._saver, self._hand_out = views, saver, Path()
        self._writing = BackgroundTask(
            *(tasks, "Writing the hand-out", self._written),
            cancelled="Cancelled; no hand-out was written.",
        )
        self.taken: dict[str, Progress] = {}
        self.progress: Progress | None = None
        self.message = ""
        self._recent = RecentEstimates()
        self._before: tuple[Settings, str] | None = None
        session.estimated.connect(guarded(self._receive))
        history.changed.connect(guarded(lambda *_: self._recent.forget()))

    def _receive(self, estimate: Estimate) -> None:
        """Keep an estimate, unless it may still be of the settings before."""
        session, status = self._session, self._session.status
        received = status.requested == session.engine.requested.number
        if self.progress is not None and received and not (status.computing or session.making):
            self._recent.receive(estimate)

    def look(self) -> None:
        """Read the lessons that come with the program, the first time."""
        if not self.taken:
            self.taken = {str(file): self._resumed(read_lesson(file)) for file in READY}
            self.changed.emit()

    # Requests of the user.

    def open(self) -> None:
        """Ask for a file, and start the lesson in it."""
        file, _ = QFileDialog.getOpenFileName(
            self._window, "Open a lesson", str(recordings_folder()), _FILES
        )
        if file:
            self.open_file(Path(file))

    def open_file(self, file: Path) -> None:
        """Start the lesson in a file, or report why it cannot be read."""
        self.look()
        try:
            self.taken[str(file)] = self._resumed(read_lesson(file))
        except Refusal as refusal:
            self.message = str(refusal)
            self.changed.emit()
            return
        self.take(str(file))

    def take(self, file: str) -> None:
        """Start the lesson in `file`, or continue it; one on a hand in a window on that hand."""
        progress = self.taken[file]
        if (hand := progress.lesson.hand) and not self._session.source.startswith(f"hand:{hand}#"):
            open_another_window(file, "--source", f"hand:{hand}")
            self.notified.emit(f"{progress.lesson.title}: it opens in a window of its hand.")
            return
        self._go(progress, progress.step)

    def restart(self, file: str) -> None:
        """Start the lesson in `file` from its first step, without answers."""
        self.taken[file] = Progress(self.taken[file].lesson)
        self._save(self.taken[file])
        self.take(file)

    def _resumed(self, lesson: Lesson) -> Progress:
        """The progress in a lesson: that of the last window, if it is the same text."""
        progress = Progress(lesson)
        return progress.resume(self._saver.lessons.get(progress.key, ""))

    def _save(self, progress: Progress) -> None:
        self._saver.lessons[progress.key] = progress.text()
        self._saver.write()

    def leave(self) -> None:
        """Restore the settings and the source from before the lesson."""
        if self._before is None:
            return
        settings, source = self._before
        before = {name: getattr(settings, name) for name in whole({})}
        self._step("leave the lesson", _Place(None, 0, replace(self._now.settings, **before), None))
        if source != self._session.source and not source.startswith("sim:"):
            self._connect(source)

    def go(self, step: int) -> None:
        """Go to another step of the lesson."""
        if self.progress is not None and step != self.progress.step:
            self._go(self.progress, step)

    def _go(self, progress: Progress, step: int) -> None:
        lesson, step = progress.lesson, min(max(step, 0), len(progress.lesson.steps))
        sets = lesson.steps[step].sets if step < len(lesson.steps) else None
        if step <= progress.step and step < len(lesson.steps):
            sets = lesson.begins(step)
        now = self._now
        before = now.before or (now.settings, self._session.source)
        if sets is not None:
            self._simulate()
        settings = now.settings if sets is None else replace(now.settings, **whole(sets))
        self._step(f"lesson step {step + 1}", _Place(progress, step, settings, before))
        if sets is not None:
            self._play(sets)

    # The place in the lesson, which can be undone.

    @property
    def _now(self) -> _Place:
        step = self.progress.step if self.progress else 0
        return _Place(self.progress, step, self._history.settings, self._before)

    def _step(self, text: str, after: _Place) -> None:
        if after != self._now:
            self._history.step(text, self._restore, self._now, after)

    def _restore(self, place: _Place) -> None:
        """Go to a place, and apply its settings."""
        left, progress = self.progress is None, place.progress
        self.progress, self._before, self.message = progress, place.before, ""
        if progress is not None:
            progress.go(place.step)
            self._save(progress)
        if place.settings != self._history.settings:
            self._history.apply(place.settings)
        at_work = progress is not None and not progress.at_end
        self.pointed.emit(progress.lesson.steps[place.step].point if progress and at_work else ())
        self.changed.emit()
        if left and progress is not None:
            if not progress.lesson.hand:
                self._simulate()
            self.taken_up.emit()

    def answer(self, given: str) -> None:
        """Judge an answer by the figures that the window shows now."""
        if self.progress is None:
            return
        try:
            self.message = ""
            self._expect_settled(self.progress)
            self.progress.give(given, self.figures())
            self._save(self.progress)
        except Refusal as refusal:
            self.message = str(refusal)
        self.changed.emit()

    def _expect_settled(self, progress: Progress) -> None:
        """Refuse to judge a task that is not done while the window does not show the settings."""
        how = None if progress.question is None else progress.question.how
        if self._recent.settled or not isinstance(how, LessonTask):
            return
        if not how.check(self.figures()):
            raise Refusal("The window does not show the new settings yet: wait a moment.")

    def press(self, number: int) -> None:
        """Apply the settings of a button of this step."""
        if self.progress is not None and not self.progress.at_end:
            button = self.progress.lesson.steps[self.progress.step].buttons[number]
            self._put(button.label, button.sets)

    def show_how(self) -> None:
        """Apply the solution of a task."""
        question = None if self.progress is None else self.progress.question
        if question is not None and isinstance(question.how, LessonTask):
            self._history.change("Apply the solution", -1, **question.how.solution)

    def hand_in(self, student: str) -> None:
        """Ask for a file, and write the figure to hand in."""
        progress, now = self.progress, datetime.now()
        if progress is None:
            return
        settings, views = self._history.settings, self._views()
        caption = caption_now(self._session)
        try:
            path = chosen_file(
                self._window, "the figure", flat=True, name=progress.file_name(student)
            )
        except Refusal as refusal:
            self.notified.emit(str(refusal))
            return
        if path is None:
            return
        made = sheet(progress, student, views, settings, now)
        try:
            save_view(made, path, progress.lesson.title, f"{student.strip()}: {caption}")
            self.notified.emit(f"Saved {path}")
        except Refusal as refusal:
            self.notified.emit(str(refusal))
        made.deleteLater()

    def hand_out(self, file: str) -> None:
        """Ask for a file, and write the hand-out of the lesson in `file`."""
        lesson = self.taken[file].lesson
        asked = str(proposed(f"{Path(lesson.name).stem}.pdf"))
        name, _ = QFileDialog.getSaveFileName(self._window, "Save the hand-out", asked, _PDF)
        if not name:
            return
        try:
            self._hand_out = with_ending(name, ".pdf")
        except Refusal as refusal:
            self.notified.emit(str(refusal))
            return
        self._writing.run(write_hand_out, lesson, self._hand_out)

    def _written(self, share: float) -> None:
        if share == 1:
            self.notified.emit(f"Saved {self._hand_out}")

    def _put(self, text: str, sets: Mapping[str, Any]) -> None:
        """Apply settings to the simulated skin."""
        self._simulate()
        self._history.change(text, -1, **whole(sets))
        self._play(sets)

    def _simulate(self) -> None:
        session = self._session
        if not session.inside or session.status.state in ("off", "lost"):
            self._connect("sim:")

    def _play(self, sets: Mapping[str, Any]) -> None:
        session = self._session
        if "scene" in sets:
            session.seek(0.0)
        if not session.running:
            session.run(True)

    # State.

    def figures(self) -> dict[str, float | str]:
        """The figures that the window shows now, by name."""
        session = self._session
        return self._recent.figures(self._history.settings, session.status, self._display.figures)
