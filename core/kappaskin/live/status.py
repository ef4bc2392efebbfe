"""Status of the engine, as reported to the window."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from kappaskin.calibration import Drift
from kappaskin.estimation import Region
from kappaskin.frames import Event
from kappaskin.health import Health
from kappaskin.live.pipelines import PipelineStatus
from kappaskin.live.tare_taking import TareStatus
from kappaskin.live.timing import ComputedFrames
from kappaskin.pipeline import Setup
from kappaskin.publish import PublishStatus, SourceState
from kappaskin.recording import RecordingStatus, Replay
from kappaskin.scenes import Playback
from kappaskin.sensing import Sensor
from kappaskin.sources import Accounting

OFF, WAITING, STREAMING, LOST = "off", "waiting", "streaming", "lost"

_EVENTS = 64  # last events in the status


@dataclass(frozen=True)
class LinkStatus:
    """The connection to an engine on another machine, which listens at `place`.

    `round_trip` in s is how long a message and its answer take, `age` in s how old estimates are
    when they come, both as the median of the last ones, `shown` the share of the computed estimates
    of the last seconds that came; NaN where none did. `cuts` counts how often it was lost.
    """

    place: str
    round_trip: float = math.nan
    age: float = math.nan
    shown: float = math.nan
    cuts: int = 0

    @property
    def words(self) -> str:
        """The delay and the loss, as far as they are known."""
        trip, age = (f"{1e3 * each:.0f} ms" for each in (self.round_trip, self.age))
        parts = [f"{trip} there and back"] if math.isfinite(self.round_trip) else []
        if math.isfinite(self.age):
            parts.append(f"estimates {age} old when they come")
        if math.isfinite(self.shown):
            parts.append(f"{1 - self.shown:.0%} of them left out")
        if self.cuts:
            parts.append(f"lost {self.cuts} time{'s' if self.cuts > 1 else ''}")
        return ", ".join(parts)


@dataclass(frozen=True)
class Status:
    """State of the engine.

    `state` is off, waiting (open, but the device has not sent its information), streaming or lost;
    `message` says why, and `ended` whether it is lost because it came to its end. `source` is the
    one in use, `connecting` the requested one until it answers, `source_refusal` says why it does
    not or cannot be used. `setup` is the one in use, `refusal` says why it is not the one requested
    last, `computing` whether another is being prepared. `region` is scanned unless `region_refusal`
    says why not. `connections` counts the devices connected so far, `skipped` the frames that
    arrived faster than they could be computed, `computed` how long the others take, `quantities`
    those of `QUANTITIES` that they have. `rate` in frames/s; `reader_gap` in s is the 99th
    percentile of the time between two arrivals; `last_frame` and `reported` in s on the monotonic
    clock. `playing` maps device time to the time of a simulated scene, which goes on by `pace`
    seconds per second. `events` are the last of `event_count`. `temperature` of the device in
    degrees Celsius, NaN if it sends none. `tare` is the state of tares, `drift` the drift since the
    tare of the `setup`, None without one. `health` lists faulty channels, `publishing` the state of
    each target, `recording` that of the file being written, `replay` the position in a recording
    (None for any other source), `compared` the state of the second pipeline (None without one).
    `slope` is the largest of the newest shape, if the method neglects it though it matters
    (`Fit.neglected_slope`), else 0. `added_noise` is the standard deviation in 1/m of what is added
    to the readings of shown estimates, and only of these. `requested` is the number of the newest
    request that the engine has received. `link` is the connection to an engine on another machine,
    None where it is on this one.
    """

    state: str = OFF
    source: str = ""
    connecting: str = ""
    source_refusal: str = ""
    message: str = ""
    ended: bool = False
    refusal: str = ""
    sensor: Sensor | None = None
    connections: int = 0
    setup: Setup = field(default_factory=Setup)
    computing: bool = False
    region: Region = field(default_factory=Region)
    region_refusal: str = ""
    skipped: int = 0
    computed: ComputedFrames = field(default_factory=ComputedFrames)
    quantities: tuple[str, ...] = ()
    generation: int = 0
    slot: "np.dtype[np.void] | None" = None
    accounting: Accounting = field(default_factory=Accounting)
    rate: float = 0.0
    reader_gap: float = math.nan
    last_frame: float = -math.inf
    reported: float = -math.inf
    playing: Playback = field(default_factory=Playback)
    pace: float = 1.0
    events: tuple[Event, ...] = ()
    event_count: int = 0
    temperature: float = math.nan
    tare: TareStatus = field(default_factory=TareStatus)
    drift: Drift | None = None
    health: Health = field(default_factory=Health)
    publishing: PublishStatus = field(default_factory=PublishStatus)
    recording: RecordingStatus = field(default_factory=RecordingStatus)
    replay: Replay | None = None
    compared: PipelineStatus | None = None
    slope: float = 0.0
    added_noise: float = 0.0
    requested: int = 0
    link: LinkStatus | None = None

    def after(self, events: Sequence[Event]) -> "Status":
        """The same status with `events` appended."""
        if not events:  # mostly, and a copy is not free
            return self
        last = (*self.events, *events)[-_EVENTS:]
        return replace(self, events=last, event_count=self.event_count + len(events))

    def without_source(self) -> "Status":
        """The same status without a source."""
        return replace(
            self,
            state=OFF,
            source="",
            connecting="",
            source_refusal="",
            message="",
            ended=False,
            sensor=None,
            region_refusal="",
            skipped=0,
            computed=ComputedFrames(),
            quantities=(),
            accounting=Accounting(),
            rate=0.0,
            last_frame=-math.inf,
            pace=1.0,
            temperature=math.nan,
            drift=None,
            health=Health(),
            replay=None,
            slope=0.0,
            added_noise=0.0,
        )

    @property
    def kind(self) -> str:
        """Kind of source in published messages: live, sim or replay; empty without a sensor."""
        if self.sensor is None:
            return ""
        if self.replay is not None:
            return "replay"
        return "sim" if self.sensor.simulated else "live"

    def source_status(self, reported: int) -> SourceState:
        """State of the source for receivers, with the events after the first `reported` ones."""
        fresh = min(self.event_count - reported, len(self.events))
        events = self.events[len(self.events) - fresh :]
        rest = self.message, self.sensor, self.rate, self.last_frame
        return SourceState(self.state, self.kind, *rest, events)
