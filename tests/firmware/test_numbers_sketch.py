"""The sketch that prints numbers, on a board of numbers, read by the description beside it."""

import subprocess
from pathlib import Path

import numpy as np
import pytest

from kappaskin.sources import load_description

HERE = Path(__file__).parent
SKETCH = HERE.parents[1] / "resources" / "kappaskin_resources" / "firmware" / "numbers_sketch"
STRICT = ("-std=c++17", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O1", "-x", "c++")
WATCHED = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")


@pytest.fixture(scope="module")
def printed(compiler: str, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """What the sketch prints in 50 frames; the compiler of the other sketch's tests is there."""
    made = tmp_path_factory.mktemp("numbers") / "sketch"
    sources = [SKETCH / "numbers_sketch.ino", HERE / "arduino" / "numbers_board.cpp"]
    command = ["g++", *STRICT, *WATCHED, f"-I{HERE / 'arduino'}", *map(str, sources)]
    told = subprocess.run([*command, "-o", str(made)], capture_output=True, check=False)
    assert told.returncode == 0, told.stderr.decode()
    ran = subprocess.run([made], capture_output=True, check=False)
    assert ran.returncode == 0, ran.stderr.decode()
    return ran.stdout


def test_its_lines_are_read_as_the_description_beside_it_says(printed: bytes) -> None:
    described = load_description(SKETCH / "board.toml")
    lines = described.decoder()

    frames = lines.feed(printed)
    accounting = lines.accounting()

    assert len(frames) == 49
    assert dict(accounting.discarded).keys() == {"half a line"}
    assert np.all(np.diff([frame.time for frame in frames]) > 0)
    read = described.sensor.transduction.curvature(frames[0].counts)
    np.testing.assert_allclose(read, 0.05 * (500 + 10 * np.arange(12)) - 25.6)
    # Element 1 is above element 0: in the layout, whose numbers run along x first, it is 2.
    assert frames[0].channels[:4].tolist() == [0, 2, 1, 3]


def test_it_is_as_short_as_the_guide_says() -> None:
    text = (SKETCH / "numbers_sketch.ino").read_text()

    assert len([line for line in text.splitlines() if line and not line.startswith("//")]) <= 30
