"""The channel map of a sensor, verified element by element."""

import sys

from kappaskin.calibration import press_elements
from kappaskin.cli.common import FAILED, Switch, print_json
from kappaskin.errors import Refusal
from kappaskin.recording import ReplayedSource as ReplayedSource  # registers replay:


def press(
    source: str, *, quick: Switch = False, patience: float = 20.0, json: Switch = False
) -> int:
    """Press one element after the other, to see that each answers where the map says.

    Names one element after the other and notices by itself when it was pressed and let go; a
    simulated source presses by itself. The exit code is 1 when the map is not confirmed.

    Example: `kappaskin press /dev/ttyACM0 --quick`

    Parameters
    ----------
    source
        `sim:`, `sim:SCENE`, or a port or URL for pyserial.
    quick
        Of a grid, press two elements in each row and column: they tell whether rows, columns or
        components are exchanged, but not every two elements.
    patience
        Seconds without an answer after which the next element is asked for.
    json
        Print one JSON object with every press and the map that was found.
    """
    try:
        test, verdict = press_elements(
            source,
            lambda line: print(line, file=sys.stderr, flush=True),
            quick=quick,
            patience=patience,
        )
    except KeyboardInterrupt:
        print(file=sys.stderr)
        raise Refusal("stopped before the last element; the map was not verified") from None
    if json:
        print_json(
            {
                "confirmed": verdict.confirmed,
                "words": list(verdict.words),
                "order": None if verdict.order is None else verdict.order.tolist(),
                "pressed": [
                    {"asked": p.asked, "verdict": p.verdict, "answered": p.element}
                    for p in test.done
                ],
            }
        )
    else:
        print(*verdict.words, sep="\n")
    return 0 if verdict.confirmed else FAILED
