"""What this machine has and what it lacks, or what is on one of its ports and how well it does."""

import math

from kappaskin.cli.common import FAILED, Switch, print_json
from kappaskin.cli.machine import examine
from kappaskin.sources import Diagnosis, Port, diagnose, permission_line


def doctor(port: str = "", *, json: Switch = False) -> int:
    """Tell what this machine has, what is missing, and the line that installs it.

    Or look at one port for a few seconds: whether it is absent, busy, not permitted, silent, at
    another baud rate or no sensor's; else who is there, how fast its readings come and how many are
    lost. The exit code is 1 where no readings come.

    Example: `kappaskin doctor /dev/ttyACM0`

    Parameters
    ----------
    port
        The port or URL to look at; this machine when left out.
    json
        Print one JSON object instead of text.
    """
    if not port:
        _tell_machine(json)
        return 0
    found = diagnose(port)
    if json:
        print_json(found.to_json())
    else:
        _tell_port(found)
    return FAILED if found.why else 0


def _tell_port(found: Diagnosis) -> None:
    _line("port", found.plug)
    if found.device:
        _line("device", found.device)
    if math.isfinite(found.rate):
        _line("rate", f"{found.rate:.1f} frames/s of the {found.said_rate:g} it says")
        known = f"known to {1e3 * found.clock_sd:.2g} ms" if found.clock_sd < math.inf else _DEAF
        _line("clock", known)
    if math.isfinite(found.temperature):
        _line("temperature", f"{found.temperature:.1f} degrees Celsius")
    if found.accounting.bytes_in:
        _line("losses", f"{found.accounting.words}, in {found.accounting.bytes_in:,} bytes")
    for event in found.events:
        if event.kind != "met":
            _line(event.kind, event.text)
    _line("verdict", found.why or "well")


_DEAF = "not known: the device does not answer pings"


def _line(name: str, text: str) -> None:
    print(f"{name:<20}{text}")


def _tell_machine(json: bool) -> None:
    found = examine()
    if json:
        print_json(found)
        return
    for name in ("kappaskin", "python", "system"):
        _line(name, found[name])
    for package, version in found["packages"].items():
        _line(package, version or "not installed")
    _line("display", found["display"] or "none (`xvfb-run` gives a virtual one)")
    for port in found["serial_ports"]:
        said = Port(**port)
        may = "" if said.opened else f"  no permission. {permission_line(said.port)}"
        _line("serial port", f"{said.words}{may}")
    if not found["serial_ports"]:
        _line("serial ports", "none found")
    _line("missing", " ".join(found["missing"]) or "nothing")
    if None in found["packages"].values():
        print("Install the desktop app's packages with: pip install 'kappaskin[app]'")
    if found["install"]:
        print(f"Install what is missing with: sudo {found['install']}")
