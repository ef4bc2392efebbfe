"""From where the skin is looked at: from a direction that fits it in, or as a person turned it."""

from PySide6.QtCore import QObject, Signal
from pyvistaqt import QtInteractor

from kappaskin_app.features.membrane.camera import DIRECTIONS, camera_of, fit_camera, place_camera
from kappaskin_app.features.membrane.sides import Sides
from kappaskin_app.shell.drawn_skin import FROM_THE_LEFT, NO_SKIN


class Gaze(QObject):
    """Places the camera of a `plotter`, in whose picture the `sides` of the `skin` are named.

    `turned` brings how the camera stands after it was dragged, or else after a turn of the wheel.
    """

    turned = Signal(tuple, bool)

    def __init__(self, plotter: QtInteractor, sides: Sides) -> None:
        super().__init__(plotter)
        self._plotter, self._sides, self.skin = plotter, sides, NO_SKIN
        self._look, self._camera = "left", ()
        self._stood: tuple[float, ...] = ()  # how the camera stood when the mouse took hold of it
        self._dragged = False
        for event, note in (
            ("StartInteractionEvent", self._begin),
            ("InteractionEvent", self._drag),
            ("EndInteractionEvent", self._end),
        ):
            plotter.iren.interactor.AddObserver(event, note)

    def _begin(self, *_: object) -> None:
        self._stood, self._dragged = camera_of(self._plotter.renderer, self.skin), False

    def _drag(self, *_: object) -> None:
        self._dragged = True
        self._sides.show_from(None)

    def _end(self, *_: object) -> None:
        stands = camera_of(self._plotter.renderer, self.skin)
        if stands != self._stood:
            self._camera = stands
            self._sides.show_from(None)
            self.turned.emit(stands, self._dragged)

    def show(self, look: str, camera: tuple[float, ...]) -> None:
        """Look at the whole skin from a direction, or as the `camera` stood that was turned."""
        if (look, camera) != (self._look, self._camera):
            self._look, self._camera = look, camera
            self.place()

    def fit(self) -> None:
        """After picture or letters have another size: have all in it, unless it was turned."""
        if self._camera:
            self._sides.fit(self._plotter.width())
        else:
            self.place()

    def place(self) -> None:
        """Look as is asked for, at this skin."""
        renderer, direction = self._plotter.renderer, DIRECTIONS.get(self._look, FROM_THE_LEFT)
        label = self._sides.fit(self._plotter.width())
        if self._camera:
            place_camera(renderer, self.skin, self._camera)
        else:
            fit_camera(renderer, self.skin, direction, label)
        self._sides.show_from(None if self._camera else direction)
        self._plotter.update()
