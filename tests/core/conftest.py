"""What several tests of the core use: commands, and skins held in every way that they can be."""

import math
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from multiprocessing.process import BaseProcess
from typing import NoReturn

import numpy as np
import pytest

from kappaskin import (
    Cap,
    Disk,
    Estimate,
    Patch,
    Pipeline,
    Polygon,
    Scene,
    Setup,
    Simulator,
    basis_for,
)
from kappaskin.bases import Basis, edges_of
from kappaskin.cli import main
from kappaskin.publish.message import EstimateMessage, MessageHeader, epoch

HEXAGON = [(0, 1), (0.5, 0), (1.5, 0), (2, 1), (1.5, 2), (0.5, 2)] * np.array(
    [0.05, 0.05 * math.sqrt(3) / 2]
)

SKINS = {
    "flat": Patch(0.1, 0.1),
    "long": Patch(0.12, 0.04),
    "strip": Patch(0.1, 0.02, strip=True),
    "bent": Patch(0.04, 0.03, 12.9e-3),
    "arc": Patch(0.03, 0.02, 12.9e-3, strip=True),
    "dome": Patch(0.1, 0.08, (0.3, 0.25)),
    "saddle": Patch(0.1, 0.08, (0.4, -0.3)),
    "disk": Disk(0.05),
    "cap": Cap(0.004, 1.2),
    "egg": Cap(0.004, stretch=1.3),
    "square": Polygon([(0, 0), (0.1, 0), (0.1, 0.1), (0, 0.1)]),
    "triangle": Polygon([(0, 0), (0.1, 0), (0.05, 0.05 * math.sqrt(3))]),
    "hexagon": Polygon(HEXAGON),
    "L": Polygon([(0, 0), (0.1, 0), (0.1, 0.05), (0.05, 0.05), (0.05, 0.1), (0, 0.1)]),
}


@cache
def _basis(patch: Patch, edge: str, Ni: int, Nj: int) -> Basis:
    return basis_for(patch, edge, Ni, Nj)


@dataclass(frozen=True)
class Held:
    """A skin and the edge that it is held by."""

    name: str
    edge: str

    @property
    def patch(self) -> Patch:
        return SKINS[self.name]

    @property
    def whole(self) -> bool:
        """Whether functions are modes of the whole skin, not products of one in x and one in y."""
        return isinstance(self.patch, Disk | Polygon)

    def basis(self, Ni: int = 6, Nj: int = 5) -> Basis:
        """Ni x Nj functions, on a strip Ni alone; made once for all tests."""
        return _basis(self.patch, self.edge, Ni, 1 if self.patch.strip else Nj)

    def __str__(self) -> str:
        return f"{self.name}-{self.edge}"


_MORE_OF_A_KIND = ("long", "square", "triangle", "hexagon", "egg")  # of flat, L, cap
ALL = [Held(name, edge) for name, patch in SKINS.items() for edge in edges_of(patch)]


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "where(which): only the held skins that `which` is true of")


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Give a test that asks for a `held_skin` every skin in every way that it can be held."""
    if "held_skin" in metafunc.fixturenames:
        which = metafunc.definition.get_closest_marker("where")
        chosen = [
            pytest.param(held, marks=pytest.mark.full if held.name in _MORE_OF_A_KIND else ())
            for held in ALL
            if which is None or which.kwargs["which"](held)
        ]
        metafunc.parametrize("held_skin", chosen, ids=str)


@pytest.fixture(autouse=True)
def slow_if_it_starts_a_process(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Keeps processes out of `start.py fast`, which leaves out what is marked as slow."""

    def refuse(*_: object, **__: object) -> NoReturn:
        pytest.fail("it starts a process: mark it with pytest.mark.slow")

    if not request.node.get_closest_marker("slow"):
        monkeypatch.setattr(subprocess.Popen, "__init__", refuse)
        monkeypatch.setattr(BaseProcess, "start", refuse)


@pytest.fixture
def run(capsys) -> Callable[..., tuple[int, str, str]]:
    """Runs a command in this process: its exit code, standard output and standard error."""

    def run_one(*arguments: object) -> tuple[int, str, str]:
        code = main([str(argument) for argument in arguments])
        return code, *capsys.readouterr()

    return run_one


@pytest.fixture
def messages_of() -> Callable[..., list[EstimateMessage]]:
    """Makes the messages about the first frames of a scene; `change` makes another estimate."""

    def made(
        scene: Scene,
        count: int = 1,
        setup: Setup | None = None,
        change: Callable[[Estimate], Estimate] | None = None,
    ) -> list[EstimateMessage]:
        pipeline = Pipeline(scene.sensor(), setup or Setup())
        simulator, told = Simulator(scene), list[EstimateMessage]()
        for sequence in range(count):
            frame = simulator.frame(sequence, time.monotonic)
            estimate = pipeline(replace(frame, taken=frame.host_time, taken_sd=1e-4))
            estimate = change(estimate) if change else estimate
            assert pipeline.fitted is not None
            told.append(
                EstimateMessage(
                    estimate,
                    pipeline.fitted,
                    pipeline,
                    MessageHeader("sim", epoch(), sequence, True),
                )
            )
        return told

    return made


@pytest.fixture
def receiver() -> Iterator[socket.socket]:
    """A program that estimates are sent to by UDP."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made:
        made.bind(("127.0.0.1", 0))
        made.settimeout(30)
        yield made
