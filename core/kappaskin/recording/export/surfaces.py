"""Moments to files of the skin's surface, one or a series of them."""

import math
from abc import ABC, abstractmethod
from pathlib import Path

import numpy as np

from kappaskin.errors import Refusal
from kappaskin.pipeline import Pipeline
from kappaskin.recording.export.about import About
from kappaskin.recording.export.moment import Moment
from kappaskin.recording.export.skin import Skin, Surface
from kappaskin.recording.export.wanted import Wanted


class Surfaces(ABC):
    """Surfaces, of which a kind of file need only say how one of them is written."""

    suffix: str

    def __init__(self, room: Path, wanted: Wanted, about: About) -> None:
        self.room, self.wanted, self.about = room, wanted, about
        self.times: dict[str, float] = {}
        """Of the surfaces that were written, in s, by the file's place beside the others."""
        self._made: tuple[Pipeline, Skin] | None = None
        if wanted.folder is not None:
            (room / wanted.folder.name).mkdir()

    def take(self, moment: Moment) -> bool:
        coefficients = moment.estimate.coefficients
        if not np.isfinite(coefficients).all():
            if self.wanted.at is not None:
                raise Refusal(
                    f"the readings at {moment.at:.6g} s decide no shape; choose another moment"
                )
            return False
        name = self.wanted.to.name
        if self.wanted.folder is not None:
            name = f"{self.wanted.folder.name}/{len(self.times):06d}{self.suffix}"
        self.write(self.room / name, moment, self._skin(moment.pipeline)(coefficients))
        self.times[name] = moment.at
        return True

    def _skin(self, pipeline: Pipeline) -> Skin:
        if self._made is None or self._made[0] is not pipeline:
            setup = pipeline.setup
            self._made = pipeline, Skin(pipeline.basis, setup.nx, setup.ny)
        return self._made[1]

    def said(self, moment: Moment) -> str:
        """What a file says of the surface at one moment."""
        estimate = moment.estimate
        numbers = {"time": moment.at, "sequence": estimate.sequence, "setup": estimate.generation}
        force = estimate.touch.force
        return self.about.json(**numbers, force=force if math.isfinite(force) else None)

    @abstractmethod
    def write(self, path: Path, moment: Moment, surface: Surface) -> None: ...

    @abstractmethod
    def finish(self) -> None: ...

    def close(self) -> None:
        """Let go of the skin; every file is closed once it is written."""
        self._made = None


class StlSurfaces(Surfaces):
    """Binary STL in m; what that cannot say stands in a JSON file beside it."""

    suffix = ".stl"

    def write(self, path: Path, moment: Moment, surface: Surface) -> None:
        facets = np.zeros(len(surface.triangles), _FACET)
        facets["corners"] = corners = surface.points[surface.triangles]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.linalg.norm(normals, axis=-1, keepdims=True)
        facets["normal"] = normals / np.where(length > 0, length, 1.0)
        head = f"{self.about.program}, {self.about.sensor.name}, {moment.at:.6f} s, in m"
        # Shorter than 80 bytes it is filled with zeros.
        with path.open("wb") as file:
            file.write(np.array(head.encode("ascii", "replace")[:80], "S80").tobytes())
            file.write(np.array(len(facets), "<u4").tobytes() + facets.tobytes())

    def finish(self) -> None:
        beside = self.wanted.beside
        if beside is not None:
            told = self.about.json(times=self.times, lengths="m", time="s")
            (self.room / beside.name).write_text(told, encoding="utf-8")


_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("unused", "<u2")])
