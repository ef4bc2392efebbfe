"""What is in a recording."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from kappaskin.cli.common import Switch, print_json
from kappaskin.recording import Recording, decode
from kappaskin.recording import messages as m
from kappaskin.sources import sensor_from_json


def info(file: Path, *, json: Switch = False) -> None:
    """Tell what is in a recording: when, how long, of which device, what happened.

    One that was not ended is told of up to where it breaks off.

    Example: `kappaskin info press.mcap`

    Parameters
    ----------
    file
        The recording.
    json
        Print one JSON object instead.
    """
    with Recording(file) as recording:
        said = _said(recording)
    if json:
        print_json(said)
        return
    whole = "" if said["whole"] else " (not ended: see `kappaskin repair`)"
    print(f"{file}: {said['seconds']:.1f} s from {said['began']}, by {said['library']}{whole}")
    for name in ("devices", "setups", "attachments", "events"):
        print(f"{name}:", *([""] if said[name] else ["none"]))
        for line in said[name]:
            print(f"  {line}")
    print("messages:")
    for topic, count in sorted(said["messages"].items()):
        print(f"  {count:>10,}  {topic}")


def _said(recording: Recording) -> dict[str, Any]:
    def texts(topic: m.Topic) -> list[str]:
        return [decode(m.STRING, got.data)["data"] for got in recording.messages_on(topic)]

    def when(stamp: int) -> float:
        return (stamp - recording.first) * 1e-9

    events = [(when(got.stamp), decode(m.LOG, got.data)) for got in recording.messages_on(m.EVENTS)]
    return {
        "began": datetime.fromtimestamp(recording.first * 1e-9, UTC).isoformat(),
        "seconds": when(recording.last),
        "library": recording.library,
        "whole": recording.whole,
        "devices": [_device(text) for text in dict.fromkeys(texts(m.DEVICE))],
        "setups": texts(m.SETUP),
        "attachments": list(recording.attachments),
        "events": [f"{time:.3f} s {said['name']}: {said['msg']}" for time, said in events],
        "messages": recording.counts,
    }


def _device(text: str) -> str:
    sensor = sensor_from_json(text)
    return f"{sensor.name} {sensor.serial_number}, {sensor.layout}, firmware {sensor.firmware}"
