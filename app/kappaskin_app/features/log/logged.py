"""What the program logs while a window is open, kept to be shown there."""

import logging
import time
from collections import deque
from dataclasses import dataclass

from kappaskin_app.guard import log

_KEPT = 1000


@dataclass(frozen=True)
class LogLine:
    """What was logged at `time` (s since 1970), how grave it is, its first line and all of it."""

    time: float
    level: int
    text: str
    whole: str

    @property
    def clock(self) -> str:
        return time.strftime("%H:%M:%S", time.localtime(self.time))

    @property
    def word(self) -> str:
        return logging.getLevelName(self.level).lower()


class Logged(logging.Handler):
    """Keeps the last `lines`, of which there were `count` ever, from any thread, until closed."""

    def __init__(self) -> None:
        super().__init__()
        self.setFormatter(logging.Formatter("%(message)s"))
        self.lines: deque[LogLine] = deque(maxlen=_KEPT)
        self.count = 0
        self._level = log.level
        log.setLevel(logging.INFO)  # what is said in passing too
        logging.getLogger().addHandler(self)

    def emit(self, record: logging.LogRecord) -> None:
        try:
            text, whole = record.getMessage().partition("\n")[0], self.format(record)
        except Exception:  # what does not fit its own words; who logged it is to go on
            self.handleError(record)
            return
        error = record.exc_info[1] if record.exc_info else None
        if error is not None:
            text += f": {type(error).__name__}: {error}".partition("\n")[0]
        self.lines.append(LogLine(record.created, record.levelno, text, whole))
        self.count += 1

    def clear(self) -> None:
        self.lines.clear()
        self.count += 1  # so that whoever looks sees that it is something else

    def close(self) -> None:
        logging.getLogger().removeHandler(self)
        log.setLevel(self._level)
        super().close()
