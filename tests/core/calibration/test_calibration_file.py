"""A calibration as a file: what is written comes back, and anything else is refused."""

import math
import tomllib
from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin import Calibration, Patch, Refusal, SensorLayout, load_calibration, load_scene
from kappaskin.calibration.calibration import fingerprint
from kappaskin.scenes.effects import SECOND_GENERATION_LOOPS, Creep

SENSOR = replace(
    load_scene("calibration").sensor(), layout=SensorLayout.regular(Patch(0.1, 0.1), 3, 2)
)
DATE = datetime(2026, 3, 1, 12, 30, 15, 250_000, tzinfo=UTC)
LATER = DATE + timedelta(days=20)
C = SENSOR.channels
RNG = np.random.default_rng(0)
CALIBRATION = Calibration(
    SENSOR.name,
    SENSOR.serial_number,
    SENSOR.firmware,
    fingerprint(SENSOR.layout),
    DATE,
    np.where(np.arange(C) == 4, np.nan, RNG.normal(1, 0.05, C)),
    np.where(np.arange(C) == 4, np.nan, RNG.normal(0, 3, C)),
    RNG.uniform(0, 1e-4, C),
    RNG.uniform(0, 1e-300, C),
    SECOND_GENERATION_LOOPS.operator(C),
    Creep(0.03, 20.0).solid(C),
    ((4, 'gain 0.1, expected "0.5" to 2\n\\ in reverse?'),),
)


@pytest.fixture
def path(tmp_path) -> Path:
    CALIBRATION.save(tmp_path / "skin.toml")
    return tmp_path / "skin.toml"


def refused(path, reason, sensor=SENSOR, now=LATER):
    with pytest.raises(Refusal, match=reason) as told:
        load_calibration(path, sensor, now)
    assert str(told.value).startswith(str(path))


def edit(path, was, becomes):
    text = path.read_text()
    assert text.count(was) == 1
    path.write_text(text.replace(was, becomes))


def sealed(path, **changes):
    """Rewrite the file with other values and the right hash: as a foreign program might."""
    from kappaskin._toml import table
    from kappaskin.calibration.calibration import digest

    said = tomllib.loads(path.read_text())
    for name, value in changes.items():
        heading, _, key = name.partition("__")
        said[heading] = {**said[heading], key: value}
    content = {k: v for k, v in said.items() if isinstance(v, dict)}
    tables = [table("", {"format": said["format"], "sha256": digest(content)})]
    tables += [table(f"[{heading}]", values) for heading, values in content.items()]
    path.write_text("\n".join(tables))


def test_what_was_written_comes_back_to_the_last_digit(path):
    found = load_calibration(path, SENSOR, LATER)
    assert found == CALIBRATION
    for name in ("gain", "offset", "gain_sd", "offset_sd"):
        np.testing.assert_array_equal(getattr(found, name), getattr(CALIBRATION, name))
    np.testing.assert_array_equal(found.hysteresis.weights, CALIBRATION.hysteresis.weights)
    assert found.creep.time_constant == 20.0
    assert found.date == DATE
    assert found.failures == CALIBRATION.failures


def test_a_calibration_of_lines_alone_comes_back(tmp_path):
    alone = replace(CALIBRATION, hysteresis=None, creep=None)
    alone.save(tmp_path / "a.toml")
    assert load_calibration(tmp_path / "a.toml", SENSOR, LATER) == alone
    assert "[hysteresis]" not in (tmp_path / "a.toml").read_text()


@given(st.text(st.characters(exclude_categories=["Cs"])), st.integers(-12, 12))
def test_any_name_and_any_time_zone_come_back(name, hours):
    date = DATE.astimezone(timezone(timedelta(hours=hours)))
    named = replace(CALIBRATION, name=name, serial_number=name, date=date)
    said = tomllib.loads(named.to_toml())
    assert said["device"]["name"] == said["device"]["serial_number"] == name
    assert said["device"]["date"] == date


def test_the_file_can_be_read_by_a_person(path):
    lines = path.read_text().splitlines()
    assert lines[0] == "format = 1"
    assert "date = 2026-03-01T12:30:15.250000+00:00" in lines
    assert 'serial_number = "SIM-0001"' in lines
    assert max(map(len, lines)) < 160


def test_line_ends_of_another_system_are_no_damage(path):
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    assert load_calibration(path, SENSOR, LATER) == CALIBRATION


def test_a_file_is_replaced_whole_or_not_at_all(path, monkeypatch):
    before = path.read_bytes()

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(Refusal, match=r"cannot be written .*No space left.*another place"):
        replace(CALIBRATION, name="other").save(path)
    monkeypatch.setattr("os.fsync", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        replace(CALIBRATION, name="other").save(path)
    assert path.read_bytes() == before
    assert list(path.parent.iterdir()) == [path]


def test_a_name_that_no_file_can_hold_is_refused(tmp_path):
    with pytest.raises(Refusal, match=r"cannot be written .*surrogates"):
        replace(CALIBRATION, name="\ud800").save(tmp_path / "a.toml")

    assert not list(tmp_path.iterdir())


def test_a_calibration_of_more_channels_than_the_sensor_has_is_refused():
    one, zero = np.ones(C + 3), np.zeros(C + 3)
    more = dict.fromkeys(("offset", "gain_sd", "offset_sd"), zero)
    with pytest.raises(Refusal, match="at other positions than when it was calibrated"):
        replace(CALIBRATION, gain=one, **more, hysteresis=None, creep=None, failures=()).check(
            SENSOR
        )


def test_the_error_on_other_paths_comes_back_and_older_files_have_none(tmp_path, path):
    error = np.linspace(0.1, 0.3, len(CALIBRATION.gain))
    replace(CALIBRATION, error=error).save(tmp_path / "a.toml")
    np.testing.assert_array_equal(Calibration.read(tmp_path / "a.toml").error, error)
    assert Calibration.read(path).error is None


@pytest.mark.parametrize("place", ["no/such/folder/skin.toml", "."])
def test_a_place_that_is_none_is_refused(tmp_path, place):
    with pytest.raises(Refusal, match="expected a file in a folder that exists"):
        CALIBRATION.save(tmp_path / place)


# Refusals on loading


def test_a_missing_or_unreadable_file_is_refused(tmp_path):
    refused(tmp_path / "none.toml", "there is no such file; `kappaskin calibrate` makes one")
    refused(tmp_path, "cannot be read .*permissions")


@pytest.mark.parametrize(
    "text", ["", "\0", "not toml", "a = 1", "format = 1", "[[device]]\n", "x = " + "[" * 5000]
)
def test_what_is_no_calibration_is_refused(tmp_path, text):
    (tmp_path / "x.toml").write_text(text)
    refused(tmp_path / "x.toml", "calibrate again, or restore the file from a copy")


def test_bytes_that_are_no_text_are_refused(tmp_path):
    (tmp_path / "x.toml").write_bytes(bytes(range(256)))
    refused(tmp_path / "x.toml", "is not a calibration file")


@given(st.data())
def test_no_changed_character_goes_unnoticed(tmp_path_factory, data):
    text = CALIBRATION.to_toml()
    at = data.draw(st.integers(0, len(text) - 1))
    new = data.draw(st.characters(exclude_categories=["Cs"]))
    path = tmp_path_factory.getbasetemp() / "changed.toml"
    path.write_text(text[:at] + new + text[at + 1 :], encoding="utf-8", newline="")
    try:
        found = Calibration.read(path)
    except Refusal:
        return
    assert found == CALIBRATION  # a space, a line end, another way to write the same number


@pytest.mark.parametrize("kept", [0.0, 0.1, 0.5, 0.9, 0.999])
def test_a_file_cut_short_is_refused(path, kept):
    text = path.read_text()
    path.write_text(text[: int(len(text) * kept)])
    refused(path, "calibrate again, or restore the file from a copy")


def test_an_edited_number_is_refused(path):
    edit(path, "time_constant = 20.0", "time_constant = 21.0")
    refused(path, "damaged or was edited .*SHA-256")


def test_a_newer_format_is_refused_with_its_remedy(path):
    edit(path, "format = 1", "format = 2\nmore = 3")
    refused(path, "has format 2, this program reads up to 1; update kappaskin")


@pytest.mark.parametrize("version", ["0", "-1", "1.0", '"1"', "true"])
def test_a_format_that_is_none_is_refused(path, version):
    edit(path, "format = 1", f"format = {version}")
    refused(path, "expected a calibration format, got")


@pytest.mark.parametrize("heading", ["device", "line", "failures"])
def test_a_missing_heading_is_refused(path, heading):
    edit(path, f"[{heading}]", "[another]")
    refused(path, "unknown tables .*another")
    edit(path, "[another]", "[creep.more]" if heading == "failures" else "[failures.more]")
    refused(path, f"lacks the tables .*{heading}")


def test_missing_and_unknown_keys_are_named(path):
    edit(path, "serial_number =", "serial_nr =")
    refused(path, r"\[device\] lacks \['serial_number'\] and has unknown \['serial_nr'\]")


def test_a_heading_that_is_none_is_refused(path):
    edit(path, "[creep]", "[[creep]]")
    refused(path, "creep is not a table")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("device__name", 3),
        ("device__date", "yesterday"),
        ("line__gain", ["one"] * C),
        ("line__gain", [1.0] * (C - 1)),
        ("line__gain", 1.0),
        ("line__gain", [-1.0] * C),
        ("creep__time_constant", "long"),
        ("creep__time_constant", 10**400),
        ("creep__time_constant", [20.0]),
        ("creep__share", [math.nan] * C),
        ("hysteresis__weights", [[1.0] * C]),
        ("hysteresis__stretch", [0.0] * C),
        ("failures__five", "why"),
        ("failures__5", 7),
    ],
)
def test_values_that_make_no_calibration_are_refused_whoever_sealed_them(path, name, value):
    sealed(path, **{name: value})
    refused(path, "cannot be used")


def test_a_resealed_file_is_read(path):
    sealed(path, device__name="Other")
    assert load_calibration(path, SENSOR, LATER).name == "Other"


def test_a_foreign_device_is_refused(path):
    other = replace(SENSOR, serial_number="K-7")
    refused(path, "belongs to Simulated skin SIM-0001, the sensor is Simulated skin K-7", other)


def test_another_layout_is_refused(path):
    layout = SensorLayout.regular(SENSOR.layout.patch, 2, 3)
    refused(path, "has 2 x 3 elements at other positions", replace(SENSOR, layout=layout))


def test_an_old_calibration_is_refused_and_the_limit_is_stated(path):
    at_most = DATE + timedelta(days=180)
    assert load_calibration(path, SENSOR, at_most) == CALIBRATION
    refused(path, "dated 2026-03-01, 181 days old; expected at most 180", now=DATE + timedelta(181))
    assert load_calibration(path, SENSOR, DATE + timedelta(181), timedelta(200)) == CALIBRATION


def test_a_date_in_the_future_is_refused_but_for_a_clock_a_little_off(path):
    assert load_calibration(path, SENSOR, DATE - timedelta(hours=20)) == CALIBRATION
    refused(path, "later than now, 2026-02-26", now=DATE - timedelta(days=3))
