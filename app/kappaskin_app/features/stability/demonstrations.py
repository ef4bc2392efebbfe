"""Hard cases of the reconstruction: settings of each, as one undo step."""

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
    """Table 1's patch and fit with the settings `differs`; `text` explains the result.

    The settings `then` follow once the skin is simulated: they are refused before that.
    """

    title: str
    text: str
    differs: Mapping[str, Any]
    then: Mapping[str, Any] = field(default_factory=dict[str, Any])

    def changes(self) -> dict[str, Any]:
        """The settings of the demonstration; those of the view do not change."""
        return _PLAIN | dict(self.differs)

    def holds(self, settings: Settings) -> bool:
        """Whether the settings are those of the demonstration."""
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
        "One row dead",
        "Ten dead elements, grey in the heatmaps. The others still distinguish all 64 modes, the "
        "worst with half the singular value of the best: the error bars grow, the shape remains.",
        {"dead_elements": _ROW},
    ),
    Demonstration(
        "A quarter dead",
        "25 dead elements. Some modes are almost zero at all the live ones: noise is amplified "
        "thousands of times. See the RMS error above, then the same with a prior.",
        {"dead_elements": _QUARTER, "load_case": "centre"},
    ),
    Demonstration(
        "A quarter dead, with a prior",
        "Without readings, Bayes assumes the smoothness of a plate: the shape remains, with wider "
        "error bars there.",
        {"dead_elements": _QUARTER, "load_case": "centre", "method": "bayes"},
    ),
    Demonstration(
        "12 x 12 functions, 10 x 10 elements",
        "Functions 11 and 12 equal 9 and 8 at the elements: four modes, in red, are unobservable. "
        "Least squares refuses the basis and continues with one that the elements determine.",
        {"functions_x": 12, "functions_y": 12},
    ),
    Demonstration(
        "12 x 12 with a prior",
        "The same readings and functions, but Bayes uses the prior of a plate: the four modes stay "
        "near zero, and the error bars include their uncertainty.",
        {"functions_x": 12, "functions_y": 12, "method": "bayes"},
    ),
    Demonstration(
        "The fingertip\N{RIGHT SINGLE QUOTATION MARK}s silent mode",
        "sin \N{GREEK SMALL LETTER THETA} translates the half circle without curvature. Pinned "
        "ends keep the arc length, which determines it: the other seven modes are observable.",
        _FINGERTIP,
    ),
    Demonstration(
        "The fingertip with sliding ends",
        "The same readings, but the fit assumes sliding ends: then "
        "sin \N{GREEK SMALL LETTER THETA}, in red, is undetermined, and the fit is refused.",
        _FINGERTIP,
        {"fit_edge": "sliding"},
    ),
    Demonstration(
        "Noise ten times the signal",
        "The noise of the readings is ten times the signal. A contact is reported only where it is "
        "significant, and every error bar grows with the noise.",
        {"load_case": "point", "force": 0.1, "noise_rms": 14.5},
    ),
    Demonstration(
        "A load at the rim",
        "2 mm from the held edge, a large force gives the same readings as a small one further "
        "inside: position and force are marked as unreliable.",
        {"load_case": "point", "x": 0.002},
    ),
)


_TITLES = {name[:1].lower() + name[1:] for name in (d.title for d in DEMONSTRATIONS)}


class Demonstrator:
    """Sets the settings in the `history` to those of a hard case."""

    def __init__(self, history: History) -> None:
        self._history = history
        self._started: tuple[Demonstration, int, Settings] | None = None

    def demonstrate(self, demonstration: Demonstration) -> None:
        """Set a hard case, as one undo step."""
        gesture = self._history.new_gesture()
        self._history.change(demonstration.title, gesture, **demonstration.changes())
        if demonstration.then:
            self._started = demonstration, gesture, self._history.settings

    @property
    def demonstrates(self) -> bool:
        """Whether the next undo step is a hard case."""
        # By its text: Qt's own commands do not keep their Python wrappers.
        return self._history.stack.undoText() in _TITLES

    def follow(self, status: Status) -> None:
        """Set the second part of a hard case, once its skin is simulated."""
        if self._started is None:
            return
        demonstration, gesture, settings = self._started
        if self._history.settings != settings:
            self._started = None  # another setting was changed meanwhile
            return
        simulated = status.sensor is not None and status.sensor.plate.patch == patch_of(settings)
        if simulated and status.slot is not None and not status.computing:
            self._started = None
            self._history.change(demonstration.title, gesture, **demonstration.then)
