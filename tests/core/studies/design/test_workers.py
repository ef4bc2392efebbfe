"""Processes of this machine and of a Dask cluster: the same numbers, also when some are killed."""

import os
import signal
import socket
import subprocess
import sys
import time
from importlib import import_module
from importlib.util import find_spec

import psutil
import pytest

from kappaskin import Refusal
from kappaskin.studies import StudyFolder, run_study
from kappaskin.studies.design import cluster, processes, worker_kind
from kappaskin.studies.design.results import BlockTask, run_task, version

pytestmark = pytest.mark.slow

NEEDS_DASK = pytest.mark.skipif(find_spec("distributed") is None, reason="Dask is not installed")
ALIKE = f"{version()}, threads of BLAS 1"
LONGER = "least = 2\nmost = 4", "least = 30\nmost = 30"


def results(study, path):
    """What the folder at `path` holds of each block."""
    folder = StudyFolder(path)
    return [
        {block: folder.result(BlockTask(point.document, block, version())) for block in range(30)}
        for point in study.points()
    ]


def here(study):
    """The same without any workers."""
    return [
        {
            block: run_task(BlockTask(point.document, block, version()))
            for block in range(study.stop.least)
        }
        for point in study.points()
    ]


class Killer:
    """Kills a process at the first word about the progress."""

    def __init__(self, victim):
        self._victim, self.killed = victim, 0

    def __call__(self, line):
        if not self.killed and not line.startswith("0 "):
            os.kill(self._victim(), signal.SIGKILL)
            self.killed += 1


def newest_child():
    """The process that was begun last of all below this one."""
    return max(psutil.Process().children(recursive=True), key=psutil.Process.create_time).pid


def test_processes_give_the_numbers_of_this_one_though_one_is_killed(study_of, tmp_path):
    study, kill = study_of("", LONGER), Killer(newest_child)

    with processes(2) as workers:
        run_study(study, StudyFolder.opened(tmp_path, study), workers, kill)

    assert kill.killed
    assert results(study, tmp_path) == here(study)


@pytest.mark.parametrize("count", [0, 100_000])
def test_numbers_of_workers_that_make_no_sense_are_refused(count):
    with pytest.raises(Refusal, match=f"expected 1 to 1024 workers, got {count}"), processes(count):
        pass


def free_port():
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return found.getsockname()[1]


@pytest.fixture
def started(tmp_path):
    """Starts `dask` programs as a person would, each a process of its own."""
    running = []

    def start(*arguments):
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": tmp_path}
        command = [sys.executable, "-m", "dask", *map(str, arguments), "--no-dashboard"]
        environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
        running.append(subprocess.Popen(command, env=environment, **quiet))
        return running[-1]

    yield start
    for process in running:
        process.kill()
        process.wait()


@pytest.mark.full
@NEEDS_DASK
def test_a_cluster_gives_the_numbers_of_this_process_though_a_worker_is_killed(
    study_of, tmp_path, started
):
    address = f"tcp://127.0.0.1:{free_port()}"
    started("scheduler", "--host", "127.0.0.1", "--port", address.rpartition(":")[2])
    told = ("--nthreads", 1, "--no-nanny")
    first, *others = (started("worker", address, *told) for _ in range(4))
    study, kill = study_of("", LONGER), Killer(lambda: first.pid)
    deadline = time.monotonic() + 90
    while True:
        try:
            with cluster(address) as workers:
                run_study(study, StudyFolder.opened(tmp_path / "out", study), workers, kill)
            break
        except Refusal:  # not all are up yet
            if time.monotonic() > deadline:
                raise
            time.sleep(0.2)

    assert kill.killed
    assert all(other.poll() is None for other in others)
    assert results(study, tmp_path / "out") == here(study)


@pytest.mark.skipif(find_spec("distributed") is not None, reason="Dask is installed")
def test_without_dask_a_scheduler_is_refused_with_the_remedy():
    with pytest.raises(Refusal, match=r"pip install 'kappaskin\[dask\]'"), cluster("tcp://x:1"):
        pass


@NEEDS_DASK
@pytest.mark.parametrize("address", ["127.0.0.1:{}", "nonsense", "http://127.0.0.1:{}"])
def test_a_scheduler_that_is_not_there_is_refused_at_once(address):
    import_module("distributed")  # which takes long by itself
    began = time.monotonic()

    with (
        pytest.raises(Refusal, match="no Dask scheduler replies there"),
        cluster(address.format(free_port())),
    ):
        pass

    assert time.monotonic() - began < 5


def test_a_worker_tells_the_threads_that_its_bits_depend_on(monkeypatch):
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    monkeypatch.setenv("OMP_NUM_THREADS", "4")

    assert worker_kind() == ALIKE.replace("BLAS 1", "BLAS 4")


class Told:
    """A client whose workers have these versions."""

    def __init__(self, versions):
        self._versions = versions

    def wait_for_workers(self, count, timeout):
        if not self._versions:
            raise TimeoutError

    def run(self, function):
        return self._versions

    def get_executor(self):
        return None

    def close(self, timeout):
        pass


@pytest.mark.parametrize(
    ("versions", "told"),
    [
        ({}, "expected workers, got none in 5 s; start some by dask worker"),
        ({"a": ALIKE, "b": "kappaskin 9"}, "got 1 of 2 with others, b with kappaskin 9"),
        ({"a": ALIKE.replace("BLAS 1", "BLAS 2")}, "start them with OPENBLAS_NUM_THREADS=1"),
    ],
)
def test_workers_that_would_give_other_numbers_are_refused(monkeypatch, versions, told):
    class Module:
        @staticmethod
        def Client(*_, **__):
            return Told(versions)

    monkeypatch.setitem(sys.modules, "distributed", Module())
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"

        with pytest.raises(Refusal) as refusal, cluster(address):
            pass

    assert told in str(refusal.value)
