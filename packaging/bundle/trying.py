"""The bundle at work: without a network, another Python or a home of its own; what it took."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from importlib import metadata
from pathlib import Path

from PIL import Image

_SHOWN = 4.0  # s that a window stays
_LONGEST = 180.0  # s for one command
_FLAT = 256  # colours at most where nothing is shaded
_APART = ["unshare", "--net"]  # no network but its own


def tried(bundle: Path) -> int:
    """Run everything that is different in a bundle; 0 where all of it works."""
    with tempfile.TemporaryDirectory(prefix="kappaskin-bundle-") as room:
        trial = Trial(bundle, Path(room))
        trial.run_all()
    for line in trial.failures:
        print(f"FAILED  {line}")
    return 1 if trial.failures else 0


class Trial:
    """Commands of a `bundle` in the folder `room`, and what went wrong."""

    def __init__(self, bundle: Path, room: Path) -> None:
        self.program, self.bundle, self.room = bundle / "kappaskin", bundle, room
        self.failures: list[str] = []
        kept = ("PATH", "DISPLAY", "XAUTHORITY", "QT_QPA_PLATFORM", "LANG")
        home = {"HOME": str(room), "XDG_RUNTIME_DIR": str(room)}
        self._variables = {name: os.environ[name] for name in kept if name in os.environ} | home
        self._apart = _APART if _may_be_apart() else []
        if not self._apart:
            print("unshare --net is not permitted here: tried with the network there is")

    def run_all(self) -> None:
        self._measure()
        self.tell_version()
        self.expect("--help")  # which loads every command, by its name
        told = json.loads(self.expect("doctor", "--json") or "{}")
        if None in told.get("packages", {"": None}).values() or told["missing"]:
            self.failures.append(f"doctor: {told}")
        self.open("cold")
        self.open("warm")
        self.expect("record", "sim:", "press.mcap", "--seconds", "2")
        self.expect("verify", "press.mcap")
        self.expect("export", "press.mcap", "--to", "press.h5")
        self.open("press.mcap", "press.mcap")
        self.expect("tables")
        self.expect("figures", "--out", "figures", "--only", "fig2")
        self.expect("study", "paper-elements", "--workers", "1", "--out", "study")
        if sys.platform != "win32":
            self.expect("drill")  # a device and an engine by -m
        if left := _running(self.bundle):
            self.failures.append(f"left running: {left}")

    def tell_version(self) -> None:
        """Have it tell the version that was built."""
        told, wanted = self.expect("--version").strip(), metadata.version("kappaskin")
        if told != wanted:
            self.failures.append(f"--version: expected {wanted}, got {told!r}")

    def expect(self, *arguments: str) -> str:
        """What a command printed; it is noted where it failed."""
        began = time.monotonic()
        command = [*self._apart, str(self.program), *arguments]
        try:
            done = subprocess.run(
                command,
                env=self._variables,
                cwd=self.room,
                capture_output=True,
                text=True,
                timeout=_LONGEST,
                check=False,
            )
        except subprocess.TimeoutExpired:
            self.failures.append(f"{' '.join(arguments)}: took over {_LONGEST:g} s")
            return ""
        if done.returncode:
            self.failures.append(
                f"{' '.join(arguments)}: exit code {done.returncode}\n{done.stderr}"
            )
        print(f"{time.monotonic() - began:6.1f} s  kappaskin {' '.join(arguments)}", flush=True)
        return done.stdout

    def open(self, name: str, *arguments: str) -> None:
        """Open the app for some seconds; how long it took until the window was there."""
        picture, began = self.room / f"{name}.png", time.time()
        options = ("--seconds", f"{_SHOWN:g}", "--screenshot", str(picture))
        self.expect("app", *arguments, *options)
        if picture.exists():
            took = picture.stat().st_mtime - began - _SHOWN
            print(f"          window, {name}: after {took:.1f} s")
            shutil.copy(picture, self.bundle.parent)
            width, height = (image := Image.open(picture).convert("RGB")).size
            skin = image.crop((width // 3, height // 3, 2 * width // 3, 2 * height // 3))
            if skin.getcolors(_FLAT):
                self.failures.append(f"no skin is drawn in the window ({name})")
        else:
            self.failures.append(f"no picture of the window ({name})")

    def _measure(self) -> None:
        files = [file for file in self.bundle.rglob("*") if file.is_file()]
        total = sum(file.stat().st_size for file in files if not file.is_symlink())
        print(f"{self.bundle}: {total / 1e6:.0f} MB in {len(files)} files")


def _may_be_apart() -> bool:
    """Whether this user may run programs without a network."""
    return (
        shutil.which("unshare") is not None
        and subprocess.run([*_APART, "true"], capture_output=True, check=False).returncode == 0
    )


def _running(bundle: Path) -> list[str]:
    """The processes of the bundle that are there, where the system lists them."""
    time.sleep(2.0)  # one that was told to end may take
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if Path(os.readlink(process / "exe")).is_relative_to(bundle):
                found.append((process / "cmdline").read_text().replace("\0", " "))
        except OSError:  # it ended, or is another's
            continue
    return found
