"""Bytes sent at one baud rate to the bytes that a receiver at another makes of them."""

import numpy as np
from numpy.typing import NDArray


def _levels(data: bytes) -> NDArray[np.uint8]:
    """The line while `data` passes, a level for each bit: start, eight data bits, stop."""
    bits = np.unpackbits(np.frombuffer(data, np.uint8), bitorder="little").reshape(-1, 8)
    framed = np.ones((len(data), 10), np.uint8)
    framed[:, 0], framed[:, 1:9] = 0, bits
    return framed.ravel()


def heard(data: bytes, sent_at: float, read_at: float) -> bytes:
    """What a receiver at the baud rate `read_at` takes for bytes when `data` is sent at another.

    It waits for the line to fall, samples the middle of eight bits, lowest first, and of a stop
    bit; whether that is one is not looked at, as systems do unless told to.
    """
    line = np.append(_levels(data), np.ones(10, np.uint8))
    step = sent_at / read_at  # bits of the sender per bit of the receiver
    falls = np.flatnonzero(np.diff(line.astype(np.int8), prepend=1) < 0)
    middles = ((np.arange(1, 9) + 0.5) * step).astype(np.intp)
    sampled = np.minimum(falls[:, None] + middles, len(line) - 1)
    values = np.packbits(line[sampled], axis=1, bitorder="little").ravel().tolist()
    # A line that is still low in the middle of the stop bit must rise before it can fall again.
    following = np.searchsorted(falls, falls + 9.5 * step).tolist()
    made, at = bytearray(), 0
    while at < len(values):
        made.append(values[at])
        at = following[at]
    return bytes(made)


def speed_code(baud_rate: int) -> int:
    """How the system numbers a baud rate."""
    import termios

    return getattr(termios, f"B{baud_rate}", baud_rate)
