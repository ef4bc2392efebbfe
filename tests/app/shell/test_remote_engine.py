"""A window on an engine in another room, which a thread of the test serves."""

import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from kappaskin.live import EngineServer, Fingers, remote_engines
from kappaskin.pipeline import Setup
from kappaskin_app import launch
from kappaskin_app.shell.simulation import settings_for

TOKEN = "only-for-this-test"


class Served:
    def __init__(self, folder: Path, sources: dict[str, str]) -> None:
        self.hand = Fingers(sources, Setup(Ni=6, Nj=7))
        self.hand.connect(sources)
        self._server = EngineServer(self.hand, sources, "127.0.0.1", 0, TOKEN, folder)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()
        self.place = f"127.0.0.1:{self._server.port}"

    def _run(self) -> None:
        while not self._over.is_set():
            self._server.poll(0.05)

    def end(self) -> None:
        self._over.set()
        self._thread.join()
        self._server.close()


@pytest.fixture
def serve(tmp_path: Path) -> Iterator:
    made: list[Served] = []

    def serve(**sources: str) -> Served:
        made.append(Served(tmp_path, sources or {"": "sim:line"}))
        return made[-1]

    yield serve
    for each in made:
        each.end()
        each.hand.close()


def test_a_window_shows_the_engine_with_its_settings(serve, opened, until, tmp_path) -> None:
    served = serve()
    engine = remote_engines(f"engine:{served.place}", TOKEN)
    window = opened("sim:line", engine)
    until(lambda: window.display.badge.state == "SIM" and window.session.estimate is not None)
    settings = window.history.settings
    assert (settings.functions_x, settings.functions_y, settings.load_case) == (6, 7, "line")
    assert served.hand.engines[""].requested.setup.Ni == 6
    until(lambda: "there and back" in window.connection.link.text())
    assert window.connection.link.text().startswith(f"Engine at {served.place}: ")
    until(lambda: window.features["connection"].link.text().startswith(f"{served.place}: "))
    assert window.recording.message.text().startswith(f"The engine at {served.place} is shown")

    window.history.change("Functions", -1, functions_x=5)
    until(lambda: served.hand.engines[""].requested.setup.Ni == 5)
    until(lambda: window.session.status.setup.Ni == 5)

    window.actions_by_name["record"].trigger()
    until(lambda: window.recorder.recording)
    assert Path(window.recorder.written.path).parent == tmp_path
    assert window.recorder.may_close()  # it goes on there
    window.actions_by_name["record"].trigger()
    until(lambda: not window.recorder.recording)
    assert f"at {served.place}" in window.recording.message.text()
    assert list(tmp_path.glob("*.mcap"))

    served.end()
    until(lambda: window.display.badge.state == "LOST")
    assert "connecting again by itself" in window.connection.message.text()


def test_another_window_takes_over_what_the_last_one_had_set(serve, opened, until) -> None:
    served = serve()
    first = opened("sim:line", remote_engines(f"engine:{served.place}", TOKEN))
    until(lambda: first.session.estimate is not None)
    first.history.change("Theme", -1, theme="light", functions_x=4)
    until(lambda: b'"functions_x": 4' in served.hand.engines[""].requested.window_state)
    first.close()
    second = opened("sim:line", remote_engines(f"engine:{served.place}", TOKEN))
    assert (second.history.settings.theme, second.history.settings.functions_x) == ("light", 4)
    until(lambda: second.session.status.setup.Ni == 4)


def test_a_hand_is_shown_with_the_settings_of_each_finger(
    serve, until, monkeypatch: pytest.MonkeyPatch
) -> None:
    served = serve(thumb="sim:line", index="sim:fingertip-cap")
    monkeypatch.setenv("KAPPASKIN_TOKEN", TOKEN)
    _, window = launch.opened(f"engine:{served.place}")
    try:
        session = window.session
        until(lambda: session.estimate is not None)
        assert (session.finger, session.source) == ("thumb", "sim:line")
        session.show_finger("index")
        until(lambda: session.status.source == "sim:fingertip-cap")
        at_first = settings_for("sim:fingertip-cap")
        assert window.history.settings == replace(at_first, functions_x=6, functions_y=7)
    finally:
        window.close()
        window.deleteLater()


def test_an_engine_is_not_connected_in_a_window_that_is_open(window, until) -> None:
    window.session.request_source("engine:lab")
    until(lambda: "kappaskin app --source engine:lab" in window.connection.message.text())
    assert window.session.source == "sim:"
