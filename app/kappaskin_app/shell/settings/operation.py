"""Settings of the operator: the input, its limits, and where poses go."""

import math
from dataclasses import dataclass
from typing import Any

from kappaskin_app.shell.settings.form_fields import (
    MILLIMETRES,
    Choice,
    Range,
    Switch,
    Text,
    setting,
)

PAD, GAMEPAD, UDP = "pad", "gamepad", "udp"


def _reach(axis: str) -> Any:
    tip = f"How far the hand may go from home along {axis}, both ways."
    return setting(0.05, Range(f"Reach {axis}", tip, 1e-3, 2.0, 5e-3, *MILLIMETRES))


@dataclass(frozen=True)
class OperationSettings:
    """What moves the hand, how fast and how far, and what the operator feels."""

    operator_input: str = setting(
        PAD,
        Choice(
            "Input",
            "What moves the hand: the pad beside with mouse and keys, a gamepad, or messages of "
            "another program, such as that of a glove, by UDP.",
            ((PAD, "Pad: mouse, keys"), (GAMEPAD, "Gamepad"), (UDP, "UDP")),
        ),
    )
    operator_listens: str = setting(
        "127.0.0.1:9875",
        Text(
            "Listen at",
            "HOST:PORT for targets by UDP. 127.0.0.1 takes those of this machine only, 0.0.0.0 "
            "those of any machine in the network.",
        ),
    )
    operator_speed: float = setting(
        0.05, Range("Speed limit", "Largest speed of the hand.", 1e-3, 1.0, 5e-3, 1e3, "mm/s")
    )
    operator_turn_rate: float = setting(
        math.radians(30.0),
        Range(
            "Turn rate limit",
            "Largest turn rate of the hand.",
            math.radians(1.0),
            2 * math.pi,
            math.radians(5.0),
            math.degrees(1.0),
            "\N{DEGREE SIGN}/s",
        ),
    )
    operator_grip: float = setting(
        1.5,
        Range(
            "Grip limit", "Largest force with which each finger grips.", 0.1, 50.0, 0.5, 1, "N", 1
        ),
    )
    operator_reach_x: float = _reach("x")
    operator_reach_y: float = _reach("y")
    operator_reach_z: float = _reach("z")
    send_to_robot: bool = setting(
        False,
        Switch(
            "Send to a robot (UDP)",
            "Send the hand's target as JSON, one datagram each, at 250/s, or as often as targets "
            "come by UDP.",
        ),
    )
    robot_at: str = setting("127.0.0.1:9876", Text("Robot at", "HOST:PORT of the robot."))
    operator_tones: bool = setting(
        False,
        Switch(
            "Tones",
            "A tone for each finger, from the left to the right: its pitch and loudness follow the "
            "force. Silent without a contact, and where data are old or lost.",
        ),
    )
    operator_rumble: bool = setting(
        True,
        Switch("Rumble", "The gamepad rumbles as strongly as the finger that feels most."),
    )
    felt_at_most: float = setting(
        1.0,
        Range(
            "Strongest at",
            "Force of a finger at which tones and rumble are strongest.",
            0.05,
            50.0,
            0.1,
            1,
            "N",
            2,
        ),
    )

    @property
    def operator_reach(self) -> tuple[float, float, float]:
        """How far the hand may go from home along x, y and z, in m."""
        return self.operator_reach_x, self.operator_reach_y, self.operator_reach_z
