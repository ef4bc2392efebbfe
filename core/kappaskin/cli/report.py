"""The results of a design study, as a page."""

from pathlib import Path

from kappaskin.errors import Refusal
from kappaskin.studies import Folder, draw_study, known_of, page_of, table_csv


def report(folder: Path) -> None:
    """Make a page of a study's results: report.html, with a CSV and an SVG of each figure beside.

    The page needs no network, and says all that it takes to repeat the study. What is not computed
    yet is missing in it, and said to be.

    Example: `kappaskin report elements`

    Parameters
    ----------
    folder
        The folder that `kappaskin study` made.
    """
    results = Folder(folder)
    study = results.study()
    known = known_of(study, results)
    figures = draw_study(study, known)
    files = {f"{name}.svg": svg for name, svg in figures.items()}
    files |= {"report.csv": table_csv(study, known), "report.html": page_of(study, known, figures)}
    try:
        for name, text in files.items():
            (folder / name).write_text(text, "utf-8")
    except OSError as error:
        raise Refusal(f"{folder}: cannot be written to ({error}); copy it elsewhere") from error
    print(*(folder / name for name in files), sep="\n")
