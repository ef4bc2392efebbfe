"""Lessons as files: what is read, what is refused and where, how answers are judged."""

import math
import re
import runpy
import textwrap
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin import Refusal
from kappaskin.pipeline import Pipeline, Setup
from kappaskin.scenes import Simulator, planned
from kappaskin.skin import Patch
from kappaskin_app.features.lessons.expression import NUMBER, TRUTH, WORD, expression
from kappaskin_app.features.lessons.figures import (
    KINDS,
    OF_AN_ESTIMATE,
    SETTINGS,
    RecentEstimates,
)
from kappaskin_app.features.lessons.lesson import (
    UNITS,
    ChoiceAnswer,
    LessonTask,
    NumberAnswer,
    whole,
)
from kappaskin_app.features.lessons.lesson_file import (
    DOCKS,
    READY,
    SETTABLE,
    checked_setting,
    lesson_of,
    read_lesson,
)
from kappaskin_app.features.lessons.progress import Answer, Progress, judged, number_in
from kappaskin_app.shell.settings import EstimatorSettings, Settings, form_field
from kappaskin_app.shell.settings.form_fields import Range, setup_values
from kappaskin_app.shell.simulation import scene_of

TEACHER = runpy.run_path(str(Path(__file__).parents[3] / "guide_lessons.py"))
FIGURES_SEEN = [name for name in KINDS if name not in SETTINGS]
FIGURES = {"force": 0.2, "method": "bayes", "noise": math.nan, "functions_x": 8.0}
HEAD = '+++\nformat = 1\ntitle = "A"\nminutes = 5\nlearn = "B"\n+++\n'
ASK = 'question = "Q?"\nhint = "h"\nexplain = "e"\n'


def lesson(block: str):
    return lesson_of(f"{HEAD}## One\nText\n```toml\n{block}\n```\n", "x")


@pytest.mark.parametrize("file", READY, ids=lambda file: file.stem)
def test_a_lesson_takes_ten_minutes_or_so_in_short_steps(file: Path) -> None:
    read = read_lesson(file)
    assert 10 <= read.minutes <= 15
    assert 5 <= len(read.steps) <= 10
    assert read.questions >= 5
    for step in read.steps:
        sentences = step.text.replace(":", ".").split(".")
        assert max(len(sentence.split()) for sentence in sentences) <= 30, step.title
        assert len(step.text) <= 800, step.title


def test_there_are_lessons_of_everything_asked_for() -> None:
    titles = " ".join(read_lesson(file).title.lower() for file in READY)
    for word in [
        "gage",
        "shape",
        "sines",
        "functions",
        "noise",
        "cost",
        "silent",
        "hysteresis",
        "contact",
        "region",
        "mend",
        "domes",
        "two fingers",
        "roll, slide, grasp",
    ]:
        assert word in titles
    assert len(READY) >= 14


@pytest.mark.parametrize("file", READY, ids=lambda file: file.stem)
def test_what_an_answer_is_right_by_says_no_to_a_plain_window(file: Path) -> None:
    nothing_seen = dict.fromkeys(KINDS, math.nan) | {
        name: "" for name, kind in KINDS.items() if kind == WORD
    }
    for step in read_lesson(file).steps:
        if step.question is not None and isinstance(step.question.how, LessonTask):
            assert not step.question.how.check(nothing_seen), step.title


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("force > 0.1 and functions_x == 8", True),
        ("force > 0.1 and not method == 'bayes'", False),
        ("noise < 1 or noise > 1", False),
        ("0.1 < force < 0.3", True),
        ("-force + 2 * 0.2 - 0.2 / 1 == 0", True),
        ("1 / 0 > 1", False),
    ],
)
def test_an_expression_asks_of_figures_what_it_says(text: str, value: bool) -> None:
    assert expression(text, KINDS, TRUTH)(FIGURES) is value


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').system('true')",
        "force.real",
        "force[0]",
        "[x for x in (1, 2)]",
        "force ** 9 ** 9",
        "(lambda: 1)()",
        "force if 1 else 2",
        "f'{force}'",
        "force := 2",
        "unknown > 1",
        "method > 'a'",
        "method == 1",
        "force and 1",
        "not force",
        "True",
        "force",
        "force >",
        "1 is 2",
        "force\0 > 1",
        "(" * 150 + "force",
        "force > 1 " + "or force > 1 " * 40,
        "",
    ],
)
def test_an_expression_that_is_anything_else_is_refused(text: str) -> None:
    with pytest.raises(Refusal, match="expected"):
        expression(text, KINDS, TRUTH)


@pytest.mark.full
@given(st.text(max_size=60))
def test_no_text_is_an_expression_that_breaks(text: str) -> None:
    try:
        found = expression(text, KINDS, NUMBER)
    except Refusal:
        return
    assert isinstance(found(dict.fromkeys(KINDS, 1.0)), float)


@pytest.mark.parametrize(
    ("block", "line", "said"),
    [
        ("sett = {}", 10, "omitted, or one of"),
        ("\nset = { force = 99 }", 11, "force from -50 to 50"),
        ("set = { send_udp = true }", 10, "the name of a setting"),
        ("set = { theme = 'light' }", 10, "the name of a setting"),
        ("set = { functions_x = 2.5 }", 10, "whole number"),
        ("set = { functions_x = true }", 10, "from 1 to 64"),
        ("set = { force = nan }", 10, "from -50 to 50"),
        ("set = { dead_elements = [-1] }", 10, "a list of elements"),
        ("scene = '../secret'", 10, "one of bolt"),
        ("point = ['nowhere']", 10, "names of settings"),
        (f"{ASK}number = 1\ntolerance = 0", 14, "a number above zero"),
        (f"{ASK}number = 'method'\ntolerance = 1", 13, "whose value is a word"),
        (f"{ASK}number = 1\ntolerance = 1\nunit = 'furlong'", 15, "one of m, mm"),
        (f"{ASK}choices = ['a']\nright = 1", 13, "2 to 6 answers"),
        (f"{ASK}choices = ['a', 'b']\nright = 3", 14, "from 1 to 2"),
        (f"{ASK}choices = ['a', 'b']\nright = 1\nunit = 'mm'", 15, "only choices, right"),
        (f"{ASK}check = 'force'", 13, "yes or no"),
        (ASK, 10, "one of choices, number or check"),
        ("hint = 'h'", 10, "one of choices, number or check"),
        ("question = 1", 10, "one of choices"),
        ("set = 1 2", 10, "an error in it"),
        ("button = [1]", 10, "a table"),
    ],
)
def test_a_mistake_is_told_with_its_line(block: str, line: int, said: str) -> None:
    with pytest.raises(Refusal, match="expected") as refused:
        lesson(block)
    assert str(refused.value).startswith(f"x, line {line}: ")
    assert said in str(refused.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "line 1: expected a header"),
        (HEAD.replace("1", "2", 1), "line 2: expected format to be 1"),
        (HEAD, "1 to 40 steps"),
        (HEAD + "Hello\n## One\nText", "before any text"),
        (HEAD + "## One\n", "a text of 1 to"),
        (HEAD + "## One\nA\n```toml\n```\n```toml\n```\n", "one block"),
        (HEAD + "## One\nA\n```toml\nset = {}", "closed by"),
        (HEAD + "## One\nA\n" * 41, "1 to 40 steps"),
        (HEAD.replace("5", "9" * 5000) + "## One\nA", "expected TOML"),
        (HEAD.replace("5", "0x" + "f" * 5000) + "## One\nA", "expected TOML"),
        (HEAD.replace("5", '"5"') + "## One\nA", "line 4: expected minutes to be a whole number"),
    ],
)
def test_a_text_that_is_no_lesson_is_refused(text: str, said: str) -> None:
    with pytest.raises(Refusal, match="expected") as refused:
        lesson_of(text, "x")
    assert said in str(refused.value)


def test_a_file_that_is_too_large_or_not_there_is_refused(tmp_path: Path) -> None:
    large = tmp_path / "large.md"
    large.write_bytes(b"a" * 300_000)
    none = tmp_path / "none.md"
    for file, said in ((large, "at most"), (none, "none.md"), (tmp_path, "lesson in UTF-8 text")):
        with pytest.raises(Refusal, match=said):
            read_lesson(file)


@pytest.mark.parametrize("name", sorted(SETTABLE))
def test_a_lesson_may_say_of_a_setting_what_a_person_may(name: str) -> None:
    usual, how = getattr(Settings(), name), form_field(name)
    said = list(usual) if isinstance(usual, tuple) else usual
    assert checked_setting(name, said) == usual
    if isinstance(how, Range):
        assert checked_setting(name, how.most) == how.most
    for wrong in ("no such", [1], None, 1e99):
        with pytest.raises(Refusal):
            checked_setting(name, wrong)


def test_a_shape_brings_its_size_and_what_is_said_goes_before() -> None:
    sets = whole({"shape": "strip", "side_y": 0.01})
    assert sets["base_radius"] == 0.0129
    assert sets["side_y"] == 0.01
    assert sets["exaggeration"] == 30.0
    assert whole({"scene": "coin"})["written"].file.stem == "coin"
    assert whole({"scene": "coin", "functions_x": 3})["functions_x"] == 3


def test_a_number_is_right_within_its_tolerance_in_its_unit() -> None:
    question = lesson(f"{ASK}number = 'force * 0.01'\ntolerance = 0.0001\nunit = 'mm'").steps[0]
    for text, right in (("2", True), ("2,09", True), ("1.91", True), ("2.2", False), ("-2", False)):
        assert judged(question.question, text, FIGURES, Answer()).right is right
    for text in ("", "two", "nan", "inf", "2 mm"):
        with pytest.raises(Refusal, match="number without its unit"):
            judged(question.question, text, FIGURES, Answer())


def test_nothing_is_judged_by_a_number_that_is_not_there() -> None:
    question = lesson(f"{ASK}number = 'noise'\ntolerance = 1").steps[0].question
    assert isinstance(question.how, NumberAnswer)
    with pytest.raises(Refusal, match="wait"):
        judged(question, "1", FIGURES, Answer())


def test_a_minus_may_be_a_real_one() -> None:
    assert number_in(" \N{MINUS SIGN}0,53 ") == -0.53


def test_two_wrong_answers_are_explained_and_then_nothing_is_judged_any_more() -> None:
    progress = Progress(lesson(f"{ASK}choices = ['a', 'b']\nright = 2"))
    assert progress.rows() == [("One", "Q?", "", "not answered")]
    for told in (False, True, True):
        progress.give("0", FIGURES)
        assert progress.answer.closed is told
    progress.give("1", FIGURES)
    assert progress.rows() == [("One", "Q?", "a", "explained")]
    progress.go(5)
    assert progress.at_end
    assert progress.describe() == "done, 0 of 1 right"


def test_progress_comes_back_from_its_text_to_the_same_lesson_alone() -> None:
    read = lesson(f"{ASK}choices = ['a', 'b']\nright = 2")
    progress = Progress(read)
    progress.give("0", FIGURES)
    progress.give("1", FIGURES)
    progress.go(1)
    assert Progress(read).resume(progress.text()) == progress
    assert lesson(f"{ASK}choices = ['a', 'c']\nright = 2").version != read.version
    for text in (
        "",
        "3",
        "[0, 9, []]",
        "[2, 1, []]",
        '[0, 0, [[7, "a", 1, true]]]',
        "[Infinity, 1, []]",
    ):
        assert Progress(read).resume(text) == Progress(read), text


def test_names_of_figures_list_the_class() -> None:
    progress = Progress(lesson_of(READY[0].read_text("utf-8"), READY[0].name))
    progress.give("1", FIGURES)
    assert (
        progress.file_name(" Ada L\u00f6velace/.. ") == "01-curvature-gage_Ada-L\u00f6velace_1-of-8"
    )


def estimates(number: int, title: str, changes: dict[str, object], frames: int = 1):
    """Estimates of the first frames of a step of lesson `number`, with `changes` of settings."""
    read = read_lesson(READY[number - 1])
    step = [step.title for step in read.steps].index(title)
    settings = replace(Settings(), **whole({**read.begins(step), **changes}))
    scene = scene_of(settings)
    setup = replace(Setup(), **setup_values(settings, EstimatorSettings))
    pipeline, simulator = Pipeline(scene.sensor(), setup), Simulator(planned(scene))
    return [pipeline(simulator.frame(n, lambda: 0.0)) for n in range(frames)]


def words(number: int, title: str) -> str:
    """All that a step says: its text, its question, the right answer, hint and explanation."""
    step = next(step for step in read_lesson(READY[number - 1]).steps if step.title == title)
    asked = step.question
    assert asked is not None
    how = asked.how
    right = how.options[how.right] if isinstance(how, ChoiceAnswer) else ""
    return " ".join((step.text, asked.text, right, asked.hint, asked.explain))


FLAT = {"shape": "flat", "side_x": 0.05, "side_y": 0.05, "force": 0.1, "exaggeration": 10}


@pytest.mark.parametrize(
    ("number", "title", "changes", "figure", "frames", "quoted"),
    [
        (1, "Twice the force", {}, "peak_xx", 1, "is -{:.1f} 1/m."),
        (1, "Twice the force", {"force": 0.3}, "peak_xx", 1, " -{:.1f} 1/m"),
        (4, "And noise?", {}, "error_rms", 600, "about {:.2f} mm"),
        (5, "Noisy readings", {"noise_kind": "none"}, "peak_xx", 1, "curvature of {:.0f} 1/m"),
        (5, "Twice the noise", {}, "error_rms", 200, "about {:.2f} mm"),
        (5, "Twice the noise", {"noise_kind": "none"}, "error_rms", 1, "noise {:.3f} mm"),
        (5, "The position of the contact", {}, "contact_sd", 60, "It is {:.1f} mm"),
        (6, "The remaining error", {}, "error_rms", 1, "from {:.4f} mm"),
        (7, "A noisy sensor", {}, "error_rms", 400, "Around {:.2f} mm"),
        (8, "An ideal gage", {}, "error_at_load", 1, "About {:.1f} mm"),
        (8, "Rising load", {"force": 0.15}, "depth", 1, "about {:.1f} mm"),
        (9, "The Cram\u00e9r-Rao bound", {}, "contact_sd", 100, "it is {:.2f} mm"),
        (11, "A whole sensor", {}, "error_rms", 400, "About {:.3f} mm"),
        (11, "Mend it by software", {"method": "bayes"}, "error_rms", 60, "is {:.2f} mm"),
        (12, "The same material, flat", FLAT, "depth", 40, "{:.2f} mm. The dome"),
        (12, "The same material, flat", {}, "depth", 40, "header shows about {:.2f} mm"),
        (12, "A saddle", {"radius_y": -0.15}, "depth", 40, "{:.2f} mm deep"),
    ],
)
def test_a_lesson_quotes_what_the_window_shows(
    number: int, title: str, changes: dict[str, object], figure: str, frames: int, quoted: str
) -> None:
    unit = 1.0 if figure.startswith("peak") else 1e3
    found = [OF_AN_ESTIMATE[figure](e) for e in estimates(number, title, changes, frames)]
    assert quoted.format(abs(unit * sum(found) / frames)) in words(number, title)


def test_the_lessons_quote_rates_that_scenes_have() -> None:
    said, rates = words(6, "Try it"), []
    for step in read_lesson(READY[5]).steps:
        if step.title == "Try it":
            assert step.question is not None
            assert isinstance(step.question.how, LessonTask)
            for changes in ({}, step.question.how.solution):
                rates.append(scene_of(replace(Settings(), **whole({**step.sets, **changes}))).rate)
    assert "from {:.0f}/s to {:.0f}/s".format(*rates) in said


def test_two_fingers_are_told_from_the_distances_that_the_lesson_says() -> None:
    title = "Two fingers"
    for apart, told in ((0.01, 1), (0.02, 2), (0.04, 2)):
        pair = {"load_case": "two-points", "x": 0.05 - apart / 2, "x_end": 0.05 + apart / 2}
        found = estimates(9, title, pair, 20)
        assert sum(len(e.contacts) == told for e in found) >= 19, apart
        assert told == 2 or all(e.contact.single and e.contact.size > 2e-5 for e in found)
    line = estimates(9, title, {"load_case": "free-line"}, 20)
    assert not any(e.contact.single for e in line)
    assert not any(len(e.contacts) == 2 for e in line)
    assert "20 mm are enough for that. At 10 mm" in words(9, title)


def test_as_many_elements_sense_a_load_as_the_lesson_on_domes_says() -> None:
    title, said = "Fewer elements sense it", words(12, "Fewer elements sense it")
    for changes, quoted in ((FLAT, "skin {} of 100"), ({}, "dome {} of 100")):
        (estimate,) = estimates(12, title, {**changes, "noise_kind": "none"})
        sensed = (np.abs(estimate.curvature) > 3 * 0.231).any(axis=0)
        assert quoted.format(sensed.sum()) in said


def test_stiffness_and_dents_of_domes_are_those_of_the_equation_that_the_lesson_has() -> None:
    side, R, h, nu = 0.05, 0.15, 0.25e-3, 0.3
    k = np.arange(1, 241) * math.pi / side
    k4 = (k[:, None] ** 2 + k**2) ** 2
    foam = 12 * (1 - nu**2) / (h * R) ** 2  # E h / R^2, over D
    assert f"{1 + foam / k4[0, 0]:.0f} times as stiff" in words(12, "Stretching")
    assert 2.7 < foam * R**2 / k4[0, 0] < 3
    x = np.linspace(side / 2, side, 2501)
    middle = np.sin(k * side / 2)
    for stretching, quoted in (
        (foam, "half as deep {:.1f} mm"),
        (0.0, "flat skin after {:.0f} mm"),
    ):
        w = np.sin(np.outer(x, k)) @ (np.outer(middle, middle) / (k4 + stretching)) @ middle
        half = x[np.argmax(w < w[0] / 2)] - side / 2
        assert quoted.format(1e3 * half) in words(12, "A small dent")


def test_a_dome_read_as_flat_tells_the_forces_that_the_lesson_says() -> None:
    title, flat = "A dome read as flat", Patch(0.05, 0.05)
    read = read_lesson(READY[11])
    step = [step.title for step in read.steps].index(title)
    for radius, quoted in ((0.15, "gives {:.3f} N of"), (1.0, "{:.2f} N")):
        sets = {**read.begins(step), "force": 0.5, "radius_x": radius, "radius_y": radius}
        scene = scene_of(replace(Settings(), **whole(sets)))
        sensor, simulator = scene.sensor(), Simulator(scene)
        plate, layout = replace(sensor.plate, patch=flat), replace(sensor.layout, patch=flat)
        as_flat = replace(sensor, plate=plate, layout=layout)
        frames = [replace(simulator.frame(n, lambda: 0.0), truth=None) for n in range(20)]
        wrong, right = (
            [pipeline(frame).contact for frame in frames]
            for pipeline in (Pipeline(each, Setup()) for each in (as_flat, sensor))
        )
        assert quoted.format(np.mean([c.force for c in wrong])) in words(12, title)
    ratio = np.mean([c.position_sd for c in wrong]) / np.mean([c.position_sd for c in right])
    assert 18 < ratio < 20
    assert "almost 20 times as uncertain" in words(12, title)


def test_readings_of_the_fingertip_have_the_mean_and_the_rms_that_the_lesson_says() -> None:
    scene = replace(scene_of(replace(Settings(), **whole({"scene": "fingertip"}))), effects=())
    readings = Pipeline(scene.sensor(), Setup())(Simulator(scene).frame(0, lambda: 0.0)).curvature[
        0
    ]
    assert 4.5 / readings.mean() == pytest.approx(0.9, abs=0.01)
    rms = np.sqrt(np.mean(readings**2))
    assert f"RMS of the readings is {rms:.0f} 1/m" in words(7, "A noisy sensor")


def test_a_step_without_settings_begins_with_those_of_one_before() -> None:
    read = lesson_of(HEAD + "## A\nT\n```toml\nset = { force = 0.1 }\n```\n## B\nT\n## C\nT\n", "x")
    assert [step.sets for step in read.steps] == [{"force": 0.1}, None, None]
    assert read.begins(2) == {"force": 0.1}


def test_a_lesson_on_a_hand_changes_no_setting() -> None:
    head = HEAD.replace('learn = "B"', 'learn = "B"\nhand = "hold"')
    assert lesson_of(head + "## A\nT\n", "x").hand == "hold"
    with pytest.raises(Refusal, match="on a hand without set, scene and button"):
        lesson_of(head + "## A\nT\n```toml\nset = { force = 0.1 }\n```\n", "x")
    with pytest.raises(Refusal, match="line 6: expected hand to be one of explore, hold"):
        lesson_of(head.replace('"hold"', '"fist"') + "## A\nT\n", "x")


def test_the_guide_tells_of_all_there_is_and_its_example_is_a_lesson() -> None:
    guide = READY[0].with_name("README.md").read_text("utf-8")
    for name in (*FIGURES_SEEN, *SETTABLE, *DOCKS):
        assert f"`{name}`" in guide
    for unit in filter(None, UNITS):
        assert unit in guide
    lines = guide.split("    +++", 1)[1].split("\nEach step", 1)[0]
    example = lesson_of(textwrap.dedent("    +++" + lines), "example")
    question = example.steps[0].question
    assert question is not None
    scene = scene_of(replace(Settings(), **whole(example.begins(0))))
    estimate = Pipeline(scene.sensor(), Setup())(Simulator(scene).frame(0, lambda: 0.0))
    assert f"{1e3 * estimate.contact.displacement:.1f} mm" in question.explain


def test_windows_line_ends_are_read_too() -> None:
    text = f"{HEAD}## One\nText\n```toml\nset = {{ force = 0.1 }}\n```\n"
    assert lesson_of(text.replace("\n", "\r\n"), "x") == lesson_of(text, "x")


def test_figures_without_an_estimate_are_settings_and_nothing_else() -> None:
    from kappaskin import Status

    found = RecentEstimates().figures(Settings(), Status(), {})
    assert set(found) == set(KINDS)
    assert found["functions_x"] == 8.0
    assert math.isnan(found["error_rms"])


@pytest.mark.parametrize(
    "says",
    [
        "![picture](/etc/passwd)",
        "![picture][one]\n\n[one]: /etc/passwd",
        "<img src=/etc/passwd>",
        "<table background=/etc/passwd>",
        "</b>",
        "<!-- hidden -->",
    ],
)
def test_a_text_that_names_files_is_refused_with_its_line(says: str) -> None:
    with pytest.raises(Refusal, match=r"x, line 7: expected a text without pictures and HTML"):
        lesson_of(f"{HEAD}## One\nText\n{says}\n", "x")
    assert lesson_of(f"{HEAD}## One\nIf force < 2 and x<3! [a link](b)\n", "x").steps


def _notes(number: int) -> dict[str, str]:
    """The notes on a lesson that the teacher's page has below its answers, by their names."""
    page = TEACHER["PAGE"].read_text("utf-8")
    part = re.search(rf"^## {number} .*?(?=^## |\Z)", page, re.DOTALL | re.MULTILINE)[0]
    found = re.findall(r"^\*\*([\w ]+)\.\*\* (.*?)\n(?:\n|\Z)", part, re.DOTALL | re.MULTILINE)
    return {name: text.replace("\n", " ") for name, text in found}


def test_the_teachers_page_has_the_answers_that_the_lessons_accept() -> None:
    page = TEACHER["PAGE"].read_text("utf-8")
    for number, read in TEACHER["lessons"]():
        assert TEACHER["told"](number, read) in page, "run python tests/guide_lessons.py"


def test_the_teachers_page_has_notes_on_every_lesson_and_quotes_wrong_answers() -> None:
    for number, read in TEACHER["lessons"]():
        notes = _notes(number)
        assert {"Before", "Common wrong answers", "Show", "Discuss"} <= set(notes), read.title
        hows = [step.question.how for step in read.steps if step.question]
        wrong = {
            option
            for how in hows
            if isinstance(how, ChoiceAnswer)
            for option in how.options
            if option != how.options[how.right]
        }
        quoted = re.findall(r"(?<!\*)\*([^*]+)\*(?!\*)", notes["Common wrong answers"])
        assert quoted
        for quote in quoted:
            assert any(option.startswith(quote) for option in wrong), (read.title, quote)
        assert notes["Discuss"].count("?") >= 3
