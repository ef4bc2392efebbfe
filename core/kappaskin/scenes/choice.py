"""Which effects of a scene are simulated."""

from dataclasses import dataclass

from kappaskin.errors import Refusal
from kappaskin.scenes.effects import EFFECTS


@dataclass(frozen=True)
class Choice:
    """Which effects are simulated: those that matter, or all there are; `on` and `off` by name.

    With `auto` an effect is left out when it and all others left out change no reading by more than
    `accuracy`, a share of the scene's peak curvature.
    """

    auto: bool = False
    accuracy: float = 0.01
    on: frozenset[str] = frozenset()
    off: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        if not 0 < self.accuracy < 1:
            raise Refusal(f"expected an accuracy between 0 and 1 of the peak, got {self.accuracy}")
        for name in sorted(self.on | self.off):
            if name not in EFFECTS:
                raise Refusal(f"expected effects among {', '.join(EFFECTS)}; got {name!r}")
        if both := sorted(self.on & self.off):
            raise Refusal(f"expected an effect to be on or off, got {', '.join(both)} as both")


LINEAR = Choice(off=frozenset({"finite-slope"}))
"""All there is of the electronics, on a skin of which the gages sense what Eqs. 3-5 say."""
