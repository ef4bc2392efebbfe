"""A gamepad: one that SDL itself makes, plugged in and out, and none."""

import ctypes
import importlib
import warnings

import pytest

from kappaskin.hand import HandTarget, OperatorLimits, OperatorSettings
from kappaskin.hand.gamepad import Gamepad, sdl
from kappaskin.hand.operator_link import OperatorLoop

pytestmark = pytest.mark.slow  # SDL is found by a program

LIMITS = OperatorLimits(speed=0.1, turn_rate=0.5, grip=4.0)
HERE = HandTarget((0.01, 0.0, 0.0), grip=1.0)


@pytest.fixture
def library():
    """SDL; without it there is nothing to try."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return pytest.importorskip("sdl2")


class Device:
    """A gamepad of SDL's own, which is plugged in."""

    def __init__(self, library) -> None:
        self.library, self.rumbles = library, []
        how = library.SDL_VirtualJoystickDesc
        rumble = dict(how._fields_)["Rumble"]
        self._rumble = rumble(lambda _, low, high: self.rumbles.append((low, high)) or 0)
        description = how(
            version=library.SDL_VIRTUAL_JOYSTICK_DESC_VERSION,
            type=library.SDL_JOYSTICK_TYPE_GAMECONTROLLER,
            naxes=library.SDL_CONTROLLER_AXIS_MAX,
            nbuttons=library.SDL_CONTROLLER_BUTTON_MAX,
            Rumble=self._rumble,
        )
        self.number = library.SDL_JoystickAttachVirtualEx(ctypes.byref(description))
        self.joystick = library.SDL_JoystickOpen(self.number)

    def move(self, axis: int, value: float) -> None:
        self.library.SDL_JoystickSetVirtualAxis(self.joystick, axis, round(32767 * value))

    def press(self, button: int, down: bool = True) -> None:
        self.library.SDL_JoystickSetVirtualButton(self.joystick, button, down)

    def unplug(self) -> None:
        self.library.SDL_JoystickClose(self.joystick)
        self.library.SDL_JoystickDetachVirtual(self.number)


class Clock:
    now = 10.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def gamepad(library, clock):
    made = Gamepad(sdl, clock)
    yield made
    made.close()


def wanted(gamepad: Gamepad, seconds: float = 0.01) -> HandTarget | None:
    return gamepad.wanted(HERE, LIMITS, seconds)


def plugged_in(gamepad: Gamepad, clock: Clock, library) -> Device:
    """A device that the gamepad has found, with its dead man's switch held."""
    device = Device(library)
    clock.now += 1.0
    gamepad.wanted(HERE, LIMITS, 0.0)
    device.press(library.SDL_CONTROLLER_BUTTON_RIGHTSHOULDER)
    return device


def test_it_is_found_when_it_is_plugged_in_and_missed_when_it_is_not(gamepad, clock, library):
    assert wanted(gamepad) is None
    assert gamepad.trouble == "no gamepad is connected; plug one in"
    for _ in range(2):
        device = plugged_in(gamepad, clock, library)
        assert wanted(gamepad) is not None
        assert gamepad.trouble == ""
        device.unplug()
        assert wanted(gamepad) is None
        assert gamepad.trouble.endswith("was unplugged; plug it in again")


def test_nothing_is_wanted_unless_the_switch_is_held(gamepad, clock, library) -> None:
    device = plugged_in(gamepad, clock, library)
    device.move(library.SDL_CONTROLLER_AXIS_LEFTX, 1.0)
    assert wanted(gamepad).position == pytest.approx((0.011, 0.0, 0.0))
    device.press(library.SDL_CONTROLLER_BUTTON_RIGHTSHOULDER, False)
    assert wanted(gamepad) is None
    device.unplug()


@pytest.mark.parametrize(
    ("stick", "shift", "turn"),
    [
        ("LEFTX", (1, 0, 0), (0, 0, 0)),
        ("LEFTY", (0, -1, 0), (0, 0, 0)),
        ("RIGHTY", (0, 0, -1), (0, 0, 0)),
        ("RIGHTX", (0, 0, 0), (0, 0, -1)),
    ],
)
def test_sticks_move_and_turn_at_the_largest_rates(gamepad, clock, library, stick, shift, turn):
    device = plugged_in(gamepad, clock, library)
    axis = getattr(library, f"SDL_CONTROLLER_AXIS_{stick}")
    for value in (1.0, -1.0):
        device.move(axis, value)
        target = wanted(gamepad)
        moved = [now - was for now, was in zip(target.position, HERE.position, strict=True)]
        assert moved == pytest.approx([value * 1e-3 * way for way in shift], abs=1e-7)
        assert target.rotation == pytest.approx([value * 5e-3 * way for way in turn], abs=1e-6)
    device.move(axis, 0.1)  # a stick at rest is not quite in the middle
    assert wanted(gamepad) == HERE
    device.unplug()


def test_triggers_close_and_open_and_the_cross_rolls(gamepad, clock, library) -> None:
    device = plugged_in(gamepad, clock, library)
    device.move(library.SDL_CONTROLLER_AXIS_TRIGGERRIGHT, 1.0)
    assert wanted(gamepad).grip == pytest.approx(1.04)
    device.move(library.SDL_CONTROLLER_AXIS_TRIGGERRIGHT, -1.0)  # as at rest
    device.move(library.SDL_CONTROLLER_AXIS_TRIGGERLEFT, 1.0)
    assert wanted(gamepad).grip == pytest.approx(0.96)
    device.press(library.SDL_CONTROLLER_BUTTON_DPAD_RIGHT)
    assert wanted(gamepad).rotation == pytest.approx((0.0, 5e-3, 0.0))
    device.unplug()


def test_it_rumbles_while_it_is_told_to(gamepad, clock, library) -> None:
    device = plugged_in(gamepad, clock, library)
    for share in (0.0, 0.5, 0.5, 2.0, 0.0, 0.0):
        clock.now += 0.02
        gamepad.rumble(share)
        clock.now += 0.02
    assert device.rumbles == [(32768, 32768), (32768, 32768), (65535, 65535), (0, 0)] or (
        device.rumbles == [(32768, 32768), (65535, 65535), (0, 0)]
    )
    device.unplug()
    wanted(gamepad)
    gamepad.rumble(1.0)


def test_the_loop_follows_it_and_stops_its_rumble_with_the_window(clock, library) -> None:
    loop = OperatorLoop(HandTarget(), clock, lambda: Gamepad(sdl, clock))
    settings = OperatorSettings(LIMITS, enabled=True, gamepad=True, rumble=1.0)

    def run(seconds: float, asks: bool = True) -> None:
        for _ in range(round(seconds / 0.004)):
            clock.now += 0.004
            status = loop.request(settings, None) if asks else loop.status
            loop.step()
            states.append(status.state)

    states = []
    run(0.1)
    assert "no gamepad" in loop.status.trouble
    device = Device(library)
    run(0.6)
    device.press(library.SDL_CONTROLLER_BUTTON_RIGHTSHOULDER)
    device.move(library.SDL_CONTROLLER_AXIS_LEFTX, 1.0)
    run(0.2)
    assert set(states[-40:]) == {"following"}
    assert loop.status.target.position[0] == pytest.approx(0.1 * 0.2, rel=0.1)
    assert device.rumbles[-1] == (65535, 65535)
    run(0.2, asks=False)
    assert device.rumbles[-1] == (0, 0)
    device.unplug()
    at = loop.status.target.position
    run(0.1)
    assert loop.status.state == "released"
    assert loop.status.target.position[0] <= at[0] + 0.1 * 0.0081
    assert "unplugged" in loop.status.trouble
    loop.request(OperatorSettings(), None)
    loop.close()


def test_without_sdl_it_says_what_installs_it(monkeypatch, clock) -> None:
    def missing(name: str) -> None:
        raise ModuleNotFoundError(f"No module named {name!r}", name=name)

    monkeypatch.setattr(importlib, "import_module", missing)
    gamepad = Gamepad(clock=clock)
    assert gamepad.trouble == "a gamepad needs sdl2: pip install 'kappaskin[gamepad]'"
    assert wanted(gamepad) is None
    gamepad.rumble(1.0)
    gamepad.close()
