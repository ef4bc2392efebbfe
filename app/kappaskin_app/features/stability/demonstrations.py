"""Hard cases, each as the settings that bring it about and what there is to see then."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from kappaskin_app.shell.settings import SceneSettings, Settings
from kappaskin_app.shell.settings.shown import EstimatorSettings
from kappaskin_app.shell.skins import SHAPES

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
    **SHAPES["strip"].asks,
    "side_y": _WIDTH,
    "elements_y": 1,
    "load_case": "centre",
    "force": SHAPES["strip"].begins["force"],
    "x": SHAPES["strip"].asks["side_x"] / 2,
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
