"""Rows of comparisons as text for people."""

from collections.abc import Sequence
from itertools import groupby

from kappaskin.studies.compare.measure import Compared

_HEAD = (
    f"{'':<26}{'N':>5}{'exact E':>8}{'RMS':>8}{'noisy E':>15}{'RMS':>8}{'bars':>5}"
    f"{'set-up':>7}{'answer':>7}{'/ours':>6}{'held':>6}\n"
    f"{'':<26}{'':>5}{'mm':>8}{'mm':>8}{'mm':>15}{'mm':>8}{'':>5}{'ms':>7}{'us':>7}{'':>6}{'KiB':>6}"
)
_SAID = """\
The same work by Kappaskin and by what one would use instead
N        unknowns that are solved for
E        signed error at the load; with noise the mean +- standard deviation of 200 draws
RMS      error over the skin; with noise the mean of the draws
bars     whether the answer comes with error bars
set-up   until the first answer; answer: median of the next ones, and over that of our first way
held     most memory at once in both, with what SuperLU holds"""


def errors_text(row: Compared) -> str:
    """A row as far as it is the same on every machine."""
    noisy = f"{'':>28}"
    if row.e_mm is not None:
        drawn = f"{row.e_mm:+z.3f} +-{row.e_sd_mm:.3f}"
        noisy = f"{drawn:>15}{row.rms_mm:>8.4f}{'yes' if row.error_bars else 'no':>5}"
    return f"{row.by:<26}{row.unknowns:>5}{row.e_exact_mm:>+z8.3f}{row.rms_exact_mm:>8.4f}{noisy}"


def _line(row: Compared) -> str:
    return (
        f"{errors_text(row)}{1e3 * row.setup_s:>7.1f}{1e6 * row.frame_s:>7.0f}{row.ratio:>6.1f}"
        f"{row.memory_bytes / 1024:>6.0f}"
    )


def compared_text(rows: Sequence[Compared]) -> str:
    """A table of each work, and what its columns are."""
    lines = [_SAID]
    for work, its in groupby(rows, lambda row: row.work):
        lines += ["", work, _HEAD, *(_line(row) for row in its)]
    return "\n".join(lines)
