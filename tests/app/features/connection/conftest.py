"""What the tests of connecting share."""

from collections.abc import Callable, Sequence

import pytest

from kappaskin.sources import Port
from kappaskin_app.features.connection.panel import ConnectionPanel


@pytest.fixture
def shown(qtbot) -> Callable[[ConnectionPanel, Sequence[Port]], ConnectionPanel]:
    """Shows a panel that lists these ports."""

    def show(panel: ConnectionPanel, ports: Sequence[Port]) -> ConnectionPanel:
        qtbot.addWidget(panel)
        panel.resize(290, 200)
        panel.show()
        panel.show_ports(ports)
        return panel

    return show
