"""README and guide tell the truth: what a page shows is run in order, in a folder of its own.

Fences say what a block is: `sh` are commands, `python` a script that goes on with the names of the
one before, `toml` a file named in its first line, `text` what the block before it printed, `output`
the same but for its numbers; ... stands for anything. The sensor at /dev/ttyACM0 is played by
`kappaskin device`.
"""

import ast
import doctest
import importlib.util
import io
import json
import os
import re
import runpy
import shlex
import signal
import socket
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from kappaskin.cli import _add_commands, app, main

ROOT = Path(__file__).parents[1]
GUIDE = Path(str(files("kappaskin_resources"))) / "guide"
PAGES = [ROOT / "README.md", *sorted(GUIDE.glob("*.md"))]
NAMES = [page.name if page.parent == GUIDE else "front" for page in PAGES]

PICTURES = runpy.run_path(str(ROOT / "tests" / "guide_pictures.py"))
SENSOR, PORT = "/dev/ttyACM0", "9870"
WINDOWS = ("app", "demo", "replay")
_OPENED: set[str] = set()  # what a page of before had opened too
SHOWN = importlib.util.find_spec("PySide6") is not None
ENOUGH = 90.0  # s for one command on a busy machine
_SHADES = 6.0  # of 255, by which points may differ in the mean


@dataclass(frozen=True)
class Block:
    """A fenced block: what kind, what it says, and the line of the page where it begins."""

    kind: str
    text: str
    line: int


def blocks_of(page: Path) -> list[Block]:
    text = page.read_text("utf-8")
    fences = re.finditer(r"^```(\w*)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    return [Block(m[1], m[2], text.count("\n", 0, m.start()) + 2) for m in fences]


def commands_of(block: Block) -> list[str]:
    return [line for line in block.text.replace("\\\n", "").splitlines() if line.strip()]


@dataclass
class Shell:
    """Runs what a page shows, and gives back what it printed."""

    stack: ExitStack
    said_as: dict[str, str] = field(default_factory=dict)
    plugged: bool = False
    """Whether plug-ins are installed, which processes of their own find."""
    names: dict[str, object] = field(default_factory=lambda: {"__name__": "__main__"})

    def run(self, block: Block) -> str:
        if block.kind == "python":
            code = compile(self._here(block.text), "page", "exec")
            return _printed(lambda: exec(code, self.names))
        return "".join(self.command(line) for line in commands_of(block))

    def command(self, line: str) -> str:
        asked = 1 if "# exit code 1" in line else 2 if "# refused" in line else 0
        words = [self._here(word) for word in shlex.split(line, comments=True)]
        match words:
            case ["pip", "install", what] if what.startswith("./"):
                self._install(what)
                return ""
            case ["pip", "install", what]:
                assert re.fullmatch(r"kappaskin\[(\w+)\]", what)[1] in _extras()
                return ""
            case ["python", "-m", module, *rest] if module.startswith("kappaskin_resources."):
                return _ran(sys.executable, "-m", module, *rest)
            case ["python3", "packaging/start.py", *task]:
                assert f"def {(task or ['app'])[0]}(" in _start()
                return ""
            case ["kappaskin", *_, "&"]:
                return self._beside(words[1:-1])
            case ["kappaskin", name, *rest] if name in WINDOWS:
                if SHOWN and (line not in _OPENED or self.plugged):
                    _OPENED.add(line)
                    _open(name, *rest)
                return ""
            case ["kappaskin", *rest] if self.plugged:
                return _ran(sys.executable, "-m", "kappaskin", *rest)
            case ["kappaskin", *rest]:
                codes: list[int] = []
                printed = _printed(lambda: codes.append(main(rest)))
                assert codes == [asked], f"{line}: exit code {codes}\n{printed}"
                return self._said(printed)
        raise AssertionError(f"{line}: expected kappaskin, pip, a module or packaging/start.py")

    def _install(self, package: str) -> None:
        """Install a plug-in where processes that are started from now on find it."""
        self.plugged, there = True, Path("plugged", package).absolute()
        alone = ("--no-index", "--no-deps", "--no-build-isolation", "-q", "--target", str(there))
        _ran(sys.executable, "-m", "pip", "install", *alone, package)
        patch = self.stack.enter_context(pytest.MonkeyPatch.context())
        patch.setenv("PYTHONPATH", str(there), prepend=os.pathsep)

    def _here(self, word: str) -> str:
        """A word of a command with the ports of this machine for those that a page names."""
        if SENSOR in word and SENSOR not in self.said_as.values():
            self._beside(["device", "circle"])
        if PORT in word and PORT not in self.said_as.values():
            self.said_as[str(_free_port())] = PORT
        for here, there in self.said_as.items():
            word = word.replace(there, here)
        return word

    def _said(self, printed: str) -> str:
        for here, there in self.said_as.items():
            printed = printed.replace(here, there)
        return printed

    def _beside(self, words: list[str]) -> str:
        """What a command that goes on beside the next ones prints first."""
        printed = self.stack.enter_context(_process(*words)).stdout.readline()
        if words[0] == "device":  # which takes the place of the one before
            self.said_as = {here: there for here, there in self.said_as.items() if there != SENSOR}
            self.said_as[json.loads(printed)["port"]] = SENSOR
        return self._said(printed)


def _ran(*words: str) -> str:
    """What a command that ends well prints."""
    both = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    done = subprocess.run(words, text=True, check=False, timeout=ENOUGH, **both)
    assert done.returncode == 0, done.stdout
    return done.stdout


def _printed(act) -> str:
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    printed = io.StringIO()
    try:
        with redirect_stdout(printed), redirect_stderr(printed):
            act()
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
    return printed.getvalue()


@contextmanager
def _process(*words: str) -> Iterator[subprocess.Popen[str]]:
    """A command that runs until it is told to stop, and then ends well."""
    call = [sys.executable, "-m", "kappaskin", *words]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(call, text=True, **pipes) as process:
        try:
            yield process
            process.send_signal(signal.SIGINT)
            _, complaint = process.communicate(timeout=ENOUGH)
            assert process.returncode == 0, complaint
        finally:
            process.kill()


def _free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as found:
        found.bind(("127.0.0.1", 0))
        return found.getsockname()[1]


def _open(*words: str) -> None:
    """Open a window as a page says, for a second."""
    printed = _ran(sys.executable, "-m", "kappaskin", *words, "--seconds", "1")
    assert not printed, words


@cache
def _extras() -> set[str]:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    return set(project["optional-dependencies"])


@cache
def _start() -> str:
    return (ROOT / "packaging" / "start.py").read_text("utf-8")


def _alike(said: str, printed: str) -> bool:
    said = re.sub(r"^\.\.\.\n", "...", said, flags=re.MULTILINE)  # any lines, or none
    how = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    return doctest.OutputChecker().check_output(said, printed, how)


def _without_numbers(text: str) -> str:
    """A text with one sign for each number, as it is written: 1,024, -3e-05."""
    text = re.sub(r"[-+]?\d[\d,]*(?:\.\d+)?(?:e[-+]?\d+)?", "#", text)
    return re.sub(r"\s+(?=\])", "", text)  # where NumPy pads a shorter number of an array


def _keep(block: Block) -> None:
    """Write the file that a block is."""
    name = re.match(r"# (\S+\.(?:toml|py))\n", block.text)
    assert name, f"line {block.line}: expected the file's name in a comment at its head"
    Path(name[1]).parent.mkdir(exist_ok=True)
    Path(name[1]).write_text(block.text, "utf-8")


@pytest.mark.cases(
    "front",
    "accuracy",
    "build",
    "calibrate",
    "validation",
    "connect",
    "numbers",
    "own-sensor",
    "paper",
    "real-sensors",
    "studies",
    "trouble",
)
@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_what_a_page_shows_runs_and_prints_what_it_says(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, same_but_for_the_last_digit
) -> None:
    monkeypatch.chdir(tmp_path)
    for kind in ("DATA", "CONFIG"):
        monkeypatch.setenv(f"XDG_{kind}_HOME", str(tmp_path / kind))
    printed = ""
    with ExitStack() as stack:
        shell = Shell(stack)
        for block in blocks_of(page):
            where = f"{page.name}, line {block.line}"
            match block.kind:
                case "python" if re.match(r"# \S+/\S+\.py\n", block.text):
                    _keep(block)
                case "sh" | "python":
                    printed = shell.run(block)
                case "toml":
                    _keep(block)
                case "text":
                    same = _alike(block.text, printed)
                    same = same or same_but_for_the_last_digit(block.text, printed)
                    assert same, f"{where}: got\n{printed}"
                case "output":
                    alike = _alike(_without_numbers(block.text), _without_numbers(printed))
                    assert alike, f"{where}: got\n{printed}"
                case other:
                    pytest.fail(f"{where}: no block is {other!r}")
        for picture, command in PICTURES["shown_on"](page):
            if shlex.split(command)[1] == "figures":
                shell.command(command)
            if made := list(tmp_path.rglob(picture.name)):
                assert _look_alike(made[0], picture), picture


def _words_in(drawing: Path) -> list[str]:
    return re.findall(r"<text[^>]*>([^<]*)<", drawing.read_text("utf-8"))


def _look_alike(made: Path, kept: Path) -> bool:
    """Whether a picture shows what the command draws: its words, or its points but for shades."""
    if kept.suffix == ".svg":
        return _words_in(made) == _words_in(kept)
    with Image.open(kept) as image:
        off = np.subtract(PICTURES["small"](made), image.convert("RGB"), dtype=float)
    return float(np.abs(off).mean()) < _SHADES


@pytest.mark.parametrize("page", PAGES[1:], ids=NAMES[1:])
def test_every_picture_is_small_and_its_caption_names_the_command(page: Path) -> None:
    pictures = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", page.read_text("utf-8"))
    shown = PICTURES["shown_on"](page)
    assert [picture for picture, _ in shown] == [(page.parent / one).resolve() for one in pictures]
    for picture, command in shown:
        assert picture.stem in command or command.startswith("kappaskin report"), command
        assert picture.stat().st_size < 60_000, picture


def test_no_command_hides_from_being_run() -> None:
    for page in PAGES:
        hidden = r"^(?: {4}|\t)(?:kappaskin|pip|python3) .*"
        assert re.findall(hidden, page.read_text("utf-8"), re.MULTILINE) == [], page.name


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_commands_named_in_the_text_are_understood(page: Path) -> None:
    _add_commands()
    text = re.sub(r"^```.*?^```$", "", page.read_text("utf-8"), flags=re.MULTILINE | re.DOTALL)
    for said in re.findall(r"`kappaskin ([^`]+)`", text):
        name, *rest = shlex.split(said.replace("\n", " "))
        assert name in app, said
        if rest:
            app.parse_args([name, *rest], exit_on_error=False, print_error=False)


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_links_lead_somewhere(page: Path) -> None:
    text = page.read_text("utf-8")
    for where in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", text):
        assert (page.parent / where).exists(), where
    for target in re.findall(r"\]\((?:http[^)]*)\)", text):
        assert target.startswith("](https://"), target


def test_every_page_is_in_the_contents_and_in_one_order() -> None:
    contents = (GUIDE / "README.md").read_text("utf-8")
    listed = re.findall(r"^\d+\. \[[^\]]+\]\(([\w-]+\.md)\)", contents, re.MULTILINE)
    assert sorted(listed) == sorted(page.name for page in PAGES[1:] if page.name != "README.md")


def test_the_first_page_lists_all_parts_that_are_installed_by_name() -> None:
    first = (GUIDE / "start.md").read_text("utf-8")
    assert set(re.findall(r"^pip install 'kappaskin\[(\w+)\]'", first, re.MULTILINE)) == (
        _extras() - {"dask"}  # which is cluster
    )


def test_the_page_on_plug_ins_shows_what_the_command_writes(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    blocks = blocks_of(GUIDE / "plug-ins.md")
    commands = [line for block in blocks if block.kind == "sh" for line in commands_of(block)]
    for line in commands:
        if line.startswith("kappaskin new "):
            assert main(line.split()[1:]) == 0
    shown = [block.text.partition("\n") for block in blocks if block.kind in ("toml", "python")]
    assert len(shown) == 10
    for name, _, text in shown:
        assert (tmp_path / name.removeprefix("# ")).read_text("utf-8") == text, name


def test_the_validation_page_lists_every_drill_as_passed() -> None:
    table = (GUIDE / "validation.md").read_text("utf-8").partition("| drill |")[2]
    for file in (Path(__file__).parent / "drills").glob("drill_*.py"):
        name = (ast.get_docstring(ast.parse(file.read_text("utf-8"))) or "").splitlines()[0]
        assert re.search(rf"^\| {re.escape(name.rstrip('.'))} \| [1-9]", table, re.M), file
    assert "failed" not in table
