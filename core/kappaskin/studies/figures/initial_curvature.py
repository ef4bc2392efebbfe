"""What base curvature costs through hysteresis, as the study's rows drawn against it."""

from typing import Any

from kappaskin.studies.figures import style
from kappaskin.studies.initial_curvature import initial_curvature
from kappaskin.studies.tables import RADIUS


def draw(figure: style.Figure) -> None:
    """Errors of the readings left, of the shape right."""
    rows = initial_curvature()
    style.resize(figure, style.DOUBLE, 70)
    applied = rows[0]["applied_mm"]
    style.letter(figure, 1, 69, "a", f"readings while {applied:.2f} mm are pressed in and released")
    style.letter(figure, 97, 69, "b", "the shape that they are taken for")
    readings, shape = (style.place(figure, (left, 10, 66, 52)) for left in (13, 105))
    for cycle, colour in (("first", style.BLUE), ("settled", style.ORANGE)):
        name = f"{cycle} cycle"
        _draw_column(readings, rows, cycle, "reading_rms", 1.0, {"color": colour, "label": name})
        _draw_column(shape, rows, cycle, "rms_mm", 1e3, {"color": colour, "label": name})
    look = {"color": style.INK, "label": "once released"}
    _draw_column(shape, rows, "settled", "rest_rms_mm", 1e3, look)
    readings.set(ylabel="RMS error of curvature [1/m]", ylim=(0, 4.8))
    shape.set(ylabel="RMS error of shape [µm]", ylim=(0, 120))
    for axes in (readings, shape):
        axes.plot([], [], "o", mfc="white", color=style.FAINT, mew=0.7, label="flat, ends hinged")
        axes.axvline(1 / RADIUS, color=style.LINE, lw=0.6, zorder=0)
        axes.text(1 / RADIUS - 1, axes.get_ylim()[1] / 40, f"fingertip, {1e3 * RADIUS:.1f} mm",
                  ha="right", va="bottom", color=style.FAINT)  # fmt: skip
        axes.set(xlim=(-3, 83), xticks=range(0, 81, 20), xlabel="base curvature 1/R₀ [1/m]")
        axes.legend(loc="upper left")


def _draw_column(
    axes: style.Axes,
    rows: list[dict[str, Any]],
    cycle: str,
    column: str,
    unit: float,
    look: dict[str, str],
) -> None:
    """One `column` of a `cycle` against the base curvature; the flat skin is held otherwise."""
    here = [row for row in rows if row["cycle"] == cycle]
    for ends, fill, label in (("pinned", look["color"], look["label"]), ("hinged", "white", None)):
        shown = [row for row in here if row["ends"] == ends]
        x = [row["base_curvature"] for row in shown]
        y = [unit * row[column] for row in shown]
        axes.plot(x, y, marker="o", mfc=fill, mew=0.7, **look | {"label": label})
