import pytest
from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QApplication

from kappaskin_app import guard


class Sender(QObject):
    sent = Signal(int)


@pytest.mark.fails_inside
def test_an_exception_in_a_slot_is_told_and_the_next_call_works(qapp: QApplication, caplog) -> None:
    told, got, sender = [], [], Sender()

    def slot(value: int) -> None:
        if value < 0:
            raise RuntimeError("below zero")
        got.append(value)

    guard.on_failure(told.append)
    sender.sent.connect(guard.guarded(slot))
    sender.sent.emit(-1)
    sender.sent.emit(1)
    guard.forget(told.append)
    assert told == ["Error in the program: below zero"]
    assert got == [1]
    assert "below zero" in caplog.text
