"""Who may connect to a server: names of the host, origins of web pages, the token."""

import os
import subprocess
import sys
from collections.abc import Iterator
from http import HTTPStatus

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin import Refusal
from kappaskin.publish import Access, access_of
from kappaskin.publish import access as module
from kappaskin.publish.access import TOKEN, AccessCheck

SECRET = "0123456789abcdef"
FOXGLOVE = "https://app.foxglove.dev"
HERE = AccessCheck(Access((FOXGLOVE, "file://")), "127.0.0.1", "127.0.0.1")
EVERYWHERE = AccessCheck(Access((FOXGLOVE,), SECRET), "0.0.0.0", "0.0.0.0")


def status(check: AccessCheck, host: str = "localhost", *origins: str, target: str = "/") -> object:
    """The status of a refusal, or None."""
    denial = check.denial(target, [host], origins)
    return denial and denial.status.value


@pytest.fixture(autouse=True, scope="module")
def named() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("socket.gethostname", lambda: "Robot.lab.example")
        yield


# The name of the host


LOOPBACK = ("localhost", "LOCALHOST:8765", "127.0.0.1", "127.0.0.1:8765", "127.9.9.9", "[::1]:8765")
INVALID = ("", "a b", "evil@localhost", "localhost:", "localhost:999999", "[::1", "::1", "a" * 254)


@pytest.mark.parametrize("host", LOOPBACK)
def test_a_client_of_this_machine_connects(host: str) -> None:
    assert status(HERE, host) is None
    assert status(EVERYWHERE, host, target=f"/?token={SECRET}") is None


@pytest.mark.parametrize(
    "host",
    ["evil.example", "evil.example:8765", "localhost.evil.example", "127.0.0.1.evil.example"],
)
def test_a_name_that_somebody_let_point_here_is_refused(host: str) -> None:
    for check in (HERE, EVERYWHERE):
        denial = check.denial(f"/?token={SECRET}", [host], [])
        assert denial.status == HTTPStatus.FORBIDDEN
        assert f"for the host {host.partition(':')[0]}; connect to" in denial.reason


@pytest.mark.parametrize("host", INVALID)
def test_what_is_no_host_is_refused_and_not_repeated(host: str) -> None:
    denial = HERE.denial("/", [host], [])
    assert denial.status == HTTPStatus.FORBIDDEN
    assert "an invalid Host;" in denial.reason


def test_a_request_has_one_host() -> None:
    assert HERE.denial("/", [], []).status == HTTPStatus.FORBIDDEN
    assert HERE.denial("/", ["localhost", "localhost"], []).status == HTTPStatus.FORBIDDEN


def test_the_name_asked_for_is_this_server_s() -> None:
    named = AccessCheck(Access(), "skin.example", "127.0.1.1")
    assert status(named, "skin.example:8765") is None
    assert status(named, "Skin.Example") is None
    assert status(named, "robot") == 403


@pytest.mark.parametrize("host", ["192.0.2.7:8765", "[2001:db8::7]:8765", "robot", "robot.local"])
def test_where_other_machines_connect_addresses_and_the_machine_s_name_do(host: str) -> None:
    assert status(EVERYWHERE, host, target=f"/?token={SECRET}") is None
    assert status(EVERYWHERE, "robot.lab.example", target=f"/?token={SECRET}") is None
    assert status(HERE, host) == 403


# Origins of web pages


@pytest.mark.parametrize(
    "origin",
    ["http://localhost", "http://localhost:3000", "https://127.0.0.1:8443", "http://[::1]:8080"],
)
def test_a_page_of_this_machine_connects(origin: str) -> None:
    assert status(HERE, "localhost", origin) is None


def test_a_page_that_is_allowed_connects() -> None:
    assert status(HERE, "localhost", FOXGLOVE) is None
    assert status(HERE, "localhost", "file://") is None


@pytest.mark.parametrize(
    "origin",
    [
        *("https://evil.example", "http://evil.example:8765", "https://app.foxglove.dev:444"),
        *("http://app.foxglove.dev", "https://app.foxglove.dev.evil.example"),
        *("http://localhost.evil.example", "http://127.0.0.1.evil.example", "app://localhost"),
        *("http://0.0.0.0:8765", "http://192.168.1.7", "vscode-webview://x1"),
    ],
)
def test_any_other_page_is_refused_with_the_option_that_allows_it(origin: str) -> None:
    denial = HERE.denial("/", ["localhost"], [origin])
    assert denial.status == HTTPStatus.FORBIDDEN
    assert f" add --allow-origin {origin} (" in denial.reason
    assert status(AccessCheck(access_of([origin]), "a", "127.0.0.1"), "localhost", origin) is None


@pytest.mark.parametrize(
    ("origin", "words"),
    [
        *(("null", "without an origin"), ("", "an invalid Origin")),
        *(("https://a/; rm", "an invalid Origin"), ("https://a`b`", "an invalid Origin")),
        *(("https://\x1b[31m", "an invalid Origin"), ("localhost", "an invalid Origin")),
        *(("http://a@localhost", "an invalid Origin"), ("*", "an invalid Origin")),
    ],
)
def test_what_no_option_can_allow_suggests_none(origin: str, words: str) -> None:
    denial = HERE.denial("/", ["localhost"], [origin])
    assert denial.status == HTTPStatus.FORBIDDEN
    assert words in denial.reason
    assert "--allow-origin" not in denial.reason
    assert origin in ("null", "", "*", "localhost") or origin not in denial.reason


def test_a_page_has_one_origin() -> None:
    assert HERE.denial("/", ["localhost"], [FOXGLOVE, FOXGLOVE]).status == HTTPStatus.FORBIDDEN


@pytest.mark.parametrize(
    "text", ["null", "*", "", "app.foxglove.dev", "https://", "https://a/b", "https://a b", "file:"]
)
def test_what_is_no_origin_cannot_be_allowed(text: str) -> None:
    with pytest.raises(Refusal, match=r"expected the origin .* https://app\.foxglove\.dev, got"):
        access_of([text])


def test_an_origin_is_allowed_as_a_browser_writes_it() -> None:
    texts = [" HTTPS://App.Foxglove.dev/ ", "file:///", "http://[::1]:1"]
    assert access_of(texts).origins == (FOXGLOVE, "file://", "http://[::1]:1")


# The token


@pytest.mark.parametrize(
    "target",
    [
        *("/", "/?token=", "/?token=0123456789abcdeF", f"/?token={SECRET}0", f"/?Token={SECRET}"),
        *(f"/{SECRET}", f"/#?token={SECRET}", f"/?token=x&token={SECRET}", "/?" + "&" * 99),
        *("/?token=%ff%00", "/?token=\udcff", "//[", "/?token=\xe9"),
    ],
)
def test_without_the_token_no_other_machine_connects(target: str) -> None:
    denial = EVERYWHERE.denial(target, ["192.0.2.7"], [])
    assert denial.status == HTTPStatus.UNAUTHORIZED
    assert SECRET not in denial.reason


def test_who_has_the_token_connects_and_a_page_has_to_be_allowed_too() -> None:
    assert status(EVERYWHERE, "192.0.2.7", target=f"/?a=1&token={SECRET}") is None
    with_it = f"/?token={SECRET}"
    assert status(EVERYWHERE, "192.0.2.7", FOXGLOVE, target=with_it) is None
    assert status(EVERYWHERE, "192.0.2.7", "https://evil.example", target=with_it) == 403


def test_this_machine_needs_none() -> None:
    assert status(HERE, target="/anything?token=wrong") is None
    assert HERE.invitation("ws", 8765) == ""


def test_it_is_compared_in_constant_time(monkeypatch) -> None:
    seen: list[tuple[bytes, bytes]] = []
    monkeypatch.setattr(module.hmac, "compare_digest", lambda a, b: seen.append((a, b)) or True)
    assert status(EVERYWHERE, target="/?token=guess") is None
    assert seen == [(b"guess", SECRET.encode())]


@pytest.mark.parametrize(
    ("host", "address", "url"),
    [
        ("0.0.0.0", "0.0.0.0", "ws://Robot.lab.example:8765/?token="),
        ("::", "::", "ws://Robot.lab.example:8765/?token="),
        ("192.0.2.7", "192.0.2.7", "ws://192.0.2.7:8765/?token="),
        ("2001:db8::7", "2001:db8::7", "ws://[2001:db8::7]:8765/?token="),
        ("skin.example", "192.0.2.7", "ws://skin.example:8765/?token="),
    ],
)
def test_the_url_with_the_token_is_told_where_other_machines_connect(host, address, url) -> None:
    check = AccessCheck(Access((), SECRET), host, address)
    assert check.invitation("ws", 8765) == (
        f"other machines can connect, unencrypted, with the token: open {url}{SECRET}"
    )


@pytest.mark.parametrize("token", ["", "short", "0123456789abcde!", "x" * 129])
def test_a_token_that_is_none_lets_nobody_in(token: str) -> None:
    with pytest.raises(Refusal, match=rf"got {len(token)} characters; without {TOKEN}"):
        AccessCheck(Access((), token), "0.0.0.0", "0.0.0.0")
    AccessCheck(Access((), token), "localhost", "::1")


_SOME = st.text() | st.sampled_from(["localhost", "null", FOXGLOVE, "http://[::1]", "/?token=%"])


@given(_SOME, st.lists(_SOME, max_size=2), st.lists(_SOME, max_size=2))
def test_any_request_is_let_in_or_refused_in_words_of_one_line(target, hosts, origins) -> None:
    for check in (HERE, EVERYWHERE):
        denial = check.denial(target, hosts, origins)
        assert denial is None or denial.reason.isprintable()


@pytest.mark.slow
@pytest.mark.parametrize("set_to", [SECRET, ""])
def test_the_environment_has_the_token_or_it_is_made_once(set_to: str) -> None:
    words = "from kappaskin.publish import access_of as a; print(a().token, a() == a(), a())"
    command, environment = [sys.executable, "-c", words], {**os.environ, TOKEN: set_to}
    told = [
        subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout
        for _ in range(2)
    ]
    (one, same, shown), (other, _, _) = (each.split(maxsplit=2) for each in told)
    assert same == "True"
    assert one not in shown
    assert (one == other == SECRET) if set_to else (one != other and len(one) >= 22)
