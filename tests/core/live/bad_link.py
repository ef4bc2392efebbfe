"""A connection as between two rooms: late, with losses that TCP repairs, and cut for a while."""

import random
import socket
import threading
import time
from collections import deque
from contextlib import suppress

_REPAIR = 0.2  # s that a chunk is late which is lost once
_CHUNK = 1400  # bytes, as in a packet


class BadLink:
    """Listens at a `port` of this machine, and carries all to another one, `delay` s late.

    A `loss` is the share of chunks that come 0.2 s later still, and all behind them, as TCP repairs
    losses. While it is `cut` nothing passes, of old connections and of new ones.
    """

    def __init__(self, to: int, delay: float = 0.0, loss: float = 0.0) -> None:
        self._to, self.delay, self.loss = to, delay, loss
        self.cut = threading.Event()
        self._over, self._random = threading.Event(), random.Random(1)
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listener.getsockname()[1])
        self._open: list[socket.socket] = []
        self._threads: list[threading.Thread] = []
        self._run(self._accept)

    def _run(self, target, *about) -> None:
        self._threads.append(threading.Thread(target=target, args=about, daemon=True))
        self._threads[-1].start()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                ours, _ = self._listener.accept()
                there = socket.create_connection(("127.0.0.1", self._to))
                for one in (ours, there):
                    one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._open += [ours, there]
                for way in ((ours, there), (there, ours)):
                    self._run(self._carry, *way)

    def _carry(self, begin: socket.socket, end: socket.socket) -> None:
        under_way: deque[tuple[float, bytes]] = deque()
        begin.settimeout(0.002)
        last, open_ = 0.0, True
        while (open_ or under_way) and not self._over.is_set():
            try:
                if open_ and (data := begin.recv(_CHUNK)):
                    late = self.delay + _REPAIR * (self._random.random() < self.loss)
                    last = max(last, time.monotonic() + late)
                    under_way.append((last, data))
                elif open_:
                    open_ = False
                else:
                    time.sleep(0.002)
            except TimeoutError:
                pass
            except OSError:
                open_ = False
            while under_way and under_way[0][0] <= time.monotonic() and not self.cut.is_set():
                try:
                    end.sendall(under_way.popleft()[1])
                except OSError:
                    open_ = False
                    under_way.clear()
        with suppress(OSError):
            end.shutdown(socket.SHUT_WR)

    def close(self) -> None:
        self._over.set()
        self._listener.shutdown(socket.SHUT_RDWR)
        for one in (self._listener, *self._open):
            one.close()
        for thread in self._threads:
            thread.join()

    def __enter__(self) -> "BadLink":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
