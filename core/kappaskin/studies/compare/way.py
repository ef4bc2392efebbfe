"""What every way from a question to a shape is, ours and others'."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from kappaskin.frames import Array


@dataclass(frozen=True, eq=False)
class Way:
    """A way to a shape, made once for what does not change from one question to the next.

    `solve` takes a question, readings (..., 3, P) in 1/m or a load, to `count` unknowns (..., U);
    `at` tells of points (G, 2) in m the matrix (G, U) that makes displacements of them. `kept` are
    bytes that it holds where Python does not count them.
    """

    solve: Callable[[Any], Array]
    at: Callable[[Array], Any]
    count: int
    error_bars: bool = False
    kept: int = 0
