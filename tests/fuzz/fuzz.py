"""Gives readers bytes that were never seen, and keeps those that reach new lines to go on from.

    python tests/fuzz/fuzz.py [SECONDS] [NAME ...]

Each reader gets an equal part of the time, which is an hour unless said otherwise. Whatever is
raised but a `Refusal`, takes longer than twenty seconds of work or more than two GiB is a finding:
it is printed, and written to this folder as `fuzz-NAME-N.bin`; the exit code is 1.
"""

import logging
import random
import runpy
import signal
import sys
import tempfile
import time
import traceback
import warnings
from pathlib import Path
from types import FrameType

from kappaskin import Refusal

HERE = Path(__file__).parent
_OTHER = runpy.run_path(str(HERE / "targets.py"))
TARGETS, Target = _OTHER["TARGETS"], _OTHER["Target"]
LONGEST = 20.0  # s of work that reading may take
MEMORY = 2 * 2**30  # bytes
OURS = "kappaskin"


class TooSlow(Exception):
    """Reading takes too long."""


def late(number: int, frame: object) -> None:
    raise TooSlow


class Seen:
    """The lines of ours that were reached, each with the one before it."""

    def __init__(self) -> None:
        self.reached: set[tuple[str, int, int]] = set()
        self._last = 0

    def __call__(self, frame: FrameType, event: str, _: object) -> object:
        if OURS not in frame.f_code.co_filename:
            return None
        self.reached.add((frame.f_code.co_filename, self._last, frame.f_lineno))
        self._last = frame.f_lineno
        return self


def mutated(rng: random.Random, corpus: list[bytes], words: tuple[bytes, ...]) -> bytes:
    """One of the `corpus` with a few changes."""
    data = bytearray(rng.choice(corpus))
    for _ in range(rng.choice((1, 1, 2, 4, 8))):
        at, size = rng.randrange(len(data) + 1), rng.choice((1, 1, 2, 4, 16, 64))
        match rng.randrange(7):
            case 0 if at < len(data):
                data[at] ^= 1 << rng.randrange(8)
            case 1:
                data[at : at + size] = rng.randbytes(size)
            case 2:
                del data[at : at + size]
            case 3:
                data[at:at] = data[at : at + size] * rng.choice((1, 2, 100))
            case 4:
                other = rng.choice(corpus)
                start = rng.randrange(len(other) + 1)
                data[at : at + size] = other[start : start + size * 4]
            case 5 if words:
                data[at:at] = rng.choice(words)
            case _ if words:
                stop = at
                while stop < len(data) and chr(data[stop]).isalnum():
                    stop += 1
                data[at : max(stop, at + 1)] = rng.choice(words)
            case _:
                pass
    return bytes(data)


def tried(target, data: bytes, folder: Path) -> str:
    """What is wrong with how `data` is read; empty if nothing is."""
    signal.setitimer(signal.ITIMER_PROF, LONGEST)
    try:
        target.read(data, folder)
    except Refusal:
        return ""
    except TooSlow:
        return f"takes longer than {LONGEST:g} s"
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        return "".join(traceback.format_exception(error)[-4:])
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    return ""


def fuzzed(target, seconds: float, rng: random.Random, folder: Path) -> list[tuple[str, bytes]]:
    """What was found, once for each last line of a trace."""
    corpus, seen, found = list(target.seeds), Seen(), dict[str, tuple[str, bytes]]()
    end, runs = time.monotonic() + seconds, 0
    while time.monotonic() < end:
        data = mutated(rng, corpus, target.words) if runs >= len(target.seeds) else corpus[runs]
        known, runs = len(seen.reached), runs + 1
        sys.settrace(seen)
        try:
            wrong = tried(target, data, folder)
        finally:
            sys.settrace(None)
        if wrong:
            where = "".join(line for line in wrong.splitlines() if line.startswith("  File"))
            found.setdefault(where or wrong, (wrong, data))
        elif len(seen.reached) > known and len(data) < 10**5:
            corpus.append(data)
    print(
        f"{target.name:<14}{runs:>8} tried, {len(corpus):>5} kept, {len(seen.reached):>6} steps "
        f"reached, {len(found)} findings",
        flush=True,
    )
    return list(found.values())


def main(arguments: list[str]) -> int:
    seconds = float(arguments[0]) if arguments else 3600.0
    chosen = [target for target in TARGETS if target.name in arguments[1:] or not arguments[1:]]
    seed = time.time_ns() % 10**6
    print(f"{seconds:g} s, seed {seed}")
    limit_memory()
    signal.signal(signal.SIGPROF, late)
    warnings.simplefilter("error")
    logging.disable()  # trimesh tells at length what it cannot read
    rng, code = random.Random(seed), 0
    with tempfile.TemporaryDirectory() as folder:
        for target in chosen:
            found = fuzzed(target, seconds / len(chosen), rng, Path(folder))
            for number, (wrong, data) in enumerate(found):
                place = Path(f"fuzz-{target.name}-{number}.bin")
                place.write_bytes(data)
                print(f"{place}:\n{wrong}")
                code = 1
    return code


def limit_memory() -> None:
    import resource

    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, resource.getrlimit(resource.RLIMIT_AS)[1]))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
