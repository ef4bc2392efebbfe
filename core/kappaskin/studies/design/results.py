"""Design results: tasks and their keys, means with intervals, and the folder of both."""

import hashlib
import json
import math
import sys
import threading
from collections import deque
from dataclasses import asdict, dataclass, field, replace
from functools import cache, cached_property, lru_cache
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from kappaskin._files import read_file, replacing, write_whole
from kappaskin._lazy import Displayed
from kappaskin.errors import Refusal
from kappaskin.estimation import Estimator
from kappaskin.frames import Array
from kappaskin.scenes import Scene, Simulator, kept_effects
from kappaskin.scenes.effects import Hysteresis
from kappaskin.studies.design.measures import MEASURES, FrameBlock, frame_times
from kappaskin.studies.design.study import (
    Point,
    PointSetup,
    Study,
    estimator_of,
    read_study,
    setup_of,
    with_values,
)

# Tasks

MEANING = 3
"""Incremented with every change that alters the numbers of a study."""

_ONE_BY_ONE = threading.Lock()  # what blocks share is not made for several threads


@cache
def version() -> str:
    """What a worker must have to give the same numbers."""
    ours = f"kappaskin {metadata.version('kappaskin')}, meaning {MEANING}"
    return f"{ours}, NumPy {np.__version__}, SciPy {scipy.__version__}"


@dataclass(frozen=True, slots=True)
class Moments:
    """How many values there were, their mean, and the squares of what they differ from it, added.

    Of no values the mean is zero.
    """

    count: int
    mean: float
    squares: float

    @classmethod
    def of(cls, values: Array) -> "Moments":
        known = values[~np.isnan(values)]
        if not len(known):
            return cls(0, 0.0, 0.0)
        with np.errstate(over="ignore", invalid="ignore"):
            mean = float(known.mean())
            squares = float(np.sum((known - mean) ** 2))
        if not math.isfinite(squares):
            raise Refusal("expected finite errors, got infinity: the arithmetic overflowed")
        return cls(len(known), mean, squares)


BlockMoments = dict[str, Moments]


@dataclass(frozen=True)
class BlockTask:
    """Block number `block` of the point that `document` describes in JSON, for a `version`.

    Its numbers depend on nothing else, whoever computes it, and when.
    """

    document: str
    block: int
    version: str

    def _digest(self, *parts: str) -> str:
        return hashlib.sha256("\n".join((*parts, str(self.block))).encode()).hexdigest()

    @cached_property
    def key(self) -> str:
        """The name of its result: another one where anything that matters is another."""
        return self._digest(self.version, self.document)

    @cached_property
    def seed(self) -> int:
        """The seed of what is random in it, whatever is measured of that."""
        content = json.loads(self.document)
        return int(self._digest(json.dumps(content | {"measure": None}, sort_keys=True))[:16], 16)


def block_of(setup: PointSetup, estimator: Estimator, seed: int) -> FrameBlock:
    """`setup.measure.frames` frames, spoilt as `seed` decides."""
    scene = replace(setup.scene, layout=estimator.layout, seed=seed)
    simulator, times = Simulator(scene), frame_times(scene, setup.measure.frames)
    truths, read = simulator.readings(scene.sensor().scan(), times)
    if setup.fit.compensate:
        read = _compensated(scene, read)
    read[:, ~scene.layout.live.ravel()] = np.nan
    known = [truth for truth in truths if truth is not None]
    return FrameBlock(simulator, estimator, known, read.reshape(-1, *scene.layout.frame_shape))


def _compensated(scene: Scene, read: Array) -> Array:
    """Readings (T, R) in 1/m, one after the other, with the scene's hysteresis compensated."""
    loops = [effect for effect in kept_effects(scene) if isinstance(effect, Hysteresis)]
    if not loops:
        raise Refusal("expected a scene with hysteresis to compensate, got one without")
    undo = loops[0].operator(read.shape[1]).inverse.start()
    return np.array([undo(frame) for frame in read])


@lru_cache(4)
def _setup(document: str) -> PointSetup:
    return setup_of(json.loads(document))


def _drawn(task: BlockTask) -> tuple[dict[str, Any], PointSetup]:
    """The content of the task's point, and its setup, with random values drawn."""
    content, setup = json.loads(task.document), _setup(task.document)
    if not setup.draws:
        return content, setup
    rng = np.random.default_rng(task.seed)
    content = with_values(content, {place: draw(rng) for place, draw in setup.draws})
    return content, setup_of(content)


def run_task(task: BlockTask) -> BlockMoments:
    """The measured values of the block; raises a `Refusal` if it cannot be computed."""
    if task.version != version():
        raise Refusal(
            f"expected a worker with {task.version}, got one with {version()}; install the same "
            "on all"
        )
    with _ONE_BY_ONE:
        content, setup = _drawn(task)
        block = block_of(setup, estimator_of(content, setup), task.seed)
        return {name: Moments.of(MEASURES[name].of(block)) for name in setup.measure.what}


# What is known of a point from its blocks

_MORE = 1.5  # times the blocks that were not enough
_DOUBT = 0.05  # what an interval of 95 % leaves


@dataclass(frozen=True, slots=True)
class Mean:
    """The `mean` of a measure with the `half` width of its 95 % interval, and the `sd` of a value.

    Blocks are independent of each other, frames of one may not be: the interval is Student's of
    the means of the blocks. Where all of them are all or nothing of something, it reaches to the
    share for which so many blocks are alike once in twenty times. NaN where nothing is known.
    """

    mean: float
    half: float
    sd: float
    count: int

    @classmethod
    def of(cls, blocks: list[Moments], share: bool = False) -> "Mean":
        """The mean of some blocks, which may be a `share` of something."""
        some = [block for block in blocks if block.count]
        count = sum(block.count for block in some)
        if not some:
            return cls(math.nan, math.nan, math.nan, 0)
        means = np.array([block.mean for block in some])
        weights = np.array([block.count for block in some]) / count
        mean = float(weights @ means)
        squares = sum(block.squares + block.count * (block.mean - mean) ** 2 for block in some)
        sd = math.sqrt(squares / (count - 1)) if count > 1 else math.nan
        alike = share and set(means.tolist()) in ({0.0}, {1.0})
        half = 1 - _DOUBT ** (1 / len(some)) if alike else _half(means, weights, mean)
        return cls(mean, half, sd, count)

    def within(self, share: float) -> bool:
        """Whether the interval reaches no further than this share of the mean."""
        return self.half <= share * abs(self.mean)


def _half(means: Array, weights: Array, mean: float) -> float:
    B = len(means)
    if B < 2:
        return math.nan
    variance = B / (B - 1) * float(np.sum((weights * (means - mean)) ** 2))
    return float(scipy.special.stdtrit(B - 1, 1 - _DOUBT / 2)) * math.sqrt(variance)


@dataclass(eq=False)
class PointResults:
    """What is known of one `point`: how many blocks are `done`, and why some failed.

    Results are held until no more are required, and then their means alone: a study of many
    points takes little more memory than one of few.
    """

    point: Point
    study: Study
    done: int = 0
    _results: dict[int, BlockMoments | str] = field(default_factory=dict[int, "BlockMoments | str"])
    _means: dict[str, Mean] = field(default_factory=dict[str, Mean])
    _failures: list[str] = field(default_factory=list[str])
    required: int = field(init=False)

    def __post_init__(self) -> None:
        self.required = self.study.stop.least

    def take(self, block: int, result: BlockMoments | str) -> range:
        """Numbers of the blocks to compute next, when `block` was the last one required.

        They follow from the results of all before alone, whoever computed them in whatever order.
        """
        self._results[block] = sys.intern(result) if isinstance(result, str) else result
        self.done += 1
        if not self.complete:
            return range(0)
        before, most = self.required, self.study.stop.most
        if before == most or self.failures or self.enough:
            self._close()
            return range(0)
        self.required = min(math.ceil(_MORE * before), most)
        return range(before, self.required)

    def _close(self) -> None:
        self._means = {name: self.mean(name) for name in self.study.measures}
        self._failures = self.failures
        self._results.clear()

    def _in_order(self) -> list[BlockMoments | str]:
        return [self._results[block] for block in sorted(self._results)]

    @property
    def failures(self) -> list[str]:
        """Why blocks failed, in their order."""
        held = [result for result in self._in_order() if isinstance(result, str)]
        return self._failures or held

    @property
    def complete(self) -> bool:
        """Whether all blocks that it takes were computed."""
        return self.done == self.required

    @property
    def enough(self) -> bool:
        """Whether all means are as accurate as the study requires."""
        stop = self.study.stop
        return all(self.mean(name).within(stop.within) for name in stop.of)

    def mean(self, measure: str) -> Mean:
        """The mean of a measure, from its blocks in order."""
        if self._means:
            return self._means[measure]
        blocks = [result[measure] for result in self._in_order() if not isinstance(result, str)]
        return Mean.of(blocks, MEASURES[measure].share)


# The folder

_ABOUT = "about.json"
_LARGEST = 2**22  # bytes of a file of a study
_TEXT = "study.toml"


class StudyFolder(Displayed):
    """Results by task, at `path`; each file is written whole or not at all.

    A task whose parameters, block, measures and version are those of an earlier one finds its
    result, whatever else has changed in the study meanwhile.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)

    @classmethod
    def opened(cls, path: Path, study: Study) -> "StudyFolder":
        """The folder for the results of `study`, made where there is none."""
        folder = cls(path)
        try:
            path.mkdir(parents=True, exist_ok=True)
            if any(path.iterdir()) and (owner := folder.name) != study.name:
                raise Refusal(
                    f"{path}: expected an empty folder or one of the study {study.name}, got that "
                    f"of {owner}; choose another with --out"
                )
            write_whole(path / _ABOUT, json.dumps({"study": study.name}))
            write_whole(path / _TEXT, study.text)
        except OSError as error:
            raise Refusal(
                f"{path}: expected a folder that can be written to ({error}); choose another"
            ) from error
        return folder

    @property
    def name(self) -> str:
        """The name of the study that it belongs to."""
        try:
            return str(json.loads(read_file(self.path / _ABOUT, _LARGEST))["study"])
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise Refusal(
                f"{self.path}: expected a folder made by kappaskin study, got another one ({error})"
            ) from error

    def study(self) -> Study:
        """The study that was last computed here."""
        name, file = self.name, self.path / _TEXT
        try:
            return read_study(read_file(file, _LARGEST).decode(), Path(f"{name}.toml"))
        except OSError as error:
            raise Refusal(f"{file}: cannot be read ({error}); run the study again") from error

    def _file(self, task: BlockTask) -> Path:
        return self.path / "results" / task.key[:2] / f"{task.key}.json"

    def result(self, task: BlockTask) -> BlockMoments | str | None:
        """What the task measured, or why it failed; None where neither is known."""
        try:
            content: dict[str, Any] = json.loads(read_file(self._file(task), _LARGEST))
            if "failed" in content:
                return str(content["failed"])
            return {name: Moments(**moments) for name, moments in content["measured"].items()}
        except (OSError, ValueError, KeyError, TypeError):
            return None  # to be computed anew

    def save(self, task: BlockTask, result: BlockMoments | str) -> None:
        """Write what the task measured, or why it failed."""
        failed = isinstance(result, str)
        found = (
            {"failed": result}
            if isinstance(result, str)
            else {"measured": {name: asdict(moments) for name, moments in result.items()}}
        )
        about = {"version": task.version, "block": task.block, "point": json.loads(task.document)}
        file = self._file(task)
        with replacing(file, "free disk space, then run the study again: it resumes") as part:
            file.parent.mkdir(parents=True, exist_ok=True)
            part.write_text(json.dumps(about | found, allow_nan=failed), "utf-8")


def stored_results(study: Study, folder: StudyFolder) -> list[PointResults]:
    """The results of every point of `study` that are in its `folder`."""
    found = list[PointResults]()
    for point in study.points():
        known, blocks = PointResults(point, study), deque(range(study.stop.least))
        while blocks:
            block = blocks.popleft()
            if (result := folder.result(BlockTask(point.document, block, version()))) is not None:
                blocks.extend(known.take(block, result))
        found.append(known)
    return found
