import math
from dataclasses import replace

import pytest
from PySide6.QtWidgets import QApplication

from kappaskin import Setup, Status, load_scene
from kappaskin.health import Health
from kappaskin.health.findings import Finding
from kappaskin.recording import RecordingStatus, Replay
from kappaskin_app.shell.badge import Badge, colour_of, functions_of, in_use, origin, state_of
from kappaskin_app.theme import LIGHT

NOW = 100.0
SENSOR = load_scene("circle").sensor()
RAILED = Health((Finding(0, 0, "xx", "saturated", 0.0, "on a rail"),), 1)
STREAMING = Status(state="streaming", sensor=SENSOR, last_frame=NOW - 0.1)
PLAYED = Replay(1.0, 2.0, 1.0, False, ((0.2, 0.4),), (), 0.0, True)


@pytest.mark.parametrize("truths", [{}, {"health": RAILED}])
@pytest.mark.parametrize(
    ("news", "expected"),
    [
        ({"state": "off", "replay": PLAYED}, "OFF"),
        ({"state": "lost", "replay": PLAYED}, "LOST"),
        ({"state": "waiting", "last_frame": 0.0}, "WAITING"),
        ({"last_frame": NOW - 0.6}, "STALE"),
        ({"last_frame": NOW - 0.6, "computing": True}, "WAITING"),
        ({"replay": replace(PLAYED, at=0.3, speed=0.0)}, "REPLAY \N{MIDDLE DOT} gap"),
    ],
)
def test_what_makes_readings_old_wins_over_all_else(
    news: dict[str, object], expected: str, truths: dict[str, object]
) -> None:
    status = replace(STREAMING, **{**truths, **news})
    assert state_of(status, NOW - 0.7, NOW, paused=True) == expected


def test_before_the_first_reading_nothing_that_is_shown_is_old() -> None:
    status = replace(STREAMING, last_frame=-math.inf)
    assert state_of(status, None, NOW, paused=False) == "WAITING"
    assert state_of(status, NOW - 0.6, NOW, paused=False) == "STALE"


@pytest.mark.parametrize(
    ("source", "word"),
    [
        ({}, "SIM"),
        ({"sensor": replace(SENSOR, simulated=False)}, "LIVE"),
        ({"replay": PLAYED}, "REPLAY"),
    ],
)
def test_a_reading_on_a_rail_is_told_below_where_it_comes_from(
    source: dict[str, object], word: str
) -> None:
    status = replace(STREAMING, **source)
    assert state_of(status, NOW, NOW, paused=False) == word
    railed = state_of(replace(status, health=RAILED), NOW, NOW, paused=False)
    assert railed == f"{word} \N{MIDDLE DOT} saturated"
    assert origin(railed) == word
    assert colour_of(railed, LIGHT) == LIGHT.warning


def test_a_rail_wins_over_a_pause() -> None:
    assert state_of(STREAMING, NOW, NOW, paused=True) == "SIM \N{MIDDLE DOT} paused"
    railed = replace(STREAMING, health=RAILED)
    assert state_of(railed, NOW, NOW, paused=True) == "SIM \N{MIDDLE DOT} saturated"


def test_the_badge_says_recording_below_what_nothing_graver_is_true_of(qapp: QApplication) -> None:
    badge = Badge()
    recorded = RecordingStatus("x.mcap", True, 11.0)
    badge.show_state("LIVE", recorded)
    assert badge.text() == "LIVE\nREC 0:11"
    badge.show_state("SIM \N{MIDDLE DOT} paused", recorded)
    assert badge.text() == "SIM\npaused"
    assert badge.accessibleName() == "SIM, paused, recording"
    badge.show_state("SIM", RecordingStatus())
    assert badge.text() == "SIM"


def test_a_mesh_has_a_number_of_functions_and_none_in_x_and_y() -> None:
    pad, setup = load_scene("thumb-pad").sensor(), Setup(Ni=7, Nj=8)
    assert functions_of(setup, SENSOR) == functions_of(setup, None) == "7 x 8"
    assert functions_of(setup, pad) == "56"
    refused = Status(setup=setup, sensor=pad, refusal="no", slot=1)
    assert in_use(refused).startswith("In use: Least squares, 56 functions. ")
