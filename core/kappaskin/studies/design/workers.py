"""Who computes tasks: processes of this machine, or the workers of a Dask cluster."""

import os
import socket
import time
from collections.abc import Generator
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from importlib import import_module
from typing import Any, Protocol
from urllib.parse import urlsplit

from kappaskin._processes import Context, end_with_parent, process_context
from kappaskin.errors import Refusal, lacking
from kappaskin.studies.design.task import Measured, Task, run, version

_PATIENCE = 5.0  # s for a scheduler to answer, and for its first worker
_MOST = 1024


class Workers(Protocol):
    """Compute tasks, so many of them at once."""

    @property
    def count(self) -> int: ...

    def submit(self, task: Task) -> "Future[Measured]": ...


def gone() -> Refusal:
    """What to say once no scheduler answers any more."""
    return Refusal(
        "the scheduler is gone; what was computed is kept, and the same command goes on from there"
    )


class _Processes:
    """Processes of this machine; where one dies all are begun anew."""

    def __init__(self, count: int, context: Context) -> None:
        self.count, self._context = count, context
        self._pool = self._begun()

    def _begun(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(self.count, self._context, end_with_parent)

    def submit(self, task: Task) -> "Future[Measured]":
        try:
            return self._pool.submit(run, task)
        except BrokenExecutor:
            self._pool.shutdown()
            self._pool = self._begun()
            return self._pool.submit(run, task)

    def close(self) -> None:
        self._pool.shutdown(cancel_futures=True)


@contextmanager
def processes(count: int) -> Generator[Workers]:
    """So many processes of this machine, one thread each."""
    if not 1 <= count <= _MOST:
        raise Refusal(f"expected 1 to {_MOST} workers, got {count}")
    with process_context() as context:
        workers = _Processes(count, context)
        try:
            yield workers
        finally:
            workers.close()


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
                raise gone() from error
            self._counted = time.monotonic()
        return self._count

    def submit(self, task: Task) -> "Future[Measured]":
        return self._executor.submit(run, task)


@contextmanager
def cluster(address: str) -> Generator[Workers]:
    """The workers of the Dask scheduler at `address`, such as tcp://10.0.0.5:8786."""
    try:
        distributed: Any = import_module("distributed")
    except ImportError as error:
        raise lacking("dask", "a scheduler", error) from error
    try:
        _knock(address)
        client = distributed.Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise Refusal(
            f"{address}: no Dask scheduler answers there ({error}); start one by dask scheduler, "
            "and give the address that it prints"
        ) from error
    try:
        _check_workers(client, address)
        yield _Cluster(client)
    finally:
        with suppress(OSError):  # where the scheduler is gone
            client.close(_PATIENCE)


def _knock(address: str) -> None:
    """Raise an error unless somebody is there: Dask itself would go on trying for 15 s."""
    place = urlsplit(address if "//" in address else f"tcp://{address}")
    if place.scheme not in ("tcp", "tls") or place.hostname is None or place.port is None:
        raise ValueError("expected an address such as tcp://10.0.0.5:8786")
    socket.create_connection((place.hostname, place.port), _PATIENCE).close()


def kind() -> str:
    """What the last bits depend on of the worker that is asked: products add up by threads."""
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
        told: dict[str, str] = client.run(kind)
    except Exception as error:  # whatever a worker without kappaskin, or with an old one, raises
        raise Refusal(
            f"{address}: expected workers with {version()}, got some that cannot tell theirs "
            f"({error}); install the same kappaskin[dask] there"
        ) from error
    alike = f"{version()}, threads of BLAS 1"
    if others := {worker: other for worker, other in told.items() if other != alike}:
        worker, other = next(iter(others.items()))
        raise Refusal(
            f"{address}: expected workers with {alike}, got {len(others)} of {len(told)} "
            f"with another, {worker} with {other}; install the same on all, and "
            "start them with OPENBLAS_NUM_THREADS=1"
        )
