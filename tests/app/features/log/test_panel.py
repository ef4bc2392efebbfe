import logging
import threading
from collections.abc import Iterator

import pytest
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QApplication

from kappaskin_app.features.log.panel import LogBuffer, LogPanel
from kappaskin_app.guard import log


@pytest.fixture
def panel(qapp: QApplication) -> Iterator[LogPanel]:
    log_buffer = LogBuffer()
    made = LogPanel(log_buffer)
    made.show()
    yield made
    made.close()
    made.deleteLater()
    log_buffer.close()


def listed(panel: LogPanel) -> list[tuple[str, str]]:
    rows = range(panel.table.rowCount())
    return [(panel.table.item(row, 1).text(), panel.table.item(row, 2).text()) for row in rows]


def write() -> None:
    log.info("Saved a.png")
    log.warning("no log is written")
    try:
        raise ValueError("no such thing")
    except ValueError as error:
        log.error("in a slot", exc_info=error)


def test_what_is_logged_is_listed_newest_first(panel: LogPanel) -> None:
    panel.look()
    assert panel.nothing.isVisible()
    assert not panel.copy.isEnabled()
    write()
    panel.look()
    assert listed(panel) == [
        ("error", "in a slot: ValueError: no such thing"),
        ("warning", "no log is written"),
        ("info", "Saved a.png"),
    ]
    assert panel.table.item(0, 0).text().count(":") == 2
    assert not panel.nothing.isVisible()


@pytest.mark.parametrize(("chosen", "count"), [(0, 3), (1, 2), (2, 1)])
def test_only_what_is_as_grave_as_asked_for_is_listed(
    panel: LogPanel, chosen: int, count: int
) -> None:
    write()
    panel.level.setCurrentIndex(chosen)
    panel.look()
    assert len(listed(panel)) == count


def test_what_is_listed_is_copied_with_where_it_came_from(panel: LogPanel) -> None:
    write()
    panel.level.setCurrentIndex(2)
    panel.copy.click()
    text = QGuiApplication.clipboard().text()
    assert "Traceback" in text
    assert "Saved a.png" not in text


def test_what_is_cleared_is_gone_and_what_comes_then_is_listed(panel: LogPanel) -> None:
    write()
    panel.look()
    panel.clear.click()
    assert listed(panel) == []
    write()
    panel.look()
    assert len(listed(panel)) == 3


def test_lines_of_other_threads_and_libraries_are_listed_and_only_the_last_are_kept(
    panel: LogPanel,
) -> None:
    beside = threading.Thread(target=lambda: logging.getLogger("qt").warning("said by Qt"))
    beside.start()
    beside.join()
    panel.look()
    assert listed(panel) == [("warning", "said by Qt")]
    for number in range(1010):
        log.info("%d", number)
    panel.look()
    assert len(listed(panel)) == 1000
    assert listed(panel)[0] == ("info", "1009")


def test_once_closed_nothing_is_kept_and_logging_is_as_before() -> None:
    handlers, level = list(logging.getLogger().handlers), log.level
    log_buffer = LogBuffer()
    log_buffer.close()
    log.warning("afterwards")
    assert not log_buffer.lines
    assert (logging.getLogger().handlers, log.level) == (handlers, level)


def test_a_line_that_cannot_be_written_does_not_end_who_logged_it(
    panel: LogPanel, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(logging, "raiseExceptions", False)  # or each handler prints it
    logging.getLogger("another").warning("%d of them", "many")
    panel.look()
    assert listed(panel) == []
