"""Growth: the engine through 24 h of its clock in minutes, with events and scenes of a long day."""

import json
import subprocess
import sys

import pytest

_HOURS = 24.0
_FASTER = 600.0  # times the clock goes faster: a day takes 144 s
_RATE = 4.0  # frames/s by that clock, 2400 by a real one: more than can be computed
_MEGABYTES = 20.0  # that may be added after the first hour

_DAY = """
import json, sys, time

hours, faster, rate = map(float, sys.argv[1:])
real, sleep, zero = time.monotonic, time.sleep, time.monotonic()
time.monotonic = lambda: zero + faster * (real() - zero)  # before anything takes it
time.sleep = lambda seconds: sleep(seconds / faster)

import multiprocessing, threading
from dataclasses import replace
import psutil
from kappaskin import load_scene
from kappaskin.live.loop import EngineLoop
from kappaskin.live.requests import Note, Requested, RequestSender
from kappaskin.live.resume import RequestReceiver
from kappaskin.live.ring import Ring
from kappaskin.live.status import Status

theirs, ours = multiprocessing.Pipe(duplex=False)
rings = Ring.pair()
rings[0].write_status(Status())
sender = RequestSender(Requested())
sender.connect(ours)
receiver = RequestReceiver(theirs, tuple(ring.name for ring in rings), None, 1.0)
loop = threading.Thread(target=EngineLoop(receiver, *rings).run)
loop.start()
scene = replace(load_scene("demo"), rate=rate)
begun, known = False, Status()
held = []
while (now := time.monotonic() - zero) < 3600 * hours:
    known = rings[0].read_status() or known
    sender.acknowledge(known.requested, known.reported)
    if not begun:
        begun = True
        sender.change(source="sim:demo")
    sender.change(scene=replace(scene, seed=len(held) % 2))
    sender.act(Note(f"at {now:.0f} s"))
    if now > 3600 * (len(held) + 1):
        held.append(psutil.Process().memory_info().rss / 1e6)
    sleep(0.01)
known = rings[0].read_status() or known
sender.say_goodbye()
loop.join()
for ring in rings:
    ring.destroy()
print(json.dumps([known.state, known.accounting.accepted, known.event_count, held]))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="its memory is counted otherwise")
def test_a_day_of_the_demonstration_adds_less_than_20_mb_to_the_engine() -> None:
    command = [sys.executable, "-c", _DAY, str(_HOURS), str(_FASTER), str(_RATE)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stderr
    state, frames, events, held = json.loads(done.stdout)
    print(f"{frames} frames, {events} events: {held[0]:.1f} MB after an hour, {held[-1]:.1f} MB")
    assert state == "streaming"
    assert frames > 50_000
    assert events > 5_000
    assert held[-1] - held[0] < _MEGABYTES
