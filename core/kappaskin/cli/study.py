"""A design study, on this machine or a cluster."""

import os
import sys
import time
from contextlib import AbstractContextManager
from pathlib import Path

from kappaskin.cli.common import FAILED, Whole
from kappaskin.errors import Refusal
from kappaskin.studies import Folder, Workers, cluster, load_study, processes, run_study, table_text

_EVERY = 10.0  # s between two lines of progress in a log


def _workers(count: int | None, scheduler: str) -> AbstractContextManager[Workers]:
    if scheduler:
        if count is not None:
            raise Refusal("expected --workers or --scheduler, got both; a cluster has its own")
        return cluster(scheduler)
    return processes(count if count is not None else os.cpu_count() or 1)


class _Teller:
    """Shows how far it is on standard error: on one line where somebody looks, else at times."""

    def __init__(self) -> None:
        self._looked_at, self._last = sys.stderr.isatty(), time.monotonic()

    def __call__(self, line: str) -> None:
        if self._looked_at:
            print(f"\r\x1b[K{line}", end="", file=sys.stderr, flush=True)
        elif time.monotonic() - self._last > _EVERY:
            self._last = time.monotonic()
            print(line, file=sys.stderr, flush=True)


def study(
    file: str, *, workers: Whole | None = None, scheduler: str = "", out: Path | None = None
) -> int:
    """Compute a design study: how good a sensor would be, before it is built.

    A study is a scene with tables [[vary]] of what it goes through, [[draw]] of what is random, and
    [measure] and [stop]. Every result is a file of its own in the folder: a study that was stopped
    goes on where it was, and a changed one computes only what changed. The exit code is 1 where
    some of it failed.

    Example: `kappaskin study paper-elements --workers 2 --out elements`

    Parameters
    ----------
    file
        The name of a ready study, or a file that ends in .toml.
    workers
        How many processes compute; as many as there are cores when left out.
    scheduler
        The address of a Dask scheduler whose workers compute, such as tcp://10.0.0.5:8786; needs
        kappaskin[dask] here and there.
    out
        The folder of its results; named as the study when left out.
    """
    asked = load_study(file)
    path = out if out is not None else Path(asked.name)
    with _workers(workers, scheduler) as found:
        folder = Folder.opened(path, asked)
        try:
            known = run_study(asked, folder, found, _Teller())
        except KeyboardInterrupt:
            raise Refusal(
                f"stopped; what was computed is in {path}, and the same command goes on from there"
            ) from None
        finally:
            if sys.stderr.isatty():
                print(file=sys.stderr)
    print(table_text(asked, known))
    print(f"kappaskin report {path} makes a page of it", file=sys.stderr)
    return FAILED if any(one.failures for one in known) else 0
