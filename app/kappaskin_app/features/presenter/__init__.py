"""Presenter: the skin and the estimates in full screen, and as sound."""

from kappaskin_app.features.presenter.controller import SOUND_TIP, TIP, PresenterController
from kappaskin_app.features.presenter.view import PresenterView
from kappaskin_app.guard import guarded
from kappaskin_app.shell.parts import VIEW
from kappaskin_app.shell.window import MainWindow

_LAYOUT = "The skin and the estimates in full screen; Esc ends"


class PresenterFeature:
    name = "presenter"

    def install(self, shell: MainWindow) -> None:
        self._shell = shell
        shell.takeCentralWidget()
        self.presenter_view = PresenterView(shell.display.centre)
        shell.setCentralWidget(self.presenter_view)
        self.presenter = PresenterController(
            shell, self.presenter_view, shell.session, shell.display, shell.selection.load
        )
        shell.layouts.add("Presenter", _LAYOUT, full=self.presenter)
        shell.session.estimated.connect(guarded(self.presenter.receive))
        shell.display.status_shown.connect(guarded(self.presenter.follow))
        shell.display.numbers.connect(guarded(self.presenter.show_numbers))
        shell.display.object_found.connect(guarded(self.presenter.set_object))
        self.presenter_view.fitted.connect(shell.display.unit_changed)
        self._add_actions(shell)
        shell.closing.connect(guarded(self.presenter.close))

    def _add_actions(self, shell: MainWindow) -> None:
        add = shell.actions_by_name.add
        add("present", VIEW, "&Presenter", self.presenter.toggle, "F11", TIP)
        toggle = self._toggle_sound
        self._action = add("sound", VIEW, "S&ound of the force", toggle, "F12", SOUND_TIP)
        self._action.setCheckable(True)
        self.presenter.sound.ended.connect(guarded(self._show_sound))

    def _toggle_sound(self) -> None:
        self._show_sound(self.presenter.sound.toggle())

    def _show_sound(self, why_not: str) -> None:
        self._shell.notify(why_not)
        self._action.setChecked(self.presenter.sound.on)
