"""Status of the engine, as it reports it to the window."""

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
from kappaskin.pipeline import Setup
from kappaskin.publish import PublishStatus, SourceState
from kappaskin.recording import RecordingStatus, Replay
from kappaskin.scenes import Playback
from kappaskin.sensing import Sensor
from kappaskin.sources import Accounting

OFF, WAITING, STREAMING, LOST = "off", "waiting", "streaming", "lost"

_EVENTS = 64  # last ones that are told


@dataclass(frozen=True)
class Status:
    """How the engine is doing.

    `state` is off, waiting (open, but the device has not said what it is), streaming or lost, and
    `message` says why. `setup` is the one in use, `refusal` says why it is not the one requested
    last, `computing` that another is being prepared. `region` is scanned unless `region_refusal`
    says why not. `meetings` counts the devices that said what they are, `skipped` the frames that
    came in faster than they could be computed. `rate` in frames/s, `reader_gap` the 99th percentile
    of the time between two arrivals in s, `last_frame` and `reported` on the monotonic clock.
    `playing` tells where a simulated scene is at a device time. `events` are the last of those that
    `happened`. `temperature` in degrees Celsius is the device's, NaN if it does not tell. `tare`
    tells of those taken, `drift` is that since the tare of the `setup`, None without one. `health`
    tells which channels are not to be trusted, `publishing` where estimates are sent to,
    `recording` what is being written, `replay` where in a recording the source is, None for any
    other, and `compared` what else is computed of the same frames, None where nothing is.
    `requested` is the number of the newest request that the engine has.
    """

    state: str = OFF
    source: str = ""
    message: str = ""
    refusal: str = ""
    sensor: Sensor | None = None
    meetings: int = 0
    setup: Setup = field(default_factory=Setup)
    computing: bool = False
    region: Region = field(default_factory=Region)
    region_refusal: str = ""
    skipped: int = 0
    generation: int = 0
    slot: "np.dtype[np.void] | None" = None
    accounting: Accounting = field(default_factory=Accounting)
    rate: float = 0.0
    reader_gap: float = math.nan
    last_frame: float = -math.inf
    reported: float = -math.inf
    playing: Playback = field(default_factory=Playback)
    events: tuple[Event, ...] = ()
    happened: int = 0
    temperature: float = math.nan
    tare: TareStatus = field(default_factory=TareStatus)
    drift: Drift | None = None
    health: Health = field(default_factory=Health)
    publishing: PublishStatus = field(default_factory=PublishStatus)
    recording: RecordingStatus = field(default_factory=RecordingStatus)
    replay: Replay | None = None
    compared: PipelineStatus | None = None
    requested: int = 0

    def after(self, events: Sequence[Event]) -> "Status":
        """The same status once `events` happened."""
        last = (*self.events, *events)[-_EVENTS:]
        return replace(self, events=last, happened=self.happened + len(events))

    def without_source(self) -> "Status":
        """The same where nothing is read."""
        return replace(
            self,
            state=OFF,
            source="",
            message="",
            sensor=None,
            region_refusal="",
            skipped=0,
            accounting=Accounting(),
            rate=0.0,
            last_frame=-math.inf,
            temperature=math.nan,
            drift=None,
            health=Health(),
            replay=None,
        )

    @property
    def kind(self) -> str:
        """Where readings come from, as receivers read it; empty without a sensor."""
        if self.sensor is None:
            return ""
        if self.replay is not None:
            return "replay"
        return "sim" if self.sensor.simulated else "live"

    def source_status(self, happened: int) -> SourceState:
        """What receivers get, with the events after so many had `happened`."""
        fresh = min(self.happened - happened, len(self.events))
        events = self.events[len(self.events) - fresh :]
        rest = self.message, self.sensor, self.rate, self.last_frame
        return SourceState(self.state, self.kind, *rest, events)
