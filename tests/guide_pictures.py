"""The guide's pictures, from the commands that their captions name, and README's moving one.

Run `python tests/guide_pictures.py` when a figure looks otherwise than it did. A picture of points
is made smaller, of a few colours; one of lines stays as the command wrote it. `python
tests/guide_pictures.py film` makes the moving picture, of the window on a display.
"""

import os
import re
import shlex
import shutil
import sys
import tempfile
import time
from pathlib import Path

from PIL import Image

from kappaskin.cli import main

GUIDE = Path(__file__).parents[1] / "resources" / "kappaskin_resources" / "guide"
_WINDOW, _FIGURE = 1280, 780  # px wide, of a window and of a figure that is printed finer
_LARGEST = 60_000  # bytes of a picture
MOVING = GUIDE / "pictures" / "window.webp"
_SETTLED = 12.0  # s until all is drawn
_FILM, _SLOWED = (960, 600), 0.2
_SHOWN = re.compile(r"!\[[^\]]+\]\(([^)]+)\)\n\n\*[^*`]*`((?:kappaskin|python3) [^`]+)`\*")


def shown_on(page: Path) -> list[tuple[Path, str]]:
    """The pictures on a page, each with the command that its caption names."""
    found = _SHOWN.findall(page.read_text("utf-8"))
    return [((page.parent / name).resolve(), command) for name, command in found]


def drawn(command: str, name: str) -> Path:
    """The file of this name that a command writes, somewhere in the folder it is run in."""
    if main(shlex.split(command)[1:]) != 0:
        raise SystemExit(f"{command}: failed")
    (made,) = Path().rglob(name)
    return made


def small(picture: Path) -> Image.Image:
    """A picture as wide as it is shown."""
    with Image.open(picture) as image:
        if image.width <= _WINDOW:
            return image.convert("RGB")
        high = round(image.height * _FIGURE / image.width)
        return image.convert("RGB").resize((_FIGURE, high), Image.Resampling.LANCZOS)


def keep(made: Path, picture: Path) -> None:
    if picture.suffix == ".svg":
        shutil.copy(made, picture)
    else:
        for colours in (192, 128, 96, 76, 64):
            how = {"method": Image.Quantize.MAXCOVERAGE, "kmeans": 4, "dither": Image.Dither.NONE}
            small(made).quantize(colours, **how).save(picture, optimize=True)
            if picture.stat().st_size <= _LARGEST:
                break


def film(source: str, seconds: float, rate: float) -> None:
    """README's moving picture: the window on a source, `rate` pictures a second of it."""
    from kappaskin_app.launch import opened

    app, window = opened(source, None)
    window.session.engine.seek(speed=_SLOWED)  # a picture takes longer than its time
    began, pictures = time.monotonic(), []
    with tempfile.TemporaryDirectory() as folder:
        while len(pictures) < seconds * rate:
            app.processEvents()
            if time.monotonic() - began < _SETTLED + len(pictures) / rate / _SLOWED:
                time.sleep(0.001)
                continue
            window.picture(made := Path(folder) / "window.png")
            with Image.open(made) as image:
                pictures.append(image.convert("RGB").resize(_FILM, Image.Resampling.LANCZOS))
    window.close()
    how = {"duration": round(1000 / rate), "quality": 50, "method": 6, "minimize_size": True}
    pictures[0].save(MOVING, save_all=True, append_images=pictures[1:], loop=0, **how)


if __name__ == "__main__":
    if sys.argv[1:] == ["film"]:
        film("sim:fingertip-cap", 6.0, 8.0)
        raise SystemExit
    os.chdir(tempfile.mkdtemp())
    shutil.copytree(GUIDE.parent / "measured", "measured")
    for page in sorted(GUIDE.glob("*.md")):
        for picture, command in shown_on(page):
            if command.split()[1] in ("figures", "app", "replay"):
                keep(drawn(command, picture.name), picture)
                print(picture, f"{picture.stat().st_size / 1e3:.0f} kB", file=sys.stderr)
