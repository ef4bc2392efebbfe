"""Readings pushed by one program and estimates in the loop of another, 1,000 times a second."""

import subprocess
import sys
import time

import numpy as np

from kappaskin import SourceError, stream

_RATE = 1000.0
_BOARD = """
format = 1
[skin]
size = [0.1, 0.1]
rigidity = 3.7e-3
[elements]
grid = [6, 6]
[line]
kind = "text"
columns = ["xx:0..35", "yy:0..35", "xy:0..35"]
[readings]
scale = 0.02
"""
_PUSHING = """
import sys, time
import numpy as np
import kappaskin

count, rate = int(sys.argv[2]), float(sys.argv[3])
values = np.random.default_rng(0).normal(0, 10, (count, 108))
with kappaskin.feed("bench", sensor=sys.argv[1]) as feed:
    print("ready", flush=True)
    sys.stdin.readline()
    due = time.perf_counter()
    for each in values:
        feed.push(each)
        due += 1 / rate
        time.sleep(max(0.0, due - time.perf_counter()))
    print(feed.dropped, flush=True)
"""


def test_a_loop_gets_every_record_that_is_pushed(tmp_path, figure, ratio, seconds) -> None:
    board, count = tmp_path / "board.toml", int(seconds * _RATE)
    board.write_text(_BOARD)
    command = [sys.executable, "-c", _PUSHING, str(board), str(count), str(_RATE)]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    ages, since = list[float](), list[float]()
    with subprocess.Popen(command, text=True, **pipes) as pushing:
        pushing.stdout.readline()
        with stream("feed:bench") as received:
            pushing.stdin.write("\n")
            pushing.stdin.flush()
            try:
                for estimate in received:
                    ages.append(time.monotonic() - estimate.host_time)
                    since.append(time.time() - estimate.device_time)
            except SourceError:  # the program has ended
                pass
        dropped = int(pushing.stdout.readline())
    late, whole = (1e3 * float(np.percentile(each, 99)) for each in (ages, since))
    figure(
        f"{count} records of 108 numbers at {_RATE:g}/s: {len(ages)} estimates in the loop, "
        f"{dropped} dropped by the feed and {received.dropped} by the loop; 99 % within "
        f"{late:.2f} ms from arrival, {whole:.2f} ms from push"
    )
    ratio("estimates in a loop, of the records pushed", len(ages) / count, at_least=0.99)
    ratio("99th percentile from arrival to loop, of the 5 ms allowed", late / 5, at_most=1)
