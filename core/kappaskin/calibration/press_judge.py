"""What the channels answered to a press to the element that was pressed, by what they read."""

from dataclasses import dataclass

import numpy as np
import scipy

from kappaskin.frames import Array
from kappaskin.sensing import SensorLayout

OK, ELSEWHERE, NOTHING, UNCLEAR, SKIPPED = "ok", "elsewhere", "nothing", "unclear", "skipped"

_BESIDE = 1.6  # distances of elements: no further apart are those beside each other
_AS_GOOD = 0.75  # of the strongest answer: one beside it that answers so much was pressed too
_ALSO = 0.8  # of the same: one elsewhere that answers so much leaves it unclear


@dataclass(frozen=True, eq=False)
class Pressed:
    """What came of pressing the element `asked` for: one of `OK`, `ELSEWHERE` and so on.

    `element` answered most, None where none did. `answer` (3, P) in 1/m is what all changed by.
    """

    asked: int
    verdict: str
    element: int | None
    answer: Array
    why: str = ""

    def __str__(self) -> str:
        if self.verdict == ELSEWHERE:
            return f"element {self.element} answers in the place of element {self.asked}"
        words = {
            OK: "answers",
            NOTHING: "does not answer, nor does any other",
            SKIPPED: "was not pressed",
        }
        return f"element {self.asked} {words.get(self.verdict, f'is not clear: {self.why}')}"


def judge(layout: SensorLayout, asked: int, answer: Array) -> Pressed:
    """Which element was pressed by the change `answer` (3, P) of all, and if it was `asked`.

    Where a skin is pressed it bends most, whichever of its components is read as which: no fit is
    asked, and none of what the map says of other elements.
    """
    # Where it bulges it was let go: under a finger that moved on from elsewhere.
    strength = np.linalg.norm(np.where(layout.live, np.minimum(answer, 0.0), 0.0), axis=0)
    peak = int(strength.argmax())
    apart = np.linalg.norm(layout.positions - layout.positions[peak], axis=1)
    near = apart <= _BESIDE * _pitch(layout)
    also = np.where(near, 0.0, strength)
    if also.max() > _ALSO * strength[peak]:
        why = f"elements {peak} and {int(also.argmax())} answer alike"
        return Pressed(asked, UNCLEAR, peak, answer, why)
    if near[asked] and strength[asked] >= _AS_GOOD * strength[peak]:
        peak = asked
    return Pressed(asked, OK if peak == asked else ELSEWHERE, peak, answer)


def _pitch(layout: SensorLayout) -> float:
    """The median distance in m of an element to the nearest other one."""
    if len(layout) < 2:
        return 1.0
    apart, _ = scipy.spatial.KDTree(layout.positions).query(layout.positions, 2)
    return float(np.median(np.asarray(apart)[:, 1]))
