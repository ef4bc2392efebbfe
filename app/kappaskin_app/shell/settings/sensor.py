"""The simulated electronics, what spoils their readings, and which elements are scanned."""

from dataclasses import dataclass

from kappaskin.scenes import PARTS
from kappaskin_app.shell.settings.asks import MILLIMETRES, Choice, Range, asked, asked_as

_CONVERTER = PARTS["converter"]
PER_CENT = (1e2, "%")


@dataclass(frozen=True)
class Electronics:
    """The chain from gage to count."""

    electronics: str = asked_as(
        PARTS["electronics"].key("like"),
        "modern",
        label="Electronics",
        tip="Gages, bridge, amplifier and converter (Figs. 4 and 5). The paper's prototypes "
        "convert 12 bits in 20 \N{MICRO SIGN}s. Choosing one brings its converter.",
    )
    bits: int = asked_as(_CONVERTER.key("bits"), 16)
    conversion_time: float = asked_as(
        _CONVERTER.key("conversion_time"), 5e-6, step=1e-6, decimals=1, least=1e-6, most=1e-3
    )


@dataclass(frozen=True)
class Spoils:
    """What the mechanics of the gages does to a reading, besides noise."""

    loops: str = asked(
        "none",
        Choice(
            "Hysteresis",
            "Loops of a reading against the curvature, as in Fig. 8: the widest gap of the second "
            "prototype is 7 1/m, of the first three times that.",
            (("none", "None"), ("second", "Second prototype"), ("first", "First prototype")),
        ),
    )
    creep: float = asked(
        0.0,
        Range(
            "Creep",
            "Share of a held reading that relaxes away, with a time constant of 5 s (standard "
            "linear solid).",
            0.0,
            0.5,
            0.01,
            *PER_CENT,
            decimals=0,
        ),
    )
    tolerance: float = asked(
        0.0,
        Range(
            "Tolerance",
            "Spread of the gains of gages that were never calibrated, with offsets of as many "
            "tenths of 1/m: what the calibration takes out.",
            0.0,
            0.2,
            0.01,
            *PER_CENT,
            decimals=0,
        ),
    )


@dataclass(frozen=True)
class Scanning:
    """Which elements every frame scans."""

    region: str = asked(
        "off",
        Choice(
            "Scan",
            "Sampling a region of interest buys rate (paper, section 6.2). The force/torque sensor "
            "stands at the base of the fingertip (intrinsic contact sensing). What tells most is "
            "chosen by the estimator Tracking; with any other the channels take turns. A sensor on "
            "a line scans around the contact or chosen elements; the rest is simulated only.",
            (
                ("off", "All elements"),
                ("skin", "Around the contact"),
                ("intrinsic", "By force and torque"),
                ("elements", "Chosen elements"),
                ("adaptive", "What tells most"),
            ),
        ),
    )
    region_radius: float = asked(
        0.025,
        Range(
            "Radius",
            "Elements within it of the contact are in every frame.",
            0.002,
            0.5,
            0.001,
            *MILLIMETRES,
            decimals=1,
        ),
    )
    region_share: float = asked(
        0.1,
        Range(
            "Share",
            "Of the other elements, those that take their turn in each frame; their last readings "
            "are held until then. Of all channels, those that are scanned where they tell most, "
            "at least 5 %.",
            0.0,
            1.0,
            0.05,
            *PER_CENT,
            decimals=0,
        ),
    )
    region_elements: tuple[int, ...] = ()  # chosen on a heatmap
