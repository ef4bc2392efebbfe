"""What the tests of connecting share."""

from collections.abc import Callable

import pytest

from kappaskin.sources import Port
from kappaskin_app.features.connection.panel import ConnectionPanel


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
