"""The rows of studies, as text for people."""

import textwrap
from typing import Any

_TITLES = {
    1: "Table 1: 10 x 10 elements, {} x {} functions, truth of 15 x 15; mm; paper in brackets;\n"
    "on slopes: with gages that sense the curvature of the bent surface",
    2: "Table 2: 10 elements on half a circle, {} functions, truth of Eq. 10 as it must read; mm;\n"
    "paper's simulation in brackets, its experiment under measured",
}
_LAST = {1: f"{'on slopes: error':>18}{'RMS':>9}", 2: "  measured"}


def _row(row: dict[str, Any]) -> str:
    def paper(name: str, form: str) -> str:
        value = row["paper"].get(name)
        return "-" if value is None else format(value, form)

    def bracketed(name: str, form: str) -> str:
        return f"({paper(name, form)})"

    if "refused" in row:
        return f"refused: {row['refused']}"
    sd, e, rms = (row.get(name) for name in ("e_max_sd_mm", "slopes_e_max_mm", "slopes_rms_mm"))
    on_slopes = "" if e is None else f"{e:>+9.3f} {rms:>8.4f}"
    spread = "" if sd is None else f" +-{sd:.3f}"
    return (
        f"{row['case']:<12}{'yes' if row['noise'] else 'no':<7}{row['w_applied_mm']:>8.2f}"
        f"{row['w_max_mm']:>8.3f} {bracketed('w_max_mm', '.2f'):<7}"
        f"{row['e_max_mm']:>+10.3f}{spread:<8} {bracketed('e_max_mm', '+.2f'):<8}"
        f"{row['rms_mm']:>8.4f} {bracketed('rms_mm', '.3f'):<8}"
        + (f"{paper('experiment_w_max_mm', '.2f'):>8}" if row["table"] == 2 else on_slopes)
    ).rstrip()


def tables_text(rows: list[dict[str, Any]]) -> str:
    """Tables 1 and 2 with the paper's numbers beside ours."""
    lines: list[str] = []
    for table, title in _TITLES.items():
        head = (
            f"{'case':<12}{'noise':<7}{'applied':>8}{'w max':>17}{'error at load':>25}{'RMS':>18}"
        )
        its = [row for row in rows if row["table"] == table]
        lines += [title.format(*its[0]["functions"]), head + _LAST[table]]
        lines += [_row(row) for row in its] + [""]
    covered = {row["case"]: row["covered_95"] for row in rows if "covered_95" in row}
    held = ", ".join(f"{case} {100 * share:.0f} %" for case, share in covered.items())
    return "\n".join(
        [
            *lines,
            f"Method: {rows[0]['method']}. With noise: means over 200 draws, error +- one standard",
            f"deviation; the 95 % bands hold of the skin: {held}.",
        ]
    )


def misprints_text(rows: list[dict[str, Any]]) -> str:
    """What is misprinted, one paragraph each."""
    lines: list[str] = []
    for row in rows:
        gives = [("gives", f"{value:.4g}  {what}") for what, value in row["gives"].items()]
        said = [("printed", row["printed"]), ("meant", row["meant"]), *gives, ("but", row["why"])]
        lines += [row["where"]]
        lines += [textwrap.fill(text, 96, initial_indent=f"    {name:<9}",
                                subsequent_indent=" " * 13) for name, text in said]  # fmt: skip
    return "\n".join(lines)


def regions_text(rows: list[dict[str, Any]]) -> str:
    """The rows of `regions` under a heading."""
    lines = [
        "A contact on a circle, 20 us per channel; RMS errors of contact and shape in mm,",
        "of each frame in the middle of its scan, and while its answer is the newest there is",
        f"{'mm/s':>6}  {'method':<14}{'around':<10}{'radius':>6}{'share':>7}{'channels':>10}"
        f"{'frames/s':>10}{'contact':>9}{'newest':>8}{'shape':>8}{'newest':>8}",
    ]
    for row in rows:
        radius = "" if row["radius_mm"] is None else format(row["radius_mm"], ".1f")
        share = "" if row["share"] is None else format(row["share"], ".0%")
        lines.append(
            f"{row['speed_mm_s']:>6.0f}  {row['method']:<14}{row['around']:<10}{radius:>6}"
            f"{share:>7}{row['channels']:>10.0f}{row['rate']:>10.0f}{row['contact_mm']:>9.3f}"
            f"{row['newest_contact_mm']:>8.3f}{row['shape_mm']:>8.3f}"
            f"{row['newest_shape_mm']:>8.3f}"
        )
    return "\n".join(lines)
