"""The file of a hand, and where its fingers are."""

import math
import socket
import time
from contextlib import closing
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kappaskin import Refusal
from kappaskin.hand import (
    JointReceiver,
    Linkage,
    angles_from_json,
    is_hand,
    load_hand,
    named_hand,
    placement,
)
from kappaskin.sources import VirtualClock

READY = Path(str(files("kappaskin_resources"))) / "hands" / "three-fingertips.toml"

FINGER = """
[[finger]]
name = "index"
source = "sim:fingertip-cap"
position = [0.01, 0.0, 0.0]
"""

# A palm, a proximal link 40 mm along x that turns about z, a distal one that turns by half as much,
# and a tip that slides out.
URDF = """<?xml version="1.0"?>
<robot name="finger">
  <link name="palm"/><link name="proximal"/><link name="distal"/><link name="tip"/>
  <joint name="base" type="revolute">
    <parent link="palm"/><child link="proximal"/>
    <origin xyz="0.1 0 0" rpy="0 0 0"/><axis xyz="0 0 2"/><limit lower="-1" upper="1.5"/>
  </joint>
  <joint name="middle" type="continuous">
    <parent link="proximal"/><child link="distal"/>
    <origin xyz="0.04 0 0"/><axis xyz="0 0 1"/>
    <mimic joint="base" multiplier="0.5" offset="0.1"/>
  </joint>
  <joint name="out" type="prismatic">
    <parent link="distal"/><child link="tip"/>
    <origin xyz="0.03 0 0"/><axis xyz="1 0 0"/><limit lower="0" upper="0.01"/>
  </joint>
</robot>
"""


def written(folder, text, urdf=""):
    if urdf:
        (folder / "hand.urdf").write_text(urdf)
    (folder / "hand.toml").write_text(text)
    return folder / "hand.toml"


def test_the_ready_hand_has_three_skins_that_face_its_middle():
    hand = load_hand(READY)

    pole = np.array([0.0104719755, 0.0104719755, 0.0])
    for where in hand.placements().values():
        at = where.rotation @ pole + where.position
        assert np.linalg.norm(at) == pytest.approx(0.04, abs=1e-6)
        np.testing.assert_allclose(where.rotation @ [0, 0, 1], -at / 0.04, atol=2e-5)


def test_roll_pitch_and_yaw_turn_about_fixed_axes_as_in_a_urdf():
    found = placement((1.0, 2.0, 3.0), (0.3, -0.7, 2.0))

    np.testing.assert_allclose(
        found.rotation, Rotation.from_euler("xyz", (0.3, -0.7, 2.0)).as_matrix(), atol=1e-15
    )
    assert found.position.tolist() == [1.0, 2.0, 3.0]


def test_links_move_as_the_joints_of_a_urdf_do(tmp_path):
    text = (
        'format = 1\nurdf = "hand.urdf"\n' + FINGER + 'link = "tip"\nrotation = [0.1, 0.2, 0.3]\n'
    )
    hand = load_hand(written(tmp_path, text, URDF))
    q, out = 0.4, 0.005

    found = hand.placements({"base": q, "out": out})["index"]

    turn = q + 0.5 * q + 0.1
    far = 0.03 + out + 0.01
    at = (
        0.1 + 0.04 * np.cos(q) + far * np.cos(turn),
        0.04 * np.sin(q) + far * np.sin(turn),
        0.0,
    )
    np.testing.assert_allclose(found.position, at, atol=1e-15)
    whole = Rotation.from_euler("z", turn) * Rotation.from_euler("xyz", (0.1, 0.2, 0.3))
    np.testing.assert_allclose(found.rotation, whole.as_matrix(), atol=1e-15)
    assert hand.joints == {"base": (-1.0, 1.5), "out": (0.0, 0.01)}


def test_the_value_of_a_joint_that_is_missing_is_asked_for(tmp_path):
    hand = load_hand(
        written(tmp_path, f'format = 1\nurdf = "hand.urdf"\n{FINGER}link = "tip"', URDF)
    )

    with pytest.raises(Refusal, match=r"joints base, out for the link 'tip', got none of 'out'"):
        hand.placements({"base": 0.1})


@pytest.mark.parametrize(
    ("was", "now", "why"),
    [
        ('type="prismatic"', 'type="floating"', "joint 'out' to be one of fixed, revolute"),
        ('xyz="1 0 0"', 'xyz="0 0 0"', "an axis of joint 'out' that is not zero"),
        ('xyz="0.04 0 0"', 'xyz="0.04 0"', "3 numbers at xyz of joint 'middle', got '0.04 0'"),
        ('joint="base"', 'joint="none"', "a joint to mimic that moves, got 'none'"),
        ('<child link="tip"/>', '<child link="distal"/>', "one joint to each link"),
        ('<parent link="distal"/>', '<parent link="tip"/>', "a ring at 'tip'|one tree"),
        ('<link name="palm"/>', '<link name="palm"/><link name="other"/>', "got 2 roots"),
        ("</robot>", "", "got XML with an error"),
        ("<robot", "<!DOCTYPE robot><robot", "without a document type"),
    ],
)
def test_a_urdf_with_an_error_is_refused(was, now, why):
    with pytest.raises(Refusal, match=why):
        Linkage(URDF.replace(was, now))


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("format = 2\n" + FINGER, "line 1: format: expected format = 1, got 2"),
        ("format = 1", "expected 1 to 64 fingers of different names"),
        ("format = 1\n" + FINGER.replace("index", "in/dex"), "a letter, then .* got 'in/dex'"),
        ("format = 1\n" + 2 * FINGER, "fingers of different names, got .'index', 'index'"),
        ("format = 1\n" + FINGER + 'link = "tip"', "expected a link of the hand's URDF for finger"),
        (
            "format = 1\n" + FINGER + "rotation = [0.0, inf, 0.0]",
            "line 7: .*-6.28319 to 6.28319 rad",
        ),
        ("format = 1\n" + FINGER + "positon_sd = 1e-4", "did you mean position_sd"),
        ('format = 1\nurdf = "../hand.urdf"\n' + FINGER, "line 2: urdf: .*folder of the hand"),
        ("format = ", "expected a hand in TOML"),
    ],
)
def test_a_hand_that_cannot_be_is_refused_with_its_line(tmp_path, text, why):
    with pytest.raises(Refusal, match=why):
        load_hand(written(tmp_path, text))


def test_joint_values_come_as_a_json_object():
    assert angles_from_json('{"base": 0.5, "out": 0}') == {"base": 0.5, "out": 0.0}
    with pytest.raises(Refusal, match="expected a number, got 'half'"):
        angles_from_json('{"base": "half"}')


def test_a_hand_is_named_as_a_source(tmp_path, monkeypatch):
    ready = named_hand("hand:three-fingertips")
    assert ready is not None
    assert ready.sources == dict.fromkeys(("thumb", "index", "middle"), "sim:fingertip-cap")

    mine = named_hand(str(written(tmp_path, f"format = 1\n{FINGER}")))
    assert mine is not None
    assert mine.sources == {"index": "sim:fingertip-cap"}


@pytest.mark.parametrize("source", ["sim:", "", "hand:three-fingertips#thumb", "none.toml"])
def test_another_source_names_no_hand(source):
    assert named_hand(source) is None


def test_a_hand_that_is_not_ready_is_refused_with_those_that_are():
    with pytest.raises(
        Refusal, match=r"a hand among .*three-fingertips, or a file that .*; got 'mine'"
    ):
        named_hand("hand:mine")


def test_a_scene_or_a_file_that_cannot_be_read_is_no_hand(tmp_path):
    assert is_hand(READY)
    assert not is_hand(READY.parents[1] / "scenes" / "demo.toml")
    assert not is_hand(tmp_path / "none.toml")


def test_angles_come_by_udp_and_what_is_none_is_counted():
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    clock = VirtualClock(10.0)
    with (
        closing(JointReceiver(f"udp://127.0.0.1:{port}", clock)) as joints,
        closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as robot,
    ):
        assert (joints.angles, joints.age) == ({}, math.inf)
        robot.connect(("127.0.0.1", port))
        for data in (
            b'{"base": 0.5, "tip": 0.1}',
            b'{"base": 0.6}',
            b'{"base": NaN}',
            b"\xff",
            b"[1]",
        ):
            robot.send(data)
        until = time.monotonic() + 10.0
        while joints.refused < 3 and time.monotonic() < until:
            assert joints.angles is not None
        assert joints.angles == {"base": 0.6, "tip": 0.1}
        clock.sleep(2.0)
        assert joints.age == pytest.approx(2.0)
        with pytest.raises(Refusal, match="cannot listen there"):
            JointReceiver(f"udp://127.0.0.1:{port}")
    with pytest.raises(Refusal, match=r"expected udp://:PORT such as udp://:9870, got 'udp://:'"):
        JointReceiver("udp://:")
