"""A damaged recording to a whole one."""

from pathlib import Path

from kappaskin.cli.common import FAILED
from kappaskin.recording.repair import repair as repaired

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
    done = repaired(file, out)
    lost = f"{done.lost:,} bytes could not be read" if done.lost else "nothing was lost"
    if not (done.total or done.attachments):
        print(f"{file}: no message could be saved; {lost}")
        return _NOTHING
    print(f"{out}: {done.total:,} messages and {done.attachments} attachments; {lost}")
    for topic, count in sorted(done.messages.items()):
        print(f"  {count:>10,}  {topic}")
    return FAILED if done.lost else 0
