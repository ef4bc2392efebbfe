"""What is drawn over the skin, each thing only while it is wanted."""

import math
import time

import numpy as np

from kappaskin.contact import ContactObject, placed_object
from kappaskin.frames import Estimate
from kappaskin.mechanics import PlacedObject
from kappaskin.scenes import Indenter
from kappaskin_app.features.membrane.band import Band
from kappaskin_app.features.membrane.contact_frame import ContactFrame
from kappaskin_app.features.membrane.directions import Directions
from kappaskin_app.features.membrane.membrane import MembraneView
from kappaskin_app.features.membrane.sheet import Sheet
from kappaskin_app.shell.colouring import Colouring
from kappaskin_app.shell.scale import SteadyRange
from kappaskin_app.shell.session import Session
from kappaskin_app.shell.settings import Settings

_LEAST = 2.0  # 1/m with the longest arm, at least: or noise would have long ones
_OLD = 2.0  # s after which an object that was found is no longer one that touches
_FOUND, _PRESSED = "#1fd17a", "#e8543f"  # as the contact and the loads are marked


class Overlaying:
    """Draws directions, band, frame and objects on the skin of a `membrane`."""

    def __init__(self, membrane: MembraneView, colouring: Colouring, session: Session) -> None:
        self._membrane, self._colouring, self._session = membrane, colouring, session
        plotter = membrane.plotter
        self.directions, self.frame = Directions(plotter), ContactFrame(plotter)
        self.band = Band(plotter)
        self.found, self.pressed = Sheet(plotter, _FOUND), Sheet(plotter, _PRESSED)
        self._longest = SteadyRange(_LEAST)
        self._what: ContactObject | None = None
        self._found_at = -math.inf

    def find(self, what: ContactObject) -> None:
        """Take up what was found to touch the skin."""
        self._what, self._found_at = what, time.monotonic()

    def show(self, estimate: Estimate, settings: Settings, times: float) -> None:
        """Draw what is wanted, of a skin that is drawn so many `times` higher."""
        self._show_directions(estimate, settings)
        self._show_band(estimate, settings, times)
        self._show_frame(estimate, settings, times)
        skin = self._membrane.skin
        self.found.show(self._of_found(estimate) if settings.show_object else None, skin, times)
        stands = self._of_scene(estimate) if settings.show_pressed else None
        self.pressed.show(stands, skin, times)

    def hide(self) -> None:
        """Draw nothing while nothing new comes in."""
        skin = self._membrane.skin
        self.directions.show(skin, None)
        self.band.show(skin, None, 1.0)
        self.frame.hide()
        for sheet in (self.found, self.pressed):
            sheet.show(None, skin, 1.0)

    def _show_directions(self, estimate: Estimate, settings: Settings) -> None:
        quantities = self._colouring.quantities(estimate) if settings.show_directions else None
        known = quantities is not None and bool(np.isfinite(estimate.coefficients).all())
        found, most = None, 1.0
        if quantities is not None and known:
            found = quantities.directions(estimate)
            most = self._longest.follow(float(np.nanmax(np.abs(found[:2]))), time.monotonic())
        self.directions.show(self._membrane.skin, found, most, self._membrane.lift)

    def _show_band(self, estimate: Estimate, settings: Settings, times: float) -> None:
        bars = self._colouring.error_bars(estimate) if settings.show_band else None
        sd = None if bars is None else bars.on_surface(estimate.noise)
        self.band.show(self._membrane.skin, sd, times)

    def _show_frame(self, estimate: Estimate, settings: Settings, times: float) -> None:
        contact = estimate.contact
        if not (settings.show_frame and contact.present):
            self.frame.hide()
            return
        bars, slopes = self._colouring.error_bars(estimate), None
        if bars is not None:
            slopes = times * bars.of_slopes(contact.position, estimate.noise)
        angle = float(estimate.geometry.angle)
        membrane = self._membrane
        self.frame.show(membrane.skin, contact.position, angle, slopes, membrane.lift)

    def _of_found(self, estimate: Estimate) -> PlacedObject | None:
        """What was found of late, where the contact is now."""
        what, contact = self._what, estimate.contact
        if what is None or not contact.present or time.monotonic() - self._found_at > _OLD:
            return None
        patch = self._membrane.skin.patch
        return placed_object(what, contact.position, max(patch.a, patch.b))

    def _of_scene(self, estimate: Estimate) -> PlacedObject | None:
        """The rigid object of the scene that is played, where it is now."""
        session = self._session
        if not session.inside:
            return None
        at = session.status.playing.time(estimate.device_time)
        for stimulus in session.scene.stimuli:
            what, pose = stimulus.what, stimulus.pose_at(at)
            if isinstance(what, Indenter) and pose.amount:
                place = np.array([what.x + pose.dx, what.y + pose.dy])
                return PlacedObject(what.rigid, place, what.turn + pose.turn)
        return None
