"""Background tasks: each ends however it goes, and what it computes comes to the GUI's thread."""

import gc
import math
import multiprocessing
import threading
import time
from collections.abc import Callable, Iterator, Sequence

import pytest
from PySide6.QtCore import QObject

from kappaskin import Refusal, Status
from kappaskin_app import guard
from kappaskin_app.shell.background import (
    BackgroundSave,
    BackgroundTask,
    BackgroundThread,
    Cancelled,
    Tasks,
    collect_garbage_here,
)
from kappaskin_app.shell.window import MainWindow

_LONG = 600.0  # s: no test waits for it


def alive() -> list[object]:
    """The threads and processes of tasks that there are."""
    threads = [each for each in threading.enumerate() if isinstance(each, BackgroundThread)]
    return [*threads, *multiprocessing.active_children()]


def ticking() -> Iterator[int]:
    """Items without an end."""
    for number in range(round(_LONG / 0.01)):
        yield number
        time.sleep(0.01)


Begin = Callable[[BackgroundTask[object]], None]
ENDLESS: dict[str, Begin] = {
    "thread": lambda task: task.run(ticking),
    "process": lambda task: task.compute(time.sleep, _LONG),
}
FAILING: dict[str, Begin] = {
    "thread": lambda task: task.run(math.sqrt, -1.0),
    "process": lambda task: task.compute(math.sqrt, -1.0),
}


class Slot:
    """A task, and what came of it: items, errors, how often it ended, and in which threads."""

    def __init__(self, tasks: Tasks) -> None:
        self.items, self.errors, self.ends = list[object](), list[Exception](), 0
        self.threads = set[threading.Thread]()
        self.task = BackgroundTask[object](
            tasks, "Counting", self.take, self.refuse, self.end, "Cancelled; it is not counted."
        )

    def take(self, item: object) -> None:
        self.items.append(item)
        self.threads.add(threading.current_thread())

    def refuse(self, error: Exception) -> None:
        self.errors.append(error)
        self.threads.add(threading.current_thread())

    def end(self) -> None:
        self.ends += 1


@pytest.fixture
def tasks(qapp) -> Iterator[Tasks]:
    made = Tasks()
    yield made
    made.close()


@pytest.fixture
def slot(tasks: Tasks) -> Slot:
    return Slot(tasks)


@pytest.mark.slow
@pytest.mark.parametrize("how", ["thread", "process"])
def test_what_is_computed_comes_to_the_gui_thread_and_leaves_nothing(slot: Slot, how, until):
    begin = {"thread": slot.task.run, "process": slot.task.compute}[how]
    begin(math.hypot, 3.0, 4.0)
    assert slot.task.running
    until(lambda: not slot.task.running)
    assert (slot.items, slot.errors, slot.ends) == ([5.0], [], 1)
    assert slot.threads == {threading.main_thread()}
    assert alive() == []


def test_every_item_of_a_generator_comes_in_order(slot: Slot, until):
    slot.task.run(ticking)
    until(lambda: len(slot.items) > 3)
    slot.task.stop()
    assert slot.items == list(range(len(slot.items)))


@pytest.mark.slow
@pytest.mark.parametrize("how", ENDLESS)
def test_cancelling_ends_it_and_says_so_once(slot: Slot, how: str, until):
    ENDLESS[how](slot.task)
    slot.task.cancel()
    slot.task.cancel()  # there is nothing left to be cancelled
    assert not slot.task.running
    assert [str(error) for error in slot.errors] == ["Cancelled; it is not counted."]
    assert isinstance(slot.errors[0], Cancelled)
    assert slot.ends == 1
    until(lambda: alive() == [])


@pytest.mark.slow
@pytest.mark.parametrize("how", ENDLESS)
def test_closing_ends_it_at_once_and_nothing_begins_any_more(tasks: Tasks, slot: Slot, how: str):
    ENDLESS[how](slot.task)
    tasks.close()
    assert alive() == []
    ENDLESS[how](slot.task)
    assert not slot.task.running
    assert alive() == []
    assert (slot.errors, slot.ends) == ([], 0)


def test_a_thread_that_does_not_end_holds_the_window_for_no_longer_than_a_second(tasks: Tasks):
    hung = threading.Event()
    Slot(tasks).task.run(lambda: hung.wait(_LONG))
    begun = time.monotonic()
    tasks.close()
    assert 0.9 < time.monotonic() - begun < 10.0  # on a busy machine too
    (thread,) = alive()
    hung.set()
    thread.join()


@pytest.mark.slow
@pytest.mark.fails_inside
@pytest.mark.parametrize("how", FAILING)
def test_an_exception_inside_ends_it_and_is_told_once(slot: Slot, how: str, until):
    told: list[str] = []
    guard.on_failure(told.append)
    FAILING[how](slot.task)
    until(lambda: not slot.task.running)
    guard.forget(told.append)
    assert (slot.items, len(slot.errors), slot.ends) == ([], 1, 1)
    assert slot.threads == {threading.main_thread()}
    if how == "thread":
        assert told == [f"Error in the program: {slot.errors[0]}"]
    else:
        assert "the background process ended unexpectedly" in str(slot.errors[0])
    assert alive() == []


def test_a_refusal_is_no_failure_and_is_told_where_no_place_is_better(tasks: Tasks, until):
    def refused() -> None:
        raise Refusal("expected another one")

    told: list[str] = []
    tasks.refused.connect(told.append)
    BackgroundTask(tasks, "", told.append).run(refused)
    until(lambda: told != [])
    assert told == ["expected another one"]


def test_what_cannot_begin_is_refused(slot: Slot):
    def start() -> BackgroundThread:
        raise Refusal("expected another one")

    slot.task.begin(start)
    assert not slot.task.running
    assert [str(error) for error in slot.errors] == ["expected another one"]


def test_a_result_that_comes_late_is_dropped(slot: Slot, until):
    go_on = threading.Event()
    slot.task.run(lambda: go_on.wait(_LONG) and "old")
    slot.task.run(lambda: "new")
    go_on.set()
    until(lambda: not slot.task.running and alive() == [])
    assert slot.items == ["new"]
    assert slot.ends == 1


def test_what_is_left_half_done_is_cleaned_up(slot: Slot, until):
    left = []

    def making() -> Iterator[int]:
        try:
            yield from ticking()
        finally:
            left.append("cleaned")

    slot.task.run(making)
    until(lambda: slot.items != [])
    slot.task.stop()
    until(lambda: left == ["cleaned"])


class Counting:
    """Work that goes on until it is closed."""

    def __init__(self) -> None:
        self.done = False

    def poll(self) -> Sequence[object]:
        return []

    def close(self) -> None:
        self.done = True


class Bench:
    """Two tasks that go on while their names are in `going`, and what was told of them."""

    def __init__(self) -> None:
        self.now, self.told = 0.0, list[str]()
        self.tasks = Tasks(clock=lambda: self.now)
        self.named = {
            name: BackgroundTask[object](self.tasks, name, self.told.append, cancelled="Cancelled.")
            for name in ("Counting", "Sorting")
        }
        self.tasks.notified.connect(self.told.append)

    @property
    def going(self) -> set[str]:
        return {name for name, task in self.named.items() if task.running}

    def at(self, now: float, *going: str, computing: bool = False) -> None:
        self.now = now
        for name, task in self.named.items():
            if name not in going:
                task.stop()
            elif not task.running:
                task.begin(Counting)
        self.tasks.report(Status(computing=computing))


@pytest.fixture
def bench(qapp) -> Iterator[Bench]:
    made = Bench()
    yield made
    made.tasks.close()


def test_what_takes_no_longer_than_a_moment_is_not_told(bench: Bench) -> None:
    bench.at(0.0, "Counting")
    bench.at(0.25, "Counting")
    bench.at(0.35)
    bench.at(0.6, "Counting")  # begun anew
    bench.at(0.85, "Counting")
    assert bench.told == []


def test_the_longest_is_told_with_its_time_and_how_many_more(bench: Bench) -> None:
    bench.at(0.0, "Sorting")
    bench.at(1.0, "Sorting", "Counting")
    bench.at(1.1, "Sorting", "Counting")
    bench.at(2.1, "Sorting", "Counting")
    bench.at(2.2)
    assert bench.told == ["Sorting: 1 s", "Sorting: 2 s, and 1 more", ""]


def test_cancel_ends_the_one_that_is_told_and_no_other(bench: Bench) -> None:
    bench.tasks.cancel()  # there is none
    bench.at(0.0, "Sorting")
    bench.at(1.0, "Sorting", "Counting")
    bench.tasks.cancel()
    assert bench.going == {"Counting"}


def test_what_the_engine_computes_is_told_and_cannot_be_cancelled(bench: Bench) -> None:
    bench.at(0.0, computing=True)
    bench.at(1.0, computing=True)
    assert bench.told == ["Computing the new settings; Ctrl+Z undoes them: 1 s"]
    assert not bench.tasks.may_cancel


@pytest.mark.full
@pytest.mark.slow
def test_closing_the_window_ends_what_runs(window: MainWindow) -> None:
    slots = [Slot(window.tasks) for _ in ENDLESS]
    for slot, begin in zip(slots, ENDLESS.values(), strict=True):
        begin(slot.task)
    window.close()
    assert alive() == []
    assert not any(slot.task.running for slot in slots)


@pytest.mark.full
def test_what_is_told_at_the_foot_of_the_window_can_be_cancelled_there(
    window: MainWindow, until
) -> None:
    window.measurement.set_active(True)
    until(lambda: window.measurement.running)
    until(lambda: "accuracy" in window.display.status_bar.activity.words.text())
    window.display.status_bar.activity.cancel.click()
    assert not window.measurement.running
    assert window.measurement.refusal.startswith("Cancelled")
    until(lambda: "accuracy" not in window.display.status_bar.activity.words.text())
    window.measurement.measure()
    assert not window.measurement.refusal


@pytest.mark.full
def test_a_plan_that_was_cancelled_is_made_at_the_next_look(window: MainWindow) -> None:
    window.planner.set_active(True)
    assert window.planner.waiting
    window.planner.task.cancel()
    assert not window.planner.waiting
    window.planner.set_active(True)
    assert window.planner.waiting


def test_of_what_is_saved_on_a_slow_disk_the_newest_is_last_and_nobody_waits(
    tasks: Tasks, until
) -> None:
    slow, saved, said = threading.Event(), list[int](), list[str]()

    def save(number: int) -> str:
        slow.wait(_LONG)
        saved.append(number)
        return "no room" if number == 9 else ""

    saving = BackgroundSave(tasks, save, said.append)
    began = time.monotonic()
    for number in range(5):
        saving(number)
    assert time.monotonic() - began < 0.5
    slow.set()
    until(lambda: saved[-1:] == [4])
    assert saved in ([0, 4], [4])
    for _ in range(2):
        saving(9)
        saving.finish()
        assert saved[-1] == 9
    until(lambda: not alive())
    assert said == ["no room"]  # once
    saving(5)
    saving.finish()
    saving(9)
    saving.finish()
    assert said == ["no room", "no room"]


class _Cycle:
    """Garbage that only the collector finds, which notes the thread that deletes it."""

    def __init__(self, deleted_in: list[int]) -> None:
        self.itself, self._deleted_in = self, deleted_in

    def __del__(self) -> None:
        self._deleted_in.append(threading.get_ident())


@pytest.mark.parametrize("here", [True, False])
def test_garbage_of_the_window_is_not_deleted_in_another_thread(qapp, until, here: bool) -> None:
    parent, deleted_in = QObject(), list[int]()
    gc.collect()
    if here:
        collect_garbage_here(parent)
    try:
        _Cycle(deleted_in)
        allocating = threading.Thread(target=lambda: [[] for _ in range(100_000)])
        allocating.start()
        allocating.join()
        if here:
            assert deleted_in == []
            until(lambda: len(deleted_in) == 1 or not [_Cycle([]) for _ in range(1000)])
            assert deleted_in == [threading.get_ident()]
        else:  # the hazard
            assert deleted_in == [allocating.ident]
    finally:
        gc.enable()
