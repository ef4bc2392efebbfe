"""A recording to what there is to know of it before it is played."""

from dataclasses import dataclass
from pathlib import Path

from kappaskin.errors import Refusal
from kappaskin.frames import Event
from kappaskin.pipeline import Setup
from kappaskin.recording import Recording, Replay, recorded_setups
from kappaskin_app.features.recording.landmarks import minutes
from kappaskin_app.shell.folders import repairing
from kappaskin_app.widgets.amounts import day


@dataclass(frozen=True)
class Recorded:
    """What there is to know of the recording at `path` before it is played.

    `setups` it was made with, each from a time in s on, and why they cannot be told.
    """

    path: Path
    length: float = 0.0
    whole: bool = True
    setups: tuple[tuple[float, Setup], ...] = ()
    trouble: str = ""

    def setup_at(self, at: float) -> Setup | None:
        """The one in use at `at` s; before the first, that."""
        used = [setup for since, setup in self.setups if since <= at] or [
            setup for _, setup in self.setups[:1]
        ]
        return used[-1] if used else None

    def title(self, replay: Replay) -> str:
        """What the window is called while it is played."""
        return f"{self.path.name}, recorded {day(replay.begun)} \N{EN DASH} Kappaskin"

    def changes(self) -> list[Event]:
        """Where another setup came into use, in words."""
        return [
            Event(since, "settings", f"{now.Ni} x {now.Nj} functions, {now.method}")
            for (_, was), (since, now) in zip(self.setups, self.setups[1:], strict=False)
            if now != was
        ]


def recorded(path: Path) -> Recorded:
    """Look into the file at `path`; a `Refusal` where it is no recording."""
    with Recording(path) as recording:
        length = (recording.last - recording.first) * 1e-9
        try:
            setups = tuple(recorded_setups(recording))
        except Refusal as refusal:
            return Recorded(path, length, recording.whole, (), str(refusal))
        return Recorded(path, length, recording.whole, setups)


def told_of(found: Recorded) -> str:
    """What a person should know of a recording that is opened, or nothing."""
    told: list[str] = []
    if not found.whole:
        told.append(
            f"The recording {found.path.name} was never ended: it is played up to "
            f"{minutes(found.length)}, where it breaks off. To make it whole: "
            f"`{repairing(found.path)}`."
        )
    if found.trouble:
        told.append(f"The settings recorded cannot be used: {found.trouble}")
    return " ".join(told)
