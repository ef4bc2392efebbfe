"""Driving of a simulated hand: its object follows the operator's target, and its skins feel it."""

from typing import NamedTuple

from PySide6.QtCore import QObject, Signal

from kappaskin.hand import HandTarget, Placement, SimulatedHand
from kappaskin.scenes import Scene
from kappaskin_app.shell.background import BackgroundTask, Newest, Tasks
from kappaskin_app.shell.session import Session


class Home(NamedTuple):
    """Where the object is and how hard it is gripped before the operator moves it."""

    where: Placement
    grip: float


def home_of(hand: SimulatedHand) -> Home:
    """Where the course of `hand` begins; at its middle, without a grip, if it has none."""
    if hand.course is None:
        return Home(HandTarget().where, 0.0)
    where, grip, _ = hand.course.at(0.0)
    return Home(where, grip)


def pose_of(target: HandTarget, home: Home, held: bool) -> Placement:
    """Where the object is in the hand: a `held` one is moved by the fingers from its `home`.

    One that stands on something stays where it is, and the hand is moved over it.
    """
    moved = target.where
    if held:
        turned = moved.rotation @ home.where.rotation
        return Placement(turned, home.where.position + moved.position)
    back = Placement(moved.rotation.T, -moved.rotation.T @ moved.position)
    return back.of(home.where)


def _scenes(hand: SimulatedHand, home: Home, target: HandTarget) -> tuple[dict[str, Scene], bool]:
    """The scene of each finger with the object at `target`, and whether it slips."""
    where = pose_of(target, home, hand.what.held)
    state = hand.move(where.position, where.rotation, target.grip)
    return hand.scenes(state), state.slips


class HandDriving(QObject):
    """Moves the simulated hand of a session, if it has one.

    `reported` brings what is wrong with the last move: that the object slips, or why it is refused;
    empty if nothing is.
    """

    reported = Signal(str)

    def __init__(self, session: Session, tasks: Tasks) -> None:
        super().__init__()
        self._session, self._target = session, HandTarget()
        self._rate, self._home = Newest(self), Home(HandTarget().where, 0.0)
        # A move takes milliseconds, but the first one of a hand a second.
        self._task = BackgroundTask(tasks, "", self._play, self._refuse, self._go_on)
        self._waits = False

    @property
    def hand(self) -> SimulatedHand | None:
        """The simulated hand of the session."""
        hand = self._session.hand
        return None if hand is None else hand.simulated

    def begin(self) -> HandTarget:
        """The target at which the hand is now."""
        if self.hand is None:
            return HandTarget()
        self._home = home_of(self.hand)
        return HandTarget(grip=self._home.grip)

    def follow(self, target: HandTarget) -> None:
        """Move the hand to the newest `target` soon."""
        if self.hand is not None:
            self._target = target
            self._rate(self._move)

    def _move(self) -> None:
        if self._task.running:
            self._waits = True
        elif self.hand is not None:
            self._task.run(_scenes, self.hand, self._home, self._target)

    def _go_on(self) -> None:
        if self._waits:
            self._waits = False
            self._move()

    def _play(self, found: tuple[dict[str, Scene], bool]) -> None:
        scenes, slips = found
        fingers = self._session.fingers
        for finger, scene in scenes.items():
            if fingers is not None and finger in fingers.engines:
                fingers.engines[finger].play(scene)
        self.reported.emit("the object slips; grip harder" if slips else "")

    def _refuse(self, error: Exception) -> None:
        self.reported.emit(str(error))

    def close(self) -> None:
        """Move it no more."""
        self._rate.forget()
        self._task.stop()
