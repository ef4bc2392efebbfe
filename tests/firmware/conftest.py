"""The firmware compiled for this machine, plain and watched by the sanitizers."""

import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

FIRMWARE = Path(__file__).parents[2] / "resources" / "kappaskin_resources" / "firmware"
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-Wconversion", "-O2")
WATCHED = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g", "-O0")

Compile = Callable[..., Path]


@pytest.fixture(scope="session")
def compiler() -> str:
    """A C compiler, where there is one for C++ too."""
    if sys.platform == "win32":
        pytest.skip("no gcc and no pseudo-terminals on this system")
    if not (shutil.which("gcc") and shutil.which("g++")):
        pytest.fail("the firmware's tests need a compiler: apt-get install -y g++")
    return "gcc"


@pytest.fixture(scope="session")
def compiled(compiler: str, tmp_path_factory: pytest.TempPathFactory) -> Compile:
    """Makes a program of C files; `watched` by the sanitizers, it ends at an error."""
    folder = tmp_path_factory.mktemp("firmware")

    def make(name: str, *files: Path, watched: bool = False) -> Path:
        program = folder / (f"{name}_watched" if watched else name)
        if program.exists():
            return program
        command = [compiler, *STRICT, *(WATCHED if watched else ()), f"-I{FIRMWARE}"]
        told = subprocess.run(
            [*command, *map(str, files), "-o", str(program)],
            capture_output=True,
            text=True,
            check=False,
        )
        assert told.returncode == 0, told.stderr
        return program

    return make


@pytest.fixture(scope="session", params=[False, True], ids=["plain", "watched"])
def wire(compiled: Compile, request: pytest.FixtureRequest) -> Callable[..., str]:
    """What the wire code says of bytes: its driver's output for arguments and a standard input."""
    files = (Path(__file__).with_name("wire_driver.c"), FIRMWARE / "kappaskin_wire.c")
    program = compiled("wire_driver", *files, watched=request.param)

    def said(*arguments: object, data: bytes) -> str:
        command = [str(program), *map(str, arguments)]
        told = subprocess.run(command, input=data, capture_output=True, check=False)
        assert told.returncode == 0, told.stderr.decode()
        return told.stdout.decode()

    return said
