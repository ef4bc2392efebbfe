"""CONTRIBUTING tells the truth: each room and file that it names is there."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
PACKAGES = {"core": ROOT / "core" / "kappaskin", "app": ROOT / "app" / "kappaskin_app"}


def rooms_told(whose: str) -> list[str]:
    """The rooms in the table of the core or the app, one ending in / a folder."""
    table = TEXT.split(f"| rooms of the {whose} |")[1].split("\n\n")[0]
    first = [row.split("|")[1] for row in table.splitlines()[2:]]
    return re.findall(r"`([\w/]+)`", " ".join(first))


@pytest.mark.parametrize("whose", PACKAGES)
def test_every_room_named_is_there_and_is_named_once(whose: str) -> None:
    told = rooms_told(whose)

    for room in told:
        there = PACKAGES[whose] / (room if room.endswith("/") else f"{room}.py")
        assert there.exists(), room
    assert len(set(told)) == len(told)


@pytest.mark.parametrize("whose", PACKAGES)
def test_every_room_is_named(whose: str) -> None:
    modules = {file.stem for file in PACKAGES[whose].glob("*.py") if "__" not in file.stem}
    folders = {f"{file.parent.name}/" for file in PACKAGES[whose].glob("*/__init__.py")}

    assert set(rooms_told(whose)) >= modules | folders


def test_every_file_named_is_there() -> None:
    named = set(re.findall(r"`([\w/]+\.(?:py|md|toml|c))\b", TEXT))
    there = [
        file.relative_to(ROOT).as_posix()
        for folder in ("core", "app", "resources", "tests", "packaging")
        for file in (ROOT / folder).rglob("*.*")
    ]

    assert len(named) > 60
    for name in named - {"pyproject.toml"}:
        assert any(f"/{file}".endswith(f"/{name}") for file in there), name
