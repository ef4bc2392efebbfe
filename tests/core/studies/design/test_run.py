"""A study at work: the same numbers whoever computes them, each once, and when it stops."""

import json
import math
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from threading import Lock, Timer

import numpy as np
import pytest
import scipy

from kappaskin import LeastSquares, Patch, Refusal, Simulator, SineBasis
from kappaskin.studies import StudyFolder, run_study
from kappaskin.studies.design.results import BlockTask, Mean, run_task, stored_results, version

NOISES = '[[vary]]\n"effects.uniform-noise.rms" = [0.1, 0.4]\n'
DRAWN = NOISES + '[[draw]]\nwhat = "touch[1].x"\nkind = "uniform"\nlow = 0.03\nhigh = 0.07\n'
GRID = Patch(0.1, 0.1).grid(101, 101)


class Here:
    """Computes in this process, as `done` says, at once."""

    count = 2

    def __init__(self, done=run_task):
        self.done, self.tasks = done, list[BlockTask]()

    def submit(self, task):
        self.tasks.append(task)
        future = Future()
        try:
            future.set_result(self.done(task))
        except Exception as error:
            future.set_exception(error)
        return future


def quiet(line):
    pass


def computed(study, path, workers=None):
    return run_study(study, StudyFolder.opened(path, study), workers or Here(), quiet)


def results(known):
    """All that is known of each point."""
    return [
        (one.done, one.failures, *(one.mean(name) for name in one.study.measures)) for one in known
    ]


def task_of(study, block=0):
    return BlockTask(next(study.points()).document, block, version())


def test_a_block_is_what_a_loop_over_its_frames_gives(study_of):
    study = study_of("", ("frames = 5", "frames = 40"))
    task = task_of(study)
    scene = replace(study.base.scene, seed=task.seed)
    fit = LeastSquares(SineBasis(scene.plate.patch, 4, 4), scene.layout)
    fitted, true = (basis.on_grid(*GRID) for basis in (fit.basis, scene.basis))
    simulator, scan = Simulator(scene), scene.sensor().scan()
    errors = []
    for time in (np.arange(40) / scene.rate).tolist():
        truth, read = simulator.reading(scan, time)
        off = fitted(fit(read.reshape(3, -1)).coefficients) - true(truth.coefficients)
        errors.append(np.sqrt(np.mean(off**2)))

    found = run_task(task)["rms"]

    assert found.count == 40
    np.testing.assert_allclose(found.mean, np.mean(errors), rtol=1e-12)
    np.testing.assert_allclose(found.squares, 40 * np.var(errors), rtol=1e-10)


def test_a_task_gives_the_same_numbers_whatever_else_is_measured(study_of):
    few, many = study_of(DRAWN), study_of(DRAWN, ('["rms"]', '["covered", "rms"]'))

    assert run_task(task_of(few))["rms"] == run_task(task_of(many))["rms"]
    assert run_task(task_of(few)) == run_task(task_of(few))


def test_blocks_points_and_seeds_differ(study_of):
    one, two = study_of(DRAWN).points()
    other = study_of(DRAWN, ("rate", "seed = 7\nrate"))
    documents = [one.document, two.document, next(other.points()).document]

    tasks = [BlockTask(document, block, version()) for document in documents for block in (0, 1)]

    assert len({task.seed for task in tasks}) == len({task.key for task in tasks}) == 6
    assert len({run_task(task)["rms"].mean for task in tasks}) == 6


def test_title_and_text_change_no_result(study_of):
    told = study_of("", ("rate", 'title = "Other"\ntext = "words"\nrate'))

    assert task_of(told).key == task_of(study_of()).key


def test_another_version_is_refused(study_of):
    task = replace(task_of(study_of()), version="kappaskin 9, meaning 9")

    with pytest.raises(Refusal, match="expected a worker with kappaskin 9"):
        run_task(task)


def test_a_version_says_all_that_the_last_bits_depend_on():
    assert f"NumPy {np.__version__}, SciPy {scipy.__version__}" in version()


@pytest.mark.parametrize("workers", [1, 7])
def test_numbers_and_blocks_do_not_depend_on_the_number_of_workers(study_of, tmp_path, workers):
    study, one = study_of(DRAWN, ("least = 2", "within = 0.2\nleast = 2")), Here()
    other = Here()
    other.count = workers

    first = computed(study, tmp_path / "first", one)

    assert results(computed(study, tmp_path / "other", other)) == results(first)
    assert {known.done for known in first} <= {2, 3, 4}


def test_what_is_computed_is_not_computed_again(study_of, tmp_path):
    study, again = study_of(NOISES), Here()
    first = computed(study, tmp_path / "out")

    second = computed(study, tmp_path / "out", again)

    assert not again.tasks
    assert (
        results(second)
        == results(first)
        == results(stored_results(study, StudyFolder(tmp_path / "out")))
    )


def test_a_stopped_study_goes_on_where_it_was(study_of, tmp_path):
    study, rest = study_of(NOISES), Here()

    def stopped(task):
        if len(stopping.tasks) > 3:
            raise KeyboardInterrupt
        return run_task(task)

    stopping = Here(stopped)
    with pytest.raises(KeyboardInterrupt):
        computed(study, tmp_path / "out", stopping)
    known = sum(one.done for one in stored_results(study, StudyFolder(tmp_path / "out")))
    second = computed(study, tmp_path / "out", rest)

    assert results(second) == results(computed(study, tmp_path / "whole"))
    assert len(rest.tasks) == sum(one.done for one in second) - known


def test_a_changed_study_computes_only_what_changed(study_of, tmp_path):
    computed(study_of(NOISES), tmp_path / "out")
    more, again = study_of(NOISES.replace("[0.1, 0.4]", "[0.1, 0.2, 0.4]")), Here()

    computed(more, tmp_path / "out", again)

    noises = {json.loads(task.document)["effects"]["uniform-noise"]["rms"] for task in again.tasks}
    assert noises == {0.2}


def test_a_damaged_result_is_computed_again(study_of, tmp_path):
    study, again = study_of(), Here()
    first = computed(study, tmp_path / "out")
    file = next((tmp_path / "out" / "results").rglob("*.json"))
    file.write_text(file.read_text()[:-20])

    assert results(computed(study, tmp_path / "out", again)) == results(first)
    assert len(again.tasks) == 1


def test_a_failing_point_does_not_stop_the_rest_and_is_tried_again(study_of, tmp_path):
    study = study_of('[[vary]]\n"fit.functions" = [[4, 4], [9, 9]]\n')

    good, bad = computed(study, tmp_path / "out")

    assert not good.failures
    assert "use at most 6 x 6 functions" in bad.failures[0]
    assert bad.done == study.stop.least
    again = Here()
    computed(study, tmp_path / "out", again)
    assert len(again.tasks) == study.stop.least


def test_any_error_of_a_task_is_told_with_its_kind(study_of, tmp_path):
    def broken(task):
        raise MemoryError("no room")

    (known,) = computed(study_of(), tmp_path / "out", Here(broken))

    assert known.failures == ["MemoryError: no room"] * 2


def test_tasks_of_a_worker_that_died_are_given_to_another(study_of, tmp_path):
    deaths = []

    def dying(task):
        if len(deaths) < 2:
            deaths.append(task.key)
            raise BrokenProcessPool("a process died")
        return run_task(task)

    study = study_of(NOISES)

    found = computed(study, tmp_path / "out", Here(dying))

    assert len(deaths) == 2
    assert results(found) == results(computed(study, tmp_path / "whole"))


class Fragile:
    """Takes its time, and breaks off all that is in hand at every task of block 1."""

    count = 2

    def __init__(self):
        self._lock, self._pending = Lock(), []

    def _finish(self, future, task):
        with self._lock:
            if not future.done():
                future.set_result(run_task(task))

    def submit(self, task):
        future = Future()
        with self._lock:
            self._pending.append(future)
            if task.block == 1:
                for pending in self._pending:
                    if not pending.done():
                        pending.set_exception(BrokenProcessPool("a process died"))
        Timer(0.02, self._finish, (future, task)).start()
        return future


def test_a_task_that_kills_workers_fails_alone(study_of, tmp_path):
    study = study_of(NOISES, ("least = 2\nmost = 4", "least = 4\nmost = 4"))

    found = computed(study, tmp_path / "out", Fragile())

    for known in found:
        assert known.failures == ["two processes that computed it ended unexpectedly"]
        folder, point = StudyFolder(tmp_path / "out"), known.point.document
        kept = [folder.result(BlockTask(point, block, version())) for block in range(known.done)]
        assert [isinstance(result, str) for result in kept] == [False, True, False, False]


class Watched:
    """Dies once, and takes its time over what it is given again; what came `beside` that."""

    count = 1

    def __init__(self):
        self.beside, self._first, self._again = list[int](), dict[str, Future](), list[Future]()

    def submit(self, task):
        future = Future()
        self.beside += [task.block for other in self._again if not other.done()]
        if task.key in self._first:
            self._again.append(future)
            Timer(0.05, lambda: future.set_result(run_task(task))).start()
        elif task.block == 1:
            for pending in (*self._first.values(), future):
                pending.set_exception(BrokenProcessPool("a process died"))
        elif task.block > 1:
            future.set_result(run_task(task))
        self._first[task.key] = future
        return future


def test_what_may_kill_workers_is_alone_for_as_long_as_it_takes(study_of, tmp_path, monkeypatch):
    monkeypatch.setitem(run_study.__globals__, "_TELL", 0.005)
    workers = Watched()

    (known,) = computed(study_of("", ("least = 2", "least = 4")), tmp_path / "out", workers)

    assert (known.done, known.failures) == (4, [])
    assert workers.beside == []


def test_a_folder_of_another_study_or_of_none_is_refused(study_of, tmp_path):
    study = study_of()
    StudyFolder.opened(tmp_path / "out", study)

    with pytest.raises(Refusal, match="got that of small; choose another"):
        StudyFolder.opened(tmp_path / "out", replace(study, name="large"))
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "cat.png").touch()
    with pytest.raises(Refusal, match="expected a folder made by kappaskin study"):
        StudyFolder.opened(tmp_path / "photos", study)
    (tmp_path / "file").touch()
    with pytest.raises(Refusal, match="expected a folder that can be written to"):
        StudyFolder.opened(tmp_path / "file", study)


def test_the_rule_stops_where_the_interval_is_narrow_enough(study_of, tmp_path):
    stop = ("least = 2\nmost = 4", 'least = 3\nmost = 99\nwithin = 0.06\nof = ["rms"]')

    study = study_of("", stop)

    (known,) = computed(study, tmp_path / "out")

    mean = known.mean("rms")
    assert mean.half <= 0.06 * mean.mean
    assert 3 < known.done < 99
    # One round before, it was not.
    folder, rounds = StudyFolder(tmp_path / "out"), range(math.ceil(known.done / 1.6))
    before = Mean.of([folder.result(task_of(study, block))["rms"] for block in rounds])
    assert before.half > 0.06 * before.mean
