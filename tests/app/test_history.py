from PySide6.QtWidgets import QApplication

from kappaskin_app.history import History
from kappaskin_app.settings import Settings


def test_a_change_is_told_and_can_be_undone(qapp: QApplication) -> None:
    history, told = History(Settings()), []
    history.changed.connect(told.append)
    history.change("Functions", -1, functions_x=5)
    history.stack.undo()
    assert [settings.functions_x for settings in told] == [5, 8]


def test_a_change_to_the_same_value_is_no_command(qapp: QApplication) -> None:
    history = History(Settings())
    history.change("Functions", -1, functions_x=8)
    assert history.stack.count() == 0


def test_the_changes_of_one_gesture_are_one_command(qapp: QApplication) -> None:
    history = History(Settings())
    gesture = history.new_gesture()
    for x in (0.01, 0.02, 0.03):
        history.change("Drag", gesture, x=x)
    history.stack.undo()
    assert (history.stack.count(), history.settings) == (1, Settings())


def test_two_gestures_are_two_commands(qapp: QApplication) -> None:
    history = History(Settings())
    for x in (0.01, 0.02):
        history.change("Drag", history.new_gesture(), x=x)
    history.stack.undo()
    assert history.settings.x == 0.01


def test_a_gesture_given_up_was_never_made(qapp: QApplication) -> None:
    history = History(Settings())
    history.change("Before", -1, x=0.07)
    gesture = history.new_gesture()
    for x in (0.01, 0.02):
        history.change("Drag", gesture, x=x)
    history.cancel(gesture)
    assert (history.settings.x, history.stack.count(), history.stack.canRedo()) == (0.07, 1, False)


def test_giving_up_a_gesture_that_changed_nothing_takes_nothing_back(qapp: QApplication) -> None:
    history = History(Settings())
    history.change("Before", -1, x=0.07)
    history.cancel(history.new_gesture())
    history.cancel(-1)
    assert history.settings.x == 0.07
