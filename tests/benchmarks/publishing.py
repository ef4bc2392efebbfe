"""The window on a port, publishing for some seconds; prints how late messages were as JSON."""

import json
import socket
import sys
import time
from urllib.parse import urlsplit

import numpy as np
from PySide6.QtCore import QTimer

from kappaskin_app.launch import opened

SETTLE = 6.0
PARTS = ("whole", "wait", "compute", "send")


def deafened(target: str) -> socket.socket:
    """A client of the WebSocket server at `target` that asks for everything, and reads nothing."""
    address = urlsplit(target)
    made = socket.create_connection((address.hostname or "127.0.0.1", address.port))
    made.sendall(
        b"GET / HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        b"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n"
        b"Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n"
    )
    for number in range(1, 8):
        pair = {"id": number, "channelId": number}
        words = json.dumps({"op": "subscribe", "subscriptions": [pair]}).encode()
        made.sendall(b"\x81" + bytes([0x80 | len(words)]) + bytes(4) + words)
    return made


def published(port: str, seconds: float, deaf: bool, targets: list[str]) -> dict[str, float]:
    """99th percentiles in ms, and messages a second."""
    application, window = opened(port)
    window.session.engine.publish(targets)
    made: list[socket.socket] = []
    if deaf:
        QTimer.singleShot(3000, lambda: made.append(deafened(targets[-1])))
    latencies: list[list[float]] = []
    begun: list[object] = []

    def look() -> None:
        latency = window.session.status.publishing.latency
        latencies.append([1e3 * getattr(latency, part) for part in PARTS])

    timer = QTimer()
    timer.timeout.connect(look)
    QTimer.singleShot(round(SETTLE * 1e3), lambda: begun.append(window.session.status))
    QTimer.singleShot(round(SETTLE * 1e3), lambda: timer.start(1000))
    QTimer.singleShot(round((SETTLE + seconds) * 1e3), application.quit)
    application.exec()
    timer.stop()
    now, status, before = time.monotonic(), window.session.status, begun[0]
    drawn = sum(when > now - seconds for when, _ in window.features["membrane"].membrane.ages)
    window.close()
    for each in made:
        each.close()
    after, earlier = status.publishing.targets, before.publishing.targets

    def a_second(name: str) -> float:
        gained = [getattr(x, name) - getattr(y, name) for x, y in zip(after, earlier, strict=True)]
        return sum(gained) / seconds

    return {
        **dict(zip(PARTS, np.median(latencies, axis=0).tolist(), strict=True)),
        "sent": a_second("sent"),
        "dropped": a_second("dropped"),
        "frames": (status.accounting.accepted - before.accounting.accepted) / seconds,
        "drawn": drawn / seconds,
    }


if __name__ == "__main__":
    port, seconds, deaf, *targets = sys.argv[1:]
    told = published(port, float(seconds), deaf == "deaf", targets)
    print(json.dumps(told))
