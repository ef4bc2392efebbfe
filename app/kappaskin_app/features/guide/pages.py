"""The guide's files to pages, in the order of its contents."""

import re
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path

FOLDER = Path(str(files("kappaskin_resources"))) / "guide"
_LISTED = re.compile(r"^\d+\. \[([^\]]+)\]\(([\w-]+\.md)\)", re.MULTILINE)
_HEADING = re.compile(r"^## (.+)$", re.MULTILINE)


@dataclass(frozen=True)
class Page:
    """A page of the guide, and the headings in it."""

    title: str
    file: Path
    headings: tuple[str, ...]


def page_called(name: str) -> Page:
    """The page in the file of this name, without its suffix."""
    return next(page for page in pages() if page.file.stem == name)


@cache
def pages() -> tuple[Page, ...]:
    """The contents, and each page that they list."""
    contents = FOLDER / "README.md"
    listed = _LISTED.findall(contents.read_text("utf-8"))
    return tuple(
        Page(title, FOLDER / name, tuple(_HEADING.findall((FOLDER / name).read_text("utf-8"))))
        for title, name in [("Contents", contents.name), *listed]
    )
