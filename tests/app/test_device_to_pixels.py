"""The whole way on real bytes: a device's own process, its port, the engine, the window."""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator

import numpy as np
import pytest

PERIOD, RADIUS = 4.0, 0.022


class Device:
    """`kappaskin device` as its own process."""

    def __init__(self) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "kappaskin", "device", "circle", "--rate", "500"],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert self.process.stdout is not None
        self.port = json.loads(self.process.stdout.readline())["port"]

    def stop(self, number: int = signal.SIGTERM) -> str:
        self.process.send_signal(number)
        _, told = self.process.communicate(timeout=30)
        return told


@pytest.fixture
def device() -> Iterator[Device]:
    made = Device()
    yield made
    if made.process.poll() is None:
        made.stop(signal.SIGKILL)


def sent_contact(device_time: float) -> np.ndarray:
    angle = 2 * np.pi * device_time / PERIOD
    return 0.05 + RADIUS * np.array([np.cos(angle), np.sin(angle)])


def test_every_number_spent_is_decoded_and_the_contact_follows(
    opened, until, colours_in, device: Device
) -> None:
    window = opened(device.port)
    errors: list[float] = []
    last = -1

    def note(estimate) -> None:
        nonlocal last
        last = estimate.sequence
        if estimate.contact.present:
            errors.append(
                float(
                    np.linalg.norm(estimate.contact.position - sent_contact(estimate.device_time))
                )
            )

    window.session.estimated.connect(note)
    until(lambda: window.display.badge.state == "SIM")  # the device says that it is a simulated one
    end = time.monotonic() + 1.1 * PERIOD
    until(lambda: time.monotonic() > end and len(errors) > 50)
    until(lambda: window.display.badge.state == "SIM")
    assert colours_in(window, window.membrane) > 500
    for heatmap in window.heatmaps.values():
        assert colours_in(window, heatmap.cells) > 20
    assert np.percentile(errors, 99) < 1.5e-3

    told = json.loads(device.stop())
    gone = time.monotonic()
    until(lambda: window.display.badge.state == "LOST", 1.0)
    assert time.monotonic() - gone < 1.0
    counts = window.session.status.accounting
    assert told["unsent"] == 0
    assert counts.lost == 0
    # pyserial throws away what comes while it opens a port; from then on nothing is missing, and
    # the last frame sent is drawn at last: only the device's information may follow it.
    assert told["spent"] - counts.accepted < 50
    until(lambda: told["spent"] - last <= 2, 10.0)
    # A line that falls silent is lost before it is gone.
    until(lambda: window.session.status.events[-1].kind == "gone")
    assert device.port in window.connection.message.text()
    assert window.membrane.surface.lost

    again = Device()
    try:
        window.connection.sources.setCurrentText(again.port)
        window.connection.connect_button.click()
        until(lambda: window.display.badge.state == "SIM")
        shown = len(errors)
        until(lambda: len(errors) > shown + 20 and not window.membrane.surface.lost)
    finally:
        again.stop(signal.SIGKILL)


@pytest.mark.full
def test_a_killed_device_is_lost_within_a_second(opened, until, device: Device) -> None:
    window = opened(device.port)
    until(lambda: window.display.badge.state == "SIM")
    device.stop(signal.SIGKILL)
    until(lambda: window.display.badge.state == "LOST", 1.0)
