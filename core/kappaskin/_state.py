"""State of filters and operators as plain arrays by name: written into recordings and restored."""

from collections.abc import Mapping
from typing import Any, ClassVar, cast

import numpy as np
from numpy.typing import NDArray

from kappaskin.errors import Refusal

StateArrays = dict[str, NDArray[np.float64]]


class Stateful:
    """Something whose answers depend on its past, which the attributes named in `STATE` hold.

    Each is an array, a number, or another `Stateful`. Recordings hold their names: another name for
    an attribute would leave the recordings of today without a beginning.
    """

    __slots__ = ()
    STATE: ClassVar[tuple[str, ...]] = ()

    def state(self, prefix: str = "") -> StateArrays:
        """The state by name, each behind `prefix`; without what has no value yet."""
        found: StateArrays = {}
        for name in self.STATE:
            value = getattr(self, name)
            if isinstance(value, Stateful):
                found |= value.state(f"{prefix}{name}.")
            elif value is not None:
                found[prefix + name] = np.array(value, float)
        return found

    def restore(self, state: Mapping[str, NDArray[np.float64]], prefix: str = "") -> None:
        """Continue from the `state` of another of the same kind and sizes."""
        for name in self.STATE:
            value = getattr(self, name)
            if isinstance(value, Stateful):
                value.restore(state, f"{prefix}{name}.")
            elif value is not None:
                setattr(self, name, _like(prefix + name, value, state))


def _like(name: str, value: Any, state: Mapping[str, NDArray[np.float64]]) -> Any:
    """What `state` has under this name, if it is of the same shape as `value`."""
    saved, shape = state.get(name), np.shape(value)
    if saved is None or saved.shape != shape:
        raise Refusal(
            f"expected {name} of shape {shape} to go on from, got "
            + ("nothing" if saved is None else f"shape {saved.shape}")
        )
    if not isinstance(value, np.ndarray):
        return float(saved)
    # In the order in which products were taken of it, or they differ in the last bit.
    return saved.astype(cast("Any", value.dtype), order="F")
