"""Access to a server: which web pages and which clients may read what it sends.

A web page can connect to any port that its browser reaches, those of this machine too. The browser
adds the page's origin, which a page cannot change, and the name of the host that it connects to,
which whoever owns the name can let point to this machine.
"""

import hmac
import ipaddress
import os
import re
import secrets
import socket
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from http import HTTPStatus
from urllib.parse import parse_qs, urlsplit

from kappaskin.errors import Refusal

TOKEN = "KAPPASKIN_TOKEN"
"""The variable of the environment that has the token; without it there is a new one each time."""

_FORM = re.compile(r"[\w.~-]{16,128}", re.ASCII)
_EXPECTED = "a token of 16 to 128 letters, digits and - . _ ~"
_BYTES = 16  # of a new token
_HOST = r"\[[0-9a-f:.]{2,45}\]|[\w.-]{1,253}"
_AUTHORITY = re.compile(rf"({_HOST})(:[0-9]{{1,5}})?", re.ASCII)
_ORIGIN = re.compile(
    rf"(?:([a-z][a-z0-9+.-]{{0,30}})://({_HOST})(?::[0-9]{{1,5}})?)|file://", re.ASCII
)
_FIELDS = 16  # of a query


@dataclass(frozen=True)
class Access:
    """Who may read what a server sends: web pages of `origins`, and who has the `token`.

    Pages of this machine need not be listed. The token is required of every client where other
    machines reach the server.
    """

    origins: tuple[str, ...] = ()
    token: str = field(default="", repr=False)


THIS_MACHINE = Access()
"""Access for this machine's clients and pages alone."""


def access_of(origins: Sequence[str] = ()) -> Access:
    """Access for pages of `origins` and with this process's token; a `Refusal` for no origin."""
    return Access(tuple(map(_origin, origins)), _token())


def _origin(text: str) -> str:
    origin = text.strip().lower()
    for written in (origin, origin.removesuffix("/")):
        if _ORIGIN.fullmatch(written):
            return written
    raise Refusal(
        "expected the origin of a web page, its address up to the first single slash such as "
        f"https://app.foxglove.dev, got {text[:99]!r}"
    )


@cache
def _token() -> str:
    return os.environ.get(TOKEN) or secrets.token_urlsafe(_BYTES)


def token_of() -> tuple[str, bool]:
    """The token of this process, and whether it was made; a `Refusal` for a short one."""
    if not _FORM.fullmatch(token := _token()):
        raise Refusal(f"expected {_EXPECTED} in {TOKEN}, got {len(token)} characters")
    return token, not os.environ.get(TOKEN)


@dataclass(frozen=True)
class Denial:
    """The answer to a client that is refused: an HTTP `status`, and why, with the remedy."""

    status: HTTPStatus
    reason: str


@dataclass(frozen=True)
class AccessCheck:
    """Checks the requests to a server that listens at `address` and was requested at `host`.

    A `Refusal` where other machines reach it and the token is too short, or of other characters.
    """

    access: Access
    host: str
    address: str

    def __post_init__(self) -> None:
        if self.networked and not _FORM.fullmatch(self.access.token):
            raise Refusal(
                f"other machines reach {self.host}, so expected {_EXPECTED} in {TOKEN}, got "
                f"{len(self.access.token)} characters; without {TOKEN} in the environment a token "
                "is made"
            )

    @property
    def networked(self) -> bool:
        """Whether other machines may reach the server."""
        return not _is_loopback(self.address)

    def invitation(self, scheme: str, port: int) -> str:
        """What a person has to know of a server that other machines reach; empty for others."""
        if not self.networked:
            return ""
        everywhere = self.address in ("0.0.0.0", "::")
        host = socket.gethostname() if everywhere else self.host
        host = f"[{host}]" if ":" in host else host
        return (
            "other machines can connect, unencrypted, with the token: open "
            f"{scheme}://{host}:{port}/?token={self.access.token}"
        )

    def denial(self, target: str, hosts: Sequence[str], origins: Sequence[str]) -> Denial | None:
        """Why a request is refused, None if it is not.

        `target` is the path with its query, `hosts` and `origins` are all headers Host and Origin.
        """
        return self._of_host(hosts) or self._of_origin(origins) or self._of_token(target)

    def _of_host(self, hosts: Sequence[str]) -> Denial | None:
        found = _AUTHORITY.fullmatch(hosts[0].lower()) if len(hosts) == 1 else None
        host = found[1].strip("[]") if found else ""
        if _is_loopback(host) or (host and host in self._names):
            return None
        if self.networked and _parsed(host) is not None:
            return None  # an address is no name that somebody may have given to this machine
        name = f"the host {host}" if host else "an invalid Host"
        return Denial(
            HTTPStatus.FORBIDDEN,
            f"refused a request for {name}; connect to localhost or an address of this machine, "
            "or start the server at that name",
        )

    @property
    def _names(self) -> set[str]:
        """Names that are this server's."""
        if not self.networked:
            return {self.host}
        name = socket.gethostname().lower()
        short = name.partition(".")[0]
        return {self.host, name, short, f"{short}.local"}

    def _of_origin(self, origins: Sequence[str]) -> Denial | None:
        if not origins:
            return None  # no browser
        origin = origins[0].lower() if len(origins) == 1 else ""
        found = _ORIGIN.fullmatch(origin)
        if found and (origin in self.access.origins or _of_this_machine(*found.groups())):
            return None
        what, remedy = "an invalid Origin", "connect with another program"
        if found:
            what = f"a web page of {origin}"
            remedy = f"to allow it, add --allow-origin {origin} (Allowed pages in the app)"
        elif origin == "null":
            what = "a web page without an origin, such as a local file or a sandboxed frame"
            remedy = "open the page from a server of this machine, http://localhost"
        return Denial(HTTPStatus.FORBIDDEN, f"refused {what}; {remedy}")

    def _of_token(self, target: str) -> Denial | None:
        if not self.networked or hmac.compare_digest(_given(target), self.access.token.encode()):
            return None
        return Denial(
            HTTPStatus.UNAUTHORIZED,
            "refused a client without the token; open the address with ?token= that the server "
            "shows",
        )


def _given(target: str) -> bytes:
    """The token in the query of a request."""
    try:
        values = parse_qs(urlsplit(target).query, max_num_fields=_FIELDS).get("token", [""])
    except ValueError:
        return b""
    return values[0].encode(errors="replace")


def _of_this_machine(scheme: str | None, host: str | None) -> bool:
    return scheme in ("http", "https") and _is_loopback((host or "").strip("[]"))


def _is_loopback(host: str) -> bool:
    address = _parsed(host)
    return host == "localhost" or (address is not None and address.is_loopback)


def _parsed(host: str) -> "ipaddress.IPv4Address | ipaddress.IPv6Address | None":
    try:
        return ipaddress.ip_address(host)
    except ValueError:
        return None
