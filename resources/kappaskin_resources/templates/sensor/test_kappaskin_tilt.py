import time
from pathlib import Path

from kappaskin.sources import described_source, open_source


def test_frames_with_nine_readings_arrive():
    description = Path(__file__).with_name("tilt.toml")
    source, frames = open_source(described_source(description, "tilt:desk")), []
    end = time.monotonic() + 10
    while not frames and time.monotonic() < end:
        frames += source.read(0.1)
    source.close()

    assert frames
    assert frames[0].counts.size == 9
