"""What somebody publishes, as readable lines."""

import math
import time

from kappaskin.cli.common import FAILED, Switch, Whole, check_time, print_json, stops
from kappaskin.publish import UdpListener

_READ = 0.1  # s


def listen(*, udp: Whole = 9870, seconds: float = math.inf, json: Switch = False) -> int:
    """Print what is published to a UDP port of this machine, until stopped (Ctrl+C).

    Contacts (ten a second) with their error bars and their age when sent, every loss on the
    network, how the source is doing, and a summary. Exit code 1 if no contact came.

    Example: `kappaskin listen --udp 9870`

    Parameters
    ----------
    udp
        The port.
    seconds
        How long to listen; until stopped when left out.
    json
        Print every message as it came, one a line.
    """
    check_time(seconds, "listen")
    stopped = stops()
    listener, end = UdpListener(udp), time.monotonic() + seconds
    try:
        while not stopped and time.monotonic() < end:
            for message in listener.read(_READ):
                lines = listener.lines(message)
                if json:
                    print_json(message)
                else:
                    print(*lines, sep="\n", end="\n" if lines else "", flush=bool(lines))
    finally:
        listener.close()
    if not json:
        print(listener.summary)
    return 0 if listener.contacts else FAILED
