"""The session: settings to the engine, estimates and status from it."""

import math
import time
from collections import deque
from collections.abc import Callable, Generator, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

from PySide6.QtCore import QObject, Qt, QTimer, Signal
from PySide6.QtWidgets import QLabel

from kappaskin.calibration import Calibration, Tare
from kappaskin.errors import Refusal
from kappaskin.estimation import Region, ScanTradeoff
from kappaskin.frames import Estimate
from kappaskin.hand import HandDescription
from kappaskin.live import STREAMING, Engine, Fingers, ResumeInfo, Status
from kappaskin.mechanics import Plate, PointLoad
from kappaskin.pipeline import Setup
from kappaskin.publish import of_finger
from kappaskin.recording import HandRecorder
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
from kappaskin_app.shell.settings import (
    READY_CASES,
    EstimatorSettings,
    SceneSettings,
    Settings,
    part,
)
from kappaskin_app.shell.settings.form_fields import setup_values
from kappaskin_app.shell.settings.publishing import PublishSettings
from kappaskin_app.shell.settings.scene import Scanning, Written
from kappaskin_app.shell.simulation import (
    planned_scene,
    plate_of,
    region_of,
    scene_of,
    scene_or_refusal,
    settings_for,
    source_settings,
)

_MAKING = "Computing the scene; Ctrl+Z undoes it"
_BESIDE = "Computing the scenes of the other fingers"
_BEGUN = 64  # scenes, as many as are cached: the text of each may be a megabyte

_Slow: TypeAlias = Written | tuple[Plate, str]
_Answer: TypeAlias = tuple[str, tuple[object, ...], Any]

_CACHES: dict[str, Cache[..., Any]] = {
    "skin": compliance_or_refusal,
    "scene": scene_or_refusal,
    "plan": planned_scene,
}


def _answers(slow: _Slow) -> Generator[_Answer]:
    """The slow parts of a scene: the name of a cache, the arguments and the result."""
    if not isinstance(slow, Written):
        yield "skin", slow, compliance_or_refusal(*slow)
        return
    scene = scene_or_refusal(slow)
    yield "scene", (slow,), scene
    if isinstance(scene, Scene):
        yield "plan", (scene,), planned_scene(scene)


class ScenePreparation:
    """Computes slow scenes in a process and caches their parts; then calls `ended`.

    These are scenes from files, and those of skins whose modes are computed. In a thread they
    took ten times as long, since each step waited for a drawing to end.
    """

    def __init__(self, tasks: Tasks, ended: Callable[[], object]) -> None:
        # Refused only where the process died: the scene is computed here then.
        self._task = BackgroundTask(tasks, _MAKING, self._learn, lambda _: None, ended)
        self._slow: _Slow | None = None
        self._begun: deque[_Slow] = deque(maxlen=_BEGUN)

    def ready(self, settings: Settings, words: str = _MAKING) -> bool:
        """Whether the scene of `settings` is available at once; if not, start computing it.

        The status bar says so in `words`.
        """
        self._task.words, slow = words, _slow(settings)
        if self.busy and slow != self._slow:
            self._begun.pop()  # it is not needed any more
            self._task.stop()
        if not self.busy and slow is not None and slow not in self._begun:
            self._begun.append(slow)
            self._slow = slow
            self._task.compute(_answers, slow)
        return not self.busy

    @property
    def busy(self) -> bool:
        return self._task.running

    def _learn(self, found: _Answer) -> None:
        memo, question, answer = found
        _CACHES[memo].store(question, answer)


def _slow(settings: Settings) -> _Slow | None:
    """The part of a scene that is slow to compute the first time."""
    if settings.written is not None:
        return settings.written
    try:
        skin = plate_of(settings), settings.edge
    except Refusal:
        return None
    # Rectangles and arcs have sines or beams: the others' functions are computed first.
    patch, mixed = skin[0].patch, skin[0].mixes_sines
    return skin if type(patch) is not Patch or (patch.is_shallow and mixed) else None


RECORDED = "replay:"
"""The prefix of a source that is a recording."""
_READY = frozenset({"sim:", *(f"sim:{case}" for case in READY_CASES)})  # never refused
_TICK = 4  # ms between two polls for a new estimate
_DRAWN = 10  # ms that an estimate has to be drawn, until the next is polled for
_ARRIVES = 0.3  # s after which a request to the engine shows in its status
_LATE = 1.2  # margin over the time of the scan lists
_NOTICE = 60.0  # s for which a replaced device is reported
_STATUS = 0.05  # s between two polls of the status


_FINGERS = 1_000_000  # connections of one finger at most: no two fingers have one number
_BASE = Setup()


def _setup_of(settings: Settings, sensor: Sensor | None = None, base: Setup = _BASE) -> Setup:
    """The setup of the settings, with calibration and tare if they are of `sensor`.

    What no setting determines is as in `base`.
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
    """How long in s elements scanned in turn stay without a reading; 0 if none do.

    With a shorter hold there are too few readings to determine the shape.
    """
    if region.around not in ("elements", "skin") or not region.share:
        return 0.0
    return _LATE / (SCAN_LISTS_PER_SECOND * region.share)


class Session(QObject):
    """Owns the engine. `estimated` brings each new estimate, `reported` the status, in one tick.

    Of a hand it owns the engines of all `fingers`, and is that of one of them, `finger`, until
    `show_finger` changes to another: as to another source, with the settings of that finger.

    `scene` is the simulated one, `running` whether it is not paused. `playing` reports another
    scene, `refused` and `refusal` why it is not that of the settings (empty when it is), and
    `preparing` whether it is still computed. `publish_refused` reports why nothing is published
    (empty when it is). `source_changing` precedes another source or a disconnection,
    `source_changed` brings the new one, `source_refused` why the requested one is not used.
    `connecting` is that one until it answers, `source` the one in use. `base` is the setup of a
    recording, for what no setting determines. `pause_requested` requests that a scene or recording
    be paused or continued, `time_requested` another time in s in a recording. `trusted` are the
    scenes, as absolute paths, that may name files outside their folders.
    """

    refused = Signal(str)
    preparing = Signal(bool)
    source_changing = Signal()
    source_changed = Signal(str)
    source_refused = Signal(str)
    finger_changed = Signal(str)
    pause_requested = Signal()
    time_requested = Signal(float)
    playing = Signal(Scene)
    publish_refused = Signal(str)
    estimated = Signal(Estimate)
    reported = Signal(Status)

    def __init__(
        self,
        history: History,
        engine: Engine | Fingers,
        tasks: Tasks,
        parent: QObject | None = None,
    ) -> None:
        super().__init__(parent)
        self.fingers = engine if isinstance(engine, Fingers) else None
        engines = {"": engine} if isinstance(engine, Engine) else engine.engines
        self.finger, engine = next(iter(engines.items()))
        self.hand: HandDescription | None = None
        """Where the fingers are, if that is known."""
        self._sources = dict[str, str]()
        """The source of each finger that is not shown."""
        self._unplayed: set[str] = set()
        """Those of them whose scene is to be that of their settings."""
        self._history = history
        self._settings = history.settings
        self.trusted: frozenset[Path] = frozenset()
        self.engine = engine
        self.scene = self._planned = scene_of(replace(history.settings, written=None))
        self.refusal = ""
        self._restarts, self.running = False, True
        self._seek_target: float | None = None
        self._seek_time = 0.0
        self._preparation, self.making = ScenePreparation(tasks, self._prepared), False
        """And whether the scene that is shown is still computed."""
        self._recorder = BackgroundTask(tasks, "", self._record_by)
        self._records = False
        self.base: Setup | None = None
        if engine.resumed is None:
            engine.set_up(_setup_of(history.settings))
            engine.scan(region_of(history.settings))
        self._cylinder: CylinderStep | None = None
        self._calibrating = False
        self.status = Status()
        self._lost_since, self._turned_at = math.inf, 0.0
        self.estimate: Estimate | None = None
        self.source = self.connecting = ""
        self.source_handlers: list[Callable[[str], bool]] = []
        """Functions that may open a requested source instead, and return whether they do."""
        self.reasons: list[QLabel] = []
        """Labels that may show why a source is lost or refused."""
        self.may_close: list[Callable[[], bool]] = []
        """Functions that return whether the window may be closed."""
        self._next_status, self.closed = 0.0, False
        self._shown: tuple[int, int] = (0, -1)
        history.changed.connect(guarded(self._follow))
        history.others_changed.connect(guarded(self._follow_others))
        self.timer = QTimer(self, interval=_TICK, timerType=Qt.TimerType.PreciseTimer)  # pyright: ignore[reportCallIssue]
        self.timer.timeout.connect(self.tick)
        self.timer.start()

    @property
    def inside(self) -> bool:
        """Whether the source is the simulation of the app."""
        return self.source.startswith("sim:")

    @property
    def simulating(self) -> bool:
        """Whether the panels determine the scene: not one from a file."""
        return self.inside and self._history.settings.written is None

    @property
    def replaying(self) -> bool:
        """Whether the source is a recording."""
        return self.source.startswith(RECORDED)

    def request_source(self, source: str) -> None:
        """Change the source, on request of the user."""
        if not any(handles(source) for handles in self.source_handlers):
            self.connect_to(source)

    def simulate(self) -> None:
        """Simulate the scene of the panels, whatever the source was."""
        self._history.change("Simulated skin", -1, written=None)
        self.request_source("sim:")

    def pause(self) -> None:
        """Pause or continue the scene or recording."""
        self.pause_requested.emit()

    def connect_to(self, source: str, already: bool = False) -> None:
        """Take frames from `source`, unless the engine does `already`.

        A source that streams is shown until the other one answers. A scene named there becomes the
        load case or the scene from a file; without a name the last simulation continues.
        """
        source = source.strip()
        streams = self.status.state == STREAMING
        if streams and not already and not source.startswith(RECORDED) and source not in _READY:
            self.connecting = source
            self.engine.connect(source, self._trusts(source))
        else:
            self._use(source, already)

    def _use(self, source: str, already: bool) -> None:
        self.source_changing.emit()
        self.connecting, self.source, self.estimate = "", source, None
        self._turned_at, self._lost_since = time.monotonic(), math.inf
        self._add_noise()
        self.source_changed.emit(source)
        trust = self._trusts(source)
        if not already:
            self.engine.connect(source, trust)
        if self.inside:
            self._restarts = True
            self._history.change("Simulated skin", -1, **source_settings(source, trust))
            self._play()

    def _trusts(self, source: str) -> bool:
        return Path(source.removeprefix("sim:")).absolute() in self.trusted

    def _follow_source(self) -> None:
        """Show the requested source once it answers; report why it is refused."""
        status = self.status
        if status.connecting or status.requested < self.engine.requested.changed.get("source", 0):
            return
        if self.connecting and status.source == self.connecting:
            self._use(self.connecting, already=True)
        elif why := status.source_refusal:
            self.withdraw()
            if status.source != self.source:
                self._use(status.source, already=True)
            self.source_refused.emit(why)

    def withdraw(self) -> None:
        """Keep the source in use instead of the one that is being connected."""
        self.connecting = ""
        self.engine.withdraw()

    def go_on(self, left: ResumeInfo) -> None:
        """Resume what another window left; its settings are already those of the history."""
        self.source, self.running = left.requested.source or "", bool(left.requested.speed)
        self.source_changed.emit(self.source)
        self.engine.compare(None)
        if self.inside:
            self._play()

    def begin(self, written: Written) -> None:
        """Play a scene from a file, from its beginning, whatever the source was."""
        if not self.inside or self.status.state in ("off", "lost"):
            self.connect_to("sim:")
        self._restarts = True
        self._history.change(f"Play {written.file.stem}", -1, written=written)
        self._play()

    def begin_fingers(
        self,
        sources: Mapping[str, str],
        hand: HandDescription | None = None,
        settings: Mapping[str, Settings] | None = None,
    ) -> None:
        """Begin with the `sources` of a hand, which its engines read already, and what it is.

        And with the `settings` of those that are in use.
        """
        self.hand, used = hand, settings or {}
        self._sources = {finger: each for finger, each in sources.items() if finger != self.finger}
        self._history.others = {
            finger: used.get(finger) or settings_for(source, self._trusts(source))
            for finger, source in self._sources.items()
        }
        self._play_others()

    def show_finger(self, finger: str) -> None:
        """Show another finger of the hand: its readings, with its settings.

        What could be undone was of the settings of the last one.
        """
        if self.fingers is None or finger not in self._sources:
            return
        self.source_changing.emit()
        before, self._sources[self.finger] = self.finger, self.source
        self.finger, self.engine = finger, self.fingers.engines[finger]
        self.source = self._sources.pop(finger)
        self.connecting, self.estimate, self._seek_target = "", None, None
        self.running, self._next_status = bool(self.engine.requested.speed), 0.0
        self._turned_at, self._lost_since = time.monotonic(), math.inf
        self._history.show(finger, instead_of=before)
        self.source_changed.emit(self.source)
        if self.inside:
            self._play()
        self.finger_changed.emit(finger)

    def disconnect_from(self) -> None:
        self.connecting = ""
        self.source_changing.emit()
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
        self._add_noise()

    def _follow_others(self, before: Mapping[str, Settings]) -> None:
        """Request what is set of the fingers that are not shown, and was as `before`.

        Of one that plays a recording when it is shown: until then all is as it was recorded.
        """
        for finger, settings in self._history.others.items():
            source, engine = self._sources[finger], self.engine_of(finger)
            if source.startswith(RECORDED):
                continue
            inside = source.startswith("sim:")
            setup = _setup_of(settings, engine.status().sensor)
            if not inside:
                setup = replace(setup, hold=max(setup.hold, _turn(region_of(settings))))
                engine.add_noise(settings.added_noise)
            engine.set_up(setup)
            engine.scan(region_of(settings))
            if part(settings, PublishSettings) != part(before[finger], PublishSettings):
                self._publish_to(settings, finger)
            if inside and part(settings, SceneSettings) != part(before[finger], SceneSettings):
                self._unplayed.add(finger)
        self._play_others()

    def _prepared(self) -> None:
        """Continue once a scene is computed."""
        if self.making:
            self._play()
        self._play_others()

    def _play_others(self) -> None:
        """Simulate the scenes of the fingers that are not shown, once each is computed.

        All are computed before a finger is chosen: in a hand the engines take the processor, and
        it may be long until a scene is computed.
        """
        for finger, settings in self._history.others.items():
            if self.making or not self._preparation.ready(settings, _BESIDE):
                return
            if finger in self._unplayed:
                self._unplayed.discard(finger)
                with suppress(Refusal):  # which is told once it is shown
                    self.engine_of(finger).play(planned_scene(scene_of(settings)))

    def engine_of(self, finger: str) -> Engine:
        return self.fingers.engines[finger] if self.fingers else self.engine

    def set_calibrating(self, calibrating: bool) -> None:
        """Add no noise to what is shown while a calibration captures it."""
        self._calibrating = calibrating
        self._add_noise()

    def _add_noise(self) -> None:
        """Request the noise that is added to what is shown of a device."""
        none = self.inside or self.replaying or self._calibrating
        rms = 0.0 if none else self._settings.added_noise
        if rms != self.engine.requested.added_noise:
            self.engine.add_noise(rms)

    def _set_up(self) -> None:
        """Request the setup of the settings, if it has changed."""
        setup = _setup_of(self._settings, self.status.sensor, self.base or _BASE)
        if self._cylinder is not None:
            # What touches is a cylinder on the whole skin: it has no place, and no force.
            setup = replace(setup, calibration=None, tare=None, quantities=("surface",))
        if not self.inside and self.base is None:
            setup = replace(setup, hold=max(setup.hold, _turn(region_of(self._settings))))
        requested = self.engine.requested.setup
        if setup != requested:
            if self.inside and setup.calibration and not requested.calibration:
                # A calibration tracks hysteresis from rest: these effects restart.
                self.engine.restart_effects()
            self.engine.set_up(setup)

    def _scan(self) -> None:
        """Scan the requested region, or everything while the skin lies on a cylinder."""
        self.engine.scan(Region() if self._cylinder else region_of(self._settings))

    def _publish(self) -> None:
        """Publish to the requested targets, or to none and report why."""
        self.publish_refused.emit(self._publish_to(self._settings, self.finger))

    def _publish_to(self, settings: Settings, finger: str) -> str:
        """Publish a finger to the targets of its settings, or to none; why there are none."""
        engine, number = self.engine_of(finger), 0
        if self.fingers is not None:
            number = list(self.fingers.engines).index(finger)
        try:
            engine.publish(of_finger(settings.targets, number), settings.origins)
        except Refusal as refusal:
            engine.publish([])
            return str(refusal)
        return ""

    def lay(self, step: CylinderStep | None) -> None:
        """Lay the simulated skin on the cylinder of `step`.

        Until None, readings are nominal, every frame has all of them, and there is no contact.
        """
        begins_or_ends = (step is None) != (self._cylinder is None)
        self._cylinder = step
        self._set_up()
        if begins_or_ends:
            self._scan()
        if self.inside:
            self._play()

    def run(self, running: bool) -> None:
        """Continue or pause the scene."""
        self.running = running
        self.engine.seek(None, float(running))

    def seek(self, at: float, held: bool = False) -> None:
        """Go to the scene's time `at` in s, and pause there while it is `held`."""
        self._seek_target, self._seek_time = at, time.monotonic()
        self.engine.seek(at, float(self.running and not held))

    @property
    def time(self) -> float:
        """The time in s at which the scene is, as the newest estimate shows it, or will be."""
        if self._seek_target is not None:
            return self._seek_target
        device_time = self.estimate.device_time if self.estimate else 0.0
        return self.status.playing.time(device_time)

    def move(self, scene: Scene) -> None:
        """Play `scene`, whose load is being dragged.

        Its plan of effects stays until the load is released.
        """
        self.scene = scene
        self.engine.play(replace(self._planned, stimuli=scene.stimuli))

    def _play(self) -> None:
        """Simulate the scene of the settings, or keep the last one and report why."""
        settings = self._history.settings
        self.making = not self._preparation.ready(settings)
        if self.making:
            self.refused.emit("")
            self.preparing.emit(True)
            return
        why = ""
        try:
            scene = scene_of(settings)
            presentation = self._cylinder and Presentation((self._cylinder,), 1.0)
            self.scene = scene.laid_on(presentation) if presentation else scene
        except Refusal as refusal:
            why = str(refusal)
        self._planned, self.refusal = planned_scene(self.scene), why
        self.engine.play(self._planned)
        if self._restarts and not why:
            self._restarts, self.running = False, True
            self.engine.seek(0.0)
        self.playing.emit(self.scene)
        self.refused.emit(why)
        self.preparing.emit(False)
        self._play_others()

    def scan_tradeoff(self) -> ScanTradeoff | None:
        """The trade-off of the region in use, None without a contact."""
        region, estimate, sensor = self.status.region, self.estimate, self.status.sensor
        if region.around == "off" or estimate is None or sensor is None:
            return None
        found = estimate.contact
        if not (math.isfinite(found.force) and math.isfinite(estimate.noise)):
            return None
        try:
            x, y = (float(place) for place in found.position)
            contact = PointLoad(x, y, found.force)
            return ScanTradeoff.of(sensor, region, contact, estimate.noise)
        except Refusal:  # elements chosen on another skin: the status says so
            return None

    def hurry(self) -> None:
        """Poll in the next turn of the event loop: the last estimate is drawn."""
        if self.timer.isActive():
            self.timer.start(0)

    @guarded
    def tick(self) -> None:
        """Poll the engine, and emit new estimates and the status."""
        if self.closed:
            return  # called by a picture drawn while closing
        now, connections = time.monotonic(), self.status.connections
        if reports := now >= self._next_status:
            self._next_status = now + _STATUS
            (self.fingers or self.engine).revive()
            self.status = self.status_of(self.finger)
            self._lost_since = min(self._lost_since, now) if self._lost else math.inf
            if self.status.connections != connections:
                self.estimate = None  # the estimate was of the last sensor
                self._set_up()
            arrived = self.status.reported > self._seek_time + _ARRIVES
            if arrived or self._seek_target == self.status.playing.at:
                self._seek_target = None
            self._follow_source()
        # Views begin anew with another sensor: its first estimate is shown in a turn of its own.
        another = self.status.connections != connections
        estimate = None if another else self.engine.latest(self.status)
        if estimate is not None and (estimate.generation, estimate.sequence) == self._shown:
            estimate = None
        if estimate is not None:
            self._shown = estimate.generation, estimate.sequence
            self.estimate = estimate
        if reports:  # with the estimate that is drawn now, not the one before
            self.reported.emit(self.status)
        if shown := estimate is not None and estimate is self.estimate:
            self.estimated.emit(estimate)
        if self.timer.isActive():
            self.timer.start(_DRAWN if shown else _TICK)

    def status_of(self, finger: str) -> Status:
        """The status of a finger, with the hand's file.

        Its number of connections is one that no other finger has.
        """
        status = self.engine_of(finger).status()
        if self.fingers is None:
            return status
        first = _FINGERS * list(self.fingers.engines).index(finger)
        recording = self.fingers.recording
        return replace(status, connections=first + status.connections, recording=recording)

    def record(self, path: Path | None) -> None:
        """Record to `path` from now on, a hand with all its fingers; None ends that.

        The recorder of a hand is started in the background.
        """
        if self.fingers is None:
            self.engine.record(path)
        elif path is not None and not self._recorder.running:
            self._records = True
            self._recorder.run(HandRecorder, path.absolute(), tuple(self.fingers.engines))
        elif path is None:
            self._records = False
            self.fingers.stop_recording()

    def _record_by(self, recorder: HandRecorder) -> None:
        """Record the hand, unless that was ended while the recorder was started."""
        if self.fingers is not None:
            self.fingers.record(recorder)
            if not self._records:
                self.fingers.stop_recording()

    @property
    def _lost(self) -> bool:
        return self.status.state == "lost"

    def alarm(self) -> str:
        """For how long the connection is lost, and why unless this is in sight elsewhere.

        Empty while it is not lost.
        """
        if not self._lost:
            return ""
        seconds, why = max(0.0, time.monotonic() - self._lost_since), self.status.message
        return f"LOST {seconds:.0f} s" + ("" if self.in_sight(why) else f"\n{why}")

    def in_sight(self, text: str) -> bool:
        """Whether one of the `reasons` shows this text."""
        seen = (label for label in self.reasons if not label.visibleRegion().isEmpty())
        return any(text.casefold() in label.text().casefold() for label in seen)

    def other_device(self) -> str:
        """The report of another device on this source, for a minute."""
        since = max(time.monotonic() - _NOTICE, self._turned_at)
        others = [e.text for e in self.status.events if e.kind == "other" and e.time > since]
        return others[-1][:1].upper() + others[-1][1:] if others else ""

    def badge(self) -> str:
        """The state shown by the badge."""
        computed = None if self.estimate is None else self.estimate.host_time
        paused = self.inside and not self.running
        return state_of(self.status, computed, time.monotonic(), paused)

    def close(self) -> None:
        self.timer.stop()
        self.closed = True
        (self.fingers or self.engine).close()
