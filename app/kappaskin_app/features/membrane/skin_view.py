"""Skin view: connects the 3-D view to display, settings and selection."""

import time

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject

from kappaskin.frames import Estimate
from kappaskin.live import Status
from kappaskin.scenes import Indenter
from kappaskin_app.features.membrane.legend import Legend
from kappaskin_app.features.membrane.measuring import Measurement
from kappaskin_app.features.membrane.membrane import MembraneView
from kappaskin_app.features.membrane.overlays import Overlays
from kappaskin_app.guard import guarded
from kappaskin_app.shell.colouring import Shade
from kappaskin_app.shell.display import Display, Shown, of_row
from kappaskin_app.shell.loads import loads_at
from kappaskin_app.shell.selection import Selection
from kappaskin_app.shell.session import Session
from kappaskin_app.shell.settings import Settings, locked_at
from kappaskin_app.theme import current
from kappaskin_app.widgets.colour_bar import SkinScale
from kappaskin_app.widgets.text import Coverage

_MARKS = 0.06  # s between two updates of the marks


class SkinView(QObject):
    """Shows the data of the `display` on the `membrane`, with its colour `scale` and `legend`.

    With `alarm_enabled` the view shows the reason why no data arrives.
    """

    def __init__(self, display: Display, session: Session, selection: Selection) -> None:
        super().__init__(display)
        self._display, self._session, self._selection = display, session, selection
        self.membrane, self.scale, self.legend = MembraneView(), SkinScale(), Legend()
        self.measurement = Measurement(self.membrane)
        self.overlays = Overlays(self.membrane, display.colouring, session)
        self.alarm_enabled = True
        self._settings = Settings()
        self._colours: object = None
        self._excluded = np.empty(0, np.intp)  # elements
        self._shown: Shown | None = None
        self._next_marks = 0.0
        self.membrane.look_changed.connect(guarded(self._redraw))
        display.ages, display.limits = self._ages, [*display.limits, self._limits]
        display.restarted.connect(guarded(self._restart))
        display.status_shown.connect(guarded(self._show_status))
        display.shown.connect(guarded(self._show))
        display.object_found.connect(
            guarded(lambda what, _: (self.overlays.set_object(what), self._redraw()))
        )
        selection.pointed.connect(guarded(self.membrane.point))
        selection.target_changed.connect(guarded(lambda *_: self._show_marked()))
        selection.map_changed.connect(guarded(self._show_map))

    def show_settings(self, settings: Settings) -> None:
        self._settings = settings
        self.legend.show_settings(settings)
        self.scale.lock.show_locked(locked_at(settings.colour_by, settings) > 0)
        self._allow_lock()
        s = settings
        self.membrane.show_box((s.from_x, s.to_x, s.from_y, s.to_y, s.from_z, s.to_z))
        self.membrane.show_options(
            fit=s.show_fit,
            elements=s.show_elements,
            truth=s.show_truth,
            contact=s.show_contact,
            load=s.show_load,
        )
        self.membrane.camera_control.show(settings.look, settings.camera)
        self._redraw()

    @property
    def _shade(self) -> Shade:
        return self._display.colouring.shades[self._settings.colour_by]

    def limit_shown(self) -> float:
        """Limit of the skin's colour range, in SI units."""
        return self.scale.bar.reach / self._shade.scale

    def _limits(self) -> dict[str, float]:
        """Colour limit by the name of the quantity."""
        if self._selection.map is not None:
            return {}
        return {self._settings.colour_by: self.limit_shown()}

    def _show_map(self) -> None:
        shown = self._selection.map
        self.membrane.show_caption(shown.words if shown else "")
        self.membrane.show_elements(shown.positions if shown else None)
        self._allow_lock()

    def _allow_lock(self) -> None:
        """Enable the lock for quantities with a range."""
        ranged = self._selection.map is None and self._settings.colour_by != "health"
        self.scale.lock.setEnabled(ranged)

    def _restart(self, status: Status) -> None:
        if status.sensor is not None:
            self._selection.point(-1)
            self._excluded, self._shown = np.empty(0, np.intp), None
            self.membrane.show_skin(status.sensor, status.setup.nx, status.setup.ny)

    def _show_status(self, _: Status) -> None:
        self._display.age_sd = self.membrane.age_sd
        self.membrane.alarm.show(self._session.alarm() if self.alarm_enabled else "")
        self.membrane.show_lost(self._display.old)
        if self._display.old:
            self.overlays.hide()
        self._show_available()

    def _show_available(self) -> None:
        """Show in the legend what can be drawn of the present source."""
        session, estimate = self._session, self._session.estimate
        stimuli = session.scene.stimuli if session.inside else ()
        self.legend.show_available(
            show_object=not self.membrane.skin.patch.strip,
            show_truth=estimate is not None and bool(np.isfinite(estimate.true_surface).any()),
            show_pressed=any(isinstance(stimulus.what, Indenter) for stimulus in stimuli),
            show_load=bool(stimuli),
        )

    def _ages(self) -> list[float]:
        """Ages in s of the frames drawn within the last second."""
        now = time.monotonic()
        return [age for when, age in self.membrane.ages if when > now - 1.0]

    def _show(self, shown: Shown) -> None:
        if not self.membrane.ready:
            return  # the last drawing is due; the next tick has a newer estimate
        estimate, settings, now = shown.estimate, self._settings, shown.now
        noise = self._display.colouring.noise("displacement", estimate)
        self._display.ranges.limit("displacement", 1e3 * estimate.surface, settings, now, noise)
        self._shown = shown
        self._redraw()
        if now >= self._next_marks:
            self._next_marks = now + _MARKS
            self._excluded = np.flatnonzero(shown.kinds.any(axis=0))
            self._show_marked()

    def _redraw(self) -> None:
        """Draw the present estimate, also while a recording is paused."""
        if self._shown is not None and not self._display.old:
            estimate = self._shown.estimate
            self._colour(self._shown)
            self._show_loads(estimate)
            self.overlays.show(estimate, self._settings, self._times())
            self.measurement.show(estimate)

    def _show_marked(self) -> None:
        self.membrane.show_marked(self._excluded, self._selection.target)

    def _colour(self, shown: Shown) -> None:
        name, times, display = self._settings.colour_by, self._times(), self._display
        estimate, shade, beside = shown.estimate, self._shade, ()
        what = shade.label, shade.symbol
        if (other := self._selection.map) and other.values.shape == estimate.surface.shape:
            tint, values, what = other.tint, other.values, (other.label, "")
        elif shade.on_surface is not None and self._settings.colour_from == "smooth":
            values = display.colouring.on_surface(name, estimate)
            tint = display.tint(name, estimate, values, shown.now)
        else:
            of_elements = display.of_elements(name, estimate, shown.kinds)
            tint = display.tint(name, estimate, of_elements, shown.now)
            on_rail = of_row(shade.row, shown.railed)
            missing = current().missing
            values = tint.rgb(of_elements, missing, on_rail)
            beside = tint.legend(of_elements, missing, on_rail)
        if tint.colours is not self._colours:
            self._colours = tint.colours
            self.membrane.show_colours(tint.colours, tint.ink)
            self.legend.show_colours(tint.colours, tint.ink)
        self._show_reason(name, values)
        barred = self._settings.show_band or self._settings.show_frame
        self.membrane.error_bars = Coverage.now.label if barred else ""
        self.membrane.limited = times < self._settings.exaggeration
        self.membrane.show_estimate(estimate, values, tint.limits, times)
        self.scale.bar.show_tint(tint, beside)
        self.scale.show_what(*what, shade.tip)

    def _show_reason(self, name: str, values: NDArray[np.generic]) -> None:
        """Show in the view why there are no colours."""
        known = name == "health" or values.dtype == np.uint8 or bool(np.isfinite(values).any())
        if self._selection.map is None:
            self.membrane.show_caption("" if known else self._shade.unknown)

    def _times(self) -> float:
        """Vertical exaggeration: the requested one, or the largest that fits."""
        fits = self.membrane.skin.deepest / self._display.ranges.deepest()
        return min(self._settings.exaggeration, fits)

    def _show_loads(self, estimate: Estimate) -> None:
        session = self._session
        at = session.status.playing.time(estimate.device_time)
        touches = loads_at(session.scene, at) if session.inside else ()
        lifted = session.inside and not touches and bool(session.scene.stimuli)
        self.membrane.show_loads([touch.load for touch in touches], lifted)
