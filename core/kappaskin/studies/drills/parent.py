"""A process with an engine that reads the port of its argument, to be killed."""

import sys
import time

from kappaskin.live import Engine

if __name__ == "__main__":
    with Engine() as engine:
        engine.connect(sys.argv[1])
        print(engine.pid, flush=True)
        while engine.alive:
            time.sleep(0.1)
