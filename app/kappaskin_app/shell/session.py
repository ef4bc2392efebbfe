"""The session: settings to the engine, estimates and status from it."""

import math
import time
from collections.abc import Callable, Generator
from contextlib import suppress
from dataclasses import replace
from typing import Any, TypeAlias

from PySide6.QtCore import QObject, Qt, QTimer, Signal

from kappaskin.calibration import Calibration, Tare
from kappaskin.errors import Refusal
from kappaskin.estimation import Region, ScanTradeoff
from kappaskin.frames import Estimate
from kappaskin.live import Engine, ResumeInfo, Status
from kappaskin.mechanics import Plate, PointLoad
from kappaskin.pipeline import Setup
from kappaskin.scenes import Scene
from kappaskin.scenes.cylinders import CylinderStep, Presentation
from kappaskin.sensing import Sensor
from kappaskin.skin import Patch
from kappaskin.sources import SCAN_LISTS_PER_SECOND
from kappaskin_app.guard import guarded
from kappaskin_app.shell.background import BackgroundTask, Tasks
from kappaskin_app.shell.badge import state_of
from kappaskin_app.shell.history import History
from kappaskin_app.shell.loads import Cache, compliance_or_refusal
from kappaskin_app.shell.settings import EstimatorSettings, SceneSettings, Settings, part
from kappaskin_app.shell.settings.form_fields import setup_values
from kappaskin_app.shell.settings.publishing import PublishSettings
from kappaskin_app.shell.settings.scene import Scanning, Written
from kappaskin_app.shell.simulation import (
    planned_scene,
    plate_of,
    region_of,
    scene_of,
    scene_or_refusal,
    source_settings,
)

_MAKING = "Making the scene; Ctrl+Z takes it back"

_Slow: TypeAlias = Written | tuple[Plate, str]
_Answer: TypeAlias = tuple[str, tuple[object, ...], Any]

_MEMOS: dict[str, Cache[..., Any]] = {
    "skin": compliance_or_refusal,
    "scene": scene_or_refusal,
    "plan": planned_scene,
}


def _answers(slow: _Slow) -> Generator[_Answer]:
    """What takes long of a scene: which memo is to learn it, the question and the answer."""
    if not isinstance(slow, Written):
        yield "skin", slow, compliance_or_refusal(*slow)
        return
    scene = scene_or_refusal(slow)
    yield "scene", (slow,), scene
    if isinstance(scene, Scene):
        yield "plan", (scene,), planned_scene(scene)


class Ahead:
    """Makes scenes once, in a process, so that they can be made at once thereafter; then `ended`.

    Those are the written ones, which are read and planned, and those of unusual skins. In a thread
    of this one they took ten times as long, each step of theirs waiting for a drawing to end.
    """

    def __init__(self, tasks: Tasks, ended: Callable[[], object]) -> None:
        # Where it is refused the process has died: the scene is made here.
        self._task = BackgroundTask(tasks, _MAKING, self._learn, lambda _: None, ended)
        self._slow: _Slow | None = None
        self._begun: set[_Slow] = set()

    def ready(self, settings: Settings) -> bool:
        """Whether the scene of `settings` can be made, or refused, at once; if not, it is begun."""
        slow = _slow(settings)
        if self.busy and slow != self._slow:
            self._begun.discard(self._slow)  # nobody waits for it any more
            self._task.stop()
        if not self.busy and slow is not None and slow not in self._begun:
            self._begun.add(slow)
            self._slow = slow
            self._task.compute(_answers, slow)
        return not self.busy

    @property
    def busy(self) -> bool:
        return self._task.running

    def _learn(self, found: _Answer) -> None:
        memo, question, answer = found
        _MEMOS[memo].store(question, answer)


def _slow(settings: Settings) -> _Slow | None:
    """What of a scene takes long to make, the first time."""
    if settings.written is not None:
        return settings.written
    try:
        skin = plate_of(settings), settings.edge
    except Refusal:
        return None
    # Rectangles and arcs have sines or beams: the others' functions are computed first.
    return skin if type(skin[0].patch) is not Patch else None


RECORDED = "replay:"
"""What the name of a source begins with that is a recording."""
_TICK = 4  # ms between two looks for a new estimate
_ARRIVES = 0.3  # s after which what was asked of the engine shows in its status
_LATE = 1.2  # times as long as the lists take, for what comes late
_NEWS = 60.0  # s for which another device in the last one's place is told
_STATUS = 0.05  # s between two looks at the status


_BASE = Setup()


def _setup_of(settings: Settings, sensor: Sensor | None = None, base: Setup = _BASE) -> Setup:
    """The setup asked for, with calibration and tare if they are of `sensor`.

    What no setting asks for is as in `base`.
    """
    chosen = setup_values(settings, EstimatorSettings)
    setup = replace(base, **chosen, calibration=None, tare=None)
    for name in ("calibration", "tare"):
        found: Calibration | Tare | None = getattr(settings, name)
        if found is not None and sensor is not None:
            with suppress(Refusal):
                found.check(sensor)
                setup = replace(setup, **{name: found})
    return setup


def _turn(region: Region) -> float:
    """For how many s a device on a line leaves elements out that take turns; 0 if it leaves none.

    Were readings held for less, too few would be there to decide the shape.
    """
    if region.around not in ("elements", "skin") or not region.share:
        return 0.0
    return _LATE / (SCAN_LISTS_PER_SECOND * region.share)


class Session(QObject):
    """Owns the engine. `estimated` brings each new estimate, `reported` the status, in one tick.

    `scene` is the one that is simulated, `running` whether it goes on; `playing` says when it
    becomes another one, `refused` and `refusal` why it is not the one the settings describe now,
    with nothing to say when it is, and `preparing` whether that takes a while to be computed.
    `unsent` says why nothing is published, with nothing to say when it is.
    `turning` tells that another source is about to be taken, or none, `source_changed` which one
    is taken; a recording that is one is computed as `base` says, but for what the settings do.
    `pausing` tells that a person pauses what is played, or lets it go on.
    """

    refused = Signal(str)
    preparing = Signal(bool)
    turning = Signal()
    source_changed = Signal(str)
    pausing = Signal()
    playing = Signal(Scene)
    unsent = Signal(str)
    estimated = Signal(Estimate)
    reported = Signal(Status)

    def __init__(
        self, history: History, engine: Engine, tasks: Tasks, parent: QObject | None = None
    ) -> None:
        super().__init__(parent)
        self._history = history
        self._settings = history.settings
        self.engine = engine
        self.scene = self._planned = scene_of(replace(history.settings, written=None))
        self.refusal = ""
        self._anew, self.running = False, True
        self._sought: float | None = None
        self._sought_at = 0.0
        self._ahead = Ahead(tasks, self._play)
        self.base: Setup | None = None
        if engine.resumed is None:
            self.asked = _setup_of(history.settings)
            engine.set_up(self.asked)
            engine.scan(region_of(history.settings))
        else:
            self.asked = engine.resumed.requested.setup
        self._laid: CylinderStep | None = None
        self.status = Status()
        self._lost_since, self._turned_at = math.inf, 0.0
        self.estimate: Estimate | None = None
        self.source = ""
        self.takers: list[Callable[[str], bool]] = []
        """Who is asked first whether they take a source that is requested."""
        self.may_close: list[Callable[[], bool]] = []
        """Who is asked, when a person closes the window, whether it may be."""
        self._next_status, self.closed = 0.0, False
        self._shown: tuple[int, int] = (0, -1)
        history.changed.connect(guarded(self._follow))
        self.timer = QTimer(self, interval=_TICK, timerType=Qt.TimerType.PreciseTimer)  # pyright: ignore[reportCallIssue]
        self.timer.timeout.connect(self.tick)
        self.timer.start()

    @property
    def inside(self) -> bool:
        """Whether the simulation inside the app is what is read."""
        return self.source.startswith("sim:")

    @property
    def simulating(self) -> bool:
        """Whether the loads and the noise are the panels' to choose: not in a written scene."""
        return self.inside and self._history.settings.written is None

    @property
    def making(self) -> bool:
        """Whether the scene that is asked for is still being made."""
        return self._ahead.busy

    @property
    def replaying(self) -> bool:
        """Whether a recording is what is read."""
        return self.source.startswith(RECORDED)

    def request_source(self, source: str) -> None:
        """Read from `source` from now on, as a person asks."""
        if not any(takes(source) for takes in self.takers):
            self.connect_to(source)

    def simulate(self) -> None:
        """Simulate the panels' skin, whatever was read or written."""
        self._history.change("Simulated skin", -1, written=None)
        self.request_source("sim:")

    def pause(self) -> None:
        """Let what is played stand, or go on."""
        self.pausing.emit()

    def connect_to(self, source: str, already: bool = False) -> None:
        """Take frames from `source`, unless the engine does `already`.

        A scene named there becomes the load case, or the one that is written; without a name, what
        was simulated last is simulated again.
        """
        self.turning.emit()
        self.source, self.estimate = source.strip(), None
        self._turned_at = time.monotonic()
        self.source_changed.emit(self.source)
        if not already:
            self.engine.connect(self.source)
        if self.inside:
            self._anew = True
            self._history.change("Simulated skin", -1, **source_settings(self.source))
            self._play()

    def go_on(self, left: ResumeInfo) -> None:
        """Go on with what the engine was left with, whose settings are the history's."""
        self.source, self.running = left.requested.source or "", bool(left.requested.speed)
        self.source_changed.emit(self.source)
        self.engine.compare(None)
        if self.inside:
            self._play()

    def begin(self, written: Written) -> None:
        """Play a scene that is written from its beginning, whatever was read before."""
        if not self.inside or self.status.state in ("off", "lost"):
            self.connect_to("sim:")
        self._anew = True
        self._history.change(f"Play {written.file.stem}", -1, written=written)
        self._play()

    def disconnect_from(self) -> None:
        self.turning.emit()
        self._turned_at = time.monotonic()
        self.engine.disconnect()

    def _follow(self, settings: Settings) -> None:
        was, self._settings = self._settings, settings
        self._set_up()
        if part(settings, Scanning) != part(was, Scanning):
            self._scan()
        if self.inside and part(settings, SceneSettings) != part(was, SceneSettings):
            self._play()
        if part(settings, PublishSettings) != part(was, PublishSettings):
            self._publish()

    def _set_up(self) -> None:
        """Have the engine compute with what is asked for now, if that is something else."""
        setup = _setup_of(self._settings, self.status.sensor, self.base or _BASE)
        if self._laid is not None:
            setup = replace(setup, calibration=None, tare=None)
        if not self.inside and self.base is None:
            setup = replace(setup, hold=max(setup.hold, _turn(region_of(self._settings))))
        if setup != self.asked:
            if self.inside and setup.calibration and not self.asked.calibration:
                # A calibration follows the loops of a skin from rest on: these effects start anew.
                self.engine.restart_effects()
            self.asked = setup
            self.engine.set_up(setup)

    def _scan(self) -> None:
        """Scan the region asked for, or everything while the skin lies on cylinders."""
        self.engine.scan(Region() if self._laid else region_of(self._settings))

    def _publish(self) -> None:
        """Send to whom it is asked for, or to nobody and say why."""
        why = ""
        try:
            self.engine.publish(self._settings.targets)
        except Refusal as refusal:
            why = str(refusal)
            self.engine.publish([])
        self.unsent.emit(why)

    def lay(self, step: CylinderStep | None) -> None:
        """Lay the simulated skin on the cylinder of `step`.

        Until None, readings are nominal and every frame has all of them.
        """
        begins_or_ends = (step is None) != (self._laid is None)
        self._laid = step
        self._set_up()
        if begins_or_ends:
            self._scan()
        if self.inside:
            self._play()

    def run(self, running: bool) -> None:
        """Let the scene go on, or stand still."""
        self.running = running
        self.engine.seek(None, float(running))

    def seek(self, at: float, held: bool = False) -> None:
        """Go to the scene's time `at` in s, and stand there while it is `held`."""
        self._sought, self._sought_at = at, time.monotonic()
        self.engine.seek(at, float(self.running and not held))

    @property
    def time(self) -> float:
        """The time in s at which the scene is, as the newest estimate shows it, or will be."""
        if self._sought is not None:
            return self._sought
        device_time = self.estimate.device_time if self.estimate else 0.0
        return self.status.playing.time(device_time)

    def move(self, scene: Scene) -> None:
        """Play `scene`, in which a touch is elsewhere, for as long as it is dragged.

        Its plan stays: what a scene calls for is told once the touch is let go.
        """
        self.scene = scene
        self.engine.play(replace(self._planned, stimuli=scene.stimuli))

    def _play(self) -> None:
        """Simulate what the settings describe, or go on as before and say why."""
        settings = self._history.settings
        if not self._ahead.ready(settings):
            self.refused.emit("")
            self.preparing.emit(True)
            return
        why = ""
        try:
            scene = scene_of(settings)
            laid = self._laid and Presentation((self._laid,), 1.0)
            self.scene = scene.laid_on(laid) if laid else scene
        except Refusal as refusal:
            why = str(refusal)
        self._planned, self.refusal = planned_scene(self.scene), why
        self.engine.play(self._planned)
        if self._anew and not why:
            self._anew, self.running = False, True
            self.engine.seek(0.0)
        self.playing.emit(self.scene)
        self.refused.emit(why)
        self.preparing.emit(False)

    def bargain(self) -> ScanTradeoff | None:
        """What scanning the region in use buys and costs, while a contact tells where it is."""
        region, estimate, sensor = self.status.region, self.estimate, self.status.sensor
        if region.around == "off" or estimate is None or sensor is None:
            return None
        touch = estimate.contact
        if not (touch.present and math.isfinite(estimate.noise)):
            return None
        try:
            x, y = (float(place) for place in touch.position)
            contact = PointLoad(x, y, touch.force)
            return ScanTradeoff.of(sensor, region, contact, estimate.noise)
        except Refusal:  # elements chosen on another skin: the status says so
            return None

    @guarded
    def tick(self) -> None:
        """Look for news; everything that shows it hangs on the two signals."""
        if self.closed:
            return  # asked for by a picture drawn while closing
        now = time.monotonic()
        if now >= self._next_status:
            self._next_status = now + _STATUS
            self.engine.revive()
            was, self.status = self.status, self.engine.status()
            self._lost_since = min(self._lost_since, now) if self._lost else math.inf
            if self.status.meetings != was.meetings:
                self.estimate = None  # what the last sensor showed is not this one's
                self._set_up()
            told = self.status.reported > self._sought_at + _ARRIVES
            if told or self._sought == self.status.playing.at:
                self._sought = None
            self.reported.emit(self.status)
        estimate = self.engine.latest(self.status)
        if estimate is not None and (estimate.generation, estimate.sequence) != self._shown:
            self._shown = estimate.generation, estimate.sequence
            self.estimate = estimate
            self.estimated.emit(estimate)

    @property
    def _lost(self) -> bool:
        return self.status.state == "lost"

    def alarm(self) -> str:
        """Since when nothing comes in any more, and why; empty while something does."""
        if not self._lost:
            return ""
        seconds = max(0.0, time.monotonic() - self._lost_since)
        return f"LOST {seconds:.0f} s\n{self.status.message}"

    def stranger(self) -> str:
        """Which device took another's place on this source, for as long as that is news."""
        since = max(time.monotonic() - _NEWS, self._turned_at)
        others = [e.text for e in self.status.events if e.kind == "other" and e.time > since]
        return others[-1][:1].upper() + others[-1][1:] if others else ""

    def badge(self) -> str:
        """The word that is true now, and the gravest of what is true besides."""
        computed = None if self.estimate is None else self.estimate.host_time
        paused = self.inside and not self.running
        return state_of(self.status, computed, time.monotonic(), paused)

    def close(self) -> None:
        self.timer.stop()
        self.closed = True
        self.engine.close()
