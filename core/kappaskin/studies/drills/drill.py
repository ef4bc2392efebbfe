"""A fault with a name, what is done, and how fast it must be over."""

import math
from collections.abc import Callable
from dataclasses import dataclass

from kappaskin.studies.drills.outcome import Outcome
from kappaskin.studies.drills.stand import Stand


@dataclass(frozen=True)
class Drill:
    """A fault: `does` says which, `run` inflicts it, and it must be over `within` so many s."""

    name: str
    does: str
    run: Callable[[Stand], Outcome]
    within: float = math.inf
