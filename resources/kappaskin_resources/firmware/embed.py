"""`device.json` to `device_json.h`, which the firmware is compiled with: `python3 embed.py`."""

import json
from pathlib import Path

HERE = Path(__file__).parent


def header(text: str) -> str:
    """The C text that holds the JSON `text`."""
    return (
        "/* Made from device.json by embed.py: what this board says it is. */\n"
        f"static const char KAPPASKIN_DEVICE_JSON[] =\n{_literals(text)};\n"
    )


def _literals(text: str) -> str:
    compact = json.dumps(json.loads(text), separators=(",", ":"))
    parts = [compact[at : at + 72] for at in range(0, len(compact), 72)]
    return "\n".join("    " + json.dumps(part) for part in parts)


if __name__ == "__main__":
    (HERE / "device_json.h").write_text(header((HERE / "device.json").read_text("utf-8")), "utf-8")
