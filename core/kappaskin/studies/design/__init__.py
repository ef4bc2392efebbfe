"""Design studies: runs, on processes of this machine or on a Dask cluster."""

import os
import socket
import time
from collections import deque
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Future,
    ProcessPoolExecutor,
    wait,
)
from contextlib import AbstractContextManager, closing, contextmanager, suppress
from dataclasses import dataclass
from typing import Any, Protocol
from urllib.parse import urlsplit

from kappaskin._processes import Context, end_with_parent, process_context
from kappaskin.errors import Refusal, optional
from kappaskin.studies.design.results import (
    BlockMoments,
    BlockTask,
    PointResults,
    StudyFolder,
    run_task,
    version,
)
from kappaskin.studies.design.study import Study

# Workers: processes of this machine, or those of a Dask cluster

_PATIENCE = 5.0  # s for a scheduler to answer, and for its first worker
_MOST = 1024


class Workers(Protocol):
    """Compute `count` tasks at a time."""

    @property
    def count(self) -> int: ...

    def submit(self, task: BlockTask) -> "Future[BlockMoments]": ...


def scheduler_lost() -> Refusal:
    """The refusal when the scheduler no longer replies."""
    return Refusal(
        "connection to the scheduler lost; the results so far are saved, the same command resumes"
    )


class _Processes:
    """Processes of this machine; if one dies, all are restarted."""

    def __init__(self, count: int, context: Context) -> None:
        self.count, self._context = count, context
        self._pool = self._begun()

    def _begun(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(self.count, self._context, end_with_parent)

    def submit(self, task: BlockTask) -> "Future[BlockMoments]":
        try:
            return self._pool.submit(run_task, task)
        except BrokenExecutor:
            self._pool.shutdown()
            self._pool = self._begun()
            return self._pool.submit(run_task, task)

    def close(self) -> None:
        self._pool.shutdown(cancel_futures=True)


@contextmanager
def processes(count: int) -> Generator[Workers]:
    """So many processes of this machine, one thread each."""
    if not 1 <= count <= _MOST:
        raise Refusal(f"expected 1 to {_MOST} workers, got {count}")
    with process_context() as context, closing(_Processes(count, context)) as workers:
        yield workers


class _Cluster:
    """The workers of a Dask scheduler, which come and go."""

    def __init__(self, client: Any) -> None:
        self._client, self._executor = client, client.get_executor()
        self._count, self._counted = 1, -_PATIENCE

    @property
    def count(self) -> int:
        if time.monotonic() > self._counted + _PATIENCE:
            try:
                self._count = max(sum(self._client.nthreads().values()), 1)
            except OSError as error:
                raise scheduler_lost() from error
            self._counted = time.monotonic()
        return self._count

    def submit(self, task: BlockTask) -> "Future[BlockMoments]":
        return self._executor.submit(run_task, task)


def study_workers(count: int | None = None, scheduler: str = "") -> AbstractContextManager[Workers]:
    """The workers of a Dask `scheduler`, or without one so many processes of this machine.

    As many as there are cores when no `count` is given.
    """
    if scheduler:
        return cluster(scheduler)
    return processes(count if count is not None else os.cpu_count() or 1)


@contextmanager
def cluster(address: str) -> Generator[Workers]:
    """The workers of the Dask scheduler at `address`, such as tcp://10.0.0.5:8786."""
    distributed = optional("distributed", "cluster", "a scheduler")
    try:
        _check_connection(address)
        client = distributed.Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise Refusal(
            f"{address}: no Dask scheduler replies there ({error}); start one with dask scheduler, "
            "and give the address that it prints"
        ) from error
    try:
        _check_workers(client, address)
        yield _Cluster(client)
    finally:
        with suppress(OSError):  # where the scheduler is gone
            client.close(_PATIENCE)


def _check_connection(address: str) -> None:
    """Raise an error unless the port is open: Dask itself would retry for 15 s."""
    place = urlsplit(address if "//" in address else f"tcp://{address}")
    if place.scheme not in ("tcp", "tls") or place.hostname is None or place.port is None:
        raise ValueError("expected an address such as tcp://10.0.0.5:8786")
    socket.create_connection((place.hostname, place.port), _PATIENCE).close()


def worker_kind() -> str:
    """What the last bits of a worker's results depend on: products add up by threads."""
    threads = os.environ.get("OPENBLAS_NUM_THREADS", os.environ.get("OMP_NUM_THREADS", "many"))
    return f"{version()}, threads of BLAS {threads}"


def _check_workers(client: Any, address: str) -> None:
    """Refuse a scheduler without workers, and workers that would give other numbers."""
    try:
        client.wait_for_workers(1, _PATIENCE)
    except TimeoutError:
        raise Refusal(
            f"{address}: expected workers, got none in {_PATIENCE:g} s; start some by dask worker "
            f"{address} --nthreads 1"
        ) from None
    try:
        kinds: dict[str, str] = client.run(worker_kind)
    except Exception as error:  # whatever a worker without kappaskin, or with an old one, raises
        raise Refusal(
            f"{address}: expected workers with {version()}, got some of unknown version "
            f"({error}); install the same kappaskin[cluster] there"
        ) from error
    alike = f"{version()}, threads of BLAS 1"
    if others := {worker: other for worker, other in kinds.items() if other != alike}:
        worker, other = next(iter(others.items()))
        raise Refusal(
            f"{address}: expected workers with {alike}, got {len(others)} of {len(kinds)} "
            f"with others, {worker} with {other}; install the same on all, and "
            "start them with OPENBLAS_NUM_THREADS=1"
        )


# The run

_QUEUED = 3  # tasks for each worker: one is computed, the others are on their way
_PROGRESS_EVERY = 0.5  # s between two lines of progress, at least


@dataclass
class StudyProgress:
    """Progress of a study: blocks `done` of those `required` by now, some `found` in the folder."""

    required: int
    began: float
    done: int = 0
    found: int = 0
    failed: int = 0

    def line(self, now: float) -> str:
        """A line of progress at `now` in s: blocks done, rate, time left, failures."""
        rate = (self.done - self.found) / max(now - self.began, 1e-9)
        left = f", {(self.required - self.done) / rate:.0f} s left" if rate else ""
        found = f", {self.found} computed before" if self.found else ""
        failed = f", {self.failed} failed" if self.failed else ""
        return f"{self.done} of {self.required} blocks{found}, {rate:.3g}/s{left}{failed}"


class _Run:
    """A running study: the results of its points, the tasks left and the workers."""

    def __init__(self, study: Study, folder: StudyFolder, workers: Workers) -> None:
        self._folder, self._workers = folder, workers
        self.known = list[PointResults]()
        self._first = self._begun(study)
        self._next = deque[tuple[PointResults, int]]()
        self._running = dict["Future[BlockMoments]", tuple[PointResults, BlockTask]]()
        self._suspects, self._alone = set[str](), deque[tuple[PointResults, BlockTask]]()
        self.progress = StudyProgress(study.count * study.stop.least, time.monotonic())

    def _begun(self, study: Study) -> Iterator[tuple[PointResults, int]]:
        """Point by point what every one begins with."""
        for point in study.points():
            self.known.append(PointResults(point, study))
            for block in range(study.stop.least):
                yield self.known[-1], block

    def fill(self) -> bool:
        """Submit tasks until all workers have enough; whether any are running.

        A task that was in hand when a worker died may be what kills them: it is handed out alone.
        """
        if self._alone and not self._running:
            self._submit(*self._alone.popleft())
        if self._alone or any(task.key in self._suspects for _, task in self._running.values()):
            return True
        while len(self._running) < _QUEUED * self._workers.count:
            known, block = self._next.popleft() if self._next else next(self._first, (None, 0))
            if known is None:
                break
            task = BlockTask(known.point.document, block, version())
            if isinstance(result := self._folder.result(task), dict):
                self.progress.found += 1
                self._take(known, block, result)
            else:
                self._submit(known, task)
        return bool(self._running)

    def _submit(self, known: PointResults, task: BlockTask) -> None:
        self._running[self._workers.submit(task)] = known, task

    def collect(self) -> None:
        """Take the results that arrive within some time."""
        for future in wait(self._running, _PROGRESS_EVERY, FIRST_COMPLETED).done:
            known, task = self._running.pop(future)
            result = self._result(future, task)
            if result is None:
                self._suspects.add(task.key)
                self._alone.append((known, task))
            else:
                self._folder.save(task, result)
                self._take(known, task.block, result)

    def _take(self, known: PointResults, block: int, result: BlockMoments | str) -> None:
        following = known.take(block, result)
        self._next.extend((known, number) for number in following)
        self.progress.required += len(following)
        self.progress.done += 1
        self.progress.failed += isinstance(result, str)

    def _result(self, future: "Future[BlockMoments]", task: BlockTask) -> BlockMoments | str | None:
        """What the task measured, or why it failed; None where its worker died."""
        try:
            return future.result()
        except Refusal as refusal:
            return str(refusal)
        except BrokenExecutor:
            again = task.key in self._suspects
            return "two processes that computed it ended unexpectedly" if again else None
        except CancelledError:
            raise scheduler_lost() from None
        except Exception as error:  # whatever there is wrong with one task, the others go on
            return f"{type(error).__name__}: {error}"

    def cancel(self) -> None:
        for future in self._running:
            future.cancel()


def run_study(
    study: Study, folder: StudyFolder, workers: Workers, show_progress: Callable[[str], None]
) -> list[PointResults]:
    """The results of every point of `study`; `show_progress` gets a line now and then.

    Results are saved in the `folder` one by one; existing ones are not computed again.
    """
    run = _Run(study, folder, workers)
    try:
        while run.fill():
            run.collect()
            show_progress(run.progress.line(time.monotonic()))
    finally:
        run.cancel()
    show_progress(run.progress.line(time.monotonic()))
    return run.known
