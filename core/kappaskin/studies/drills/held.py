"""What a process holds: threads, descriptors, processes and memory."""

import os
import threading
from dataclasses import dataclass
from pathlib import Path

_PAGE = 4096


@dataclass(frozen=True)
class Held:
    """Threads, open descriptors, child processes and resident bytes; 0 where it cannot be told."""

    threads: int
    descriptors: int
    processes: int
    memory: int

    @classmethod
    def now(cls) -> "Held":
        """Of this process."""
        own = Path("/proc/self")
        if not (own / "fd").exists():
            return cls(threading.active_count(), 0, 0, 0)
        children = (own / "task" / str(os.getpid()) / "children").read_text().split()
        resident = int((own / "statm").read_text().split()[1])
        return cls(
            threading.active_count(), len(os.listdir(own / "fd")), len(children), resident * _PAGE
        )

    def leaked(self, since: "Held", memory: int) -> list[tuple[bool, str]]:
        """Claims that nothing was added, but for so many bytes of `memory`."""
        grown = self.memory - since.memory
        return [
            (self.threads <= since.threads, f"{self.threads - since.threads} threads leaked"),
            (
                self.descriptors <= since.descriptors,
                f"{self.descriptors - since.descriptors} descriptors leaked",
            ),
            (self.processes <= since.processes, "a process leaked"),
            (grown <= memory, f"memory grew by {grown / 2**20:.1f} MiB"),
        ]
