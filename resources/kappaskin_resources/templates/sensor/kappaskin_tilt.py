import math
import time

from kappaskin import SourceError
from kappaskin.sources import Input, SerialSource, load_description


class TiltInput(Input):
    """A line each 10 ms; a driver would read its hardware here."""

    def arriving(self):
        time.sleep(0.01)
        now = time.monotonic()
        slopes = [0.02 * math.sin(now + k) for k in range(9)]
        return now, (",".join(map(str, slopes)) + "\n").encode()


def opened(url, sensor):
    if sensor is None:
        raise SourceError(f"expected --sensor FILE, which describes the readings of {url}")
    return SerialSource(url, description=load_description(sensor), opened=TiltInput)
