from dataclasses import fields, replace

import pytest
from PySide6.QtWidgets import QApplication

from kappaskin_app.shell.history import History
from kappaskin_app.shell.settings import Settings, change_text


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


def test_wishes_in_a_row_are_one_step_that_tells_the_first_and_the_last_value(
    qapp: QApplication,
) -> None:
    history = History(Settings())
    for creep in (0.02, 0.03, 0.05):
        history.request("creep", creep=creep)
    assert history.stack.undoText() == "creep 0 \N{RIGHTWARDS ARROW} 5 %"
    history.stack.undo()
    assert history.settings == Settings()


def test_a_wish_after_an_undo_is_no_part_of_what_was_before(qapp: QApplication) -> None:
    history = History(Settings())
    history.request("creep", creep=0.02)
    history.stack.undo()
    history.stack.redo()
    history.request("creep", creep=0.03)
    history.stack.undo()
    assert history.settings.creep == 0.02


def test_wishes_that_end_where_they_began_are_no_step(qapp: QApplication) -> None:
    history = History(Settings())
    history.request("show_band", show_band=True)
    history.request("show_band", show_band=False)
    assert (history.stack.count(), history.settings) == (0, Settings())


def test_more_than_settings_may_be_a_step(qapp: QApplication) -> None:
    history, seen = History(Settings()), []
    history.step("lesson step 2", seen.append, 1, 2)
    history.stack.undo()
    history.stack.redo()
    assert seen == [2, 1, 2]


def test_the_look_of_the_window_is_no_step_and_stays_when_others_are_undone(
    qapp: QApplication,
) -> None:
    history = History(Settings())
    gesture = history.new_gesture()
    history.change("Both", gesture, theme="light", x=0.01)
    history.request("letters", letters=150.0)
    look = {"theme": "light", "letters": 150.0}
    assert (history.stack.count(), history.settings) == (1, replace(Settings(), x=0.01, **look))
    history.stack.undo()
    assert history.settings == replace(Settings(), **look)
    history.stack.redo()
    history.request("theme", theme="dark")
    history.cancel(gesture)
    assert history.settings == replace(Settings(), letters=150.0)


def test_ten_thousand_steps_are_bounded_and_the_last_ones_stay(qapp: QApplication) -> None:
    history = History(Settings())
    for n in range(10_000):
        history.change("Seed", -1, noise_seed=n + 1)
    assert history.stack.count() == 500
    history.stack.setIndex(0)
    assert history.settings.noise_seed == 9_500


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("noise_rms", 0.5, "noise RMS 0.231 > 0.500 1/m"),
        ("noise_kind", "gaussian", "noise kind Uniform (Table 1) > Gaussian"),
        ("x", 0.06, "load x 50.0 > 60.0 mm"),
        ("region", "skin", "scan All elements > Around the contact"),
        ("show_truth", False, "true surface off"),
        ("udp_to", "", "publish to 127.0.0.1:9870 > nothing"),
        ("range_xx", 3.0, "colour range"),
        ("camera", (1.0,), "the view"),
        ("functions_x", 5, "basis functions in x 8 > 5"),
    ],
)
def test_a_change_is_told_in_its_own_words_and_unit(name: str, value: object, words: str) -> None:
    after = replace(Settings(), **{name: value})
    said = change_text(name, Settings(), after)
    assert said == words.replace(">", "\N{RIGHTWARDS ARROW}")


def test_every_setting_has_words() -> None:
    for field in fields(Settings):
        assert change_text(field.name, Settings(), Settings())


def of_a_hand(**others: int) -> History:
    """The history of a hand, whose other fingers have so many functions."""
    history = History(Settings())
    history.others = {name: Settings(functions_x=count) for name, count in others.items()}
    return history


def functions(history: History) -> list[int]:
    return [each.functions_x for each in (history.settings, *history.others.values())]


def test_a_request_of_all_fingers_is_undone_to_what_each_had(qapp: QApplication) -> None:
    history = of_a_hand(index=10, ring=12)
    history.set_of_all(True)
    history.request("functions_x", functions_x=5)
    assert functions(history) == [5, 5, 5]
    assert history.stack.undoText().endswith(", all fingers")
    history.stack.undo()
    assert functions(history) == [8, 10, 12]
    history.stack.redo()
    assert functions(history) == [5, 5, 5]


def test_a_request_of_one_finger_leaves_the_others_alone(qapp: QApplication) -> None:
    history = of_a_hand(index=10)
    history.request("functions_x", functions_x=5)
    assert functions(history) == [5, 10]
    history.set_of_all(True)  # in the same second, and yet a step of its own
    history.request("functions_x", functions_x=6)
    history.stack.undo()
    assert functions(history) == [5, 10]


def test_what_is_of_one_skin_is_never_set_of_all_fingers(qapp: QApplication) -> None:
    history = of_a_hand(index=10)
    history.set_of_all(True)
    history.request("force", force=0.7)
    history.reset("Reset Basis", functions_x=8, side_x=0.2)
    assert functions(history) == [8, 8]
    assert (history.others["index"].force, history.others["index"].side_x) == (
        Settings().force,
        Settings().side_x,
    )


def test_the_settings_of_another_finger_become_the_present_ones(qapp: QApplication) -> None:
    history = of_a_hand(index=10)
    history.request("functions_x", functions_x=5)
    history.show("index", instead_of="thumb")
    assert functions(history) == [10, 5]
    assert not history.stack.canUndo()
