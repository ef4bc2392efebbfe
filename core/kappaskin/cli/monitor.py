"""What a device says, as readable lines."""

import math
import time

from kappaskin.cli.common import FAILED, Switch, check_time, stops
from kappaskin.sources import WireMonitor

_READ = 0.1  # s


def monitor(port: str, *, seconds: float = math.inf, reset: Switch = False) -> int:
    """Print what comes over a port as readable lines, to bring up a device.

    Every message with its sequence number, time and content (of scans, ten a second), every gap and
    every byte that was thrown away, and a summary at the end (Ctrl+C). Exit code 1 if no message
    came, or the line broke.

    Example: `kappaskin monitor /dev/ttyACM0`

    Parameters
    ----------
    port
        A port, or a URL that pyserial opens.
    seconds
        How long to listen; until stopped when left out.
    reset
        Pulse DTR and RTS first, at which many boards start anew.
    """
    check_time(seconds, "listen")
    stopped = stops()
    listening, end = WireMonitor(port), time.monotonic() + seconds
    try:
        if reset:
            listening.reset()
        while not (stopped or listening.lost) and time.monotonic() < end:
            for line in listening.read(_READ):
                print(line, flush=True)
    finally:
        listening.close()
    print(listening.summary())
    return FAILED if listening.lost or not listening.accounting().accepted else 0
