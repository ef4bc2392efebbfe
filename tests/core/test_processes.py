"""Processes beside this one: what they are deaf to, and when they end."""

import signal
import time
from multiprocessing import Pipe, forkserver, util
from pathlib import Path
from types import SimpleNamespace

import pytest

from kappaskin import _processes
from kappaskin._files import left_behind
from kappaskin._processes import process_context

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="no signal masks"),
]


def _blocked() -> set[signal.Signals]:
    return signal.pthread_sigmask(signal.SIG_BLOCK, ())


def test_ctrl_c_reaches_this_process_alone_while_others_begin(monkeypatch) -> None:
    began: list[set[signal.Signals]] = []
    monkeypatch.setattr(forkserver, "ensure_running", lambda: began.append(_blocked()))
    with process_context():
        assert signal.SIGINT not in _blocked()
    assert [signal.SIGINT in mask for mask in began] == [True]
    assert signal.SIGINT not in _blocked()


def test_the_folder_of_the_fork_servers_socket_is_marked_as_in_use() -> None:
    with process_context() as context:
        if context.get_start_method() != "forkserver":
            pytest.skip("the system cannot fork")
    mark = Path(util.get_temp_dir(), "kappaskin.lock")
    with left_behind(mark, mark.read_bytes()) as left:
        assert mark.read_bytes()
        assert not left


def test_one_that_computes_for_long_ends_soon_after_who_asked(monkeypatch) -> None:
    ended: list[object] = []
    parent = SimpleNamespace(join=lambda: ended.append("who asked"))
    monkeypatch.setattr(_processes.multiprocessing, "parent_process", lambda: parent)
    monkeypatch.setattr(_processes.os, "_exit", lambda code: ended.append("it"))
    monkeypatch.setattr(_processes, "_GRACE", 0.0)
    monkeypatch.setattr(_processes.signal, "signal", lambda *_: None)
    told, asked = Pipe(duplex=False)
    _processes._send_items(asked, _waiting_for(ended), ())  # noqa: SLF001
    asked.close()
    told.close()
    assert ended == ["who asked", "it"]


def _waiting_for(ended: list[object]):
    """Computes until it is ended, telling nothing."""

    def compute() -> list[object]:
        give_up = time.monotonic() + 30
        while len(ended) < 2 and time.monotonic() < give_up:
            time.sleep(0.001)
        return []

    return compute
