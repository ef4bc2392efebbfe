"""Tares: taken, undone, stored for real sensors, and loaded again."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from kappaskin import Setup, Status, Tare, load_scene
from kappaskin.calibration import Drift, TareStore
from kappaskin.calibration.calibration import fingerprint
from kappaskin.live.tare_taking import TareStatus
from kappaskin_app.features.calibration.tare import (
    TareController,
    TarePanel,
    ago,
    drift_text,
    temperature_text,
)
from kappaskin_app.shell.history import History
from kappaskin_app.shell.settings import Settings

SENSOR = replace(load_scene("centre").sensor(), serial_number="KS-7", simulated=False)
OTHER = replace(SENSOR, serial_number="KS-8")
NOW = datetime.now(UTC)


def tare_of(level=0.0, sensor=SENSOR, **changes):
    offset = np.full(sensor.channels, float(level))
    layout = fingerprint(sensor.layout)
    parts = (sensor.name, sensor.serial_number, layout, NOW, 21.25, 500, 1.0, offset, 0 * offset)
    return replace(Tare(*parts), **changes)


class Bench:
    """The controller and its panel, without an engine."""

    def __init__(self, folder, **settings):
        self.asked, self.reported = 0, []
        self.history = History(Settings(**settings))
        self.tares = TareStore(folder)
        self.engine = SimpleNamespace(tare=self.ask, source="/dev/ttyACM0")
        self.tare_controller = TareController(
            self.history, cast(Any, SimpleNamespace(engine=self.engine)), self.tares
        )
        self.tare_controller.reported.connect(self.reported.append)
        self.panel = TarePanel()
        self.panel.connect_to(self.tare_controller)
        self.history.changed.connect(self.panel.show_settings)
        self.panel.show_settings(self.history.settings)
        self.status = Status()
        self.tell()

    def ask(self):
        self.asked += 1
        self.tell(tare=TareStatus(True, self.status.tare.ended))

    def tell(self, **changes):
        self.status = replace(self.status, **changes)
        self.tare_controller.follow(self.status)
        self.panel.show_status(self.status, False)

    def meet(self, sensor=SENSOR):
        self.tell(sensor=sensor, connections=self.status.connections + 1, state="streaming")

    def end(self, tare=None, refusal=""):
        self.tell(tare=TareStatus(False, self.status.tare.ended + 1, tare, refusal))

    @property
    def used(self):
        return self.history.settings.tare


@pytest.fixture
def bench(qapp, tmp_path):
    made = Bench(tmp_path)
    yield made
    made.panel.deleteLater()


def test_a_tare_is_taken_used_and_kept(bench):
    bench.meet()
    bench.panel.take.click()
    assert bench.asked == 1
    assert not bench.panel.take.isEnabled()

    bench.end(tare_of(1.0))

    assert bench.used == tare_of(1.0)
    assert bench.tares.load("KS-7").used == tare_of(1.0)
    assert bench.panel.what.text().startswith("Taken 20")
    assert bench.panel.take.isEnabled()


def test_a_refusal_is_said_and_changes_nothing(bench):
    bench.meet()
    bench.tare_controller.tare()
    bench.end(refusal="the skin is loaded: 12 mN")

    assert bench.used is None
    assert bench.panel.message.text() == "The skin is loaded: 12 mN."
    assert bench.tares.load("KS-7").tares == ()

    bench.tare_controller.tare()
    assert bench.panel.message.text() == ""


def test_it_is_undone_by_its_button_and_by_the_stack(bench):
    bench.meet()
    for level in (1.0, 2.0):
        bench.tare_controller.tare()
        bench.end(tare_of(level))

    bench.panel.undo.click()
    assert bench.used == tare_of(1.0)
    assert bench.tares.load("KS-7").used == tare_of(1.0)
    bench.history.stack.undo()
    assert bench.used == tare_of(2.0)
    for _ in range(2):
        bench.history.stack.undo()
    assert bench.used is None
    assert bench.tares.load("KS-7").used is None
    assert not bench.panel.undo.isEnabled()


def test_undoing_the_only_one_leaves_none(bench):
    bench.meet()
    bench.tare_controller.tare()
    bench.end(tare_of(1.0))

    bench.tare_controller.undo()
    assert bench.used is None
    bench.history.stack.undo()
    bench.tare_controller.undo()
    assert bench.used is None


def test_the_one_kept_is_used_again_and_said(bench):
    bench.tares.add(tare_of(1.0, date=NOW - timedelta(hours=10)))

    bench.meet()

    assert bench.used == tare_of(1.0, date=NOW - timedelta(hours=10))
    assert len(bench.reported) == 1
    text = bench.reported[0].removeprefix("In use: the stored tare of ")
    assert "(10 hours ago)" in text
    assert bench.panel.what.text().startswith(f"Stored: taken {text},")
    bench.tell(temperature=24.5)
    assert "at 21.2 °C, now 24.5 °C" in bench.panel.what.text()


def test_one_that_was_undone_is_not_used_again(bench, tmp_path):
    bench.meet()
    bench.tare_controller.tare()
    bench.end(tare_of(1.0))
    bench.tare_controller.undo()

    again = Bench(tmp_path)
    again.meet()

    assert again.used is None
    again.panel.deleteLater()


def test_each_sensor_has_its_own(bench):
    bench.tares.add(tare_of(1.0))
    bench.tares.add(tare_of(2.0, OTHER))

    bench.meet()
    first = bench.used
    bench.meet(OTHER)

    assert (first, bench.used) == (tare_of(1.0), tare_of(2.0, OTHER))
    assert bench.tares.load("KS-7").used == tare_of(1.0)


def test_another_sensor_without_one_is_told_that_it_is_not_in_use(bench):
    bench.meet()
    bench.tare_controller.tare()
    bench.end(tare_of(1.0))
    bench.meet(OTHER)

    assert bench.used == tare_of(1.0)
    assert bench.panel.message.text().startswith(
        "Not in use: this tare belongs to Simulated skin KS-7"
    )
    assert bench.tares.load("KS-7").used == tare_of(1.0)
    assert bench.tares.load("KS-8").used is None


def test_those_of_a_simulated_sensor_are_not_kept(bench):
    sensor = replace(SENSOR, simulated=True)
    bench.meet(sensor)
    bench.tare_controller.tare()
    bench.end(tare_of(1.0))

    assert bench.used == tare_of(1.0)
    assert not list(bench.tares.folder.iterdir())


def test_a_damaged_file_is_said(bench):
    bench.tares.path("KS-7").write_text("damaged")
    bench.meet()
    assert "contains no valid tares" in bench.panel.message.text()


def test_a_file_that_cannot_be_written_is_said_and_the_tare_used(bench, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    bench.meet()
    bench.tare_controller.tare()
    bench.end(tare_of(1.0))

    assert bench.used == tare_of(1.0)
    assert "cannot be written" in bench.panel.message.text()


def test_nothing_can_be_tared_while_nothing_streams(bench):
    assert not bench.panel.take.isEnabled()
    assert bench.panel.message.text() == "No readings: connect a sensor to tare it."
    bench.tare_controller.tare()
    assert bench.asked == 0

    bench.meet()
    assert bench.panel.take.isEnabled()
    bench.tell(state="lost")
    assert not bench.panel.take.isEnabled()


def test_none_is_taken_while_calibrating(bench):
    bench.meet()
    bench.tare_controller.set_calibrating(True)
    assert not bench.panel.take.isEnabled()
    assert (
        bench.panel.message.text()
        == "Not during a calibration, which uses readings without a tare."
    )
    bench.tare_controller.set_calibrating(False)
    assert bench.panel.take.isEnabled()


def test_a_refusal_is_cleared_with_its_connection(bench):
    bench.meet()
    bench.tare_controller.tare()
    bench.end(refusal="the skin is loaded")
    bench.tell(state="off", sensor=None)
    assert "No readings" in bench.panel.message.text()


def test_drift_is_told_in_words():
    status = Status(setup=Setup(tare=tare_of()), drift=Drift(0.0512, 3.4e-5, 12.0))
    words = "Drift since the tare: 0.051 1/m (RMS), equal to a displacement of 0.034 mm"
    assert drift_text(status) == words
    loaded = replace(status, drift=Drift(0.0512, 3.4e-5, 12.0, True))
    assert drift_text(loaded) == f"{words}, before the load"
    assert "wait two seconds" in drift_text(replace(status, drift=Drift()))
    assert "the skin is loaded" in drift_text(replace(status, drift=Drift(loaded=True)))
    assert drift_text(Status()) == ""


def test_temperatures_are_told_where_they_are_known():
    assert temperature_text(None, 20.0) == ""
    assert temperature_text(20.0, np.nan) == ",\nat 20.0 °C"


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(5.2, "5 s ago"), (300, "5 minutes ago"), (86400, "24 hours ago"), (1e6, "11 days ago")],
)
def test_a_time_that_passed_is_one_number(seconds, words):
    assert ago(seconds) == words


@pytest.mark.full
def test_a_window_tares_a_skin_at_rest_and_refuses_a_loaded_one(window, until):
    window.history.change("Centre", -1, load_case="centre")
    until(lambda: not window.session.scene.moves and not window.session.status.computing)
    action, panel = window.actions_by_name["tare"], window.tare
    until(lambda: action.isEnabled())
    action.trigger()
    until(lambda: bool(panel.message.text()))
    assert "loaded" in panel.message.text() or "move" in panel.message.text()

    window.history.change("Lift", -1, load_case="point", force=0.0)
    until(lambda: not window.session.estimate.contact.present)
    action.trigger()
    until(lambda: window.history.settings.tare is not None)
    until(lambda: window.session.status.setup.tare is not None)
    until(lambda: panel.drift.text().startswith("Drift since the tare: 0.0"))

    window.history.stack.undo()
    until(lambda: window.session.status.setup.tare is None)
    assert panel.drift.text() == ""


@pytest.mark.full
def test_the_age_has_its_error_bar(window, until):
    def reported(age, sd):
        window.readouts.show_health(500, 60, age, sd)
        return window.readouts.text("age")

    assert reported(0.0124, 0.0) == "12 ms"
    assert reported(0.0124, 0.00031) == "12.40 ± 0.31 ms"
    assert reported(0.0124, 0.0014) == "12.4 ± 1.4 ms"
    assert reported(0.0124, np.inf) == "≥ 12 ms"
    assert reported(np.nan, np.inf) == "–"


@pytest.mark.full
def test_large_counts_are_told_in_few_digits(window):
    def reported(lost, discarded, skipped):
        counts = {"lost": lost, "discarded": discarded, "skipped": skipped}
        window.readouts.show_health(500, 60, 0.01, 0.0, **counts)
        return window.readouts.text("lost")

    assert reported(0, 0, 0) == "0"
    assert reported(3, 120, 9_999) == "3, 9999 skipped, 120 B"
    assert reported(0, 0, 43_210) == "0, 43 k skipped"
    assert reported(0, 0, 999_600) == "0, 1.0 M skipped"


def test_what_is_in_use_with_a_recording_is_no_tare_of_the_sensor_now(bench):
    bench.tares.use(SENSOR.serial_number, tare_of(1.0))
    bench.engine.source = "replay:then.mcap"
    bench.meet()
    assert bench.used is None  # it was recorded without
    bench.history.change("Settings of then.mcap", -1, tare=tare_of(2.0))
    bench.history.change("Calibration and tare as before", -1, tare=None)
    assert bench.tares.load(SENSOR.serial_number).fit_for(SENSOR) == tare_of(1.0)
    bench.engine.source = "/dev/ttyACM0"
    bench.meet()
    assert bench.used == tare_of(1.0)
