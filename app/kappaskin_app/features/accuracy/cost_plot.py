"""Plot of the RMS error against the computing time of each measured setting."""

import math

import numpy as np
from PySide6.QtCore import QSize, Qt, Signal

from kappaskin.studies import Cost
from kappaskin_app.features.accuracy.measurement import Frontier, setting_text
from kappaskin_app.guard import guarded
from kappaskin_app.shell.settings.shown import METHOD_SHORT
from kappaskin_app.widgets.chart import Chart, ChartAxis, ChartPoint, Series
from kappaskin_app.widgets.text import duration, length

_METHODS = list(METHOD_SHORT)
_MARKS = ("o", "s", "t1", "d", "t", "p", "t3", "t2")
_ERROR = ChartAxis("RMS error", log=True, text=length)
_TIME = ChartAxis("Computing time", log=True, text=duration)
_TIP = "RMS error and computing time of each measured setting. Click a point to use its setting."


class CostPlot(Chart):
    """Draws a `Frontier`: a colour and mark per estimator, a ring around the one in use.

    `chosen` emits the cost that is clicked.
    """

    chosen = Signal(object)

    def __init__(self) -> None:
        super().__init__(_ERROR, _TIME, _TIP)
        self.frontier = Frontier()
        self._shown: object = None
        self.setAccessibleName("Error against time")
        self.clicked.connect(guarded(self._choose))
        self.pointed.connect(guarded(self._show_hand))

    def minimumSizeHint(self) -> QSize:
        return QSize(28, 13) * self.fontMetrics().height()

    def show_costs(
        self, frontier: Frontier, present: Cost | None, live: tuple[float, float], empty: str = ""
    ) -> None:
        """Draw the costs, a ring at `present` and a cross at `live`, (error in m, time in s).

        The text `empty` is shown while there are no costs.
        """
        shown = (frontier, present, live, empty)
        if shown != self._shown:
            self._shown, self.frontier = shown, frontier
            costs = _of_costs(frontier, present)
            self.show_series([*costs, *_others(frontier, present, live)] if costs else [], empty)

    def _choose(self, point: ChartPoint) -> None:
        if point.series.key is not None:
            self.chosen.emit(point.series.key[point.index])

    def _show_hand(self, point: ChartPoint | None) -> None:
        hand, arrow = Qt.CursorShape.PointingHandCursor, Qt.CursorShape.ArrowCursor
        self.canvas.setCursor(hand if point is not None and point.series.key else arrow)


def _of_costs(frontier: Frontier, present: Cost | None) -> list[Series]:
    """Costs by estimator, filled with the elements of the one in use."""
    found: dict[tuple[str, bool], list[Cost]] = {}
    for cost in frontier.costs:
        own = present is None or cost.setting.elements == present.setting.elements
        found.setdefault((cost.setting.method, own), []).append(cost)
    drawn = []
    for method, own in sorted(found, key=lambda each: (_number(each[0]), not each[1])):
        costs, number = tuple(found[method, own]), _number(method)
        named = own or (method, True) not in found
        drawn.append(
            Series(
                METHOD_SHORT.get(method, method) if named else "",
                *_at(*costs),
                colour=number,
                line="",
                mark=_MARKS[number % len(_MARKS)],
                size=8.0,
                filled=own,
                tips=list(map(cost_text, costs)),
                key=costs,
            )
        )
    return drawn


def _number(method: str) -> int:
    return _METHODS.index(method) if method in _METHODS else len(_METHODS)


def _others(frontier: Frontier, present: Cost | None, live: tuple[float, float]) -> list[Series]:
    """What the marks are, the setting in use, and the least error within each time."""
    none, (error, time) = np.empty(0), live
    known = math.isfinite(error) and math.isfinite(time)
    measured = (np.array([time]), np.array([error])) if known else (none, none)
    return [
        Series("filled: own elements", none, none, "text", "", "o"),
        Series("open: other elements", none, none, "text", "", "o", filled=False),
        Series(
            "in use, predicted", *_at(*([present] if present else [])), "text", "", "o", 18.0, False
        ),
        Series("in use, measured", *measured, "alert", "", "x", 12.0),
        Series("best for its time", *_steps(frontier), "text", "dashed"),
    ]


def _at(*costs: Cost) -> tuple[np.ndarray, np.ndarray]:
    """Times (n,) in s and errors (n,) in m."""
    return np.array([c.time_per_frame for c in costs]), np.array([c.rms for c in costs])


def _steps(frontier: Frontier) -> tuple[np.ndarray, np.ndarray]:
    """Corners of the least error within each time: a step down at each Pareto-optimal setting."""
    times, errors = _at(*frontier.best)
    all_times, all_errors = _at(*frontier.costs)
    return (
        np.append(np.repeat(times, 2), all_times.max()),
        np.append(all_errors.max(), np.repeat(errors, 2)),
    )


def cost_text(cost: Cost) -> str:
    """The tooltip of a point."""
    return (
        f"{setting_text(cost.setting, cost.count)}: RMS error {length(cost.rms)}, "
        f"{length(cost.rms_exact)} without noise; computing time {duration(cost.time_per_frame)} "
        f"per frame, conversion time {duration(cost.conversion_time)} for {cost.channels} "
        "channels. Click to use it."
    )
