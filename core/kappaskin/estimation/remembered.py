"""What depends on which readings are there, kept for the frames that lack the same ones."""

from collections import OrderedDict
from collections.abc import Callable
from typing import Generic, TypeVar

from kappaskin.frames import Mask

_SETS = 8  # that are kept: those used last
_Made = TypeVar("_Made")


class Remembered(Generic[_Made]):
    """What was made of the sets of readings that were used last."""

    def __init__(self) -> None:
        self._made: OrderedDict[bytes, _Made] = OrderedDict()

    def __call__(self, used: Mask, make: Callable[[Mask], _Made]) -> _Made:
        """What `make` makes of the readings `used`; it is asked when it was not lately."""
        key = used.tobytes()
        if key in self._made:
            self._made.move_to_end(key)
            return self._made[key]
        made = self._made[key] = make(used)
        if len(self._made) > _SETS:
            self._made.popitem(last=False)
        return made
