"""The guide's tables of what an estimate tells, from the table of its quantities.

Run `python tests/guide_quantities.py` when a quantity came, went or changed.
"""

from collections.abc import Callable
from pathlib import Path

from kappaskin.pipeline import REPORTED, ReportedQuantity
from kappaskin.publish.message import CONTACT, SECOND, SWITCHES

_RESOURCES = Path(__file__).parents[1] / "resources" / "kappaskin_resources"
_HEAD = "| quantity | symbol | unit | what it is | in files | in messages | on the screen |"


def keys() -> str:
    """A row for each key of a message about a contact."""
    rows = SWITCHES | {number.key: number.text for number in CONTACT}
    keys = ", ".join(f"`{number.key}`" for number in SECOND)
    rows |= {"second": f"null, or a weaker contact besides the first: {keys}"}
    return "".join(f"| `{key}` | {text} |\n" for key, text in rows.items())


def quantities() -> str:
    """A row for each quantity of an estimate."""
    shown = (of for of in REPORTED if of.group != "second" or of.columns)
    lines = [_HEAD, "|---" * 7 + "|", *map(_row, shown)]
    return "".join(f"{line}\n" for line in lines).replace("|  |", "| |").replace("|  |", "| |")


def _row(of: ReportedQuantity) -> str:
    tables = of.group in ("frame", "fit", "contact", "second")
    files = [f"{of.name}{suffix}" for suffix, _, _ in of.forms if tables and suffix in of.columns]
    inside = "second." if of.group == "second" else ""
    sent = [f"{inside}{number.key}" for number in of.published if tables]
    shown = [*of.labels_shown, *([f"{of.traced} over time"] if of.traced else [])]
    shown += [f"colour {colour.label}" for colour in of.colours]
    cells = (f"`{of.name}`", of.symbol, of.unit, of.text, _coded(files), _coded(sent))
    return f"| {' | '.join((*cells, ', '.join(shown)))} |"


def _coded(names: list[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)


TABLES: dict[Path, tuple[str, str, Callable[[], str]]] = {
    _RESOURCES / "publishing" / "messages.md": ("| `present` |", "\n", keys),
    _RESOURCES / "guide" / "numbers.md": (_HEAD, "\n", quantities),
}
"""How the table of a page begins, the line that ends it, and what makes it."""


def renewed(page: Path) -> str:
    """The text of a page with its table made anew."""
    begin, end, made = TABLES[page]
    before, _, rest = page.read_text(encoding="utf-8").partition(f"\n{begin}")
    _, _, after = f"{begin}{rest}".partition(f"\n{end}")
    return f"{before}\n{made()}{end}{after}" if after else f"{before}\n{made()}"


if __name__ == "__main__":
    for page in TABLES:
        page.write_text(renewed(page), encoding="utf-8", newline="\n")
