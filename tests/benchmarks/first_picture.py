"""Opens the app as its command does.

Prints how long after the time given the skin was drawn, and what processor time that took here.
"""

import math
import sys
import time

from kappaskin_app.launch import opened

if __name__ == "__main__":
    started = float(sys.argv[1])
    application, window = opened("sim:")
    while not any(math.isfinite(age) for _, age in window.membrane.ages):
        application.processEvents()
        time.sleep(0.001)
    print(time.monotonic() - started, time.process_time())
    window.close()
