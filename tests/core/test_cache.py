"""What takes long to compute is kept for the next process, and never trusted blindly."""

from pathlib import Path

import numpy as np
import pytest

from kappaskin._files import cached


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "kappaskin" / "modes"


class Asked:
    def __init__(self, size: int = 4) -> None:
        self.times, self.size = 0, size

    def __call__(self) -> dict[str, np.ndarray]:
        self.times += 1
        return {"roots": np.sqrt(np.arange(self.size)), "two": np.eye(2)}


def test_what_is_kept_is_not_computed_again_and_has_the_same_bits():
    compute = Asked()

    first, second = cached("roots", compute), cached("roots", compute)

    assert compute.times == 1
    assert {name: v.tobytes() for name, v in first.items()} == {
        name: v.tobytes() for name, v in second.items()
    }


def test_another_question_has_an_answer_of_its_own():
    assert len(cached("short", Asked(3))["roots"]) == 3
    assert len(cached("long", Asked(5))["roots"]) == 5


@pytest.mark.parametrize("cut", [0, 10, 300, -1])
def test_a_damaged_file_is_computed_anew_and_mended(folder: Path, cut: int):
    compute = Asked()
    cached("roots", compute)
    (file,) = folder.iterdir()
    file.write_bytes(file.read_bytes()[:cut])

    answer = cached("roots", compute)
    cached("roots", compute)

    assert compute.times == 2
    assert np.array_equal(answer["roots"], np.sqrt(np.arange(4)))


@pytest.mark.full
def test_whichever_byte_is_spoilt_it_is_computed_anew(folder: Path):
    compute = Asked()
    cached("roots", compute)
    (file,) = folder.iterdir()
    whole = file.read_bytes()
    for place in range(len(whole)):
        file.write_bytes(whole[:place] + bytes([whole[place] ^ 0x21]) + whole[place + 1 :])
        answer = cached("roots", compute)
        assert np.array_equal(answer["roots"], np.sqrt(np.arange(4)))

    assert compute.times == 1 + len(whole)


def test_a_flipped_bit_is_found(folder: Path):
    compute = Asked(100)
    cached("roots", compute)
    (file,) = folder.iterdir()
    spoilt = bytearray(file.read_bytes())
    spoilt[len(spoilt) // 3] ^= 1
    file.write_bytes(spoilt)

    assert np.array_equal(cached("roots", compute)["roots"], np.sqrt(np.arange(100)))


def test_no_folder_to_write_in_costs_only_time(folder: Path):
    folder.parent.write_text("a file where the folder should be")
    compute = Asked()

    cached("roots", compute)
    answer = cached("roots", compute)

    assert compute.times == 2
    assert np.array_equal(answer["two"], np.eye(2))


def test_no_more_than_sixteen_files_stay_and_the_latest_do(folder: Path):
    for i in range(20):
        cached(f"question {i}", Asked())
    latest = Asked()

    cached("question 19", latest)

    assert len(list(folder.iterdir())) == 16
    assert latest.times == 0


def test_what_is_too_large_is_not_kept(folder: Path):
    cached("huge", lambda: {"zeros": np.zeros(9_000_000)})

    assert not folder.exists() or not list(folder.iterdir())
