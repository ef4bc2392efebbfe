"""What the doctor finds, and the line that mends it."""

import json
import shutil
import sys

import pytest
from serial.tools import list_ports
from serial.tools.list_ports_common import ListPortInfo

from kappaskin.cli import main
from kappaskin.cli import system as doctor

pytestmark = pytest.mark.slow  # the first that asks for the system's name runs uname


@pytest.fixture
def bare(monkeypatch: pytest.MonkeyPatch) -> None:
    """A Linux without a display, a serial port or a library."""
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(list_ports, "comports", list)
    monkeypatch.setattr("ctypes.CDLL", no_library)
    monkeypatch.setattr(shutil, "which", lambda _: None)


def no_library(name: str) -> None:
    raise OSError(f"{name}: cannot open shared object file")


def port(device: str, description: str) -> ListPortInfo:
    found = ListPortInfo(device)
    found.description = description
    return found


def told(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert main(["doctor", *arguments]) == 0
    printed, errors = capsys.readouterr()
    assert errors == ""
    return printed


def test_json_is_one_object_on_one_line(capsys) -> None:
    printed = told(capsys, "--json")
    found = json.loads(printed)
    assert printed.count("\n") == 1
    assert found.keys() == {
        *("kappaskin", "python", "system", "packages", "plug_ins", "display"),
        *("serial_ports", "missing", "install"),
    }
    assert found["packages"]["numpy"].split(".")[0] == "2"
    assert found["kappaskin"]


def test_the_text_tells_the_same_as_the_json(capsys, bare) -> None:
    found, text = json.loads(told(capsys, "--json")), told(capsys)
    for value in (found["python"], found["system"], *filter(None, found["packages"].values())):
        assert value in text
    assert f"sudo {found['install']}" in text


def test_on_a_bare_debian_the_line_installs_every_library(bare) -> None:
    found = doctor.examine()
    assert found["missing"] == [*doctor.LIBRARIES.values(), "xvfb"]
    assert found["install"].startswith("apt-get install -y --no-install-recommends libegl1 ")
    assert found["install"].split()[4:] == found["missing"]


def test_a_display_or_a_virtual_one_is_enough(bare, monkeypatch) -> None:
    monkeypatch.setattr("ctypes.CDLL", lambda name: None)
    assert doctor.examine()["missing"] == ["xvfb"]
    monkeypatch.setattr(shutil, "which", lambda name: f"/usr/bin/{name}")
    assert (doctor.examine()["missing"], doctor.examine()["install"]) == ([], "")
    monkeypatch.setattr(shutil, "which", lambda name: None)
    monkeypatch.setenv("WAYLAND_DISPLAY", "wayland-0")
    assert (doctor.examine()["missing"], doctor.examine()["display"]) == ([], "wayland-0")


def test_where_wheels_bring_all_nothing_is_missing(bare, monkeypatch) -> None:
    monkeypatch.setattr(sys, "platform", "darwin")
    found = doctor.examine()
    assert (found["missing"], found["install"], found["display"]) == ([], "", "native")


def test_a_package_that_is_not_installed_says_so(capsys, bare, monkeypatch) -> None:
    monkeypatch.setattr(doctor, "PACKAGES", ("numpy", "no-such-package-7"))
    assert json.loads(told(capsys, "--json"))["packages"]["no-such-package-7"] is None
    assert "no-such-package-7   not installed" in told(capsys)


def test_no_serial_port_says_so(capsys, bare) -> None:
    assert json.loads(told(capsys, "--json"))["serial_ports"] == []
    assert "serial ports        none found" in told(capsys)


def test_serial_ports_are_listed_with_whether_they_may_be_opened(
    capsys, bare, monkeypatch, tmp_path
) -> None:
    mine = str(tmp_path / "ttyACM0")
    (tmp_path / "ttyACM0").touch()
    ports = [port(mine, "Skin"), port("/dev/ttyABSENT7", "Arduino")]
    ports[0].manufacturer, ports[0].serial_number = "Kappa Ltd", "A-7"
    ports[0].vid, ports[0].pid = 0x2341, 7
    monkeypatch.setattr(list_ports, "comports", lambda: ports)

    found, text = json.loads(told(capsys, "--json"))["serial_ports"], told(capsys)

    assert [(port["port"], port["opened"]) for port in found] == [
        ("/dev/ttyABSENT7", False),
        (mine, True),
    ]
    assert (found[1]["maker"], found[1]["serial_number"]) == ("Kappa Ltd", "A-7")
    assert found[1]["usb"] == [0x2341, 7]
    assert f"{mine}  Skin  Kappa Ltd  [A-7]\n" in text
    assert "Arduino  no permission. Join the port's group with `sudo usermod -aG dialout" in text
