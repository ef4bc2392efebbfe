"""Scenes that take long are made in a process beside, and no wait is for a skin left meanwhile."""

import multiprocessing
from dataclasses import replace

import numpy as np
import pytest

from kappaskin import Refusal, read_scene
from kappaskin.scenes import scene_file
from kappaskin_app.shell.background import Tasks
from kappaskin_app.shell.loads import Cache, compliance_or_refusal
from kappaskin_app.shell.session import ScenePreparation
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.simulation import (
    plate_of,
    scene_of,
    scene_or_refusal,
    with_consequences,
    written,
)


@pytest.fixture
def ahead(qapp):
    tasks = Tasks()
    yield ScenePreparation(tasks, lambda: None)
    tasks.close()


@pytest.fixture
def finish(ahead: ScenePreparation, until):
    return lambda: until(lambda: not ahead.busy)


def shaped(name: str, rim_radius: float) -> Settings:
    settings = Settings()
    changed = with_consequences(settings, scene_of(settings), "shape", name)
    return replace(settings, **changed | {"rim_radius": rim_radius})


def test_a_skin_is_computed_beside_and_as_it_would_be_here(
    ahead: ScenePreparation, finish, monkeypatch
):
    settings = shaped("disk", 0.047)
    skin = plate_of(settings), settings.edge

    assert not ahead.ready(settings)
    finish()
    assert ahead.ready(settings)
    monkeypatch.setattr(compliance_or_refusal, "_function", None)  # it is known, not computed

    here = plate_of(settings).compliance(scene_of(settings).basis)
    assert np.array_equal(compliance_or_refusal(*skin).values, here.values)


def test_a_written_scene_is_read_beside_or_refused_in_the_same_words(
    ahead: ScenePreparation, finish, monkeypatch
):
    good = replace(Settings(), written=written(scene_file("coin")))
    text = "[skin]\nside = 'wide'\n"
    bad = replace(good, written=replace(good.written, text=text))

    for settings in (good, bad):
        assert not ahead.ready(settings)
        finish()
        assert ahead.ready(settings)
    monkeypatch.setattr(scene_or_refusal, "_function", None)

    with pytest.raises(Refusal) as here:
        read_scene(text, good.written.file)
    with pytest.raises(Refusal) as beside:
        scene_of(bad)
    assert scene_of(good).name == "coin"
    assert str(beside.value) == str(here.value).replace(str(good.written.file), "coin.toml")


def test_another_skin_is_not_kept_waiting_by_the_one_before(ahead: ScenePreparation, finish):
    assert not ahead.ready(shaped("hexagon", 0.0461))

    assert not ahead.ready(shaped("disk", 0.0462))
    finish()

    assert ahead.ready(shaped("disk", 0.0462))
    assert not ahead.ready(shaped("hexagon", 0.0461))  # begun anew


def test_a_scene_is_made_here_when_the_process_dies(ahead: ScenePreparation, finish):
    settings = shaped("disk", 0.0463)
    ahead.ready(settings)

    (process,) = multiprocessing.active_children()
    process.kill()
    finish()

    assert ahead.ready(settings)
    assert scene_of(settings).plate == plate_of(settings)


def test_a_memo_forgets_what_was_asked_for_longest_ago():
    asked: list[int] = []
    memo = Cache(lambda n: asked.append(n) or n * n, 2)

    answers = [memo(n) for n in (1, 2, 1, 3, 1, 2)]

    assert answers == [1, 4, 1, 9, 1, 4]
    assert asked == [1, 2, 3, 2]
