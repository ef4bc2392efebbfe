"""A damaged recording to a whole one."""

from pathlib import Path

from kappaskin.cli.common import FAILED, progress
from kappaskin.recording import Repaired, repair_steps

_NOTHING = 3


def repair(file: Path, *, out: Path) -> int:
    """Save every whole message of a damaged or unfinished recording to a new file.

    Any MCAP file will do. Exit code 0 if nothing was lost, 1 if some of the file could not be read,
    3 if nothing of it could.

    Example: `kappaskin repair press.mcap.part --out press.mcap`

    Parameters
    ----------
    file
        The recording; it stays as it is.
    out
        The new one, which must not be there yet.
    """
    done = progress(repair_steps(file, out), Repaired)
    if not (done.total or done.attachments):
        print(f"{file}: {done.words}")
        return _NOTHING
    print(f"{out}: {done.words}")
    for topic, count in sorted(done.messages.items()):
        print(f"  {count:>10,}  {topic}")
    return FAILED if done.lost else 0
