"""Bytes to the messages in them, written from the page once more: what the C code must say."""

import binascii
import struct
import zlib

MAGIC = b"\x4b\xa7"
LONGEST = 2**18


def read(data: bytes, capacity: int = LONGEST + 26) -> tuple[list[bytes], int]:
    """The whole messages in `data`, and how many bytes wait for more, by a reader of `capacity`."""
    found, at = list[bytes](), 0
    while (magic := data.find(MAGIC, at)) >= 0 and magic + 22 <= len(data):
        at = magic
        version, kind, length = struct.unpack_from("<BBI", data, at + 2)
        (check,) = struct.unpack_from("<H", data, at + 20)
        end = at + 26 + length
        told = length <= min(LONGEST, capacity - 26)
        if not told or binascii.crc_hqx(data[at : at + 20], 0) != check:
            at += 1
        elif end > len(data):
            break
        elif zlib.crc32(data[at : end - 4]) != int.from_bytes(data[end - 4 : end], "little"):
            at += 1
        else:
            if version == 1 and 1 <= kind <= 4:
                found.append(data[at:end])
            at = end
    waiting = len(data) - magic if magic >= 0 else int(data.endswith(MAGIC[:1], at))
    return found, waiting
