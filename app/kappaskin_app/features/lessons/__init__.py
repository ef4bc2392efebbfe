"""Lessons in the window, with questions judged by what it shows."""

from functools import partial

from PySide6.QtGui import QPixmap
from PySide6.QtWidgets import QWidget

from kappaskin_app.features.lessons.lesson_file import DOCKS
from kappaskin_app.features.lessons.panel import LessonPanel
from kappaskin_app.features.lessons.pointing import ControlPointer
from kappaskin_app.features.lessons.teaching import Teaching
from kappaskin_app.guard import guarded
from kappaskin_app.shell.form import Form
from kappaskin_app.shell.opening import Kind
from kappaskin_app.shell.parts import HELP
from kappaskin_app.shell.window import MainWindow

_ABOUT = "Lessons of ten to fifteen minutes, from the curvature gage to a hand that rolls a rod"
_TEACHER = "Of each lesson: goal, time, answers, common mistakes, questions to discuss"


class LessonsFeature:
    name = "lessons"

    def install(self, shell: MainWindow) -> None:
        self._shell, self.lesson = shell, LessonPanel()
        session, docks = shell.session, shell.docks
        shell.layouts.add("Teach", "The lessons above the settings")
        docks.put_above(
            "lesson",
            "Lessons",
            self.lesson,
            "settings",
            "Shift+F1",
            _ABOUT,
            layouts={"Teach": 0.25},
        )
        self.teaching = Teaching(
            *(shell.history, session, shell.display, shell),
            *(session.request_source, self._seen, shell.tasks, shell.saver),
        )
        self.pointing = ControlPointer(self._forms, self._places, docks.reveal, shell)
        self.lesson.bind(self.teaching)
        shell.opening.add(Kind("lesson", (".md",), self.teaching.open_file))
        teacher = partial(shell.guide_requested.emit, "teach")
        self.lesson.list.teacher_wanted.connect(guarded(teacher))
        shell.actions_by_name.add("teacher", HELP, "&Teacher's page", teacher, "", _TEACHER)
        docks["lesson"].closed.connect(guarded(self.teaching.leave))
        self.teaching.pointed.connect(guarded(self.pointing.point))
        self.teaching.taken_up.connect(guarded(partial(docks.reveal, "lesson")))
        self.teaching.notified.connect(guarded(shell.notify))
        shell.menus.welcome.add(
            3,
            "&Begin a lesson",
            "Fourteen lessons, from the curvature gage to a hand that rolls a rod.",
            lambda: docks.reveal("lesson"),
        )

    def _forms(self) -> list[Form]:
        return [panel for panel in self._shell.panels.all() if isinstance(panel, Form)]

    def _places(self) -> dict[str, list[QWidget]]:
        docks = self._shell.docks
        shown = {name: [docks.widget(name)] for name in DOCKS if name in docks.by_name()}
        return {**shown, **self._shell.display.places}

    def _seen(self) -> list[QPixmap]:
        """Pictures of the numbers, and of the skin with the docks beside and below it."""
        shell = self._shell
        whole = shell.display.centre.geometry()
        for dock in [*shell.docks.right, *shell.docks.below]:
            if not dock.visibleRegion().isEmpty():
                whole = whole.united(dock.geometry())
        numbers = [widget.grab() for widget in shell.display.places.get("readouts", [])]
        return [*numbers, shell.grab(whole)]
