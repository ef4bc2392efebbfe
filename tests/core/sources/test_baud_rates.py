"""Which baud rate is tried next."""

from kappaskin.sources import BAUD_RATES
from kappaskin.sources.ports import BaudRateSearch


def tried(tuning: BaudRateSearch, rate: int, count: int) -> list[int]:
    rates = []
    for _ in range(count):
        rate = tuning.next(rate)
        rates.append(rate)
    return rates


def test_every_rate_is_tried_round_and_round() -> None:
    tuning = BaudRateSearch(BAUD_RATES[0])
    assert tried(tuning, BAUD_RATES[0], 7) == [*BAUD_RATES[1:], BAUD_RATES[0]]
    assert tuning.tried == "at any baud rate from 115200 to 2000000:"


def test_a_rate_that_was_right_is_tried_again_after_each_other_one() -> None:
    tuning = BaudRateSearch(BAUD_RATES[0])
    assert tuning.good(500_000)
    assert not tuning.good(500_000)
    rates = tried(tuning, 500_000, 6)
    assert rates[1::2] == [500_000] * 3
    assert 500_000 not in rates[::2]


def test_a_right_rate_is_never_the_only_one_tried() -> None:
    tuning = BaudRateSearch(BAUD_RATES[0])
    tuning.good(BAUD_RATES[1])
    assert set(tried(tuning, BAUD_RATES[1], 40)) == set(BAUD_RATES)
