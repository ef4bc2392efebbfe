"""Our CDR against the decoder of another project, and bytes that are no message."""

import random
import struct

import numpy as np
import pytest
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory

from kappaskin import Refusal
from kappaskin.recording import messages as m
from kappaskin.recording.cdr import MessageLayout, MessageType, decode, encode

INNER = MessageType("pkg/msg/Inner", "uint8 a\nfloat64 b")
NESTED = MessageType(
    "pkg/msg/Nested",
    """
bool yes
string text
float64[2] pair  # m
uint8[] small
# A comment on a line of its own
pkg/Inner[] inner
int64 last
""",
    INNER,
)


def theirs(kind, data):
    """What the independent decoder reads."""
    schema = Schema(id=1, name=kind.name, encoding="ros2msg", data=kind.definition)
    return DecoderFactory().decoder_for("cdr", schema)(data)


def plain(value):
    return np.asarray(list(value) if isinstance(value, bytes) else value).tolist()


@pytest.mark.parametrize("text", ["", "a", "abcdefg", "längs"])
@pytest.mark.parametrize("small", [0, 1, 5])
@pytest.mark.parametrize("inner", [0, 1, 3])
def test_texts_lists_and_messages_within_are_read_by_others(text, small, inner) -> None:
    layout = MessageLayout(NESTED, {"text": text, "small": small, "inner": inner})
    values = {"yes": True, "pair": [1.5, -2.0], "last": -7}
    values |= {"small": np.arange(small)} if small else {}
    for n in range(inner):
        values |= {f"inner.{n}.a": n, f"inner.{n}.b": n / 3}
    data = layout(values)

    read = theirs(NESTED, data)
    assert (read.yes, read.text, list(read.pair), read.last) == (True, text, [1.5, -2.0], -7)
    assert plain(read.small) == list(range(small))
    assert [(part.a, part.b) for part in read.inner] == [(n, n / 3) for n in range(inner)]
    ours = decode(NESTED, data)
    assert (ours["text"], ours["last"], ours["pair"].tolist()) == (text, -7, [1.5, -2.0])
    assert all(ours[f"inner.{n}.b"] == n / 3 for n in range(inner))


@pytest.mark.parametrize("topic", m.TOPICS, ids=lambda topic: topic.name)
def test_every_message_of_a_recording_is_read_by_others(topic) -> None:
    """Each field with a number of its own, so that none can pass for another."""
    values, fields = {}, []

    def fill(kind, before):
        for field in kind.fields:
            path = before + field.name
            if field.kind == "string":
                values[path] = f"text {len(values)}"
            elif field.kind in kind.inside:
                if field.count is None:
                    fill(kind.inside[field.kind], f"{path}.")
                continue
            elif field.count is None:
                values[path] = len(values) % 2 if field.kind == "bool" else len(values) + 1
            else:
                values[path] = np.arange(field.count or 3) + len(values)
            if field.kind not in kind.inside:
                fields.append(path)

    fill(topic.kind, "")
    if topic == m.SKIN:
        values["fields"] = []
    data = encode(topic.kind, values)
    read = theirs(topic.kind, data)
    for path in fields:
        got = read
        for name in path.split("."):
            got = getattr(got, name)
        assert plain(got) == plain(values[path]), path
        assert plain(decode(topic.kind, data)[path]) == plain(values[path])


def test_the_bytes_of_a_line_are_packed_as_any_other_message() -> None:
    for data in (b"", b"x", bytes(range(256))):
        values = {"host_time": 1.5, "sent": True, "data": np.frombuffer(data, np.uint8)}
        message = m.pack_line(1.5, True, data)
        assert message == encode(m.LINE, values)
        assert m.unpack_line(message) == (1.5, True, data)


def test_no_bytes_are_read_as_something_that_they_are_not() -> None:
    rng = random.Random(1)
    whole = encode(m.TRUTH, {"edge": "hinged", "contact": [0, 1], "coefficients": [1.0, 2.0]})
    for n in range(len(whole)):
        with pytest.raises(Refusal, match="expected"):
            decode(m.TRUTH, whole[:n])
    huge = whole[:16] + struct.pack("<I", 2**32 - 1) + whole[20:]
    with pytest.raises(Refusal, match="expected"):
        decode(m.STRING, huge[:4] + huge[16:])
    for _ in range(500):
        data = bytearray(whole)
        data[rng.randrange(len(data))] = rng.randrange(256)
        try:
            decode(m.TRUTH, bytes(data))
        except Refusal:
            continue
    for data in (b"", b"\0\1\0\0", m.pack_line(0.0, False, b"abc")[:-1], whole):
        with pytest.raises(Refusal, match=m.LINE.name):
            m.unpack_line(data)


def test_a_definition_that_is_none_is_a_mistake_of_ours() -> None:
    with pytest.raises(ValueError, match="expected a field"):
        MessageType("pkg/msg/Wrong", "float64")


def test_a_contact_is_packed_as_any_other_message() -> None:
    rng = np.random.default_rng(1)
    times, flags = rng.normal(size=4).tolist(), [True, False, True, True, False, False, True]
    numbers = rng.normal(size=40)
    message = m.pack_contact(17 * 10**9 + 5, 2**40, times, flags, -3, numbers.tolist())
    read = theirs(m.CONTACT, message)
    names = [field.name for field in m.CONTACT.fields]
    head, rest = names[: names.index("noise")], names[names.index("noise") :]
    assert (read.header.stamp.sec, read.header.stamp.nanosec) == (17, 5)
    assert read.header.frame_id == m.FRAME
    assert [getattr(read, name) for name in head[1:]] == [2**40, *times, *flags, -3]
    assert np.concatenate([np.ravel(getattr(read, name)) for name in rest]).tolist() == (
        numbers.tolist()
    )
    assert encode(m.CONTACT, decode(m.CONTACT, message)) == message
