"""All panels on their pages: a panel is added by one line, and shows whatever all are shown."""

from typing import TypeVar

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QScrollArea, QTabWidget, QWidget

from kappaskin.live import Status
from kappaskin_app.features.calibration.in_use import InUsePanel
from kappaskin_app.features.calibration.panel import CalibratePanel
from kappaskin_app.features.calibration.tare import TarePanel
from kappaskin_app.features.connection.panel import ConnectionPanel
from kappaskin_app.features.estimator.panel import BasisPanel
from kappaskin_app.features.membrane.panel import ViewPanel
from kappaskin_app.features.publish.panel import PublishPanel
from kappaskin_app.features.recording.panel import RecordingPanel
from kappaskin_app.features.scene.load_panel import LoadPanel, NoisePanel
from kappaskin_app.features.sensor.panel import ElectronicsPanel, RegionPanel, SpoilsPanel
from kappaskin_app.features.sensor.skin import ElementsPanel, ShapePanel, SupportPanel
from kappaskin_app.shell.form import Form
from kappaskin_app.shell.panel import Panel
from kappaskin_app.shell.settings import Settings
from kappaskin_app.theme import Theme
from kappaskin_app.widgets.columns import scrolled

_Some = TypeVar("_Some", bound=Panel)
_LIVE, _SKIN, _SENSOR, _CALIBRATE = "&Live", "S&kin", "Se&nsor", "C&alibrate"


class Panels(QTabWidget):
    """The panels by name; `wished` says which setting is to be what.

    `reset_wanted` says of which panel, and which, are to be as they are at first.
    """

    wished = Signal(str, object)
    reset_wanted = Signal(str, tuple)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._pages: dict[str, list[Panel]] = {}
        self.connection = self._add(_LIVE, ConnectionPanel())
        self.recording = self._add(_LIVE, RecordingPanel())
        self.tare = self._add(_LIVE, TarePanel())
        self.load = self._add(_LIVE, LoadPanel())
        self.noise = self._add(_LIVE, NoisePanel())
        self.basis = self._add(_LIVE, BasisPanel())
        self.view = self._add(_LIVE, ViewPanel())
        self.publish = self._add(_LIVE, PublishPanel())
        self.shape = self._add(_SKIN, ShapePanel())
        self.elements = self._add(_SKIN, ElementsPanel())
        self.support = self._add(_SKIN, SupportPanel())
        self.electronics = self._add(_SENSOR, ElectronicsPanel())
        self.spoils = self._add(_SENSOR, SpoilsPanel())
        self.region = self._add(_SENSOR, RegionPanel())
        self.in_use = self._add(_CALIBRATE, InUsePanel())
        self.calibrate = self._add(_CALIBRATE, CalibratePanel())
        for title, panels in self._pages.items():
            self.addTab(scrolled(*panels), title)
        self.setUsesScrollButtons(False)  # every title is to be seen
        self.tabBar().setElideMode(Qt.TextElideMode.ElideNone)

    def _add(self, page: str, panel: _Some) -> _Some:
        """A panel at the end of the page with this title."""
        self._pages.setdefault(page, []).append(panel)
        panel.wished.connect(self.wished)
        if isinstance(panel, Form):
            panel.reset_wanted.connect(self.reset_wanted)
        return panel

    def all(self) -> list[Panel]:
        return [panel for panels in self._pages.values() for panel in panels]

    def turn(self, pages: int) -> None:
        """Show the page so many further on, round and round."""
        self.setCurrentIndex((self.currentIndex() + pages) % self.count())
        self.tabBar().setFocus(Qt.FocusReason.TabFocusReason)

    def show_calibration(self) -> None:
        """Show the page that guides through a calibration."""
        self.setCurrentIndex(list(self._pages).index(_CALIBRATE))

    def show_recording(self) -> None:
        """Show the panel on recordings."""
        self._show_live(self.recording)

    def show_connection(self) -> None:
        """Show the panel on connections, ready to choose a source."""
        self._show_live(self.connection)
        self.connection.sources.setFocus(Qt.FocusReason.OtherFocusReason)

    def _show_live(self, panel: Panel) -> None:
        self.setCurrentIndex(list(self._pages).index(_LIVE))
        page = self.currentWidget()
        if isinstance(page, QScrollArea):
            page.ensureWidgetVisible(panel)

    def show_settings(self, settings: Settings) -> None:
        for panel in self.all():
            panel.show_settings(settings)

    def show_status(self, status: Status, simulating: bool) -> None:
        for panel in self.all():
            panel.show_status(status, simulating)

    def show_theme(self, theme: Theme) -> None:
        for panel in self.all():
            panel.show_theme(theme)
