"""How well a few letters name a text: they need only come in it in their order."""

from collections.abc import Mapping
from functools import lru_cache

_BEGINS, _FOLLOWS, _SKIPS = 8, 5, 0.2  # points of a letter that begins a word, or has its neighbour
_WHOLE = 4  # points more where the text begins so
_FAR = 0.3  # of the best one's points, below which it is not what was meant
_ELSEWHERE = 0.4  # of the points, for what is found only in where a thing stands


def score(query: str, text: str, place: str = "") -> float:
    """Points of `text`, which stands at `place`, for all words of `query`; 0 where one misses.

    The words may come in any order, their letters only in theirs.
    """
    points = [_best(word, text, place) for word in query.lower().split()]
    if not points:
        return 1.0
    return sum(points) - 0.01 * len(text) if min(points) > 0 else 0.0


def best(points: Mapping[str, float]) -> list[str]:
    """Those that were meant, the best first; of equal ones in the order given."""
    least = _FAR * max(points.values(), default=0.0)
    return sorted((name for name in points if points[name] > least), key=lambda name: -points[name])


def _best(word: str, text: str, place: str) -> float:
    return max(_points(word, text.lower()), _ELSEWHERE * _points(word, place.lower()))


@lru_cache(maxsize=20_000)
def _points(word: str, text: str) -> float:
    """Points of the best way to find the letters of `word` in `text`; 0 where there is none."""
    letters = iter(text)
    if not all(letter in letters for letter in word):
        return 0.0
    # best[j]: of the letters so far, the last of them at j.
    best = {at: _at(text, at) for at, letter in enumerate(text) if letter == word[0]}
    for letter in word[1:]:
        best = {
            at: max(
                _step(text, before, at) + points for before, points in best.items() if before < at
            )
            for at in range(min(best) + 1, len(text))
            if text[at] == letter
        }
    most = max(best.values(), default=0.0)
    return max(most, 0.1) + _WHOLE * text.startswith(word)


def _at(text: str, at: int) -> float:
    begins = at == 0 or not text[at - 1].isalnum()
    return 1.0 + _BEGINS * begins


def _step(text: str, before: int, at: int) -> float:
    """Points of a letter at `at` after one at `before`."""
    skipped = at - before - 1
    return max(_at(text, at), 1.0 + _FOLLOWS * (skipped == 0)) - _SKIPS * skipped
