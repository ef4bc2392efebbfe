"""Hard cases: the settings that bring each about, as one step to undo."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from kappaskin.live import Status
from kappaskin_app.shell.history import History
from kappaskin_app.shell.settings import SceneSettings, Settings
from kappaskin_app.shell.settings.scene import SHAPES
from kappaskin_app.shell.settings.shown import EstimatorSettings
from kappaskin_app.shell.simulation import patch_of

_PLAIN = {f.name: f.default for kind in (SceneSettings, EstimatorSettings) for f in fields(kind)}


@dataclass(frozen=True)
class Demonstration:
    """Table 1's patch and fit, but for what `differs`; `told` says what is seen and why.

    What is refused of a skin that nothing is known of yet would leave nothing to see: `then` is
    changed once the skin is there.
    """

    title: str
    told: str
    differs: Mapping[str, Any]
    then: Mapping[str, Any] = field(default_factory=dict[str, Any])

    def changes(self) -> dict[str, Any]:
        """The settings that bring it about; how things are shown stays as it is."""
        return _PLAIN | dict(self.differs)

    def holds(self, settings: Settings) -> bool:
        """Whether it is what the settings describe."""
        whole = self.changes() | dict(self.then)
        return all(getattr(settings, name) == value for name, value in whole.items())


_WIDTH = 0.01  # m
_FINGERTIP = {
    "shape": "strip",
    **SHAPES["strip"].lengths,
    "side_y": _WIDTH,
    "elements_y": 1,
    "load_case": "centre",
    "force": SHAPES["strip"].defaults["force"],
    "x": SHAPES["strip"].lengths["side_x"] / 2,
    "y": _WIDTH / 2,
}
_ROW = tuple(range(40, 50))
_QUARTER = tuple(p + 10 * q for q in range(5) for p in range(5))

DEMONSTRATIONS = (
    Demonstration(
        "Drop a row of elements",
        "Ten elements read nothing, grey in the maps. The others still tell all 64 shapes apart, "
        "the worst half as well as the best: the error bars grow, the shape stays.",
        {"dead_elements": _ROW},
    ),
    Demonstration(
        "Drop a quarter",
        "25 elements read nothing, and functions are fine enough to hide there: noise enters such "
        "a shape thousands of times as strongly. See the RMS error above, then the same with a "
        "prior.",
        {"dead_elements": _QUARTER, "load_case": "centre"},
    ),
    Demonstration(
        "The quarter with a prior",
        "Where nothing is read, Bayes takes the skin to be as smooth as a plate: the shape stays, "
        "with wider error bars there.",
        {"dead_elements": _QUARTER, "load_case": "centre", "method": "bayes"},
    ),
    Demonstration(
        "Ask for 12 x 12 from 10 x 10",
        "Functions 11 and 12 look like 9 and 8 at the elements: four mixtures of them, in red, "
        "change no reading. Least squares refuses, and goes on with functions that it can tell.",
        {"functions_x": 12, "functions_y": 12},
    ),
    Demonstration(
        "12 x 12 with a prior",
        "The same readings and functions, but Bayes expects what a plate does: the four mixtures "
        "stay near zero, and the error bars hold how far they may be off.",
        {"functions_x": 12, "functions_y": 12, "method": "bayes"},
    ),
    Demonstration(
        "The fingertip\N{RIGHT SINGLE QUOTATION MARK}s silent mode",
        "sin \N{GREEK SMALL LETTER THETA} moves half a circle as a whole and bends nothing. Pinned "
        "ends keep the length of the arc, which decides it: seven shapes are left, all seen.",
        _FINGERTIP,
    ),
    Demonstration(
        "Its ends free to slide",
        "The same readings, but the fit believes that the ends slide: then nothing decides "
        "sin \N{GREEK SMALL LETTER THETA}, in red, and the fit is refused.",
        _FINGERTIP,
        {"fit_edge": "sliding"},
    ),
    Demonstration(
        "Noise ten times the signal",
        "The readings hold ten times more noise than shape. No contact is claimed unless it "
        "stands out, and every error bar grows with the noise.",
        {"load_case": "point", "force": 0.1, "noise_rms": 14.5},
    ),
    Demonstration(
        "A load at the rim",
        "2 mm from the edge, which holds the skin: a light touch further in and a hard one here "
        "read alike, so that place and force are marked as not to be trusted.",
        {"load_case": "point", "x": 0.002},
    ),
)


_TITLES = {name[:1].lower() + name[1:] for name in (d.title for d in DEMONSTRATIONS)}


class Demonstrating:
    """Changes the settings of the `history` to those of a hard case."""

    def __init__(self, history: History) -> None:
        self._history = history
        self._begun: tuple[Demonstration, int, Settings] | None = None

    def demonstrate(self, demonstration: Demonstration) -> None:
        """Bring a hard case about, as one step."""
        gesture = self._history.new_gesture()
        self._history.change(demonstration.title, gesture, **demonstration.changes())
        if demonstration.then:
            self._begun = demonstration, gesture, self._history.settings

    @property
    def demonstrates(self) -> bool:
        """Whether the last step, which undoing takes back, brought a hard case about."""
        # By its words: Qt's own commands, asked for at every step, come and go with their wrappers.
        return self._history.stack.undoText() in _TITLES

    def follow(self, status: Status) -> None:
        """Go on with the hard case that was begun, once its skin is there."""
        if self._begun is None:
            return
        demonstration, gesture, settings = self._begun
        if self._history.settings != settings:
            self._begun = None  # something else was requested meanwhile
            return
        there = status.sensor is not None and status.sensor.plate.patch == patch_of(settings)
        if there and status.slot is not None and not status.computing:
            self._begun = None
            self._history.change(demonstration.title, gesture, **demonstration.then)
