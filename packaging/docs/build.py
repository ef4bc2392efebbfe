"""The site: guide, lessons, notebooks and the library's reference as pages that need no network.

python3 packaging/start.py docs    writes dist/docs; open dist/docs/index.html
"""

import importlib
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
PAGES = ROOT / "resources" / "kappaskin_resources"
OUT = ROOT / "dist" / "docs"
ROOMS = (
    *("studies", "live", "publish", "recording", "hand", "pipeline", "calibration", "health"),
    *("sources", "scenes", "contact", "estimation", "sensing", "mechanics", "bases", "skin"),
    *("frames", "errors"),
)

_INDEX = """# Kappaskin

Shape and contact from curvature-sensing tactile skins, live and with error bars. Begin with
[the guide](guide/README.md), [the lessons](lessons/README.md) or
[a notebook](notebooks/paper-tables.ipynb); the search is in the sidebar.

{trees}
"""
_TREE = """```{{toctree}}
:caption: {caption}
:maxdepth: 1

{pages}
```
"""
_ROOM = """# kappaskin.{room}

```{{eval-rst}}
.. automodule:: kappaskin.{room}
   :members: {names}
   :imported-members:
```
"""


def tree(caption: str, pages: list[str]) -> str:
    return _TREE.format(caption=caption, pages="\n".join(pages))


def names_of(module: str) -> list[str]:
    """The classes and functions of a room's face, without those of other rooms."""
    face = importlib.import_module(module)
    return [
        name
        for name in dir(face)
        if not name.startswith("_")
        and str(getattr(getattr(face, name), "__module__", "")).startswith(module)
    ]


def lesson_page(lesson: str) -> str:
    """A lesson to read: its title, texts and questions, without settings and answers."""
    _, head, text = lesson.split("+++\n", 2)
    about = tomllib.loads(head)

    def asked(block: re.Match[str]) -> str:
        step = tomllib.loads(block[1])
        choices = "".join(f"- {choice}\n" for choice in step.get("choices", ()))
        return f"**{step['question']}**\n\n{choices}" if "question" in step else ""

    text = re.sub(r"^```toml\n(.*?)^```\n", asked, text, flags=re.M | re.S)
    return f"# {about['title']}\n\n{about['learn']}\n{text}"


def write_pages(source: Path) -> None:
    """Write all pages into the folder `source`, which has no file yet."""
    shutil.copytree(PAGES, source, ignore=shutil.ignore_patterns("*.py", "__pycache__", "measured"))
    for lesson in (source / "lessons").glob("[0-9]*.md"):
        lesson.write_text(lesson_page(lesson.read_text("utf-8")), "utf-8")
    reference = source / "reference"
    reference.mkdir()
    for room in ROOMS:
        own = ", ".join(names_of(f"kappaskin.{room}"))
        (reference / f"{room}.md").write_text(_ROOM.format(room=room, names=own), "utf-8")

    def names(folder: str, kind: str) -> list[str]:
        return sorted(f"{folder}/{file.name}" for file in (source / folder).glob(kind))

    contents = (source / "guide" / "README.md").read_text("utf-8")
    guide = [f"guide/{page}" for page in re.findall(r"^\d+\. \[.+?\]\((.+?)\)", contents, re.M)]
    more = {file.relative_to(source).as_posix() for file in source.rglob("*.md")}
    more -= {*names("guide", "*.md"), *names("lessons", "*.md"), *names("reference", "*.md")}
    trees = (
        tree("Guide", ["guide/README.md", *guide]),
        tree("Lessons", names("lessons", "*.md")),
        tree("Notebooks", names("notebooks", "*.ipynb")),
        tree("Reference", [f"reference/{room}.md" for room in ROOMS]),
        tree("Formats and parts", sorted(more)),
    )
    (source / "index.md").write_text(_INDEX.format(trees="\n".join(trees)), "utf-8")


# What a page loads by itself; a link that a reader follows may lead anywhere.
_LOADED = re.compile(
    r"<(?:script|img|link|iframe|source)\b[^>]*?\b(?:src|href)=[\"'](?:https?:)?//[^>]*>"
    r"|url\([\"']?(?:https?:)?//[^)]*\)|@import [\"'](?:https?:)?//[^;]*",
    re.IGNORECASE,
)


def loaded_from_network(folder: Path) -> list[str]:
    """What the pages and styles in `folder` would load from a network."""
    files = [file for file in sorted(folder.rglob("*")) if file.suffix in (".html", ".css")]
    return [f"{file}: {found}" for file in files for found in _LOADED.findall(file.read_text())]


def main() -> int:
    """Build the site; it fails for a dead link, and for what needs a network."""
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder, "source")
        write_pages(source)
        shutil.rmtree(OUT, ignore_errors=True)
        command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-c", str(HERE)]
        code = subprocess.call([*command, "-d", f"{folder}/trees", str(source), str(OUT)])
    if found := loaded_from_network(OUT):
        print("expected pages that load nothing from a network, got", *found, sep="\n")
        return 1
    if not code:
        print(f"The site: {OUT / 'index.html'}")
    return code


if __name__ == "__main__":
    sys.exit(main())
