"""A study to results in its folder: every task once, whoever computes it."""

import time
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait
from dataclasses import dataclass

from kappaskin.errors import Refusal
from kappaskin.studies.design.folder import Folder
from kappaskin.studies.design.known import Known
from kappaskin.studies.design.study import Study
from kappaskin.studies.design.task import Measured, Task, version
from kappaskin.studies.design.workers import Workers, gone

_AHEAD = 3  # tasks in hand for each worker: one at work, the others on their way
_TELL = 0.5  # s between two words about the progress, at least


@dataclass
class Progress:
    """How far a study is: blocks `done` of those `wanted` by now, some `found` in the folder."""

    wanted: int
    began: float
    done: int = 0
    found: int = 0
    failed: int = 0

    def line(self, now: float) -> str:
        """What to tell at `now` in s: how far it is, the rate, the time left, failures."""
        rate = (self.done - self.found) / max(now - self.began, 1e-9)
        left = f", {(self.wanted - self.done) / rate:.0f} s left" if rate else ""
        found = f", {self.found} known before" if self.found else ""
        failed = f", {self.failed} failed" if self.failed else ""
        return f"{self.done} of {self.wanted} blocks{found}, {rate:.3g}/s{left}{failed}"


class _Run:
    """A study at work: what is known of its points, what is left to do and who does it."""

    def __init__(self, study: Study, folder: Folder, workers: Workers) -> None:
        self._folder, self._workers = folder, workers
        self.known = list[Known]()
        self._first = self._begun(study)
        self._next = deque[tuple[Known, int]]()
        self._running = dict["Future[Measured]", tuple[Known, Task]]()
        self._suspects, self._alone = set[str](), deque[tuple[Known, Task]]()
        self.progress = Progress(study.count * study.stop.least, time.monotonic())

    def _begun(self, study: Study) -> Iterator[tuple[Known, int]]:
        """Point by point what every one begins with."""
        for point in study.points():
            self.known.append(Known(point, study))
            for block in range(study.stop.least):
                yield self.known[-1], block

    def fill(self) -> bool:
        """Hand out tasks until all workers have enough; whether any are at work.

        A task that was in hand when a worker died may be what kills them: it is handed out alone.
        """
        if self._alone and not self._running:
            self._submit(*self._alone.popleft())
        if self._alone or any(task.key in self._suspects for _, task in self._running.values()):
            return True
        while len(self._running) < _AHEAD * self._workers.count:
            known, block = self._next.popleft() if self._next else next(self._first, (None, 0))
            if known is None:
                break
            task = Task(known.point.document, block, version())
            if isinstance(result := self._folder.result(task), dict):
                self.progress.found += 1
                self._take(known, block, result)
            else:
                self._submit(known, task)
        return bool(self._running)

    def _submit(self, known: Known, task: Task) -> None:
        self._running[self._workers.submit(task)] = known, task

    def collect(self) -> None:
        """Take the results that are there within some time."""
        for future in wait(self._running, _TELL, FIRST_COMPLETED).done:
            known, task = self._running.pop(future)
            result = self._result(future, task)
            if result is None:
                self._suspects.add(task.key)
                self._alone.append((known, task))
            else:
                self._folder.keep(task, result)
                self._take(known, task.block, result)

    def _take(self, known: Known, block: int, result: Measured | str) -> None:
        following = known.take(block, result)
        self._next.extend((known, number) for number in following)
        self.progress.wanted += len(following)
        self.progress.done += 1
        self.progress.failed += isinstance(result, str)

    def _result(self, future: "Future[Measured]", task: Task) -> Measured | str | None:
        """What the task measured, or why it failed; None where its worker died."""
        try:
            return future.result()
        except Refusal as refusal:
            return str(refusal)
        except BrokenExecutor:
            again = task.key in self._suspects
            return "the process that computed it died, and so did a second one" if again else None
        except CancelledError:
            raise gone() from None
        except Exception as error:  # whatever there is wrong with one task, the others go on
            return f"{type(error).__name__}: {error}"

    def cancel(self) -> None:
        for future in self._running:
            future.cancel()


def run_study(
    study: Study, folder: Folder, workers: Workers, tell: Callable[[str], None]
) -> list[Known]:
    """What is known of every point of `study` in the end; `tell` is told how far it is.

    Results go to the `folder` one by one, and what is there already is not computed again.
    """
    run = _Run(study, folder, workers)
    try:
        while run.fill():
            run.collect()
            tell(run.progress.line(time.monotonic()))
    finally:
        run.cancel()
    tell(run.progress.line(time.monotonic()))
    return run.known


def known_of(study: Study, folder: Folder) -> list[Known]:
    """What is known of every point of `study` from the results in its `folder`."""
    found = list[Known]()
    for point in study.points():
        known, blocks = Known(point, study), deque(range(study.stop.least))
        while blocks:
            block = blocks.popleft()
            if (result := folder.result(Task(point.document, block, version()))) is not None:
                blocks.extend(known.take(block, result))
        found.append(known)
    return found
