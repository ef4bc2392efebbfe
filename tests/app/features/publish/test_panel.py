"""The panel that publishes: off until asked, what each receiver gets, and what cannot be."""

import json
import socket
from dataclasses import replace

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QCheckBox, QLabel, QLineEdit, QWidget
from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

from kappaskin import Status
from kappaskin.publish import CueStatus, Latency, PublishStatus, TargetStatus
from kappaskin.publish.publishing import Receiver
from kappaskin_app.features.publish import PublishPanel
from kappaskin_app.shell.settings import Settings
from kappaskin_app.widgets.layout import scrolled

FINE = TargetStatus("udp://127.0.0.1:9870", receivers=(Receiver("udp://127.0.0.1:9870", 12345, 6),))
DEAD = Receiver("udp://robot:1", 0, 7, "nobody receives there")
VIEWER = Receiver("127.0.0.1:50000", 90, 2, "too slow")
SERVED = TargetStatus("foxglove://127.0.0.1:8765", sent=100, dropped=2, receivers=(VIEWER,))


@pytest.fixture
def panel(qtbot) -> PublishPanel:
    made = PublishPanel()
    qtbot.addWidget(made)
    made.show_settings(Settings())
    made.show()
    return made


def told(panel: PublishPanel, *targets: TargetStatus, late: float = float("nan")) -> str:
    panel.show_refusal("")
    news = PublishStatus(targets, Latency(late, late, late, late))
    panel.show_status(replace(Status(), publishing=news), True)
    return panel.counts.text()


def test_nothing_is_sent_before_it_is_asked_for(panel: PublishPanel) -> None:
    assert Settings().targets == []
    assert not any(box.isChecked() for box in panel.findChildren(QCheckBox))
    assert told(panel) == ""
    assert not panel.counts.isVisible()
    assert not panel.late.isVisible()


def test_settings_name_the_targets() -> None:
    both = Settings(send_udp=True, udp_to="robot:1, [::1]:2", serve_foxglove=True)
    assert both.targets == ["udp://robot:1", "udp://[::1]:2", "foxglove://127.0.0.1:8765"]
    assert replace(both, send_udp=False).targets == ["foxglove://127.0.0.1:8765"]
    assert replace(both, send_udp=False, send_rerun=True, rerun_at=" desk ").targets == [
        "foxglove://127.0.0.1:8765",
        "rerun://desk",
    ]
    felt = Settings(send_cues=True, cues_to="glove:1?force=2, stick")
    assert felt.targets == ["cue://glove:1?force=2", "cue://stick"]


def test_every_receiver_is_told_with_what_it_got(panel: PublishPanel) -> None:
    text = told(panel, FINE, TargetStatus("udp://robot:1", receivers=(DEAD,)), SERVED, late=2.4e-3)
    assert "127.0.0.1:9870\n    12,345 sent, 6 dropped" in text
    assert "0 sent, 7 dropped, nobody receives there" in text
    assert "8765, 1 connected\n    127.0.0.1:50000: 90 sent, 2 dropped, too slow" in text
    assert panel.late.text() == "99 % within 2.4 ms"


def test_a_haptic_device_is_told_with_how_late_its_cues_are(panel: PublishPanel) -> None:
    cue = CueStatus("live", 1.0, 1.04e-3, 2.5e-3, 1234)
    name = "cue://glove:9871?force=2"
    text = told(panel, TargetStatus(name, receivers=(Receiver(name, 12345, 6),), cue=cue))
    assert "cues to glove:9871?force=2\n    12,345 sent, 6 dropped" in text
    assert "bytes in to cue out: 1.0 ms, 99 % within 2.5 ms" in text
    assert "1,234 not in time, live" in text


def test_what_is_looked_for_or_refused_says_so(panel: PublishPanel) -> None:
    text = told(panel, TargetStatus("udp://robot:1", opening=True))
    assert text.startswith("udp://robot:1: connecting")
    text = told(panel, FINE, TargetStatus("udp://a:1", refusal="udp://a:1: not known"))
    assert "udp://a:1" not in text
    assert panel.message.text() == "udp://a:1: not known."


def test_who_was_refused_and_the_url_with_the_token_are_shown(panel: PublishPanel) -> None:
    url = "other machines can connect, unencrypted, with the token: open ws://robot:1/?token=abc"
    page = "refused a web page of https://a.example; to allow it, add ..."
    told(panel, FINE, replace(SERVED, notices=(url, page)))
    assert panel.message.text() == f"{url}\n{page}"
    assert panel.message.textInteractionFlags() & Qt.TextInteractionFlag.TextSelectableByMouse
    told(panel, FINE, SERVED)
    assert panel.message.text() == ""


def test_settings_name_the_pages_that_may_connect() -> None:
    assert Settings().origins == []
    some = Settings(serve_foxglove=True, allowed_pages=" https://a, file:// ,")
    assert some.origins == ["https://a", "file://"]
    assert replace(some, serve_foxglove=False).origins == []


def test_an_address_is_wished_once_it_is_typed(panel: PublishPanel, qtbot) -> None:
    wishes: list[tuple[str, object]] = []
    panel.requested.connect(lambda *wish: wishes.append(wish))
    line = panel.editor("udp_to")
    assert isinstance(line, QLineEdit)
    line.selectAll()
    qtbot.keyClicks(line, " robot:9870 ")
    assert wishes == []
    qtbot.keyClick(line, Qt.Key.Key_Return)
    assert wishes[-1] == ("udp_to", "robot:9870")


def test_what_comes_of_it_is_in_sight_of_who_asked(qtbot, until) -> None:
    panel, other = PublishPanel(), QLineEdit()
    page = scrolled(other, QLabel("\n" * 40), panel)
    qtbot.addWidget(page)
    page.resize(300, 380)  # as high as the panel with its counts
    page.show()
    page.activateWindow()
    box, bar = panel.editor("serve_foxglove"), page.verticalScrollBar()

    def grown_after(asked: QWidget) -> int:
        told(panel)
        asked.setFocus()
        until(asked.hasFocus)
        qtbot.wait(50)
        bar.setValue(bar.maximum())
        told(panel, FINE, SERVED)
        qtbot.wait(50)
        return bar.maximum() - bar.value()

    assert grown_after(other) > 50
    assert grown_after(box) == 0
    assert panel.counts.visibleRegion().boundingRect() == panel.counts.rect()


@pytest.mark.full
def test_the_window_publishes_when_asked_and_undo_ends_it(window, until) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(30)
        panel = window.publish
        window.requests.set("udp_to", f"127.0.0.1:{receiver.getsockname()[1]}")
        assert window.session.status.publishing.targets == ()
        panel.editor("send_udp").click()
        until(lambda: "sent" in panel.counts.text())
        until(lambda: json.loads(receiver.recv(9999))["kind"] == "contact")
        window.history.stack.undo()
        until(lambda: panel.counts.text() == "")
        assert not panel.editor("send_udp").isChecked()
        assert window.session.status.publishing.targets == ()


@pytest.mark.full
def test_what_is_no_address_is_refused_in_the_panel_and_nothing_is_sent(window, until) -> None:
    panel = window.publish
    window.requests.set("send_udp", True)
    until(lambda: window.session.status.publishing.targets)
    window.requests.set("udp_to", "robot:70000")
    until(lambda: "Not publishing: expected a port" in panel.message.text())
    until(lambda: window.session.status.publishing.targets == ())
    window.requests.set("udp_to", "nowhere.invalid:1")
    until(lambda: "nowhere.invalid is not known" in panel.message.text())
    window.requests.set("send_udp", False)
    until(lambda: panel.message.text() == "")


@pytest.mark.full
def test_a_page_that_was_refused_connects_once_it_is_allowed(window, until) -> None:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        port = found.getsockname()[1]
    url, page, panel = f"ws://127.0.0.1:{port}", "https://app.foxglove.dev", window.publish

    def reads() -> bool:
        try:
            with connect(url, subprotocols=["foxglove.sdk.v1"], origin=page) as one:
                return "serverInfo" in str(one.recv(30))
        except (WebSocketException, OSError):
            return False

    window.requests.set("foxglove_at", f"127.0.0.1:{port}")
    window.requests.set("serve_foxglove", True)
    until(lambda: reads() or "Allowed pages" in panel.message.text())
    assert f"--allow-origin {page} (Allowed pages in the app)" in panel.message.text()
    window.requests.set("allowed_pages", "null")
    until(lambda: "Not publishing: expected the origin of a web page" in panel.message.text())
    window.requests.set("allowed_pages", page)
    until(reads)
    until(lambda: panel.message.text() == "")


@pytest.mark.full
def test_resetting_settings_leaves_receivers_alone(window) -> None:
    window.requests.set("serve_foxglove", True)
    window.requests.set("functions_x", 5)
    window.requests.reset()
    assert (window.history.settings.functions_x, window.history.settings.serve_foxglove) == (
        8,
        True,
    )
