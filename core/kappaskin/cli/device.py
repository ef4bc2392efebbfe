"""A simulated sensor on a pseudo-terminal."""

import json
import sys
from dataclasses import replace

from kappaskin.cli.common import stops
from kappaskin.errors import Refusal
from kappaskin.scenes import load_scene


def device(scene: str = "", *, rate: float | None = None, dwell: float | None = None) -> None:
    """Play a simulated sensor on a pseudo-terminal, as a real one would on a serial port.

    Prints one JSON line with the port, then serves until stopped (Ctrl+C); then tells on standard
    error how many messages it spent a sequence number on and how many it could not send.

    Example: `kappaskin device circle --rate 500`

    Parameters
    ----------
    scene
        What to simulate; the default scene when left out.
    rate
        Frames per second; the scene's when left out.
    dwell
        Seconds on each cylinder, in the scene `calibration`; one when left out.
    """
    from kappaskin.sources import PseudoDevice

    played = load_scene(scene)
    if dwell is not None:
        if played.laid is None:
            raise Refusal(
                f"the scene {played.name} has no cylinders to dwell on; leave --dwell out"
            )
        played = replace(played, laid=replace(played.laid, dwell=dwell))
    server = PseudoDevice(played if rate is None else replace(played, rate=rate))
    stopped = stops()
    print(json.dumps({"port": server.port, "rate": server.rate}), flush=True)
    server.serve(lambda: bool(stopped))
    server.close()
    print(json.dumps({"spent": server.spent, "unsent": server.unsent}), file=sys.stderr)
