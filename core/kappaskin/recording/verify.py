"""Verification of a recording: whether its bytes give the same estimates again, bit for bit."""

import math
from collections.abc import Generator
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kappaskin.frames import Estimate
from kappaskin.pipeline import Getter, Reported, getters
from kappaskin.recording import messages as m
from kappaskin.recording.cdr import decode
from kappaskin.recording.reading import RecordedMessage, Recording
from kappaskin.recording.recompute import Recomputation

_COMPARED = {
    m.CONTACTS.name: m.CONTACT,
    m.CURVATURES.name: m.CURVATURE,
    m.SHAPES.name: m.COEFFICIENTS,
}
_TOLD = 1000  # messages between two times that the share is told


_GETTERS: dict[str, Getter] = {**getters(), "shape": attrgetter("estimate.coefficients.shape")}


@dataclass(frozen=True)
class Verification:
    """What came of it: contacts, curvatures and shapes `compared`, of `frames`; `different` ones.

    `first` tells the first difference, `largest` is the largest one as a share of the largest
    number beside it. `missing` counts recorded results whose frames are not there.
    """

    frames: int
    compared: int
    missing: int
    different: int
    first: str
    largest: float

    @property
    def same(self) -> bool:
        return self.compared > 0 and not (self.different or self.missing)

    @property
    def words(self) -> str:
        """The verdict as a sentence or two."""
        counts = f"{self.compared:,} recorded results of {self.frames:,} frames"
        if not self.compared:
            return f"{counts}: there is nothing to compare"
        parts = [f"{counts}: {'the same bit for bit' if self.same else 'not the same'}"]
        if self.different:
            parts.append(f"{self.different:,} differ, by {self.largest:.1g} of the largest number")
            parts.append(f"first {self.first}")
        if self.missing:
            parts.append(f"the frames of {self.missing:,} more are not there")
        return "; ".join(parts)


def verify_steps(path: Path) -> Generator[float | Verification]:
    """Work out everything that was recorded in `path` once more, and compare.

    Now and then the share that is done, and the verdict at the end. To be run where the engine's
    own arithmetic is, in one thread: others sum in another order. A `Refusal` where it is no
    recording.
    """
    with Recording(path) as recording:
        worker = _Worker(recording)
        span = max(recording.last - recording.first, 1)
        for n, message in enumerate(recording.messages()):
            worker(message)
            if n % _TOLD == 0:
                yield (message.stamp - recording.first) / span
        yield worker.verdict()


class _Worker:
    """Takes the messages as they were written."""

    def __init__(self, recording: Recording) -> None:
        self._recomputation = Recomputation(recording)
        self._frames = self._compared = self._missing = self._different = 0
        self._first, self._largest = "", 0.0

    def __call__(self, message: RecordedMessage) -> None:
        if kind := _COMPARED.get(message.topic):
            self._compare(decode(kind, message.data))
            return
        for _ in self._recomputation(message):
            self._frames += 1

    def _compare(self, recorded: dict[str, Any]) -> None:
        """Work out the frame that a recorded estimate is of, and hold the two together."""
        estimate = self._recomputation.estimate(recorded["sequence"])
        if estimate is None:
            self._missing += 1
            return
        self._compared += 1
        names = (name for name in recorded if not name.startswith("header."))
        differences = [
            d for name in names if (d := self._difference(name, recorded[name], estimate))
        ]
        self._different += bool(differences)
        self._first = self._first or "; ".join(differences[:1])

    def _difference(self, name: str, value: Any, estimate: Estimate) -> str:
        """In which way one number, or list of numbers, is another now; nothing if it is not."""
        again = _GETTERS[name](Reported(estimate))
        was, now = np.asarray(value).ravel(), np.asarray(again).ravel()
        real = was.dtype.kind == now.dtype.kind == "f" and was.shape == now.shape
        if was.tobytes() == now.tobytes() if real else np.array_equal(was, now):
            return ""
        scale = float(np.max(np.abs(was), initial=0.0)) if real else math.nan
        share = float(np.max(np.abs(was - now))) / scale if scale > 0 else math.inf
        self._largest = max(self._largest, share if share == share else math.inf)
        return (
            f"frame {estimate.sequence} at {estimate.device_time:.6f} s: {name} was "
            f"{_short(was)}, and is {_short(now)} now"
        )

    def verdict(self) -> Verification:
        return Verification(
            self._frames,
            self._compared,
            self._missing,
            self._different,
            self._first,
            self._largest,
        )


def _short(values: "NDArray[Any]") -> str:
    return ", ".join(f"{value!r}" for value in values[:4].tolist()) + ", ..." * (len(values) > 4)
