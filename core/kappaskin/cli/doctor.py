"""What this machine has and what it lacks."""

from kappaskin.cli.common import Switch, print_json
from kappaskin.doctor import examine
from kappaskin.sources.ports import Port, permission_line


def doctor(*, json: Switch = False) -> None:
    """Tell what this machine has, what is missing, and the line that installs it.

    Example: `kappaskin doctor`

    Parameters
    ----------
    json
        Print one JSON object instead of text.
    """
    found = examine()
    if json:
        print_json(found)
        return
    for name in ("kappaskin", "python", "system"):
        print(f"{name:<20}{found[name]}")
    for package, version in found["packages"].items():
        print(f"{package:<20}{version or 'not installed'}")
    print(f"{'display':<20}{found['display'] or 'none (a virtual one will be used)'}")
    for port in found["serial_ports"]:
        said = Port(**port)
        may = "" if said.opened else f"  no permission. {permission_line(said.port)}"
        print(f"{'serial port':<20}{said.words}{may}")
    if not found["serial_ports"]:
        print(f"{'serial ports':<20}none found")
    print(f"{'missing':<20}{' '.join(found['missing']) or 'nothing'}")
    if None in found["packages"].values():
        print("Install the desktop app's packages with: pip install 'kappaskin[app]'")
    if found["install"]:
        print(f"Install what is missing with: sudo {found['install']}")
