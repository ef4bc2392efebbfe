"""What the tests of connecting share."""

from collections.abc import Callable, Iterator

import pytest

from kappaskin.sources import Port
from kappaskin_app.features.connection.panel import ConnectionPanel
from kappaskin_app.shell.window import MainWindow


@pytest.fixture
def shown(qtbot) -> Callable[[ConnectionPanel, list[Port]], ConnectionPanel]:
    """Shows a panel that lists these ports."""

    def show(panel: ConnectionPanel, ports: list[Port]) -> ConnectionPanel:
        qtbot.addWidget(panel)
        panel.resize(290, 200)
        panel.show()
        panel.show_ports(ports)
        return panel

    return show


@pytest.fixture
def window(shared_window: MainWindow) -> Iterator[MainWindow]:
    """The window that the tests of a file share, without what was typed before each."""
    yield shared_window
    shared_window.connection.sources.hidePopup()
    shared_window.session.connect_to("sim:")
