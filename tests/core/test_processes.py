"""Processes beside this one: what they are deaf to."""

import signal
from multiprocessing import forkserver

import pytest

from kappaskin.processes import beginning_processes

pytestmark = pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="no signal masks")


def _blocked() -> set[signal.Signals]:
    return signal.pthread_sigmask(signal.SIG_BLOCK, ())


def test_ctrl_c_reaches_this_process_alone_while_others_begin(monkeypatch) -> None:
    began: list[set[signal.Signals]] = []
    monkeypatch.setattr(forkserver, "ensure_running", lambda: began.append(_blocked()))
    with beginning_processes():
        assert signal.SIGINT not in _blocked()
    assert [signal.SIGINT in mask for mask in began] == [True]
    assert signal.SIGINT not in _blocked()
