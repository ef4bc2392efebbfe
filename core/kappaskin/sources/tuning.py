"""Bytes that mean nothing to the baud rate to try next."""

from kappaskin.sources.ports import BAUD_RATE

BAUD_RATES = (BAUD_RATE, 1_000_000, 921_600, 500_000, 460_800, 230_400, 115_200)
"""Rates that a device may speak at, the usual one first."""


class Tuning:
    """Which rate to listen at; a rate that was right is tried again after each other one."""

    def __init__(self, rate: int) -> None:
        self._good: int | None = None
        self._told, self._place, self._tried = rate, BAUD_RATES.index(rate), {rate}

    def good(self, rate: int) -> bool:
        """Take note that a message came at `rate`; whether that is news."""
        self._good = rate
        news, self._told = rate != self._told, rate
        return news

    def next(self, rate: int) -> int:
        """The rate to try after this one."""
        if self._good not in (None, rate):
            return self._good
        self._place = (self._place + 1) % len(BAUD_RATES)
        if BAUD_RATES[self._place] == rate:
            self._place = (self._place + 1) % len(BAUD_RATES)
        self._tried.add(BAUD_RATES[self._place])
        return BAUD_RATES[self._place]

    @property
    def told(self) -> str:
        """What was tried, in words."""
        if len(self._tried) == len(BAUD_RATES):
            return f"at any baud rate from {BAUD_RATES[-1]} to {BAUD_RATES[0]}:"
        tried = ", ".join(str(rate) for rate in BAUD_RATES if rate in self._tried)
        return f"at {tried} baud; as bytes come other rates are tried, or"
