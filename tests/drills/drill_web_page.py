"""Web pages and idle clients: who reads the skin from a browser, and who keeps others out.

Pages are opened in every browser on the path, without a window, by names that lead to this machine.
Foxglove's own client comes from the npm registry.
"""

import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from queue import Empty, Queue
from threading import Thread
from urllib.parse import unquote, urlsplit

import pytest
from websockets.sync.client import connect

ENOUGH = 60.0  # s for a browser to start and for its page to say what came
BROWSERS = {
    "chromium": ("chromium", "chromium-browser", "google-chrome"),
    "firefox": ("firefox", "firefox-esr"),
}
TOKEN = "a-token-of-this-drill"
LIBRARY = ("@foxglove/ws-protocol@0.8.0", "ws@8")
_PREFERENCES = (
    'user_pref("network.dns.localDomains", "evil.example,allowed.example");\n'
    'user_pref("browser.shell.checkDefaultBrowser", false);\n'
    'user_pref("datareporting.policy.dataSubmissionEnabled", false);\n'
)

# A page opens what `to` names, and says what came of it by the address of an image.
_SOCKET = """<script>
const to = new URLSearchParams(location.search).get("to");
const say = (text) => new Image().src = "http://127.0.0.1:{PORT}/said?" + encodeURIComponent(text);
if (to.startsWith("http")) {
  fetch(to).then((got) => got.text()).then((text) => say("read " + text), () => say("refused"));
} else {
  const one = new WebSocket(to, ["foxglove.sdk.v1"]);
  one.onmessage = (event) => { one.onclose = null; say("read " + event.data); one.close(); };
  one.onclose = () => say("refused");
}
</script>"""
_FRAME = """<iframe sandbox="allow-scripts"></iframe><script>
document.querySelector("iframe").src = "/socket" + location.search;
</script>"""
_CLIENT = """<script type="importmap">
{"imports": {"eventemitter3": "/eventemitter3/dist/eventemitter3.esm.js"}}
</script><script type="module">
import FoxgloveClient from "/@foxglove/ws-protocol/dist/esm/src/FoxgloveClient.js";
const say = (text) => new Image().src = "http://127.0.0.1:{PORT}/said?" + encodeURIComponent(text);
const to = new URLSearchParams(location.search).get("to");
const ws = new WebSocket(to, [FoxgloveClient.SUPPORTED_SUBPROTOCOL]);
const client = new FoxgloveClient({ ws });
client.on("error", (error) => say("refused " + error));
client.on("advertise", (channels) => {
  client.subscribe(channels.find((channel) => channel.topic === "/contact").id);
});
client.on("message", (event) => {
  say("read " + new TextDecoder().decode(event.data));
  client.close();
});
</script>"""
_PROGRAM = """
const { FoxgloveClient } = require("@foxglove/ws-protocol");
const { WebSocket } = require("ws");
const ws = new WebSocket(process.argv[2], [FoxgloveClient.SUPPORTED_SUBPROTOCOL]);
const client = new FoxgloveClient({ ws });
client.on("error", (error) => { console.log("refused", error.message); process.exit(); });
client.on("advertise", (channels) => {
  client.subscribe(channels.find((channel) => channel.topic === "/contact").id);
});
client.on("message", (event) => {
  console.log("read", new TextDecoder().decode(event.data));
  process.exit();
});
"""


class Pages:
    """Serves pages at every name of this machine; `said` has what they say."""

    def __init__(self) -> None:
        self.said: Queue[str] = Queue()
        self.folder = Path()
        pages = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                pages.answer(self)

            def log_message(self, *_: object) -> None:
                pass

        self.server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.port = self.server.server_address[1]
        self.thread = Thread(target=self.server.serve_forever)
        self.thread.start()

    def answer(self, request: BaseHTTPRequestHandler) -> None:
        path, query = urlsplit(request.path)[2:4]
        if path == "/said":
            self.said.put(unquote(query))
        shown = {"/socket": _SOCKET, "/frame": _FRAME, "/client": _CLIENT}.get(path, "")
        kind, body = "text/html", shown.replace("{PORT}", str(self.port)).encode()
        if self.folder.name and not shown:
            kind, body = "text/javascript", self._script(path.lstrip("/"))
        request.send_response(200)
        request.send_header("Content-Type", kind)
        request.end_headers()
        with suppress(OSError):
            request.wfile.write(body)

    def _script(self, path: str) -> bytes:
        """A file of the library, whose modules name each other without a suffix."""
        for name in (path, f"{path}.js"):
            if (file := self.folder / name).is_file():
                return file.read_bytes()
        return b""

    def close(self) -> None:
        self.server.shutdown()
        self.server.server_close()
        self.thread.join()


@pytest.fixture
def pages() -> Iterator[Pages]:
    made = Pages()
    yield made
    made.close()


@pytest.fixture(params=BROWSERS)
def browse(request: pytest.FixtureRequest, tmp_path: Path, pages: Pages) -> Callable[[str], str]:
    """Opens an address in a browser, and returns what its page says."""
    browser = next(filter(None, map(shutil.which, BROWSERS[request.param])), None)
    if browser is None:
        pytest.skip(f"no {request.param} is on the path: install it to try its pages")
    if request.param == "firefox":
        (tmp_path / "user.js").write_text(_PREFERENCES)
        command = [browser, "--headless", "--no-remote", "--profile", str(tmp_path)]
    else:
        names = "--host-resolver-rules=MAP *.example 127.0.0.1"
        command = [browser, "--headless=new", "--no-sandbox", "--disable-gpu", names]
        command.append(f"--user-data-dir={tmp_path}")

    def said(address: str) -> str:
        with _running([*command, address]):
            try:
                return pages.said.get(timeout=ENOUGH)
            except Empty:
                return "nothing"

    return said


@contextmanager
def _running(command: list[str]) -> Iterator[subprocess.Popen[str]]:
    """A process that is ended with all that it started."""
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, start_new_session=True, **quiet) as process:
        try:
            yield process
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGTERM)
            try:
                process.communicate(timeout=10)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)


@contextmanager
def publishing(*options: str, host: str = "127.0.0.1") -> Iterator[tuple[int, "Queue[str]"]]:
    """`kappaskin publish` at a free port; the lines of its standard error."""
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        port = found.getsockname()[1]
    words = ["publish", "sim:centre", "--foxglove", f"{host}:{port}", *options]
    lines: Queue[str] = Queue()
    with _running([sys.executable, "-m", "kappaskin", *words]) as process:
        reader = Thread(target=lambda: [lines.put(line) for line in process.stderr])
        reader.start()
        end = time.monotonic() + ENOUGH
        while not _listens(port) and time.monotonic() < end:
            time.sleep(0.05)
        yield port, lines
        process.send_signal(signal.SIGTERM)
        reader.join(ENOUGH)


def _listens(port: int) -> bool:
    with socket.socket() as one:
        return one.connect_ex(("127.0.0.1", port)) == 0


# Pages. Each has the host of its address, its kind, what it opens, and whether it reads.

_PAGES = {
    "a page of this machine": ("localhost", "socket", "ws://127.0.0.1", True),
    "the same by another name": ("127.0.0.1", "socket", "ws://localhost", True),
    "a page that is allowed": ("allowed.example", "socket", "ws://127.0.0.1", True),
    "a foreign page": ("evil.example", "socket", "ws://127.0.0.1", False),
    "a foreign page to localhost": ("evil.example", "socket", "ws://localhost", False),
    "a foreign page that fetches": ("evil.example", "socket", "http://127.0.0.1", False),
    "a name made to point here": ("evil.example", "socket", "ws://evil.example", False),
    "an allowed page with such a name": (
        "allowed.example",
        "socket",
        "ws://allowed.example",
        False,
    ),
    "a sandboxed frame of this machine": ("localhost", "frame", "ws://127.0.0.1", False),
}


@pytest.mark.parametrize("name", _PAGES)
def test_a_page_reads_the_skin_only_if_it_may(browse, pages: Pages, name: str) -> None:
    host, kind, to, reads = _PAGES[name]
    origin = f"http://allowed.example:{pages.port}"
    with publishing("--allow-origin", origin) as (port, lines):
        said = browse(f"http://{host}:{pages.port}/{kind}?to={to}:{port}")
    if reads:
        assert said.startswith('read {"op": "serverInfo"')
        assert lines.empty()
    else:
        assert said == "refused"
    names = f"--allow-origin http://evil.example:{pages.port} " in "".join(lines.queue)
    assert names == (host == "evil.example" != urlsplit(to).hostname)


def test_a_local_file_has_no_origin_to_allow(browse, pages: Pages, tmp_path: Path) -> None:
    file = tmp_path / "page.html"
    file.write_text(_SOCKET.replace("{PORT}", str(pages.port)))
    with publishing() as (port, lines):
        assert browse(f"file://{file}?to=ws://127.0.0.1:{port}") == "refused"
    assert "a web page without an origin" in "".join(lines.queue)


@pytest.mark.parametrize("query", ["", "?token=another-token-than-that", f"?token={TOKEN}"])
def test_where_other_machines_connect_a_page_needs_the_token(
    browse, pages: Pages, monkeypatch, query: str
) -> None:
    monkeypatch.setenv("KAPPASKIN_TOKEN", TOKEN)
    with publishing(host="0.0.0.0") as (port, lines):
        to = f"ws://127.0.0.1:{port}/{query}"
        said = browse(f"http://localhost:{pages.port}/socket?to={to}")
    told = "".join(lines.queue)
    assert f":{port}/?token={TOKEN}\n" in told
    assert said.startswith("read") == (query == f"?token={TOKEN}")
    assert ("refused a client without the token" in told) != said.startswith("read")


# Foxglove's own client


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    npm, folder = shutil.which("npm"), tmp_path_factory.mktemp("npm")
    if npm is None:
        pytest.skip("npm is not on the path: install Node.js to try Foxglove's own client")
    command = [npm, "install", "--prefix", str(folder), *LIBRARY]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    if done.returncode:
        pytest.skip(f"npm could not install {LIBRARY[0]}: {done.stderr.splitlines()[-1:]}")
    return folder / "node_modules"


def test_foxglove_s_client_reads_contacts_in_a_page(browse, pages: Pages, library: Path) -> None:
    pages.folder = library
    with publishing() as (port, lines):
        here = browse(f"http://localhost:{pages.port}/client?to=ws://127.0.0.1:{port}")
        assert re.match(r'read {"kind":"contact"', here)
        assert lines.empty()
        there = browse(f"http://evil.example:{pages.port}/client?to=ws://127.0.0.1:{port}")
    assert there == "refused Error: WebSocket error"


def test_foxglove_s_client_reads_contacts_in_a_program(library: Path, monkeypatch) -> None:
    monkeypatch.setenv("KAPPASKIN_TOKEN", TOKEN)
    program = library.parent / "program.cjs"
    program.write_text(_PROGRAM)

    def said(url: str) -> str:
        command = ["node", str(program), url]
        return subprocess.run(command, capture_output=True, text=True, timeout=ENOUGH).stdout

    with publishing() as (port, _):
        assert said(f"ws://localhost:{port}").startswith('read {"kind":"contact"')
    with publishing(host="0.0.0.0") as (port, _):
        assert "401" in said(f"ws://127.0.0.1:{port}")
        assert said(f"ws://127.0.0.1:{port}/?token={TOKEN}").startswith("read")


# Idle connections

_HELLO = (
    b"GET / HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n"
    b"Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n"
)


@pytest.mark.parametrize("said", [b"", b"GET / HTTP/1.1\r\nX: ", _HELLO], ids=["", "part", "all"])
def test_200_idle_connections_keep_no_viewer_out_and_go_within_15_s(said: bytes) -> None:
    with publishing() as (port, _):
        began = time.monotonic()
        idle = [socket.create_connection(("127.0.0.1", port)) for _ in range(200)]
        for one in idle:
            with suppress(OSError):  # it has made room
                one.sendall(said)
        with connect(f"ws://127.0.0.1:{port}", subprotocols=["foxglove.sdk.v1"]) as viewer:
            viewer.send('{"op": "subscribe", "subscriptions": [{"id": 7, "channelId": 1}]}')
            while isinstance(viewer.recv(2.0), str):
                pass
            assert time.monotonic() - began < 5.0
            while idle and time.monotonic() - began < 16.0:  # 15 s, and a busy machine's second
                assert viewer.recv(2.0)
                idle = [one for one in idle if not _is_over(one)]
            assert idle == []
            assert viewer.recv(2.0)


def _is_over(one: socket.socket) -> bool:
    """Whether the server closed the connection; what came before is read."""
    one.setblocking(False)
    try:
        while one.recv(4096):
            pass
    except BlockingIOError:
        return False
    except ConnectionResetError:
        pass
    one.close()
    return True
