"""The rows of drills, as text for people."""

from typing import Any


def drills_text(rows: list[dict[str, Any]]) -> str:
    """A table with a line for each drill, and the reasons of those that failed."""
    lines = [
        f"{'drill':<20}{'sent':>8}{'accepted':>10}{'lost':>8}{'discarded':>11}{'wrong':>7}"
        f"{'recovered after':>17}  verdict"
    ]
    for row in rows:
        after = "-" if row["recovered_s"] is None else f"{row['recovered_s']:.3f} s"
        lines.append(
            f"{row['drill']:<20}{row['sent']:>8}{row['accepted']:>10}{row['lost']:>8}"
            f"{row['discarded']:>11}{row['wrong']:>7}{after:>17}  {row['verdict']}"
        )
        lines += [f"    {reason}" for reason in row["reasons"]]
    failed = sum(row["verdict"] == "failed" for row in rows)
    return "\n".join([*lines, f"{len(rows)} drills, {failed or 'none'} failed"])
