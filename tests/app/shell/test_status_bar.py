"""What is doubtful, at the foot of the window."""

from dataclasses import replace

import numpy as np
import pytest

from kappaskin import Pipeline, Setup, Simulator, load_scene
from kappaskin.estimation import FAULTS
from kappaskin.frames import Contact
from kappaskin_app.shell.status_bar import Notice, StatusBar, SteadyWarning, warnings
from kappaskin_app.theme import DARK, LIGHT, apply_look

INSIDE = Contact(np.full(2, 0.05), np.full(2, 1e-4), 0.1, 1e-3, 4e-3, 1e-5, 297, True, False)
NEAR = replace(INSIDE, near_rim=True)
SCENE, METHOD = load_scene("centre"), "least-squares"
ESTIMATE = Pipeline(SCENE.sensor(), Setup())(Simulator(SCENE).frame(0, lambda: 0.0))


def suspecting(**why: int) -> np.ndarray:
    """Codes (100,) that call so many elements, from the first on, by what they are excluded for."""
    codes = [FAULTS.index(kind) for kind, count in why.items() for _ in range(count)]
    return np.array(codes + [0] * (100 - len(codes)), np.uint8)


@pytest.mark.parametrize(
    ("contact", "strained", "words"),
    [
        (INSIDE, 0, ""),
        (NEAR, 0, "Contact near the rim: unreliable"),
        (INSIDE, 1, "1 element over 1 % strain"),
        (NEAR, 12, "12 elements over 1 % strain; contact near the rim: unreliable"),
    ],
)
def test_what_is_doubtful_is_told_in_words(contact: Contact, strained: int, words: str) -> None:
    assert warnings(replace(ESTIMATE, contact=contact), strained, METHOD) == words


@pytest.mark.parametrize(
    ("suspect", "words"),
    [
        (suspecting(stuck=1), "Element 0 (stuck) excluded"),
        (suspecting(spike=1, swapped=2), "Elements 0 (spike), 1 (swapped), 2 (swapped) excluded"),
        (suspecting(noisy=3, stuck=2), "5 elements excluded (stuck, noisy)"),
    ],
)
def test_elements_that_are_left_out_are_named(suspect: np.ndarray, words: str) -> None:
    assert warnings(replace(ESTIMATE, suspect=suspect), 0, METHOD) == words


@pytest.mark.parametrize(
    ("method", "words"),
    [
        ("finite-slope", "No convergence; least squares shown"),
        (
            "robust",
            "Too many elements contradict each other: the shape may be wrong; "
            "tare, or repair what Health lists",
        ),
    ],
)
def test_a_method_that_gave_up_says_why(method: str, words: str) -> None:
    assert warnings(replace(ESTIMATE, converged=False), 0, method) == words


def test_slopes_that_a_method_neglects_are_told_after_the_rest() -> None:
    words = "slopes reach 0.4: up to 8 % too flat; select Finite slope"
    assert warnings(ESTIMATE, 0, METHOD, 0.4) == words[0].upper() + words[1:]
    assert warnings(ESTIMATE, 1, METHOD, 0.4) == f"1 element over 1 % strain; {words}"
    assert "up to 1 % too flat" in warnings(ESTIMATE, 0, METHOD, 0.141)
    assert warnings(ESTIMATE, 0, METHOD, 0.02) == ""  # 0.02 %


def test_a_warning_takes_the_hints_place_in_the_colour_of_alarms_and_gives_it_back(qapp) -> None:
    notice = Notice("Drag the arrow")
    width = notice.minimumWidth()
    for theme in (LIGHT, DARK):
        apply_look(theme)
        qapp.processEvents()
        notice.show_warning("Too near")
        assert (notice.text(), notice.minimumWidth()) == ("Too near", width)
        assert notice.palette().color(notice.foregroundRole()).name() == theme.alert
        assert "near" in notice.toolTip().lower()
        notice.show_warning("")
        assert (notice.text(), notice.toolTip()) == ("Drag the arrow", "")
        assert notice.palette().color(notice.foregroundRole()).name() == theme.text


def test_another_hint_waits_for_the_warning_to_go(qapp) -> None:
    notice = Notice("Drag the arrow")
    notice.show_warning("Too near")
    notice.show_hint("F1: shortcuts")
    assert notice.text() == "Too near"
    notice.show_warning("")
    assert notice.text() == "F1: shortcuts"


def test_a_slope_that_wavers_is_shown_as_one() -> None:
    shown = SteadyWarning(share=0.1, kept=2.0)
    slopes = [(0.12, 0.0), (0.125, 0.2), (0.2, 0.4), (0.0, 0.6), (0.2, 0.8), (0.0, 2.7), (0.0, 2.9)]
    assert [shown(*one) for one in slopes] == [0.12, 0.12, 0.2, 0.2, 0.2, 0.2, 0.0]


def test_a_busy_machine_is_warned_of_without_flicker() -> None:
    shown = SteadyWarning(share=0.5, kept=10.0)
    delays = [0.06 if tenth % 7 < 3 else 0.0 for tenth in range(300)]
    assert {shown(delay, 0.1 * tenth) for tenth, delay in enumerate(delays)} == {0.06}
    assert shown(0.0, 41.0) == 0.0


def test_a_message_is_alone_even_where_the_bar_grows_meanwhile(qapp) -> None:
    notice = Notice("F1: shortcuts")
    bar = StatusBar(notice)
    bar.show()
    qapp.processEvents()
    bar.showMessage("connected")
    notice.setMinimumHeight(2 * bar.height())
    for _ in range(3):
        qapp.processEvents()
    hidden = not notice.isVisible()
    bar.clearMessage()
    back = notice.isVisible()
    bar.close()

    assert hidden
    assert back


def test_a_warning_that_lacks_room_is_whole_in_the_tooltip(qapp) -> None:
    notice = Notice("F1: shortcuts")
    bar = StatusBar(notice)
    bar.resize(400, 30)
    bar.show()
    words = (
        "Slopes reach 0.14: up to 1 % too flat; select Finite slope; "
        "this computer is not fast enough"
    )
    notice.show_warning(words)
    qapp.processEvents()
    cut, tip, inside = not notice.whole, notice.tip(), bar.rect().contains(notice.geometry())
    bar.resize(1200, 30)
    qapp.processEvents()
    whole = notice.whole
    bar.close()

    assert (cut, inside, whole) == (True, True, True)
    assert tip.startswith(words)
