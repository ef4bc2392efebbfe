"""The app as one folder that needs no Python: built, tried without a network, and measured.

python3 packaging/start.py bundle            builds dist/kappaskin and tries it
python3 packaging/start.py bundle --try      tries the one that is there
"""

from __future__ import annotations

import shutil
import struct
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
BUNDLE = ROOT / "dist" / "kappaskin"
ICON = ROOT / "resources" / "kappaskin_resources" / "icons" / "kappaskin.svg"
DRAWN = ROOT / "build" / "kappaskin.png"
SHARE = {
    "kappaskin.desktop": "applications/kappaskin.desktop",
    "kappaskin.xml": "mime/packages/kappaskin.xml",
}
_SIDE = 256  # px
_ELF = b"\x7fELF\x02\x01"  # of 64 bits, little-endian


def main(arguments: list[str]) -> int:
    if arguments not in ([], ["--try"]):
        print(f"expected nothing or --try, got {' '.join(arguments)}", file=sys.stderr)
        return 2
    if not arguments:
        build()
    elif not BUNDLE.is_dir():
        print(f"expected a bundle at {BUNDLE}, none is there: leave out --try", file=sys.stderr)
        return 2
    from trying import tried

    return tried(BUNDLE)


def build() -> None:
    """Make the bundle, with icon, desktop entry and kinds of files where the system has them."""
    DRAWN.parent.mkdir(exist_ok=True)
    draw(ICON, DRAWN)
    shutil.rmtree(BUNDLE, ignore_errors=True)
    command = [sys.executable, "-m", "PyInstaller", str(HERE / "kappaskin.spec"), "--noconfirm"]
    command += ["--log-level", "WARN", "--distpath", str(BUNDLE.parent)]
    command += ["--workpath", str(ROOT / "build" / "bundle")]
    subprocess.run(command, cwd=ROOT, check=True)
    if sys.platform.startswith("linux"):
        before = size(BUNDLE)
        for file in (BUNDLE / "_internal").rglob("*"):
            if file.is_file() and not file.is_symlink():
                strip(file)
        print(f"stripped: {before / 1e6:.0f} to {size(BUNDLE) / 1e6:.0f} MB")
        add_desktop(BUNDLE, DRAWN)


def draw(svg: Path, png: Path) -> None:
    """Draw the icon, for what takes no SVG."""
    from PySide6.QtGui import QImage, QPainter
    from PySide6.QtSvg import QSvgRenderer

    picture = QImage(_SIDE, _SIDE, QImage.Format.Format_ARGB32)
    picture.fill(0)
    painter = QPainter(picture)
    QSvgRenderer(str(svg)).render(painter)
    painter.end()
    picture.save(str(png))


def strip(file: Path) -> None:
    """Take out what only a debugger reads; a file that would not load then stays as it is."""
    with file.open("rb") as opened:
        if opened.read(len(_ELF)) != _ELF:
            return
    made = file.with_name(f"{file.name}.stripped")
    command = ["strip", "--strip-unneeded", "-o", str(made), str(file)]
    done = subprocess.run(command, capture_output=True, check=False)
    if done.returncode == 0 and loads(made.read_bytes()):
        shutil.copymode(file, made)
        made.replace(file)
    made.unlink(missing_ok=True)


def loads(elf: bytes) -> bool:
    """Whether the loader can map the segments: strip moves those of files that patchelf changed."""
    at, each, count = *struct.unpack_from("<Q", elf, 32), *struct.unpack_from("<HH", elf, 54)
    for i in range(count):
        kind, _, offset, address, *_, alignment = struct.unpack_from(
            "<IIQQQQQQ", elf, at + i * each
        )
        if kind == 1 and (offset - address) % max(alignment, 1):
            return False
    return True


def add_desktop(bundle: Path, drawn: Path) -> None:
    """Put icon, desktop entry and kinds of files into `share`, and what installs them beside it."""
    icons = bundle / "share" / "icons" / "hicolor"
    for source, place in (
        (ICON, icons / "scalable" / "apps" / "kappaskin.svg"),
        (drawn, icons / f"{_SIDE}x{_SIDE}" / "apps" / "kappaskin.png"),
        *((HERE / name, bundle / "share" / place) for name, place in SHARE.items()),
        (HERE / "install.sh", bundle / "install.sh"),
        (ROOT / "LICENSE", bundle / "LICENSE"),
    ):
        place.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(source, place)


def size(folder: Path) -> int:
    """Bytes of all files in a folder."""
    return sum(file.stat().st_size for file in folder.rglob("*") if not file.is_symlink())


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
