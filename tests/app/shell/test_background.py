import pytest

from kappaskin import Status
from kappaskin_app.shell.background import Tasks
from kappaskin_app.shell.window import MainWindow


class Bench:
    """Two tasks that go on while their names are in `going`, and what was told of them."""

    def __init__(self) -> None:
        self.now, self.going, self.told = 0.0, set[str](), list[str]()
        self.doing = Tasks(clock=lambda: self.now)
        for name in ("Counting", "Sorting"):
            self.doing.add(
                name, lambda name=name: name in self.going, lambda name=name: self.end(name)
            )
        self.doing.told.connect(self.told.append)

    def end(self, name: str) -> None:
        self.going.remove(name)

    def at(self, now: float, *going: str) -> None:
        self.now, self.going = now, set(going)
        self.doing.follow(Status())


@pytest.fixture
def bench() -> Bench:
    return Bench()


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
    bench.doing.cancel()  # there is none
    bench.at(0.0, "Sorting")
    bench.at(1.0, "Sorting", "Counting")
    bench.doing.cancel()
    assert bench.going == {"Counting"}


def test_what_is_told_at_the_foot_of_the_window_can_be_cancelled_there(
    window: MainWindow, until
) -> None:
    window.costing.watch(True)
    until(lambda: window.costing.running)
    until(lambda: "accuracy" in window.display.foot.activity.words.text())
    window.display.foot.activity.cancel.click()
    assert not window.costing.running
    assert window.costing.refusal.startswith("Cancelled")
    until(lambda: "accuracy" not in window.display.foot.activity.words.text())
    window.costing.measure()
    assert not window.costing.refusal


def test_a_plan_that_was_cancelled_is_made_at_the_next_look(window: MainWindow) -> None:
    window.planning.watch(True)
    assert window.planning.waiting
    window.planning.cancel()
    assert not window.planning.waiting
    window.planning.watch(True)
    assert window.planning.waiting
