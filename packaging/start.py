"""A fresh machine, set up, and one task run on it: the app, every check or some, or benchmarks.

    python3 packaging/start.py                     opens the app on a simulated fingertip
    python3 packaging/start.py app [ARGUMENTS]     opens the app, e.g. app --source sim:
    python3 packaging/start.py test [ARGUMENTS]    runs every check; ARGUMENTS go to pytest
    python3 packaging/start.py full                runs all that a release needs
    python3 packaging/start.py lint                runs those that read, and run nothing
    python3 packaging/start.py fast [ARGUMENTS]    runs what of the library's tests takes a minute
    python3 packaging/start.py cover [ARGUMENTS]   tells which lines of the library no test runs
    python3 packaging/start.py bench [ARGUMENTS]   runs the benchmarks; --history plots how it went
    python3 packaging/start.py fuzz [SECONDS]      gives every reader mutated bytes, for an hour
    python3 packaging/start.py drill [ARGUMENTS]   kills, stops, fills and floods what runs, and
                                                   writes the results to the guide's validation page
    python3 packaging/start.py mutate ROOM [COUNT] changes contact, sources, estimation or scenes:
                                                   do its tests notice?
    python3 packaging/start.py core [ARGUMENTS]    tests the library where no GUI is installed;
                                                   --python python3.12 with another Python
    python3 packaging/start.py docs                makes the site in dist/docs
    python3 packaging/start.py bundle [--try]      makes the app one folder; --try only tries it

Needs Linux and Python 3.11 or newer. A second start with nothing changed installs nothing.
"""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import importlib.util
import json
import os
import platform
import select
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import IO

OLDEST = (3, 11)
ROOT = Path(__file__).resolve().parent.parent
CONSTRAINTS = ROOT / "packaging" / "constraints.txt"
PICTURE = ROOT / "kappaskin-window.png"
VENV, CORE_VENV = ROOT / ".venv", ROOT / ".venv-core"
STAMP = VENV / "kappaskin-stamp"
REFUSED = 2
PATIENCE = 30.0  # s that a process is given to start or to end
REPORT = 15.0  # s after which a silent command is reported to go on

READING = (
    ("ruff", "check"),
    ("ruff", "format", "--check"),
    ("basedpyright",),
    ("lint-imports", "--no-cache"),  # the cache does not notice that a module was renamed
)
# Each process has a display of its own; -n0 among ARGUMENTS makes it one for all, on ours.
# One that crashes ends the run: what it had in hand would be waited for without end.
# Three of them: fewer leave the cores idle, more gain nothing.
TESTS = ("pytest", "-n3", "--max-worker-restart=0", "-m", "not full")
# A busy machine can make a test of a window late; more that fail are no matter of time.
RETRIED = 3
LIBRARY = "tests/core"
ALL_CASES = ("-m", "")  # the last -m counts
# Benchmarks and drills are named so that plain pytest passes them by.
BENCHMARKS = ("tests/benchmarks", "-o", "python_files=bench_*.py", "-q")
DRILLS = ("tests/drills", "-o", "python_files=drill_*.py", "-n0")
CORE = (f"{ROOT}[plots,foxglove,hdf5]", "hypothesis", "mcap-ros2-support", "mpmath", "psutil")
CORE += ("pytest", "pytest-xdist", "scikit-fem")


# What a release runs, besides the library's tests with each other Python that is there.
RELEASE = (
    ("test", *ALL_CASES, f"--ignore={LIBRARY}"),
    ("test", *ALL_CASES, "--without=presenter", "tests/app"),
    ("cover",),
    ("core",),
    *(("mutate", room, "20") for room in ("contact", "sources", "estimation", "scenes")),
    ("fuzz", "120"),
    ("drill",),
    ("bench",),
    ("docs",),
    ("bundle",),
)


class Stop(Exception):
    """A reason to give up: what was expected, what came, what to do."""


def main(arguments: list[str]) -> int:
    """Set up, run one task; the exit code is the task's, or 2 where the setup was refused."""
    name, rest = (arguments[0], arguments[1:]) if arguments else ("app", [])
    if name in ("-h", "--help"):
        print(__doc__)
        return 0
    try:
        if name not in TASKS:
            raise Stop(f"expected one of {', '.join(TASKS)}, got {name!r}; --help shows examples")
        end_orderly_on_signals()
        set_up()
        with display(environment()) as shown:
            return TASKS[name](rest, shown)
    except Stop as reason:
        print(f"start: {reason}", file=sys.stderr)
        return REFUSED
    except KeyboardInterrupt:
        return 128 + signal.SIGINT


# --- the tasks


def app(arguments: list[str], shown: dict[str, str]) -> int:
    """Open the app; on a virtual display for some seconds, leaving a picture."""
    command = [tool("kappaskin"), "app", *arguments]
    if not displayless():
        say("Opening the app")
        return run(command, shown)
    say("No display here: running on a virtual one for some seconds")
    PICTURE.unlink(missing_ok=True)
    for option, value in (("--seconds", "10"), ("--screenshot", str(PICTURE))):
        if option not in [argument.split("=")[0] for argument in arguments]:
            command += [option, value]
    code = run(command, shown)
    if PICTURE.exists():
        say(f"A picture of the window: {PICTURE}")
    return code


def test(arguments: list[str], shown: dict[str, str]) -> int:
    """Run every check, whatever the others say; the exit code is the first failure's."""
    have_compiler()
    command = [tool("python"), __file__, "lint"]
    with tempfile.TemporaryFile("w+") as said, started(command, shown, said) as reading:
        say(shlex.join([*TESTS, *arguments]))
        tested = run_tests(arguments, shown)
        read = reading.wait()
        said.seek(0)
        print(said.read(), end="", flush=True)
    if tested:
        say(f"Failed: pytest (exit code {tested})")
    elif not read:
        say(f"All {len(READING) + 1} checks passed")
    return read or tested


def run_tests(arguments: list[str], shown: dict[str, str]) -> int:
    """Run the tests, and once more, one at a time, the few that fail beside others."""
    with tempfile.TemporaryDirectory() as folder:
        command = [tool(TESTS[0]), *TESTS[1:], *arguments, "-o", f"cache_dir={folder}"]
        tested = run(command, shown, cwd=ROOT)
        failed = Path(folder, "v", "cache", "lastfailed")
        names = list(json.loads(failed.read_text())) if failed.exists() else []
        if tested != 1 or not 0 < len(names) <= RETRIED:
            return tested
        say(f"Once more, one at a time: {shlex.join(names)}")
        tested = run([*command, "-n1", "--last-failed"], shown, cwd=ROOT)
    if not tested:
        say(f"To mend: failed beside other tests, passed alone: {shlex.join(names)}")
    return tested


def lint(arguments: list[str], shown: dict[str, str]) -> int:
    """Run the checks that only read the code, whatever the others say."""
    if arguments:
        raise Stop(f"expected nothing after lint, got {shlex.join(arguments)}")
    return in_turn([[tool(name), *rest] for name, *rest in READING], shown)


def full(arguments: list[str], shown: dict[str, str]) -> int:
    """Run every task of a release, whatever the others say, on a machine that does nothing else."""
    if arguments:
        raise Stop(f"expected nothing after full, got {shlex.join(arguments)}")
    steps = [*RELEASE, *(("core", "--python", python) for python in other_pythons())]
    return in_turn([[tool("python"), __file__, *step] for step in steps], shown)


def fast(arguments: list[str], shown: dict[str, str]) -> int:
    """Run the library's tests but those that are slow or start a process."""
    command = [tool("pytest"), "-n2", "-q", "-m", "not slow and not full", LIBRARY, *arguments]
    return run(command, shown, cwd=ROOT)


def cover(arguments: list[str], shown: dict[str, str]) -> int:
    """Run the library's tests, and fail where they leave too much of it out."""
    coverage = [tool("python"), "-m", "coverage"]
    with tempfile.TemporaryDirectory() as folder:
        variables = shown | {"COVERAGE_FILE": str(Path(folder, "coverage"))}
        tests = ["run", "-m", "pytest", "-n3", "-q", LIBRARY, *arguments]
        steps = (tests, ["combine", "-q"], ["report"])
        codes = [run([*coverage, *words], variables, cwd=ROOT) for words in steps]
    return next(filter(None, codes), 0)


def bench(arguments: list[str], shown: dict[str, str]) -> int:
    """Run the benchmarks."""
    return run([tool("pytest"), *BENCHMARKS, *arguments], shown, cwd=ROOT)


def drill(arguments: list[str], shown: dict[str, str]) -> int:
    """Run the drills, one at a time."""
    return run([tool("pytest"), *DRILLS, *arguments], shown, cwd=ROOT)


def fuzz(arguments: list[str], shown: dict[str, str]) -> int:
    """Give the readers of files and lines mutated bytes, for minutes or an hour."""
    return run([tool("python"), str(ROOT / "tests" / "fuzz" / "fuzz.py"), *arguments], shown)


def core(arguments: list[str], shown: dict[str, str]) -> int:
    """Run the library's tests in a venv of its own, without any GUI library."""
    python, venv = base_python(), CORE_VENV
    if arguments[:1] == ["--python"]:
        (python, *arguments) = arguments[1:] or [python]
        venv = venv.with_name(f"{venv.name}-{Path(python).name}")
    install(venv, *CORE, keep=Path(tool("python", venv)).exists(), python=python)
    command = [tool("pytest", venv), "-n2", "-m", "not full", LIBRARY, *arguments]
    return run(command, shown, cwd=ROOT)


def bundle(arguments: list[str], shown: dict[str, str]) -> int:
    """Make the app a folder that needs no Python, and try it."""
    install(VENV, str(ROOT), *group("bundle"), keep=True)
    return run([tool("python"), str(ROOT / "packaging/bundle/build.py"), *arguments], shown)


def docs(arguments: list[str], shown: dict[str, str]) -> int:
    """Make the site: guide, lessons, notebooks and reference, with their links checked."""
    install(VENV, str(ROOT), *group("docs"), keep=True)
    return run([tool("python"), str(ROOT / "packaging/docs/build.py"), *arguments], shown)


def mutate(arguments: list[str], shown: dict[str, str]) -> int:
    """Change a room of the core in one place at a time, and say what no test notices."""
    return run([tool("python"), str(ROOT / "tests" / "mutation" / "mutate.py"), *arguments], shown)


TASKS = {
    task.__name__: task
    for task in (app, test, full, lint, fast, cover, bench, fuzz, drill, mutate, core, docs, bundle)
}


# --- the setup


def set_up() -> None:
    """Make .venv and have the system libraries, or stop with what to do."""
    if sys.version_info[:2] < OLDEST:
        newer = [name for name in named_pythons() if starts(name)]
        remedy = "install a newer one (Debian 12, Ubuntu 24.04: apt-get install python3-venv)"
        remedy = f"start with {newer[-1]} packaging/start.py" if newer else remedy
        wanted = "Python {}.{} or newer".format(*OLDEST)
        raise Stop(f"expected {wanted}, this is {platform.python_version()}; {remedy}")
    if not sys.platform.startswith("linux"):
        say(f"Kappaskin is tested on Linux alone; parts may fail on this {platform.system()}")
    wanted, found = stamp(), STAMP.read_text("utf-8") if STAMP.exists() else ""
    if found != wanted:
        STAMP.unlink(missing_ok=True)  # Killed from here on, the next start begins anew.
        keep = found.split("\n")[0] == wanted.split("\n")[0]
        install(VENV, f"{ROOT}[app]", *group("dev"), keep=keep)
        STAMP.write_text(wanted, "utf-8")
    have_libraries()


def stamp() -> str:
    """Two lines, which interpreter works where, and a hash of what it was asked to install."""
    asked = hashlib.sha256((ROOT / "pyproject.toml").read_bytes() + CONSTRAINTS.read_bytes())
    return f"{platform.python_version()} {sys.base_prefix} {ROOT}\n{asked.hexdigest()}\n"


def group(name: str) -> list[str]:
    """The requirements of a dependency group, which pip before 25.1 does not read."""
    import tomllib  # An older Python lacks it, and is to be told what is needed.

    lines = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["dependency-groups"][name]
    included = [each for line in lines if isinstance(line, dict) for each in line.values()]
    own = [line for line in lines if isinstance(line, str)]
    return own + [requirement for other in included for requirement in group(other)]


def base_python() -> str:
    """The Python that venvs are made with: .venv's own would clear itself away."""
    return getattr(sys, "_base_executable", sys.executable)


def other_pythons() -> list[str]:
    """The names of other Pythons on the path that the library is for, and that start."""
    names = named_pythons()
    started = [name for name in names if starts(name)]
    if missing := [name for name in names if name not in started]:
        say(f"Skipped, as they do not start here: {', '.join(missing)}")
    return started


def named_pythons() -> list[str]:
    """The names of other Pythons on the path that the library is for."""
    minors = set(range(OLDEST[1], 30)) - {sys.version_info.minor}
    return [name for minor in sorted(minors) if shutil.which(name := f"python3.{minor}")]


def starts(python: str) -> bool:
    return not subprocess.call([python, "-c", ""], stderr=subprocess.DEVNULL)


def install(venv: Path, *asked: str, keep: bool, python: str = "") -> None:
    """Fill a venv, made anew unless the one found was complete, to `keep`, and only out of date."""
    if not keep:
        if not importlib.util.find_spec("ensurepip"):
            apt("Python's venv module is incomplete", "apt-get install -y python3-venv")
        if venv.is_symlink():  # which venv would follow, to clear what others use
            raise Stop(f"expected {venv} to be a folder of its own, it is a link; remove the link")
        say(f"Making {venv}")
        command = [python or base_python(), "-m", "venv", "--clear", str(venv)]
        quietly(command, environment(pip=True), "repair this Python, or start with another")
    say("Updating the packages" if keep else "Installing the packages (minutes, up to 1.5 GB)")
    command = [tool("python", venv), "-m", "pip", "install", "-c", str(CONSTRAINTS)]
    command += ["-e", *asked]
    quietly(command, environment(pip=True), "check the network and pip's settings, start again")


def have_libraries() -> None:
    """Install the system libraries that Qt and VTK miss, or stop with the line that does."""
    if line := doctor()["install"]:
        apt("Qt and VTK need system libraries", line)
        if still := doctor()["missing"]:
            raise Stop(f"expected nothing missing after {line!r}, but {' '.join(still)}")


def have_compiler() -> None:
    """Install a compiler for the firmware's tests, or stop with the line that does."""
    # g++ brings gcc and the C library's headers with it.
    if sys.platform.startswith("linux") and not (shutil.which("gcc") and shutil.which("g++")):
        line = "apt-get install -y --no-install-recommends g++"
        apt("The firmware's tests need a compiler", line)


def doctor() -> dict[str, str]:
    """What `kappaskin doctor` found."""
    command = [tool("kappaskin"), "doctor", "--json"]
    told = subprocess.run(command, env=environment(), capture_output=True, text=True, check=False)
    try:
        return json.loads(told.stdout)
    except json.JSONDecodeError:
        raise Stop(
            f"expected JSON from {shlex.join(command)}, got exit code {told.returncode} and\n"
            f"{told.stdout}{told.stderr}\nremove {VENV} and start again if this is not your change"
        ) from None


def apt(why: str, line: str) -> None:
    """Run the apt-get `line` as root on Debian; else stop with what a person has to run."""
    if not (Path("/etc/debian_version").exists() and os.geteuid() == 0):
        update = "sudo apt-get update && sudo "
        raise Stop(f"{why}. Run this line (Debian, Ubuntu), then start again:\n{update}{line}")
    say(f"{why}: {line}")
    silent = environment(pip=True) | {"DEBIAN_FRONTEND": "noninteractive"}
    for command in (["apt-get", "update"], shlex.split(line)):
        quietly(command, silent, "mend apt's settings or the network, then start again")


# --- processes


def tool(name: str, venv: Path = VENV) -> str:
    """The path of a program of a venv."""
    return str(venv / ("Scripts" if sys.platform == "win32" else "bin") / name)


def environment(*, pip: bool = False) -> dict[str, str]:
    """Our environment without another Python's paths; pip's settings only for `pip` itself."""
    # Without bytecode each of the app's processes would compile the library anew, for 0.3 s.
    foreign = {"PYTHONHOME", "PYTHONPATH", "VIRTUAL_ENV", "PYTHONDONTWRITEBYTECODE"}
    kept = {name: value for name, value in os.environ.items() if name not in foreign}
    if not pip:
        return {name: value for name, value in kept.items() if not name.startswith("PIP_")}
    # For the isolated build too; pip before 25.3 knows the first alone. Spaces would separate.
    pins = CONSTRAINTS.as_uri()
    return kept | {"PIP_CONSTRAINT": pins, "PIP_BUILD_CONSTRAINT": pins}


def in_turn(commands: list[list[str]], variables: dict[str, str]) -> int:
    """The first exit code that is not 0 of commands that all run, whatever the others say."""
    failures: list[tuple[str, int]] = []
    for command in commands:
        began, words = time.monotonic(), shlex.join([Path(command[0]).name, *command[1:]])
        say(words)
        if code := run(command, variables, cwd=ROOT):
            failures.append((words, code))
        say(f"{words}: {time.monotonic() - began:.0f} s")
    if failures:
        say("Failed: " + ", ".join(f"{words} (exit code {code})" for words, code in failures))
    return failures[0][1] if failures else 0


def run(
    command: list[str],
    variables: dict[str, str],
    cwd: Path | None = None,
    output: IO[str] | None = None,
) -> int:
    """The command's exit code; where we are stopped meanwhile, so is it."""
    with started(command, variables, output, cwd) as child:
        code = child.wait()
    return code if code >= 0 else 128 - code


@contextlib.contextmanager
def started(
    command: list[str],
    variables: dict[str, str],
    output: IO[str] | None = None,
    cwd: Path | None = None,
) -> Iterator[subprocess.Popen[bytes]]:
    """The process of a command; where we are stopped meanwhile, so is it."""
    both = subprocess.STDOUT if output else None
    with subprocess.Popen(command, env=variables, cwd=cwd, stdout=output, stderr=both) as child:
        try:
            yield child
        except (KeyboardInterrupt, SystemExit) as reason:
            # After Ctrl+C the terminal has told the child already.
            end(child, ask=not isinstance(reason, KeyboardInterrupt))
            raise


def quietly(command: list[str], variables: dict[str, str], mend: str) -> None:
    """Run a command; show the last line it printed now and then, and more where it fails."""
    with tempfile.TemporaryDirectory() as folder:
        log, code = Path(folder, "log"), None
        with log.open("w") as output, started(command, variables, output) as child:
            while code is None:
                try:
                    code = child.wait(REPORT)
                except subprocess.TimeoutExpired:
                    say(f"  {printed(log, 1):.90}")
        if code:
            raise Stop(f"{shlex.join(command)}\n{printed(log, 30)}\nexit code {code}; {mend}")


def printed(log: Path, most: int) -> str:
    """The last lines of a log that are not empty, so many at most."""
    lines = log.read_text("utf-8", "replace").splitlines()
    return "\n".join([line.strip() for line in lines if line.strip()][-most:])


def end(child: subprocess.Popen[bytes], *, ask: bool = True) -> None:
    """Let a process end, then make it."""
    if ask:
        child.terminate()
    try:
        child.wait(PATIENCE)
    except subprocess.TimeoutExpired:
        child.kill()
        child.wait()


def end_orderly_on_signals() -> None:
    """Turn the signals that would end us at once into an exit that cleans up."""
    for name in ("SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        if number and signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, lambda got, _: sys.exit(128 + got))


def say(line: str) -> None:
    """Print a line of our own, in order with what the children print."""
    print(f"==> {line}", flush=True)


# --- the display


def displayless() -> bool:
    """Whether windows would have nowhere to go."""
    shown = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    return sys.platform.startswith("linux") and not shown


def display(variables: dict[str, str]) -> contextlib.AbstractContextManager[dict[str, str]]:
    """The environment `variables` with a display, a virtual one where there is none."""
    return virtual_display(variables) if displayless() else contextlib.nullcontext(variables)


@contextlib.contextmanager
def virtual_display(variables: dict[str, str]) -> Iterator[dict[str, str]]:
    """The environment `variables` with a virtual display of its own."""
    with tempfile.TemporaryFile("w+", errors="replace") as log:
        reader, writer = os.pipe()
        # Its default, a reset whenever the last client leaves, refuses whoever comes meanwhile.
        command = ["Xvfb", "-displayfd", str(writer), "-screen", "0", "1920x1200x24"]
        command += ["-nolisten", "tcp", "-noreset"]
        server = subprocess.Popen(
            command,
            env=variables,
            stdout=log,
            stderr=log,
            pass_fds=[writer],
            start_new_session=True,  # Ctrl+C is for the app; the server goes last.
            preexec_fn=end_with_parent,
        )
        os.close(writer)
        try:
            number = display_number(reader, log)
            yield variables | {"DISPLAY": f":{number}", "QT_QPA_PLATFORM": "xcb"}
        finally:
            end(server)


def end_with_parent() -> None:
    """Have the kernel end this process with its parent, even where that is killed (Linux)."""
    set_parent_death_signal = 1
    ctypes.CDLL(None).prctl(set_parent_death_signal, signal.SIGTERM)


def display_number(reader: int, log: IO[str]) -> str:
    """The number that the server writes once it is ready."""
    with open(reader, encoding="ascii") as ready:
        number = ready.readline().strip() if select.select([ready], [], [], PATIENCE)[0] else ""
    if not number:
        log.seek(0)
        raise Stop(f"expected Xvfb to start in {PATIENCE:g} s; it printed\n{log.read()}")
    return number


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
