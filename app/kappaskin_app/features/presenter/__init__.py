"""The presenter: what is felt fills the screen, and sounds."""

from kappaskin_app.features.presenter.controller import SOUND_TIP, TIP, Presenting
from kappaskin_app.features.presenter.view import Stage
from kappaskin_app.guard import guarded
from kappaskin_app.shell.parts import VIEW
from kappaskin_app.shell.window import MainWindow

_LAYOUT = "The skin and what is felt fill the screen; Esc leaves"


class PresenterFeature:
    name = "presenter"

    def install(self, shell: MainWindow) -> None:
        self._shell = shell
        shell.takeCentralWidget()
        self.stage = Stage(shell.display.centre)
        shell.setCentralWidget(self.stage)
        self.presenting = Presenting(
            shell, self.stage, shell.session, shell.display, shell.selection.load
        )
        shell.layouts.add("Presenter", _LAYOUT, full=self.presenting)
        shell.session.estimated.connect(guarded(self.presenting.receive))
        shell.display.status_shown.connect(guarded(self.presenting.follow))
        shell.display.object_found.connect(guarded(self.presenting.find))
        self.stage.fitted.connect(shell.display.unit_changed)
        self._add_actions(shell)
        shell.closing.connect(guarded(self.presenting.close))

    def _add_actions(self, shell: MainWindow) -> None:
        add = shell.actions_by_name.add
        add("present", VIEW, "&Presenter", self.presenting.turn, "F11", TIP)
        self._action = add("sound", VIEW, "S&ound of the force", self._turn, "F12", SOUND_TIP)
        self._action.setCheckable(True)
        self.presenting.sound.ended.connect(guarded(self._show_sound))

    def _turn(self) -> None:
        sound, before = self.presenting.sound, self.presenting.sound.on
        self._have_sound(not before)
        if sound.on != before:  # or there is nothing to undo: nothing here can play it
            words = "sound of the force on" if sound.on else "sound of the force off"
            self._shell.history.step(words, self._have_sound, before, sound.on)

    def _have_sound(self, on: bool) -> None:
        sound = self.presenting.sound
        if sound.on != on:
            self._show_sound(sound.turn())

    def _show_sound(self, why_not: str) -> None:
        self._shell.tell(why_not)
        self._action.setChecked(self.presenting.sound.on)
