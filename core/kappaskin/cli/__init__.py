"""The command `kappaskin`: its subcommands, in groups."""

import os
import sys
from importlib import metadata
from keyword import iskeyword

# Before NumPy is loaded, as in the engine: small products lose by threading, and threads that spin
# for each other on busy cores took twenty times as long.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from cyclopts import App, CycloptsError, Group

from kappaskin.cli.common import FAILED as FAILED
from kappaskin.cli.common import REFUSED as REFUSED
from kappaskin.cli.common import DescribedFingers as DescribedFingers
from kappaskin.cli.common import Limit as Limit
from kappaskin.cli.common import ProgressLine as ProgressLine
from kappaskin.cli.common import Sources as Sources
from kappaskin.cli.common import Switch as Switch
from kappaskin.cli.common import allow as allow
from kappaskin.cli.common import check_output as check_output
from kappaskin.cli.common import fingers_of as fingers_of
from kappaskin.cli.common import show
from kappaskin.errors import Refusal

app = App(
    name="kappaskin",
    help="Shape and contact from curvature-sensing tactile skins.",
    version=metadata.version("kappaskin"),
    help_format="plaintext",  # of the list; a parser of Markdown takes as long as all else
    group_commands=Group("Options", sort_key=9),
)
# A panel of the help for each group: the module that holds its commands and loads no room before
# one of them runs, and their names.
_PANELS = {
    "Live": ("live", "publish serve listen"),
    "Recordings": ("record", "record info verify repair export import reconstruct"),
    "Sensor": ("sensor", "calibrate tare press monitor device"),
    "Studies": ("study", "plan simulate cost compare stability regions design study report"),
    "Paper": ("study", "tables figures"),
    "System": ("system", "doctor drill new"),
}
_GROUPS = {panel: Group(panel, sort_key=place) for place, panel in enumerate(_PANELS, 1)}
for _panel, (_module, _names) in _PANELS.items():
    for _name in _names.split():
        app.command(
            f"kappaskin.cli.{_module}:{_name}{'_' * iskeyword(_name)}",
            name=_name,
            group=_GROUPS[_panel],
            help_format="markdown",
        )
app.command(
    "kappaskin.cli.system:install_completion", name="--install-completion", help_format="markdown"
)


def _add_commands() -> None:
    """Add the commands of other packages, such as those that open the app."""
    for entry in metadata.entry_points(group="kappaskin.commands"):
        if entry.name not in app:
            app.command(entry.value, name=entry.name, group=_GROUPS["Live"])


def _load_all() -> None:
    """Load every command: a list of them says what each does."""
    for name in app:
        app[name]


def _typed(arguments: list[str] | None) -> str:
    """The command that was typed, or nothing where it is none of ours."""
    first, *_ = (sys.argv[1:] if arguments is None else arguments) or [""]
    return first if first in app and not first.startswith("-") else ""


def _report_plug_ins() -> None:
    """Print which plug-ins were left out, and why."""
    if "kappaskin._plugins" in sys.modules:  # else no room was loaded that has any
        from kappaskin._plugins import found_plug_ins

        for plug_in in found_plug_ins():
            if plug_in.trouble:
                show(f"kappaskin: plug-in {plug_in.text}", error=True)


def main(arguments: list[str] | None = None) -> int:
    """Run one command; the exit code is 0 when done, 1 or 2 as `FAILED` and `REFUSED` say."""
    if reconfigure := getattr(sys.stdout, "reconfigure", None):
        reconfigure(errors="backslashreplace")  # where a terminal has no such letter
    _add_commands()
    typed = _typed(arguments)
    if not typed:
        _load_all()
    try:
        code = app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
        sys.stdout.flush()
        if typed != "app":  # the window shows them
            _report_plug_ins()
        return int(code or 0)
    except Refusal as refusal:
        show(f"kappaskin: {refusal}", error=True)
        return REFUSED
    except CycloptsError as error:
        named = f"kappaskin {typed}".strip()
        show(*f"kappaskin: {error} See `{named} --help`.".splitlines(), error=True)
        return REFUSED
    except MemoryError as error:
        show(f"kappaskin: {error}; reduce the requested size, or the resolution", error=True)
        return REFUSED
    except BrokenPipeError:
        # Whoever read our output has gone; what is still buffered must have somewhere to go.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 0
