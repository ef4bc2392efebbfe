"""Gamepad: sticks that move a hand, and rumble, by SDL."""

import time
import warnings
from collections.abc import Callable
from typing import Any

from kappaskin.errors import Refusal, optional
from kappaskin.hand.operation import HandTarget, OperatorLimits

_FULL = 32767.0  # of an axis
_DEAD = 0.12  # of that, in which a stick that is let go of rests
_CLOSES = 1.0  # s from no grip to the largest with a trigger pressed down
_STRONGEST = 0xFFFF
_RUMBLES = 120  # ms for which one rumble lasts at most, if no other follows
_EVERY = 0.04  # s between two rumbles
_AGAIN = 0.5  # s between two looks for a gamepad
_ABSENT = "no gamepad is connected; plug one in"


def sdl() -> Any:
    """SDL, with the gamepads of this machine; a `Refusal` where it is missing."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it says by one which SDL it found
        found = optional("sdl2", "gamepad", "a gamepad")
    for hint in (
        found.SDL_HINT_NO_SIGNAL_HANDLERS,
        found.SDL_HINT_JOYSTICK_ALLOW_BACKGROUND_EVENTS,
    ):
        found.SDL_SetHint(hint, b"1")
    if found.SDL_InitSubSystem(found.SDL_INIT_GAMECONTROLLER):
        raise Refusal(f"SDL finds no gamepads: {found.SDL_GetError().decode(errors='replace')}")
    return found


class Gamepad:
    """The first gamepad that is connected, now or later; `trouble` says why there is none.

    Its right shoulder button is a dead man's switch: while it is held the sticks move the hand. The
    left one moves it along x and y, the right one along z, sideways it turns it; the cross rolls
    it. The right trigger closes, the left one opens.
    """

    def __init__(
        self, opened: Callable[[], Any] = sdl, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._clock = clock
        self._sdl: Any = None
        self._pad: Any = None
        self._again = self._next_rumble = 0.0
        self._name, self._rumbles = "", False
        self.trouble = ""
        try:
            self._sdl = opened()
            self.trouble = _ABSENT
        except Refusal as refusal:
            self.trouble = str(refusal)

    def wanted(
        self, target: HandTarget, limits: OperatorLimits, seconds: float
    ) -> HandTarget | None:
        """Where it wants the hand after `seconds`, from `target`; None with its switch released."""
        if not self._connected():
            return None
        if not self._button("RIGHTSHOULDER"):
            return None
        axis = self._axis
        along, by = limits.speed * seconds, limits.turn_rate * seconds
        shift = along * axis("LEFTX"), -along * axis("LEFTY"), -along * axis("RIGHTY")
        down = self._button("DPAD_DOWN") - self._button("DPAD_UP")
        right = self._button("DPAD_RIGHT") - self._button("DPAD_LEFT")
        turn = by * down, by * right, -by * axis("RIGHTX")
        closes = axis("TRIGGERRIGHT") - axis("TRIGGERLEFT")
        return target.moved(shift, turn, limits.grip * closes * seconds / _CLOSES)

    def _axis(self, name: str) -> float:
        """How far a stick or trigger is moved, from -1 to 1."""
        number = getattr(self._sdl, f"SDL_CONTROLLER_AXIS_{name}")
        value = self._sdl.SDL_GameControllerGetAxis(self._pad, number) / _FULL
        beyond = max(0.0, min(abs(value), 1.0) - _DEAD) / (1 - _DEAD)
        return beyond if value > 0 else -beyond

    def _button(self, name: str) -> int:
        number = getattr(self._sdl, f"SDL_CONTROLLER_BUTTON_{name}")
        return self._sdl.SDL_GameControllerGetButton(self._pad, number)

    def _connected(self) -> bool:
        """Whether there is a gamepad; its state is read."""
        if (sdl := self._sdl) is None:
            return False
        sdl.SDL_GameControllerUpdate()
        sdl.SDL_FlushEvents(sdl.SDL_FIRSTEVENT, sdl.SDL_LASTEVENT)  # nobody else takes them
        if self._pad is not None and not sdl.SDL_GameControllerGetAttached(self._pad):
            self._release()
            self.trouble = f"the gamepad {self._name} was unplugged; plug it in again"
        if self._pad is None and self._clock() >= self._again:
            self._again = self._clock() + _AGAIN
            self._find()
        return self._pad is not None

    def _find(self) -> None:
        sdl = self._sdl
        for number in filter(sdl.SDL_IsGameController, range(sdl.SDL_NumJoysticks())):
            if pad := sdl.SDL_GameControllerOpen(number):
                self._pad, self.trouble = pad, ""
                name = sdl.SDL_GameControllerName(pad) or b""
                self._name = name.decode(errors="replace")
                return

    def rumble(self, share: float) -> None:
        """Rumble with a `share` of the strongest, for a moment; to be called all the time."""
        on, now = share > 0, self._clock()
        if self._pad is None or now < self._next_rumble or not (on or self._rumbles):
            return
        self._next_rumble, self._rumbles = now + _EVERY, on
        strength = round(_STRONGEST * min(max(share, 0.0), 1.0))
        self._sdl.SDL_GameControllerRumble(self._pad, strength, strength, _RUMBLES)

    def _release(self) -> None:
        if self._pad is not None:
            self._sdl.SDL_GameControllerClose(self._pad)
            self._pad = None

    def close(self) -> None:
        """Stop the rumble, and let go of the gamepad."""
        self._next_rumble = 0.0
        self.rumble(0.0)
        self._release()
        if self._sdl is not None:
            self._sdl.SDL_QuitSubSystem(self._sdl.SDL_INIT_GAMECONTROLLER)
            self._sdl = None
