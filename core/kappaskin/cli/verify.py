"""A recording to whether its bytes come to the same estimates again."""

from pathlib import Path

from kappaskin._background import Beside
from kappaskin.cli.common import FAILED, progress
from kappaskin.recording import Verification, verify_steps


def verify(file: Path) -> int:
    """Work out every recorded estimate once more from the recorded bytes, and compare bit for bit.

    Exit code 0 if all are the same, 1 if one is not, and then the first is told. Another processor
    may round differently in the last digits.

    Example: `kappaskin verify press.mcap`

    Parameters
    ----------
    file
        The recording.
    """
    # As the engine does: products are summed in another order by more than one thread.
    with Beside[float | Verification]("verify", verify_steps, file) as work:
        verdict = progress(work.wait(), Verification)
    print(f"{file}: {verdict.words}")
    return 0 if verdict.same else FAILED
