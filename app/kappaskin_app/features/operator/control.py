"""Operator control: from the pad and the settings to the operator's process."""

import time
from collections.abc import Callable
from dataclasses import replace

from PySide6.QtCore import QObject, Qt, QTimer, Signal

from kappaskin.errors import Refusal
from kappaskin.hand import (
    HandTarget,
    OperatorLimits,
    OperatorLink,
    OperatorSettings,
    OperatorStatus,
    TargetFilter,
)
from kappaskin_app.features.operator.pad import Pad
from kappaskin_app.guard import guarded
from kappaskin_app.shell.history import History
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.settings.operation import GAMEPAD, PAD, UDP

_EVERY = 8  # ms between two targets
_REPORTED = 0.04  # s between two reports


def limits_of(settings: Settings) -> OperatorLimits:
    """The limits that the settings have."""
    return OperatorLimits(
        settings.operator_speed,
        settings.operator_turn_rate,
        settings.operator_grip,
        settings.operator_reach,
    )


class OperatorControl(QObject):
    """Follows the input while it is `enabled`; off at first, and at `start`.

    `reported` brings the status, about 25 times a second; `switched` whether it is enabled;
    `refused` why the process does not run, `ended` that it has ended. `followers` get each target
    that is followed.
    """

    reported = Signal(OperatorStatus)
    switched = Signal(bool)
    refused = Signal(str)
    ended = Signal()

    def __init__(self, history: History, pad: Pad, start: Callable[[], HandTarget]) -> None:
        super().__init__()
        self._history, self._pad, self._start = history, pad, start
        self.followers: list[Callable[[HandTarget], object]] = []
        self.enabled = self._visible = False
        self.status = OperatorStatus(HandTarget())
        self._filter = TargetFilter(limits_of(history.settings), HandTarget())
        self.link: OperatorLink | None = None
        self._grip: float | None = None
        self.rumble = 0.0
        """How strongly a gamepad rumbles, as a share of the strongest."""
        self._input, self._next = history.settings.operator_input, 0.0
        self._shown = False, ""
        self._timer = QTimer(self, interval=_EVERY, timerType=Qt.TimerType.PreciseTimer)  # pyright: ignore[reportCallIssue]
        self._timer.timeout.connect(guarded(self._tick))

    def set_visible(self, visible: bool) -> None:
        """Have the operator's process while its state is visible, or the input moves the hand."""
        self._visible = visible
        if visible:
            self._begin()
        elif not self.enabled:
            self.close()

    def _begin(self) -> None:
        try:
            if not self.status.target.time:
                self.status = OperatorStatus(self._start())
            self.link = self.link or OperatorLink(self.status.target)
            self._timer.start()
        except Refusal as refusal:
            self.refused.emit(str(refusal))

    def switch(self, on: bool) -> None:
        """Let the input move the hand, or not."""
        if on:
            self._begin()
        if (on := on and self.link is not None) != self.enabled:
            self.enabled, self._grip = on, None
            self.switched.emit(on)
            self.set_visible(self._visible)

    def set_grip(self, share: float) -> None:
        """Grip with a `share` of the largest force."""
        if self.enabled:
            self._grip = share * self._filter.limits.grip

    def _tick(self) -> None:
        settings = self._history.settings
        if settings.operator_input != self._input:
            self._input = settings.operator_input
            self.switch(False)
        try:
            self._request(settings, limits_of(settings))
        except Refusal as refusal:
            self.close()
            self.refused.emit(str(refusal))
            return
        shown, self._shown = self._shown, (self.enabled, self.status.state)
        if shown != self._shown or time.monotonic() >= self._next:
            self._next = time.monotonic() + _REPORTED
            self.reported.emit(self.status)

    def _request(self, settings: Settings, limits: OperatorLimits) -> None:
        """Request that the input is followed, and take the status."""
        if self.link is None:
            return
        now = time.monotonic()
        self._filter.limits = limits
        pad = self.enabled and self._input == PAD
        wanted = self._wanted(limits, now) if pad else None
        if wanted is None:
            self._filter.target = replace(self.status.target, time=now)
        request = OperatorSettings(
            limits,
            self.enabled,
            settings.operator_listens if self._input == UDP else "",
            self._input == GAMEPAD,
            settings.robot_at if settings.send_to_robot else "",
            self.rumble,
        )
        was = self.status.target
        self.status = self.link.request(request, wanted and self._filter.follow(wanted, now))
        target = self.status.target
        if (target.position, target.rotation, target.grip) != (
            was.position,
            was.rotation,
            was.grip,
        ):
            for follow in self.followers:
                follow(target)

    def _wanted(self, limits: OperatorLimits, now: float) -> HandTarget | None:
        """What the pad wants, with the grip that is set."""
        at = self._filter.target
        wanted = self._pad.wanted(at, limits, now - at.time)
        if self._grip is not None:
            wanted = replace(wanted or at, grip=min(self._grip, limits.grip))
            if wanted.grip == self.status.target.grip:
                self._grip = None
        return wanted

    def close(self) -> None:
        """Hold still, and end the process, until it is shown or enabled again."""
        self._visible = False
        self._timer.stop()
        if self.link is not None:
            link, self.link = self.link, None
            link.close()
            self.ended.emit()
        self.switch(False)
