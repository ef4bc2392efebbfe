"""Panels of the simulated sensor: skin, elements, electronics, and the scanned region."""

import math
from contextlib import suppress

from PySide6.QtWidgets import QLabel, QWidget

from kappaskin.bases import edges_of
from kappaskin.errors import Refusal
from kappaskin.estimation import ScanTradeoff
from kappaskin.live import Status
from kappaskin.sensing import Sensor
from kappaskin_app.shell.badge import in_use
from kappaskin_app.shell.form import Form, SimulationForm
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.settings.scene import SHAPES
from kappaskin_app.shell.simulation import patch_of

_PREPARING = "Computing this skin; the last one stays until then."
_NUMBERS = ("side_x", "side_y", "base_radius", "rim_radius")


class ShapePanel(SimulationForm):
    """Asks for the shape, its sizes and its edge; says why there can be no such skin."""

    purpose = (
        "The simulated skin at rest, flat or bent, and how its edge is held. What a flat one does "
        "under a load follows from "
        "D \u2207\u2074w = p, D = E h\u00b3 / (12 (1 \u2212 \u03bd\u00b2))."
    )
    guide_page = "scenes"

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Shape", ("shape", *_NUMBERS, "edge"), parent)
        self.opening = QLabel()
        self._opening_name = QLabel("Opening")
        self._opening_name.setToolTip("The angle of the arc: its length over its radius.")
        self.form.insertRow(len(_NUMBERS) + 1, self._opening_name, self.opening)
        self._refusal, self._preparing = "", False

    def show_settings(self, settings: Settings) -> None:
        super().show_settings(settings)
        asked = set(SHAPES[settings.shape].lengths)
        self.show_rows({"shape", "edge"} | asked)
        with suppress(Refusal):  # what cannot be is said below
            self.offer("edge", edges_of(patch_of(settings)))
        self.form.setRowVisible(self.opening, "base_radius" in asked)
        degrees = math.degrees(settings.side_x / settings.base_radius)
        self.opening.setText(f"{degrees:.1f}\N{DEGREE SIGN}")

    def show_refusal(self, text: str) -> None:
        """Say why the skin asked for cannot be, or nothing when it can."""
        self._refusal = text

    def show_preparing(self, preparing: bool) -> None:
        """Say that the skin asked for is on its way."""
        self._preparing = preparing

    def show_status(self, status: Status, simulating: bool) -> None:
        super().show_status(status, simulating)
        if simulating and self._preparing:
            self.show_message(_PREPARING, hint=True)

    def alarm(self, status: Status) -> str:
        return f"The last skin stays: {self._refusal}." if self._refusal else ""


class ElementsPanel(SimulationForm):
    """Asks for m x n elements, and says when they are too few for the functions of the fit."""

    purpose = (
        "How many sense, on a regular grid. Each reads three curvatures where it is: xx = "
        "\u2202\u00b2w/\u2202x\u00b2, yy = \u2202\u00b2w/\u2202y\u00b2, "
        "xy = \u2202\u00b2w/\u2202x\u2202y of a flat skin's displacement w."
    )
    guide_page = "scenes"

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Elements", ("elements_x", "elements_y"), parent)

    def alarm(self, status: Status) -> str:
        return in_use(status)


class SupportPanel(SimulationForm):
    """Asks for what holds the skin besides its own stiffness."""

    purpose = (
        "What carries the simulated skin beside its stiffness: tension T, foam k, a fluid that "
        "keeps its volume. D \u2207\u2074w \u2212 T \u2207\u00b2w + k w = p."
    )
    guide_page = "scenes"

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Below and around", ("tension", "foam", "fluid"), parent)


_CHOOSE = "Click elements on a heatmap to choose them."


def _facts(sensor: Sensor) -> tuple[str, str, str]:
    """What the electronics come to: frame rate, smallest step and range, strain limit."""
    chain = sensor.transduction
    most = min(abs(limit) for limit in chain.limits) * chain.resolution
    return (
        f"{sensor.channels} channels, {1 / chain.scan_time(sensor.channels):.0f}/s",
        f"{chain.resolution:.2g} 1/m, to \N{PLUS-MINUS SIGN}{most:.0f} 1/m",
        f"1 % at {chain.strain_limit_curvature:.0f} 1/m",
    )


class ElectronicsPanel(SimulationForm):
    """Asks for the electronics; says how fast, how fine and how far they read."""

    purpose = (
        "What turns the change of resistance of a gage into counts, with how many bits and how "
        "fast: a step of the converter and its noise are the least that can be told apart."
    )
    guide_page = "scenes"

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Electronics", ("electronics", "bits", "conversion_time"), parent)
        self._facts = [QLabel() for _ in range(3)]
        rows = (
            ("Frame", "The most frames per second: one over the time of all channels."),
            ("Step", "The curvature of one count, and how far the converter reads."),
            ("Strain", "Where a gage strains by 1 %, beyond which metal foil is not elastic."),
        )
        for (name, tip), fact in zip(rows, self._facts, strict=True):
            label = QLabel(name)
            for widget in (label, fact):
                widget.setToolTip(tip)
            self.form.addRow(label, fact)
        self._sensor: Sensor | None = None

    def show_status(self, status: Status, simulating: bool) -> None:
        super().show_status(status, simulating)
        if status.sensor is not None and status.sensor is not self._sensor:
            self._sensor = status.sensor
            for label, text in zip(self._facts, _facts(status.sensor), strict=True):
                label.setText(text)


class SpoilsPanel(SimulationForm):
    """Asks for hysteresis, creep and tolerance."""

    purpose = (
        "What spoils the reading of a real gage: loops (it comes back another way), creep, and "
        "gages that are not alike."
    )
    guide_page = "scenes"

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Gages", ("loops", "creep", "tolerance"), parent)


class RegionPanel(Form):
    """Asks for a region of interest; says what it buys and costs, or why there can be none."""

    purpose = (
        "Scans only part of the channels in each frame, around the contact or those chosen: "
        "frames/s = 1 / (channels \u00d7 conversion time)."
    )
    guide_page = "accuracy"

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Region of interest", ("region", "region_radius", "region_share"), parent)
        self._region, self._chosen = "off", 0
        self._told, self._rates = "", (math.inf, math.inf)

    def show_settings(self, settings: Settings) -> None:
        super().show_settings(settings)
        self._region, self._chosen = settings.region, len(settings.region_elements)
        round_a_contact = settings.region in ("skin", "intrinsic")
        rows = {"region"} | ({"region_radius"} if round_a_contact else set())
        self.show_rows(rows | ({"region_share"} if settings.region != "off" else set()))

    def show_bargain(self, bargain: ScanTradeoff | None) -> None:
        """What the region in use buys and costs; None while that is not known."""
        self._told = "" if bargain is None else _words(bargain, *self._rates)

    def show_status(self, status: Status, simulating: bool) -> None:
        if status.sensor is not None:
            self._rates = status.region.rate, status.sensor.rate
        if status.region_refusal:
            self.show_message(f"{status.region_refusal}.")
        elif self._region == "elements" and not self._chosen:
            self.show_message(_CHOOSE, hint=True)
        else:
            self.show_message(self._told if self._region != "off" else "", hint=True)


def _words(bargain: ScanTradeoff, asked: float, without: float) -> str:
    """What a region of which `asked` frames/s are wanted buys and costs; so many come `without`."""
    rate, full_rate = min(asked, bargain.rate), min(without, bargain.full_rate)
    buys = (
        f"buys {rate:.0f} instead of {full_rate:.0f} frames/s, {rate / full_rate:.1f} times"
        if rate > 1.005 * full_rate
        else f"buys no rate: all channels come at {full_rate:.0f} frames/s as well"
    )
    more = f" (it could be {bargain.rate:.0f})" if bargain.rate > 1.005 * rate else ""
    told = [axis for axis in (0, 1) if math.isfinite(bargain.full_bound[axis])]  # a strip's x alone
    if not told:
        return f"Scans {bargain.channels} channels a frame. It {buys}{more}."
    mm, full = (1e3 * max(bound[told]) for bound in (bargain.bound, bargain.full_bound))
    all_tell = f"all channels to \N{PLUS-MINUS SIGN}{full:.2f} mm"
    if not math.isfinite(mm):
        costs = f"costs accuracy: one frame does not tell where the contact is, {all_tell} at best"
        return f"Scans {bargain.channels} channels a frame. It {buys}{more}. It {costs}."
    costs = (
        f"costs accuracy: one frame tells where the contact is to \N{PLUS-MINUS SIGN}{mm:.2f} mm "
        f"at best, {all_tell}"
        if mm > 1.005 * full
        else f"costs no accuracy: \N{PLUS-MINUS SIGN}{full:.2f} mm at best, as all channels"
    )
    return f"Scans {bargain.channels} channels a frame. It {buys}{more}. It {costs}."
