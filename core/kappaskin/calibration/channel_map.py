"""Verification of the channel map by pressing elements."""

from dataclasses import dataclass
from itertools import permutations

import numpy as np
import scipy

from kappaskin.bases import basis_for
from kappaskin.frames import COMPONENTS, Array, Indices
from kappaskin.mechanics import PointLoad
from kappaskin.sensing import Sensor, SensorLayout

OK, ELSEWHERE, NOTHING, UNCLEAR, SKIPPED = "ok", "elsewhere", "nothing", "unclear", "skipped"

_BESIDE = 1.6  # distances of elements: no further apart are those beside each other
_AS_GOOD = 0.75  # of the largest response: a neighbour that responds so much was pressed too
_ALSO = 0.8  # of the same: one elsewhere that answers so much leaves it unclear

_CLEARLY = 0.5  # of the squares left: by so much another order of components explains more
_FUNCTIONS = 15  # along each side, of the shape it makes
_ORDERS = tuple(permutations(range(3)))
_NAMED = 6  # of them one by one


@dataclass(frozen=True, eq=False)
class PressResult:
    """The result of pressing the element `target` for; `verdict` is `OK`, `ELSEWHERE` and so on.

    `element` responded most, None where none did. `answer` (3, P) in 1/m is the change of all.
    """

    target: int
    verdict: str
    element: int | None
    answer: Array
    why: str = ""

    def __str__(self) -> str:
        if self.verdict == ELSEWHERE:
            return f"element {self.element} responds in place of element {self.target}"
        words = {
            OK: "responds",
            NOTHING: "does not respond, and no other does",
            SKIPPED: "was not pressed",
        }
        return f"element {self.target} {words.get(self.verdict, f'is ambiguous: {self.why}')}"


def judge_press(layout: SensorLayout, target: int, answer: Array) -> PressResult:
    """Which element was pressed, by the change `answer` (3, P) of all, and if it was `target`.

    Where a skin is pressed it bends most, whichever of its components is read as which: neither a
    fit nor the map of other elements is needed.
    """
    # Where it bulges it was let go: under a finger that moved on from elsewhere.
    strength = np.linalg.norm(np.where(layout.live, np.minimum(answer, 0.0), 0.0), axis=0)
    peak = int(strength.argmax())
    distance = np.linalg.norm(layout.positions - layout.positions[peak], axis=1)
    near = distance <= _BESIDE * _pitch(layout)
    also = np.where(near, 0.0, strength)
    if also.max() > _ALSO * strength[peak]:
        why = f"elements {peak} and {int(also.argmax())} respond equally"
        return PressResult(target, UNCLEAR, peak, answer, why)
    if near[target] and strength[target] >= _AS_GOOD * strength[peak]:
        peak = target
    return PressResult(target, OK if peak == target else ELSEWHERE, peak, answer)


def _pitch(layout: SensorLayout) -> float:
    """The median distance in m of an element to the nearest other one."""
    if len(layout) < 2:
        return 1.0
    distance, _ = scipy.spatial.KDTree(layout.positions).query(layout.positions, 2)
    return float(np.median(np.asarray(distance)[:, 1]))


@dataclass(frozen=True, eq=False)
class MapVerdict:
    """Whether the map is `confirmed`, and what was found, as texts in `words`.

    `order` (3 P,) is the map that was found: `readings[order]` are those of the channels in their
    right places. None where the presses do not determine it.
    """

    confirmed: bool
    words: tuple[str, ...]
    order: Indices | None

    def __str__(self) -> str:
        return "; ".join(self.words)


def map_verdict(sensor: Sensor, done: tuple[PressResult, ...]) -> MapVerdict:
    """What pressing some elements shows of the channel map."""
    layout = sensor.layout
    answered = [pressed for pressed in done if pressed.verdict in (OK, ELSEWHERE)]
    open_ = [str(pressed) for pressed in done if pressed.verdict not in (OK, ELSEWHERE)]
    found = {p.target: p.element for p in answered if p.element is not None}
    elements, words = _elements(layout, found)
    if elements is None:
        return MapVerdict(False, (*words, *_some(open_)), None)
    orders, more = _components(sensor, answered, elements)
    words = [*words, *more]
    order = np.concatenate([orders[c] * len(layout) + elements for c in range(3)])
    if not words and answered and not open_:
        return MapVerdict(
            True, (f"channel map confirmed: {_counted(answered)} where pressed",), order
        )
    if not answered:
        words = ["the presses do not determine the map"]
    elif not words:
        words = [f"no error was found: {_counted(answered)} where pressed"]
    return MapVerdict(False, (*words, *_some(open_)), order if answered else None)


def _counted(answered: list[PressResult]) -> str:
    return "1 element responds" if len(answered) == 1 else f"{len(answered)} elements respond"


def _some(words: list[str]) -> list[str]:
    more = len(words) - _NAMED
    return words[:_NAMED] + ([f"and {more} more"] if more > 0 else [])


# Elements: which of them reads what is done to each.


def _elements(layout: SensorLayout, found: dict[int, int]) -> tuple[Indices | None, list[str]]:
    """The element that answers for each (P,), and what is wrong in words; None if that is open."""
    every = np.arange(len(layout))
    wrong = {target: element for target, element in found.items() if target != element}
    if not wrong:
        return every, []
    words = [f"element {q} responds in place of element {p}" for p, q in wrong.items()]
    closed = sorted(wrong) == sorted(wrong.values())
    by_lines = None if closed and len(wrong) <= _NAMED else _by_lines(layout, found)
    if by_lines is not None:
        return by_lines
    if closed:
        return _permuted(every, wrong), _some(_fewest_words(wrong))
    return None, [*_some(words), "these presses do not determine the map: press every element"]


def _permuted(every: Indices, moved: dict[int, int]) -> Indices:
    order = every.copy()
    order[list(moved)] = list(moved.values())
    return order


def _fewest_words(moved: dict[int, int], what: str = "element") -> list[str]:
    """A permutation as its cycles."""
    words, left = list[str](), dict(moved)
    while left:
        cycle = [next(iter(left))]
        while (after := left.pop(cycle[-1])) != cycle[0]:
            cycle.append(after)
        if len(cycle) == 2:
            words.append(f"{what}s {cycle[0]} and {cycle[1]} are swapped")
        elif len(cycle) > 2:
            text = ", ".join(f"{p} reads as {moved[p]}" for p in cycle)
            words.append(f"{what}s are exchanged: {text}")
    return words


def _by_lines(layout: SensorLayout, found: dict[int, int]) -> tuple[Indices, list[str]] | None:
    """The same where whole columns and rows are exchanged, mirrored or both for each other."""
    if layout.shape is None:
        return None
    m, n = layout.shape
    target, element = (np.array(list(part)) for part in (found.keys(), found.values()))
    for turned in (False, True) if m == n else (False,):
        first, second = (element // m, element % m) if turned else (element % m, element // m)
        columns, rows = _line_map(target % m, first, m), _line_map(target // m, second, n)
        if columns is None or rows is None:
            continue
        p, q = np.arange(m * n) % m, np.arange(m * n) // m
        to = rows[q] + m * columns[p] if turned else columns[p] + m * rows[q]
        words = ["columns and rows are exchanged"] if turned else []
        return to, [*words, *_line_words("column", columns), *_line_words("row", rows)]
    return None


def _line_map(target: Indices, answered: Indices, count: int) -> Indices | None:
    """Which of `count` lines answers for each (count,), None where that is open."""
    to = np.full(count, -1)
    for line, other in zip(target.tolist(), answered.tolist(), strict=True):
        if to[line] not in (-1, other):
            return None
        to[line] = other
    return to if sorted(to.tolist()) == list(range(count)) else None


def _line_words(what: str, to: Indices) -> list[str]:
    if (to == np.arange(len(to))[::-1]).all():
        return [f"{what}s are mirrored"]
    return _some(_fewest_words({p: q for p, q in enumerate(to.tolist()) if p != q}, what))


# Components: which channel of an element reads what.


def _components(
    sensor: Sensor, answered: list[PressResult], elements: Indices
) -> tuple[Indices, list[str]]:
    """Which component reads xx, yy and xy of each element (3, P), and what is wrong in words."""
    P = len(sensor.layout)
    right = np.repeat(np.arange(3)[:, None], P, axis=1)
    if sensor.layout.patch.strip or not answered:
        return right, []
    read = np.array([pressed.answer[:, elements] for pressed in answered])  # (N, 3, P)
    due = _expected(sensor, [pressed.target for pressed in answered])
    live = sensor.layout.live & sensor.layout.live[:, elements]
    read, due = np.where(live, read, 0.0), np.where(live, due, 0.0)
    cost = np.array([_residual(read[:, list(order)], due) for order in _ORDERS])  # (6, P)
    best = int(cost.sum(axis=1).argmin())
    if cost[best].sum() < _CLEARLY * cost[0].sum():
        return np.repeat(np.array(_ORDERS[best])[:, None], P, axis=1), [_order_words(best)]
    each = cost.argmin(axis=0)
    wrong = cost.min(axis=0) < _CLEARLY * cost[0]
    wrong &= np.isin(np.arange(P), [pressed.target for pressed in answered])
    for p in np.flatnonzero(wrong):
        right[:, p] = _ORDERS[each[p]]
    words = [f"{_order_words(int(each[p]))} of element {p}" for p in np.flatnonzero(wrong)]
    return right, _some(words)


def _order_words(number: int) -> str:
    moved = {c: to for c, to in enumerate(_ORDERS[number]) if c != to}
    names = [COMPONENTS[c] for c in moved]
    if len(names) == 2:
        return f"{names[0]} and {names[1]} are swapped"
    text = ", ".join(f"{COMPONENTS[a]} reads as {COMPONENTS[b]}" for a, b in moved.items())
    return f"components are exchanged: {text}"


def _residual(read: Array, due: Array) -> Array:
    """Squared residuals (P,) of N presses `read` (N, 3, P) when `due` was expected, scaled."""
    share = np.sum(read * due, axis=(1, 2)) / np.sum(due**2, axis=(1, 2))
    scale = np.sum(read**2, axis=(1, 2))  # each press counts alike
    left = (read - share[:, None, None] * due) ** 2 / scale[:, None, None]
    return np.sum(left, axis=(0, 1))


def _expected(sensor: Sensor, pressed: list[int]) -> Array:
    """The expected change of all by a press of each element, (N, 3, P) in 1/m for unit force."""
    layout, plate = sensor.layout, sensor.plate
    basis = basis_for(layout.patch, sensor.edge, _FUNCTIONS, _FUNCTIONS)
    compliance, M = plate.compliance(basis), layout.operator(basis, plate)
    loads = [PointLoad(x, y, 1.0) for x, y in layout.positions[pressed].tolist()]
    c = [compliance(load.modal(basis)).ravel() for load in loads]
    return (np.array(c) @ M.T).reshape(len(c), 3, -1)
