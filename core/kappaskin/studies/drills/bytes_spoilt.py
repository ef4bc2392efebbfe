"""Drills on the bytes under way: noise, cuts, wrong baud rates."""

from collections.abc import Callable
from functools import partial

from kappaskin.sources import BAUD_RATES, wire
from kappaskin.studies.drills.drill import Drill
from kappaskin.studies.drills.outcome import Outcome
from kappaskin.studies.drills.relay import Spoil, clean
from kappaskin.studies.drills.spoil import Cut, Flips, Garbage, OtherRate
from kappaskin.studies.drills.stand import Stand
from kappaskin.studies.drills.uart import speed_code

_WITHIN = 1.0  # s
_SEARCH = 12.0  # s to find one of seven baud rates


def _spoilt(make: Callable[[Stand], Spoil], stand: Stand) -> Outcome:
    """Spoil what passes for some time."""
    stand.settle()
    stand.relay.spoil = make(stand)
    stand.run(10.0 if stand.long else 0.8)
    stand.heal()
    stand.recover(_WITHIN)
    spoilt = stand.source.accounting().bytes_discarded
    return stand.outcome((spoilt > 0, "nothing was spoilt"))


def _garbage(share: float, stand: Stand) -> Outcome:
    return _spoilt(lambda stand: Garbage(share, stand.rng), stand)


def _flips(stand: Stand) -> Outcome:
    return _spoilt(lambda stand: Flips(20_000, stand.rng), stand)


def _misread(rate: float, stand: Stand) -> Outcome:
    return _spoilt(lambda _: OtherRate(BAUD_RATES[0], rate), stand)


def _cuts(stand: Stand) -> Outcome:
    """Break messages off at every byte of the longest, and let a whole one follow each."""
    stand.settle()
    cut = Cut()

    def many(message: wire.FromDevice) -> list[wire.FromDevice]:
        return [message] * 4

    stand.relay.rewrite, stand.relay.spoil = many, cut
    done = stand.until(lambda: cut.cuts >= cut.length, 60.0)
    stand.heal()
    stand.recover(_WITHIN)
    lost = stand.source.accounting().lost
    return stand.outcome(
        (done, f"only {cut.cuts} of {cut.length} cuts were made within 60 s"),
        (lost == cut.cuts, f"{cut.cuts} messages were cut, {lost} lost"),
    )


def _speed(baud_rate: int, stand: Stand) -> Outcome:
    """A device that means something at one baud rate only."""
    relay, code = stand.relay, speed_code(baud_rate)
    rates = {speed_code(rate): rate for rate in BAUD_RATES}

    def as_heard(data: bytes) -> bytes:
        if relay.speed == code:
            return data
        return OtherRate(baud_rate, rates.get(relay.speed, baud_rate / 2))(data)

    relay.spoil = as_heard
    stand.recover(_SEARCH)
    relay.spoil = clean
    lost = stand.source.accounting().lost
    return stand.outcome(
        (stand.told("rate"), "the rate that was found is not told"),
        (lost == 0, f"{lost} messages lost after the rate was found"),
        restarted=True,  # what was sent before is nowhere counted
    )


GARBAGE = [
    Drill(
        f"garbage {100 * share:.0f} %",
        f"bursts of noise over and between {100 * share:.0f} % of the bytes",
        partial(_garbage, share),
        _WITHIN,
    )
    for share in (0.01, 0.05, 0.2)
]

DRILLS = [
    *GARBAGE,
    Drill("bits", "one bit in 20,000 turned over", _flips, _WITHIN),
    Drill("cuts", "messages broken off after every byte, and begun again", _cuts, _WITHIN),
    Drill(
        "baud rate too low",
        "bits at 2,000,000 baud read at 921,600",
        partial(_misread, 921_600),
        _WITHIN,
    ),
    Drill(
        "baud rate too high",
        "bits at 2,000,000 baud read at 5,000,000",
        partial(_misread, 5e6),
        _WITHIN,
    ),
    Drill(
        "baud rate", "a device that speaks at 921,600 baud only", partial(_speed, 921_600), _SEARCH
    ),
]
