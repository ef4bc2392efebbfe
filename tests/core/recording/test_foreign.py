"""What is known of a file of another program before its sensor is described."""

import numpy as np
import pytest

from kappaskin.recording import FileLines


def rows(count=100, columns=9, seed=0):
    return np.random.default_rng(seed).normal(0, 100, (count, columns)).round(2)


@pytest.mark.parametrize(
    ("step", "role"), [(0.01, "time"), (10, "time_ms"), (10_000, "time_us"), (1, "sequence")]
)
def test_the_times_of_a_file_are_guessed_by_their_steps(tmp_path, step, role) -> None:
    file = tmp_path / "a.csv"
    file.write_text("t,a,b\n" + "".join(f"{n * step},{n % 3},{n % 5}\n" for n in range(50)))
    found = FileLines(file).recogniser.found()

    assert (found.labels, found.roles) == (("t", "a", "b"), (role, None, None))
    assert len(found.numbers) == 50
    assert "lines/s" not in found.text


def test_a_file_that_cannot_be_read_says_so(tmp_path) -> None:
    assert "cannot be read" in FileLines(tmp_path / "none.csv").trouble


def test_arrays_and_tables_are_lines_of_their_first_rows(tmp_path) -> None:
    values, time = rows(500, 4), np.arange(500) / 100
    np.savez(tmp_path / "a.npz", values=values, time=time)
    found = FileLines(tmp_path / "a.npz").recogniser.found()
    assert found.labels == ("time", *(f"values[{n}]" for n in range(4)))
    assert found.roles == ("time", None, None, None, None)
    np.testing.assert_array_equal(found.numbers, np.column_stack([time, values])[:300])

    parquet = pytest.importorskip("pyarrow.parquet")
    import pyarrow

    parquet.write_table(pyarrow.table({"t": time, "h0": values[:, 0]}), tmp_path / "a.parquet")
    found = FileLines(tmp_path / "a.parquet").recogniser.found()
    assert (found.labels, found.roles) == (("t", "h0"), ("time", None))
    np.testing.assert_array_equal(found.numbers[:, 1], values[:300, 0])


@pytest.mark.parametrize("name", ["a.npz", "a.parquet"])
@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", b"PAR1" + bytes(40), b"1,2,3\n" * 9])
def test_damaged_arrays_and_tables_say_so(tmp_path, name, content) -> None:
    if name == "a.parquet":
        pytest.importorskip("pyarrow")
    (tmp_path / name).write_bytes(content)
    trouble = FileLines(tmp_path / name).trouble
    assert f"expected {name[1:]} contents" in trouble or "cannot be read" in trouble


def test_arrays_of_objects_and_without_values_are_refused(tmp_path) -> None:
    np.savez(tmp_path / "a.npz", values=np.array([{}, 1], object))
    assert "cannot be read" in FileLines(tmp_path / "a.npz").trouble
    np.savez(tmp_path / "b.npz", other=np.ones((3, 2)))
    assert "expected arrays values" in FileLines(tmp_path / "b.npz").trouble


def test_arrays_whose_bytes_are_damaged_say_so(tmp_path) -> None:
    file = tmp_path / "a.npz"
    np.savez_compressed(file, values=rows(500, 4))
    content = bytearray(file.read_bytes())
    content[200:260] = bytes(60)
    file.write_bytes(content)

    assert "cannot be read" in FileLines(file).trouble
