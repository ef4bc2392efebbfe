"""What something remembers, as plain arrays by name, and back: safe to read from any file."""

from collections.abc import Mapping
from typing import Any, ClassVar, cast

import numpy as np
from numpy.typing import NDArray

from kappaskin.errors import Refusal

State = dict[str, NDArray[np.float64]]


class Stateful:
    """Something whose past is in its attributes `REMEMBERED`: arrays, numbers, or such things."""

    __slots__ = ()
    REMEMBERED: ClassVar[tuple[str, ...]] = ()

    def remembered(self, before: str = "") -> State:
        """All that it remembers; what it has none of yet is left out."""
        found: State = {}
        for name in self.REMEMBERED:
            value = getattr(self, name)
            if isinstance(value, Stateful):
                found |= value.remembered(f"{before}{name}.")
            elif value is not None:
                found[before + name] = np.array(value, float)
        return found

    def recall(self, memory: Mapping[str, NDArray[np.float64]], before: str = "") -> None:
        """Go on from what another of the same kind and sizes `remembered`."""
        for name in self.REMEMBERED:
            value = getattr(self, name)
            if isinstance(value, Stateful):
                value.recall(memory, f"{before}{name}.")
            elif value is not None:
                setattr(self, name, _like(before + name, value, memory))


def _like(name: str, value: Any, memory: Mapping[str, NDArray[np.float64]]) -> Any:
    """What `memory` has under this name, if it is of the same shape as `value`."""
    kept, shape = memory.get(name), np.shape(value)
    if kept is None or kept.shape != shape:
        raise Refusal(
            f"expected {name} of shape {shape} to go on from, got "
            + ("nothing" if kept is None else f"shape {kept.shape}")
        )
    if not isinstance(value, np.ndarray):
        return float(kept)
    # In the order in which products were taken of it, or they differ in the last bit.
    return kept.astype(cast("Any", value.dtype), order="F")
