"""The name of a target to what sends there: `udp://HOST:PORT`, `foxglove://[HOST][:PORT]`."""

import importlib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

from kappaskin.errors import Refusal, lacking
from kappaskin.publish.publisher import Publisher

MOST_TARGETS = 8
"""So many targets at most are published to at the same time."""

PORTS = {"udp": 9870, "foxglove": 8765}  # PlotJuggler's and Foxglove's own
_HOSTS = {"udp": "", "foxglove": "127.0.0.1"}
_FORM = re.compile(
    r"(\w+)://(?:\[([0-9a-fA-F:.]+(?:%[\w.-]+)?)\]|([\w.-]*))(?::([^:/]*))?/?"  # IPv6, or a name
)
_LONGEST = 253  # characters of a name on the internet


@dataclass(frozen=True)
class Target:
    """Where messages go, and how: by `scheme`."""

    scheme: str
    host: str
    port: int

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.scheme}://{host}:{self.port}"


def target_of(text: str) -> Target:
    """The target called `text`, refused where it is none."""
    found = _FORM.fullmatch(text.strip())
    scheme = found[1].lower() if found else ""
    if found is None or scheme not in PORTS:
        raise Refusal(
            f"expected a target such as udp://127.0.0.1:9870 or foxglove://, got {text[:99]!r}"
        )
    host = (found[2] or found[3] or _HOSTS[scheme]).lower()
    if not host or len(host) > _LONGEST:
        raise Refusal(
            f"expected a host in front of the port, such as udp://127.0.0.1:9870, got {text[:99]!r}"
        )
    return Target(scheme, host, _port(found[4], PORTS[scheme]))


def _port(text: str | None, usual: int) -> int:
    if text is None:
        return usual
    if not re.fullmatch("[0-9]{1,5}", text) or not 0 < int(text) < 65536:
        raise Refusal(f"expected a port from 1 to 65535, got {text[:20]!r}")
    return int(text)


def targets_of(texts: Sequence[str]) -> tuple[Target, ...]:
    """The targets with these names, none of them twice."""
    targets = tuple(map(target_of, texts))
    for number, target in enumerate(targets):
        if target in targets[:number]:
            raise Refusal(f"{target} is given twice; give every target once")
    if len(targets) > MOST_TARGETS:
        raise Refusal(f"expected at most {MOST_TARGETS} targets, got {len(targets)}")
    return targets


def reason(error: OSError | UnicodeError) -> str:
    """What the system said, without its number."""
    return getattr(error, "strerror", None) or str(error)


def opened(target: Target) -> Publisher:
    """What sends to `target`; a `Refusal` says why nothing can. This may take a while."""
    try:  # by name: a transport is imported when somebody asks for it
        module = importlib.import_module(f"kappaskin.publish.{target.scheme}")
    except ImportError as error:
        raise lacking(target.scheme, str(target), error) from error
    return cast("Publisher", module.opened(target))
