"""The engine: the process that reads, records, computes and publishes."""

from kappaskin.live.engine import LONGEST_NOTE as LONGEST_NOTE
from kappaskin.live.engine import Engine as Engine
from kappaskin.live.pipelines import Computed as Computed
from kappaskin.live.region_tracking import steered as steered
from kappaskin.live.resume import Left as Left
from kappaskin.live.resume import orphans_folder as orphans_folder
from kappaskin.live.status import LOST as LOST
from kappaskin.live.status import STREAMING as STREAMING
from kappaskin.live.status import Status as Status
