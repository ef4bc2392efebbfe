"""Forms of the simulated sensor: skin, elements, electronics, scanned region."""

import math
from contextlib import suppress
from typing import Any, cast

from kappaskin.bases import edges_of
from kappaskin.errors import Refusal
from kappaskin.estimation import ScanTradeoff
from kappaskin.live import Status
from kappaskin.mechanics import INPLANE
from kappaskin.sensing import DigitalReadings, Sensor
from kappaskin.skin import Cap, Patch
from kappaskin_app.shell.badge import in_use
from kappaskin_app.shell.form import Form, SimulationForm
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.settings.scene import SHAPES
from kappaskin_app.shell.simulation import patch_of
from kappaskin_app.widgets.parts import Label
from kappaskin_app.widgets.text import Coverage

_PREPARING = "Computing this skin; the previous one is shown until then."
_NUMBERS = tuple(dict.fromkeys(length for shape in SHAPES.values() for length in shape.lengths))
_FACTS = (
    ("Opening angle", "The angle of the arc: its length over its radius."),
    ("Rise", "Height of the unloaded skin, from its lowest to its highest point."),
    (
        "Model error",
        "1 / (R k)\u00b2 with the smallest radius R and the wave number k of the longest wave: the "
        "relative error of shallow shell theory, which is refused above 1 %.",
    ),
)


def _facts_of(patch: Patch) -> tuple[str, str, str]:
    """Opening, rise and relative error of shallow shell theory, as far as `patch` has them."""
    if isinstance(patch, Cap):
        return (
            f"{2 * math.degrees(patch.angle):.1f}\N{DEGREE SIGN}",
            f"{1e3 * patch.rise:.2f} mm",
            "",
        )
    bent = [(L, H) for L, H in zip((patch.a, patch.b), patch.curvatures, strict=True) if H]
    if not bent:
        return "", "", ""
    angles = [f"{math.degrees(side * abs(H)):.1f}\N{DEGREE SIGN}" for side, H in bent]
    rise = f"{1e3 * patch.rise:.2f} mm, {patch.rise / min(L for L, _ in bent):.0%} of the side"
    error = f"{100 * patch.steepness:.2f} %, at most 1 %" if patch.is_shallow else ""
    return " \N{MULTIPLICATION SIGN} ".join(angles), rise.replace("%", " %"), error


class ShapePanel(SimulationForm):
    """The form of the shape, its lengths and its edge, with the message of a refusal."""

    purpose = (
        "The unloaded simulated skin, flat or curved, and its boundary condition. A flat skin "
        "under a pressure p follows "
        "D \u2207\u2074w = p, D = E h\u00b3 / (12 (1 \u2212 \u03bd\u00b2))."
    )
    guide_page = "scenes"

    def __init__(self) -> None:
        super().__init__("Shape", ("shape", *_NUMBERS, "edge"))
        self.facts = {name: Label() for name, _ in _FACTS}
        for row, (name, tip) in enumerate(_FACTS, len(_NUMBERS) + 1):
            label = Label(name)
            for widget in (label, self.facts[name]):
                widget.setToolTip(tip)
            self.form.insertRow(row, label, self.facts[name])
        self._refusal, self._preparing = "", False
        self._shown, self._changed, self._below = Settings(), "shape", ""

    def show_settings(self, settings: Settings) -> None:
        super().show_settings(settings)
        changed = [n for n in self.names if getattr(settings, n) != getattr(self._shown, n)]
        self._shown, self._changed = settings, changed[0] if changed else self._changed
        lengths = set(SHAPES[settings.shape].lengths)
        self.show_rows({"shape", "edge"} | lengths)
        facts, wrong = ("", "", ""), ""
        try:
            self.offer("edge", edges_of(patch_of(settings)))
            facts = _facts_of(patch_of(settings))
        except Refusal:
            wrong = self._changed
        self._put_message(wrong)
        for fact, text in zip(self.facts.values(), facts, strict=True):
            fact.setText(text)
            self.form.setRowVisible(fact, bool(text))

    def _put_message(self, name: str) -> None:
        """Put the message below the field of a setting; below all of them without a name."""
        if name == self._below:
            return
        if self._below:
            self.form.takeRow(self.message)
        if name:
            row, _ = cast(tuple[int, Any], self.form.getWidgetPosition(self.editor(name)))
            self.form.insertRow(row + 1, self.message)
        else:
            self._around.addWidget(self.message)
        self._below = name

    def show_refusal(self, text: str) -> None:
        """Show why the requested skin is refused; nothing if it is not."""
        self._refusal = text

    def show_preparing(self, preparing: bool) -> None:
        """Show that the requested skin is being computed."""
        self._preparing = preparing

    def show_status(self, status: Status, simulating: bool) -> None:
        super().show_status(status, simulating)
        if simulating and self._preparing:
            self.show_message(_PREPARING, hint=True)

    def alarm(self, status: Status) -> str:
        return f"The previous skin is still simulated: {self._refusal}." if self._refusal else ""


class ElementsPanel(SimulationForm):
    """The form of the m x n elements, with a message where they are too few for the basis."""

    purpose = (
        "Number of elements on a regular grid. Each measures three curvatures at its position: "
        "xx = \u2202\u00b2w/\u2202x\u00b2, yy = \u2202\u00b2w/\u2202y\u00b2, "
        "xy = \u2202\u00b2w/\u2202x\u2202y of a flat skin's displacement w."
    )
    guide_page = "scenes"

    def __init__(self) -> None:
        super().__init__("Elements", ("elements_x", "elements_y"))

    def alarm(self, status: Status) -> str:
        return in_use(status)


class SupportPanel(SimulationForm):
    """The form of tension, foam and fluid."""

    purpose = (
        "Support of the simulated skin in addition to its stiffness: tension T, foam k, a fluid of "
        "constant volume. D \u2207\u2074w \u2212 T \u2207\u00b2w + k w = p."
    )
    guide_page = "scenes"

    def __init__(self) -> None:
        super().__init__("Support", ("tension", "foam", "fluid"))


class StretchingPanel(SimulationForm):
    """The form of thickness, Poisson's ratio and how the edge is held in the plane."""

    purpose = (
        "How the simulated skin resists stretching (von K\u00e1rm\u00e1n): pressed in by its "
        "thickness h, a flat skin whose edge is held in its plane is about twice as stiff. Of flat "
        "skins, a rectangle or strip of known thickness stretches. "
        "E = 12 (1 \u2212 \u03bd\u00b2) D / h\u00b3."
    )
    guide_page = "scenes"

    def __init__(self) -> None:
        super().__init__("Stretching", ("thickness", "poisson", "inplane"))

    def show_settings(self, settings: Settings) -> None:
        super().show_settings(settings)
        with suppress(Refusal):  # shown with the shape
            flat = not patch_of(settings).arc_curvature
            self.offer("inplane", ("", *(INPLANE[:-1] if flat else INPLANE)))


_SELECT = "Click elements on a heatmap to select them."


def _facts(sensor: Sensor) -> tuple[str, str, str]:
    """Frame rate, resolution and range, and strain limit of the electronics."""
    chain = sensor.transduction
    if isinstance(chain, DigitalReadings):
        step = f"{chain.resolution:.2g}, in the unit of each reading"
        return f"{sensor.channels} channels, at the device's rate", step, "not known"
    most = min(abs(limit) for limit in chain.limits) * chain.resolution
    return (
        f"{sensor.channels} channels, {1 / chain.scan_time(sensor.channels):.0f}/s",
        f"{chain.resolution:.2g} 1/m, to \N{PLUS-MINUS SIGN}{most:.0f} 1/m",
        f"1 % at {chain.strain_limit_curvature:.0f} 1/m",
    )


class ElectronicsPanel(SimulationForm):
    """The form of the electronics, with their frame rate, resolution and range."""

    purpose = (
        "Conversion of the resistance change of a gage into counts: resolution and conversion "
        "time. The smallest detectable change is given by the step of the converter and by noise."
    )
    guide_page = "scenes"

    def __init__(self) -> None:
        super().__init__("Electronics", ("electronics", "bits", "conversion_time"))
        self._facts = [Label() for _ in range(3)]
        rows = (
            ("Frame", "Largest frame rate: one over the conversion time of all channels."),
            ("Step", "The curvature of one count, and the range of the converter."),
            ("Strain", "Curvature at a gage strain of 1 %, the elastic limit of metal foil."),
        )
        for (name, tip), fact in zip(rows, self._facts, strict=True):
            label = Label(name)
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


class GagesPanel(SimulationForm):
    """The form of hysteresis, creep and tolerance."""

    purpose = (
        "Effects of real gages on their readings: hysteresis loops, creep, and different gains and "
        "offsets."
    )
    guide_page = "scenes"

    def __init__(self) -> None:
        super().__init__("Gages", ("loops", "creep", "tolerance"))


class RegionPanel(Form):
    """The form of the region of interest, with its frame rate and accuracy, or a refusal."""

    purpose = (
        "Scans part of the channels in each frame, around the contact or selected ones: "
        "frames/s = 1 / (channels \u00d7 conversion time)."
    )
    guide_page = "accuracy"

    def __init__(self) -> None:
        super().__init__("Region of interest", ("region", "region_radius", "region_share"))
        self._region, self._selected = "off", 0
        self._text, self._rates = "", (math.inf, math.inf)

    def show_settings(self, settings: Settings) -> None:
        super().show_settings(settings)
        self._region, self._selected = settings.region, len(settings.region_elements)
        around_contact = settings.region in ("skin", "intrinsic")
        rows = {"region"} | ({"region_radius"} if around_contact else set())
        self.show_rows(rows | ({"region_share"} if settings.region != "off" else set()))

    def show_tradeoff(self, tradeoff: ScanTradeoff | None) -> None:
        """Show frame rate and accuracy of the region; None while unknown."""
        self._text = "" if tradeoff is None else _tradeoff_text(tradeoff, *self._rates)

    def show_status(self, status: Status, simulating: bool) -> None:
        if status.sensor is not None:
            self._rates = status.region.rate, status.sensor.rate
        if status.region_refusal:
            self.show_message(f"{status.region_refusal}.")
        elif self._region == "elements" and not self._selected:
            self.show_message(_SELECT, hint=True)
        else:
            self.show_message(self._text if self._region != "off" else "", hint=True)


def _tradeoff_text(tradeoff: ScanTradeoff, requested: float, without: float) -> str:
    """Frame rate and accuracy of a region, in frames/s `requested` and `without` the region."""
    rate, full_rate = min(requested, tradeoff.rate), min(without, tradeoff.full_rate)
    gain = (
        f"{rate:.0f} instead of {full_rate:.0f} frames/s, {rate / full_rate:.1f} times as many"
        if rate > 1.005 * full_rate
        else f"{full_rate:.0f} frames/s, as with all channels"
    )
    more = f" (possible: {tradeoff.rate:.0f})" if tradeoff.rate > 1.005 * rate else ""
    text = f"{tradeoff.channels} channels per frame. Frame rate: {gain}{more}."
    known = [axis for axis in (0, 1) if math.isfinite(tradeoff.full_bound[axis])]  # a strip: x only
    if not known:
        return text
    mm, full = (1e3 * max(bound[known]) for bound in (tradeoff.bound, tradeoff.full_bound))
    bars = Coverage.now
    mm, full = bars.of(mm), bars.of(full)
    off = f"\N{PLUS-MINUS SIGN} {mm:.2f} mm ({bars.label})"
    accuracy = off if math.isfinite(mm) else "undetermined"
    compared = (
        f"\N{PLUS-MINUS SIGN} {full:.2f} mm with all channels"
        if not mm <= 1.005 * full
        else "as with all channels"
    )
    return f"{text} Contact position from one frame, at best: {accuracy}, {compared}."
