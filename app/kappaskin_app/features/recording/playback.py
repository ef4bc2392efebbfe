"""Playback of recordings: opening, seeking, speed, recorded settings."""

import time
from functools import partial
from pathlib import Path

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QFileDialog, QWidget

from kappaskin._text import printable
from kappaskin.errors import Damaged
from kappaskin.frames import Event
from kappaskin.live import Status
from kappaskin.pipeline import Setup
from kappaskin.recording import RecordingSummary, Replay, made_by, summary_of
from kappaskin_app.features.recording.transport import SPEEDS, Transport, minutes
from kappaskin_app.guard import guarded
from kappaskin_app.shell.actions import Actions
from kappaskin_app.shell.background import BackgroundTask, Cancelled, Newest, Tasks
from kappaskin_app.shell.folders import recordings_folder, repairing
from kappaskin_app.shell.history import History
from kappaskin_app.shell.session import RECORDED, Session
from kappaskin_app.shell.settings import EstimatorSettings
from kappaskin_app.shell.settings.form_fields import settings_from
from kappaskin_app.widgets.parts import ELLIPSIS
from kappaskin_app.widgets.text import day

FILES = "Recording (*.mcap *.mcap.part)"
_MENU = "&Recording"
_TIPS = {
    "forward": "Pause, and show the next frame",
    "back": "Pause, and show the previous frame",
    "next": "Go to the next note, gap or change of settings",
    "previous": "Go to the previous note, gap or change of settings",
    "faster": "Play the recording at the next higher speed",
    "slower": "Play the recording at the next lower speed",
    "loop": "Play the recording in a loop, or once",
    "settings": "Fit with the settings that were in use when this frame was recorded",
    "recompute": "Compute the estimates again from the recorded readings, or show recorded ones",
}
_RECOMPUTE, _RECORDED = "&Recompute estimates", "Show &recorded estimates"
_ARRIVES = 0.4  # s after which a request to the engine shows in its status
_HERE = 1e-4  # s: an event so near is where the replay is


class PlaybackControl(QObject):
    """Opens recordings, and plays them as `transport` requests.

    `opened` brings the source that is played, `notified` the result of a request, `changed` reports
    another `message` about the recording, an alarm where it is `alarming`; `damaged` is a
    recording that can be repaired, and `offered` reports one.
    """

    opened = Signal(str)
    notified = Signal(str)
    changed = Signal()
    offered = Signal()

    def __init__(
        self,
        history: History,
        session: Session,
        transport: Transport,
        tasks: Tasks,
        window: QWidget,
    ) -> None:
        super().__init__(window)
        self._history, self._session, self._transport = history, session, transport
        self._window = window
        self.summary: RecordingSummary | None = None
        self.message, self.alarming = "", False
        self.damaged: Path | None = None
        self.speed, self._looped, self._goes = 1.0, False, True
        self._recomputes, self.made_by = False, ""
        """Whether estimates are computed again on request, and whose are shown."""
        self._replay: Replay | None = None
        self._sought: float | None = None
        self._sought_at, self._steps = 0.0, 0
        self._begins = False  # from the beginning, once the settings are in use
        self._before: dict[str, object] = {}
        self._changes: list[Event] = []
        self._asked, self._connects = Path(), True
        """The recording that is read, and whether the engine is to play it."""
        self._reading = BackgroundTask(
            tasks,
            "Reading the recording",
            self._play,
            self._refuse,
            cancelled="Cancelled; it is not opened",
        )
        self._send, self._folder = Newest(self), recordings_folder()
        self._actions: Actions | None = None
        self._wire()

    def _wire(self) -> None:
        transport, session = self._transport, self._session
        transport.sought.connect(guarded(self.seek))
        session.time_requested.connect(guarded(self.seek))
        session.source_refused.connect(guarded(self._give_up))
        transport.course.sliderReleased.connect(guarded(self._release_handle))
        transport.step_wanted.connect(guarded(self.step))
        transport.jump_wanted.connect(guarded(self.jump))
        transport.play_wanted.connect(guarded(self.go))
        transport.speed_wanted.connect(guarded(self.play_at))
        transport.loop_wanted.connect(guarded(self.loop))
        session.source_changing.connect(guarded(self._leave))
        session.reported.connect(guarded(self.follow))

    def add_actions(self, actions: Actions) -> None:
        """Register the actions."""
        self._actions = actions
        tip = "Play a recording; it can also be dropped on the window"
        add = partial(actions.add, menu=_MENU)
        add(
            "open-recording",
            text=f"&Open{ELLIPSIS}",
            act=self.open,
            shortcut="Ctrl+Shift+O",
            tip=tip,
        )
        for name, text, act, shortcut in (
            ("forward", "One frame &forward", partial(self.step, 1), "Ctrl+."),
            ("back", "One frame &back", partial(self.step, -1), "Ctrl+,"),
            ("next", "Ne&xt event", partial(self.jump, 1), "Ctrl+]"),
            ("previous", "&Previous event", partial(self.jump, -1), "Ctrl+["),
            ("faster", "F&aster", partial(self._faster, 1), "Ctrl+Shift+Up"),
            ("slower", "Slo&wer", partial(self._faster, -1), "Ctrl+Shift+Down"),
            ("loop", "&Loop", self._turn_loop, "Ctrl+Shift+L"),
            ("settings", "Settings as recorded &here", self.use_recorded, ""),
            ("recompute", _RECOMPUTE, self.recompute, ""),
        ):
            add(f"replay-{name}", text=text, act=act, shortcut=shortcut, tip=_TIPS[name])
        self._show_actions()

    # Opening.

    def open(self) -> None:
        """Ask for a recording, and play it."""
        folder = str(self._folder)
        file, _ = QFileDialog.getOpenFileName(self._window, "Open a recording", folder, FILES)
        if file:
            self.open_file(Path(file))

    def open_file(self, path: Path) -> None:
        """Read the file at `path` in the background, and play it if it is a recording."""
        self._read(path.absolute(), connects=True)

    def takes(self, source: str) -> bool:
        """Open `source` if it is a recording; whether it is."""
        if source.startswith(RECORDED):
            self.open_file(Path(source.removeprefix(RECORDED).strip()))
        elif not self._reading.running:
            self._asked = Path()  # or another refusal that names the file would seem to be of it
            if self.summary is None:
                self._set_message("")  # of a recording that was refused
        return source.startswith(RECORDED)

    def resume(self, source: str) -> None:
        """Resume a recording that the engine plays already."""
        if source.startswith(RECORDED):
            self._read(Path(source.removeprefix(RECORDED).strip()), connects=False)

    def _read(self, path: Path, connects: bool) -> None:
        self.notified.emit(f"Reading {path.name}{ELLIPSIS}")
        self._asked, self._connects = path, connects
        self._reading.compute(summary_of, path)

    def _refuse(self, error: Exception) -> None:
        if not isinstance(error, Cancelled):
            damaged = self._asked if isinstance(error, Damaged) else None
            self._set_message(str(error), alarming=True, damaged=damaged)
        self.notified.emit(str(error))

    def _play(self, found: RecordingSummary) -> None:
        source = f"{RECORDED}{found.path}"
        if self._connects:
            self._session.connect_to(source)
        self.summary, self._changes = found, _changes(found)
        self._goes, self._begins, self._sought = True, True, None
        self.speed, self._looped, self._recomputes = 1.0, False, False
        self._folder = found.path.parent
        self._session.engine.seek(0.0, 0.0, False)  # until the settings are in use
        now = self._history.settings
        self._before = {"calibration": now.calibration, "tare": now.tare}
        self._use(found.setup_at(0.0))
        self._set_message(_opening_message(found), damaged=None if found.whole else found.path)
        self.opened.emit(source)
        settings = (
            "settings recorded" if found.setup_at(0.0) else "present settings, as it has none"
        )
        self.notified.emit(self.message or f"Playing {found.path.name}, with the {settings}")

    def _use(self, setup: Setup | None) -> None:
        """Use a recorded setup, as one change that can be undone."""
        if setup is None or self.summary is None:
            return
        self._session.base = setup
        self._history.change(
            f"Settings of {self.summary.path.name}",
            -1,
            **settings_from(vars(setup), EstimatorSettings),
            calibration=setup.calibration,
            tare=setup.tare,
        )

    def use_recorded(self) -> None:
        """Use the settings that were in use at this time of the recording."""
        if self.summary is not None:
            self._use(self.summary.setup_at(self.time))

    def recompute(self) -> None:
        """Compute the estimates again, or show the recorded ones again."""
        self._recomputes = not self._recomputes
        self._session.engine.recompute(self._recomputes)
        self._show_actions()

    def _leave(self) -> None:
        """Restore calibration and tare before another source is opened."""
        if self.summary is None:
            return
        self.summary, self._changes, self._session.base = None, [], None
        self._send.forget()
        self._set_message("")
        self._history.change("Calibration and tare as before", -1, **self._before)

    def _give_up(self, why: str) -> None:
        """Keep nothing of a recording that the engine refused."""
        if self._asked.name and str(self._asked) in why:
            self._leave()
            self.notified.emit(f"{self._asked.name} is not played")

    # Playing.

    @property
    def time(self) -> float:
        """The time of the playback in s, or the requested one."""
        if self._sought is not None:
            return self._sought
        return self._replay.at if self._replay else 0.0

    @property
    def playing(self) -> bool:
        """Whether it is neither paused nor at the end."""
        return self._goes and not self._over

    @property
    def _over(self) -> bool:
        replay = self._replay
        return replay is not None and not self._looped and self.time >= replay.length

    @property
    def events(self) -> list[Event]:
        """The events of the recording, with its changes of settings, in order."""
        events = list(self._replay.events) if self._replay else []
        return sorted(events + self._changes, key=lambda event: event.time)

    def toggle(self) -> None:
        """Play or pause."""
        self.go(not self.playing)

    def go(self, on: bool) -> None:
        """Play, from the beginning where it is at the end, or pause."""
        if self._replay is None:
            return
        anew = on and self._over
        self._goes = on
        if anew:
            self.seek(0.0)
        else:
            self._send_speed()

    def play_at(self, speed: float) -> None:
        """Play at a multiple of the recorded speed."""
        self.speed = speed
        self._send_speed()

    def _faster(self, by: int) -> None:
        index = SPEEDS.index(self.speed) + by
        self.play_at(SPEEDS[min(max(index, 0), len(SPEEDS) - 1)])

    def loop(self, looped: bool) -> None:
        """Play in a loop, or once."""
        self._looped = looped
        self._send_speed()

    def _turn_loop(self) -> None:
        self.loop(not self._looped)

    @property
    def _speed_now(self) -> float:
        held = self._transport.course.isSliderDown()
        return self.speed if self._goes and not held else 0.0

    def _send_speed(self) -> None:
        """Request the present speed and loop from the engine."""
        if self._replay is None:
            return
        if self._sought is not None:
            self._send(self._go_there)
        else:
            self._session.engine.seek(None, self._speed_now, self._looped)
        self._show()

    def seek(self, at: float) -> None:
        """Go to `at` s, and pause there while the mouse holds the handle."""
        if self._replay is None:
            return
        self._begins = False  # else a request of the user would be overruled
        self._sought, self._sought_at, self._steps = at, time.monotonic(), 0
        self._send(self._go_there)
        self._show()

    def _go_there(self) -> None:
        if self._sought is not None:
            self._sought_at = time.monotonic()
            self._session.engine.seek(self._sought, self._speed_now, self._looped)

    def _release_handle(self) -> None:
        """Play from where the handle was released."""
        self.seek(self._transport.course.time)

    def step(self, frames: int) -> None:
        """Pause, and step by so many frames."""
        if self._replay is None:
            return
        self._goes, self._begins, self._sought = False, False, None
        self._steps += frames
        self._send(self._go_by)
        self._show()

    def _go_by(self) -> None:
        steps, self._steps = self._steps, 0
        if steps:
            self._session.engine.step(steps)

    def jump(self, way: int) -> None:
        """Go to the next or the previous event."""
        here, times = self.time, [event.time for event in self.events]
        ahead = [at for at in times if at > here + _HERE]
        behind = [at for at in times if at < here - max(_HERE, 0.5 * self._speed_now)]
        found = ahead[:1] if way > 0 else behind[-1:]
        if found and self._replay is not None:
            self.seek(min(max(found[0], 0.0), self._replay.length))

    # Status.

    def follow(self, status: Status) -> None:
        """Take the engine's place in the recording from its status."""
        self._replay = replay = status.replay if self._session.replaying else None
        if replay is not None and self._begins and not status.computing:
            self.seek(0.0)
        if replay is not None and self._sought is not None:
            passed = status.reported - self._sought_at  # by the engine's own times
            there = 0 <= replay.at - self._sought <= passed * self._speed_now + 1e-6
            if there or passed > _ARRIVES:
                self._sought = None
        self._look_for_damage(status)
        self._follow_estimates(replay)
        self._transport.show_recording(replay, self.events)
        self._show()
        self._show_actions()
        self._show_title(replay)

    def _follow_estimates(self, replay: Replay | None) -> None:
        """Take whose estimates are shown from the status."""
        was, self.made_by = self.made_by, ""
        if replay is not None and replay.shows_recorded:
            self.made_by = f"Estimates as recorded by {replay.made_by}"
        elif replay is not None:
            self.made_by = f"Estimates recomputed by {made_by()}; recorded by {replay.made_by}"
        if self.made_by != was:
            self.changed.emit()

    def _look_for_damage(self, status: Status) -> None:
        """Report why the engine closed the recording."""
        why, found = status.message, self.summary
        if status.state != "lost" or found is None or why == self.message:
            return
        if str(found.path) in why:
            helps = "`kappaskin repair`" in why and found.path.exists()
            self._set_message(why, alarming=True, damaged=found.path if helps else None)

    def _show(self) -> None:
        self._transport.show_time(self.time, self.playing)
        self._transport.show_speed(self.speed, self._looped)

    def _show_actions(self) -> None:
        if self._actions is not None:
            why_not = "" if self._replay is not None else "no recording is played"
            for name in self._actions.entries:
                if name.startswith("replay-"):
                    self._actions.allow(name, why_not)
            self._actions["replay-recompute"].setText(_RECORDED if self._recomputes else _RECOMPUTE)

    def _show_title(self, replay: Replay | None) -> None:
        title = " \N{EN DASH} ".join(filter(None, (self._session.finger, "Kappaskin")))
        if replay is not None and self.summary is not None:
            name = printable(self.summary.path.name)
            title = f"{name}, recorded {day(replay.begun)} \N{EN DASH} {title}"
        if title != self._window.windowTitle():
            self._window.setWindowTitle(title)

    def _set_message(
        self, message: str, alarming: bool = False, damaged: Path | None = None
    ) -> None:
        self.message, self.alarming, self.damaged = message, alarming, damaged
        self.changed.emit()
        if damaged is not None:
            self.offered.emit()

    def close(self) -> None:
        self._send.forget()


def _changes(found: RecordingSummary) -> list[Event]:
    """The changes of the setup, as events."""
    return [
        Event(since, "settings", f"{now.Ni} x {now.Nj} functions, {now.method}")
        for (_, was), (since, now) in zip(found.setups, found.setups[1:], strict=False)
        if now != was
    ]


def _opening_message(found: RecordingSummary) -> str:
    """The message about an opened recording; empty where there is none."""
    texts: list[str] = []
    if not found.whole:
        texts.append(
            f"The recording {found.path.name} is unfinished: it is played up to "
            f"{minutes(found.length)}, where it ends. To repair it: "
            f"`{repairing(found.path)}`."
        )
    if found.trouble:
        texts.append(f"The settings recorded cannot be used: {found.trouble}")
    return " ".join(texts)
