"""What may colour the skin and its heatmaps: how each is called, told, scaled and coloured."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kappaskin.estimation import FAULTS
from kappaskin.pipeline import QUANTITIES
from kappaskin_app.theme import DIVERGING, PULLED, SEQUENTIAL
from kappaskin_app.widgets.tint import Tint, rgb_of

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_UNITS = {"m": (1e3, "mm"), "1/m": (1.0, "1/m"), "1/m^2": (1.0, "1/m\u00b2"), "": (1.0, "")}
_DIGITS = {"mm": ".3f", "1/m": ".2f", "1/m\u00b2": ".3g"}
_GROUPS = (
    ("xx", "yy", "xy", "first", "second", "mean"),
    ("residual_xx", "residual_yy", "residual_xy"),
)
"""Those that may share one range, or each has its own."""

HEALTH_WORDS = ("well", *("on a rail" if kind == "saturated" else kind for kind in FAULTS[1:]))


# In the order of `WHY`: what is well recedes, and of the others each has another lightness too.
HEALTH_COLOURS = rgb_of(
    *("#5f7f8c", "#f0e060", "#d55e00", "#cc79a7", "#56b4e9"),
    *("#e69f00", "#1a1c20", "#9b30d0", "#00a070"),
)


HEALTH = Tint(HEALTH_COLOURS, (0.0, len(FAULTS) - 1.0), "", kinds=HEALTH_WORDS)


@dataclass(frozen=True)
class Shade:
    """A quantity as it is shown: its `symbol` in HTML, and a `tip` with its equation.

    `surface` says whether there is a value at every point of the skin, or only at the elements.
    """

    name: str
    symbol: str
    tip: str
    surface: bool = True

    @property
    def scale(self) -> float:
        """What a value in SI units is multiplied by for the screen."""
        return _UNITS[QUANTITIES.get(self.name, "")][0]

    @property
    def unit(self) -> str:
        return _UNITS[QUANTITIES.get(self.name, "")][1]

    @property
    def signed(self) -> bool:
        """Whether colours go both ways from what the skin has at rest."""
        return self.name not in ("displacement", "error_bar", "health")

    @property
    def alike(self) -> tuple[str, ...]:
        """The quantities that it may share one range with, itself among them."""
        return next((group for group in _GROUPS if self.name in group), (self.name,))

    def tint(self, limit: float, at_rest: float = 0.0, pulled: bool = False) -> Tint:
        """The colours of values up to `limit` from what they are `at_rest`."""
        if self.name == "health":
            return HEALTH
        if self.signed:
            return Tint(DIVERGING, (at_rest - limit, at_rest + limit), self.unit, limit)
        if pulled:
            return Tint(PULLED, (-limit, 0.0), self.unit, limit)
        return Tint(SEQUENTIAL, (0.0, limit), self.unit, limit)

    def written(self, value: float) -> str:
        """A value on the screen's scale, with its unit."""
        if self.name == "health":
            return HEALTH_WORDS[int(value)]
        sign = "+" if self.signed else "-"  # and z: no minus before a zero
        return f"{value:{sign}z{_DIGITS[self.unit]}} {self.unit}".replace("-", "\N{MINUS SIGN}")


_KAPPA, _SIGMA, _DELTA = ("\N{GREEK SMALL LETTER KAPPA}", "\u03c3", "\u0394")
_OWN = "of the skin itself, its bend at rest included"
_WHITE = "White is a skin at rest."

SHADES = {
    shade.name: shade
    for shade in (
        Shade("displacement", "w", "How far the skin moved in along its normal: w (Eq. 1)."),
        Shade(
            "xx",
            f"{_KAPPA}<sub>xx</sub>",
            "Bending along x as each element reads it: w_xx (Eq. 3).",
        ),
        Shade(
            "yy",
            f"{_KAPPA}<sub>yy</sub>",
            "Bending along y as each element reads it: w_yy (Eq. 4).",
        ),
        Shade("xy", f"{_KAPPA}<sub>xy</sub>", "Twist as each element reads it: w_xy (Eq. 5)."),
        Shade(
            "first",
            f"{_KAPPA}<sub>1</sub>",
            f"The larger principal curvature {_OWN}: (xx + yy) / 2 + "
            f"\u221a(((xx \u2212 yy) / 2)\u00b2 + xy\u00b2). {_WHITE}",
        ),
        Shade(
            "second",
            f"{_KAPPA}<sub>2</sub>",
            f"The smaller principal curvature {_OWN}: (xx + yy) / 2 \u2212 "
            f"\u221a(((xx \u2212 yy) / 2)\u00b2 + xy\u00b2). {_WHITE}",
        ),
        Shade(
            "mean",
            f"{_KAPPA}<sub>m</sub>",
            f"The mean curvature {_OWN}: (xx + yy) / 2. {_WHITE}",
        ),
        Shade(
            "gaussian",
            "K",
            f"The Gaussian curvature {_OWN}: xx yy \u2212 xy\u00b2. Above zero like a ball or a "
            "bowl, below like a saddle; a sheet that only bends keeps zero.",
        ),
        *(
            Shade(
                f"residual_{name}",
                f"r<sub>{name}</sub>",
                f"What the shape leaves of each reading of {name}: reading less fit. Noise alone "
                "has no pattern; one that stays tells of too few functions or a wrong edge.",
                surface=False,
            )
            for name in ("xx", "yy", "xy")
        ),
        Shade(
            "error_bar",
            f"{_SIGMA}<sub>w</sub>",
            "The standard deviation of the displacement that the noise of the readings leads to: "
            "\u221a(b' C b), with the functions b there and the covariance C of their "
            "coefficients. Of Tracking, as one frame by itself would have it.",
        ),
        Shade(
            "difference",
            f"{_DELTA}w",
            "The displacement found less the true one, which only a simulation knows.",
        ),
        Shade(
            "health",
            "Health",
            "What is wrong with each element (F3): any of its three channels that is left out, "
            "and why.",
            surface=False,
        ),
    )
}
