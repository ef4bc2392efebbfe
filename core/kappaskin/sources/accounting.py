"""What became of every byte and every sequence number that came over a line."""

from dataclasses import dataclass

SEQUENCES = 2**32
"""Sequence numbers there are, before they begin again at 0."""

_LATE = 64  # how far back a sequence number may be late rather than a restart of the device

_FEW = 1e-5  # share below which its size is not told


@dataclass(frozen=True, slots=True)
class Accounting:
    """What became of every byte and every sequence number since a source was opened.

    bytes_in = bytes_good + sum of discarded + buffered; good = accepted + duplicate;
    span = accepted + lost.
    """

    bytes_in: int = 0
    bytes_good: int = 0
    discarded: tuple[tuple[str, int], ...] = ()
    buffered: int = 0
    good: int = 0
    accepted: int = 0
    duplicate: int = 0
    lost: int = 0
    span: int = 0
    restarts: int = 0
    other_version: int | None = None

    @property
    def bytes_discarded(self) -> int:
        return sum(n for _, n in self.discarded)

    @property
    def words(self) -> str:
        """Losses in words, such as "12 of 30,210 messages lost; 0.3 % of bytes discarded"."""
        told = [f"{self.lost:,} of {self.span:,} messages lost"]
        if thrown := self.bytes_discarded:
            why = ", ".join(f"{reason} {n:,}" for reason, n in self.discarded if n)
            told.append(f"{_percent(thrown / self.bytes_in)} of bytes discarded: {why}")
        if self.restarts:
            times = "once" if self.restarts == 1 else f"{self.restarts} times"
            told.append(f"the device began anew {times}")
        return "; ".join(told)

    @property
    def balanced(self) -> bool:
        """Whether the three sums hold, as they always do."""
        return (
            self.bytes_in == self.bytes_good + self.bytes_discarded + self.buffered
            and self.good == self.accepted + self.duplicate
            and self.span == self.accepted + self.lost
        )


def _percent(share: float) -> str:
    return f"under {100 * _FEW:g} %" if share < _FEW else f"{float(f'{100 * share:.2g}'):g} %"


class Sequence:
    """Tells accepted, duplicate, late and lost sequence numbers apart, through wrap and restart."""

    def __init__(self) -> None:
        self.good = self.accepted = self.duplicate = self.lost = self.span = self.restarts = 0
        self._next: int | None = None
        # The number expected when the line was interrupted, and the first one since.
        self._before: int | None = None
        self._first: int | None = None
        self._missing: set[int] = set()

    def take(self, sequence: int) -> bool:
        """Count one good message; False when it came before."""
        self.good += 1
        if sequence == self._next and not self._missing:  # nearly all of them
            self.span += 1
            self.accepted += 1
            self._next = (sequence + 1) % SEQUENCES
            return True
        if self._next is None:
            self._first = sequence
        expected = sequence if self._next is None else self._next
        ahead = (sequence - expected) % SEQUENCES
        if ahead < SEQUENCES // 2:
            self._advance(sequence, ahead)
        elif SEQUENCES - ahead > _LATE:
            self.restarts += 1
            self._missing.clear()
            self._advance(sequence, 0)
        elif sequence in self._missing:
            self._missing.remove(sequence)
            self.lost -= 1
        else:
            self.duplicate += 1
            return False
        self.accepted += 1
        return True

    def interrupt(self) -> None:
        """The line is gone: whether the next number goes on from the last is to be said then."""
        if self._next is not None:
            self._before = self._next
        self._next = self._first = None
        self._missing.clear()

    def resume(self, same: bool) -> None:
        """Say of the first number since whether the device went on, or began anew."""
        if self._before is None or self._first is None:
            return
        gap = (self._first - self._before) % SEQUENCES
        if same and gap < SEQUENCES // 2:
            self.lost += gap
            self.span += gap
        else:
            self.restarts += 1
        self._before = None

    def _advance(self, sequence: int, gap: int) -> None:
        self.lost += gap
        self.span += gap + 1
        self._next = (sequence + 1) % SEQUENCES
        recent = min(gap, _LATE)
        self._missing.update((sequence - q) % SEQUENCES for q in range(1, recent + 1))
        if self._missing:
            self._missing = {s for s in self._missing if (self._next - s) % SEQUENCES <= _LATE}
