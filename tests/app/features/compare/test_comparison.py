"""A against B: the same frames, their difference, and nothing left when it ends."""

import math
from pathlib import Path

import numpy as np
import pytest

from kappaskin import Setup, load_scene
from kappaskin.pipeline import Readout
from kappaskin_app.features.compare.comparison import Pair, other_setup
from kappaskin_app.features.compare.panel import OtherForm, difference_text
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.window import MainWindow


@pytest.fixture
def pairs(window: MainWindow, until) -> list[Pair]:
    """What came of comparing in the window on the simulation."""
    found: list[Pair] = []
    window.comparison.compared.connect(found.append)
    window.actions_by_name["dock-compare"].trigger()
    until(lambda: len(found) > 0)
    return found


@pytest.mark.full
def test_both_are_of_the_same_frame_and_the_difference_is_theirs(
    window: MainWindow, pairs: list[Pair], until
) -> None:
    until(lambda: len(pairs) > 5)
    for pair in pairs:
        assert pair.a.sequence == pair.b.sequence
        assert pair.a.coefficients.shape == (8, 8)
        assert pair.b.coefficients.shape == (6, 6)
        assert np.allclose(pair.difference, pair.b.surface - pair.a.surface)
    assert np.abs(pairs[-1].difference).max() > 0


@pytest.mark.full
def test_equal_settings_differ_by_nothing(window: MainWindow, pairs: list[Pair], until) -> None:
    window.history.change("Equal", -1, other_x=8, other_y=8)
    until(lambda: pairs[-1].b.coefficients.shape == (8, 8))
    assert not pairs[-1].difference.any()
    table = window.compare.table
    until(lambda: {table.item(row, 3).text() for row in range(6)} == {"same"})


@pytest.mark.full
def test_every_figure_has_its_error_bar(window: MainWindow, pairs: list[Pair], until) -> None:
    table = window.compare.table
    until(lambda: table.rowCount() == 6)
    for row in range(6):
        for column in (1, 2):
            assert "\N{PLUS-MINUS SIGN}" in table.item(row, column).text()
    # Place and force follow from the readings; depth and curvature from the functions too.
    changed = [table.item(row, 3).text() != "same" for row in range(6)]
    assert changed == [False, False, False, True, True, True]
    # Half a minute at most, for the process that computes them.
    until(lambda: all("\N{PLUS-MINUS SIGN}" in table.item(row, 3).text() for row in (3, 4, 5)))
    for a, b, sd in pairs[-1].figures()[3:]:
        assert 0 < sd < math.hypot(a.sd, b.sd)
    assert [a.label for a, _, _ in pairs[-1].figures()] == [
        table.item(row, 0).text().rpartition(",")[0] for row in range(6)
    ]


@pytest.mark.parametrize(
    ("a", "b", "sd", "words"),
    [
        ((1.0, 0.3), (1.0, 0.3), 0.1, "same"),
        ((1.0, 0.3), (3.04, 0.04), math.nan, "+2.040"),
        ((3.0, 0.4), (1.0, 0.3), math.nan, "\N{MINUS SIGN}2.00"),
        ((1.0, 0.3), (3.04, 0.4), 0.021, "+2.040 \N{PLUS-MINUS SIGN} 0.021"),
        ((math.nan, 0.3), (3.0, 0.4), 0.1, "\N{EN DASH}"),
    ],
)
def test_a_difference_has_its_own_error_or_the_digits_of_the_smaller_one(
    a: tuple[float, float], b: tuple[float, float], sd: float, words: str
) -> None:
    one, other = (Readout("x", *each, math.nan, "mm", 1) for each in (a, b))
    assert difference_text(one, other, sd) == words
    assert difference_text(one, other._replace(words="edge: no force"), sd) == "\N{EN DASH}"


@pytest.mark.full
def test_b_is_undone_like_any_setting(window: MainWindow, pairs: list[Pair], until, qtbot) -> None:
    box = window.compare.form.editor("other_x")
    box.setValue(4)
    until(lambda: pairs[-1].b.coefficients.shape == (4, 6))
    window.history.stack.undo()
    until(lambda: pairs[-1].b.coefficients.shape == (6, 6))


@pytest.mark.full
def test_a_and_b_change_places_in_one_step(window: MainWindow, pairs: list[Pair], until) -> None:
    count = window.history.stack.count()
    window.compare.form.swap.click()
    until(lambda: pairs[-1].a.coefficients.shape == (6, 6))
    until(lambda: pairs[-1].b.coefficients.shape == (8, 8))
    assert window.history.stack.count() == count + 1
    window.history.stack.undo()
    assert window.history.settings.functions_x == 8


@pytest.mark.full
def test_a_basis_that_the_readings_do_not_decide_is_refused_for_b_alone(
    window: MainWindow, pairs: list[Pair], until
) -> None:
    window.history.change("Many", -1, other_x=12, other_y=12)
    until(lambda: "determine 140 of the 144" in window.compare.form.message.text())
    assert window.basis.message.text() == ""


@pytest.mark.full
def test_ending_it_leaves_the_window_as_it_was_and_the_engine_to_a_alone(
    window: MainWindow, until
) -> None:
    size = window.size()
    window.actions_by_name["dock-compare"].trigger()
    until(lambda: window.session.status.compared is not None)
    assert window.size() == size
    window.actions_by_name["dock-compare"].trigger()
    until(lambda: window.session.status.compared is None)
    assert not window.compare.isVisible()
    assert window.size() == size


@pytest.mark.full
def test_it_works_on_a_recording_that_stands(
    window: MainWindow, recording: Path, pairs: list[Pair], until
) -> None:
    window.playback.open_file(recording)
    until(lambda: window.display.badge.state.startswith("REPLAY"))
    window.playback.go(False)
    window.playback.seek(0.4)
    until(lambda: abs(pairs[-1].a.device_time - 0.4) < 0.02)
    window.history.change("B", -1, other_x=3)
    until(lambda: pairs[-1].b.coefficients.shape == (3, 6))
    assert abs(pairs[-1].b.device_time - 0.4) < 0.02
    until(lambda: pairs[-1].errors[3] > 0)  # once, though no other frame comes


def test_b_keeps_all_of_a_that_it_is_not_told_otherwise() -> None:
    setup = Setup(8, 9, hold=0.3, method="bayes")
    other = other_setup(Settings(), setup)
    assert (other.Ni, other.Nj, other.method, other.hold) == (6, 6, "least-squares", 0.3)


def test_nothing_is_blank(window: MainWindow, pairs: list[Pair], until, colours_in) -> None:
    until(lambda: len(pairs) > 3)
    for view in window.compare.maps.values():
        assert colours_in(window, view.map) > 30


def test_the_functions_of_b_are_named_by_the_skin(qtbot) -> None:
    form = OtherForm()
    qtbot.addWidget(form)

    def names() -> list[str]:
        each = (form.form.itemAt(row, form.form.ItemRole.LabelRole) for row in (0, 1))
        return [item.widget().text() for item in each]

    form.show_pipeline(None, load_scene("thumb-pad").sensor())
    assert names() == ["Functions, N =", "\N{MULTIPLICATION SIGN}"]
    form.show_pipeline(None, load_scene("circle").sensor())
    assert names() == ["Basis functions in x", "Basis functions in y"]
