"""The engine: the process that reads, records, computes and publishes."""

from kappaskin.live.differences import DifferenceErrors as DifferenceErrors
from kappaskin.live.differences import PairErrors as PairErrors
from kappaskin.live.differences import compared_readouts as compared_readouts
from kappaskin.live.differences import difference_errors as difference_errors
from kappaskin.live.differences import reading_noise as reading_noise
from kappaskin.live.engine import LONGEST_NOTE as LONGEST_NOTE
from kappaskin.live.engine import Engine as Engine
from kappaskin.live.engine import Fingers as Fingers
from kappaskin.live.link import PORT as PORT
from kappaskin.live.link import SCHEME as SCHEME
from kappaskin.live.link import place_of as place_of
from kappaskin.live.pipelines import PipelineStatus as PipelineStatus
from kappaskin.live.region_tracking import track_region as track_region
from kappaskin.live.remote import RemoteEngine as RemoteEngine
from kappaskin.live.remote import RemoteFingers as RemoteFingers
from kappaskin.live.remote import remote_engines as remote_engines
from kappaskin.live.resume import ResumeInfo as ResumeInfo
from kappaskin.live.resume import resume_folder as resume_folder
from kappaskin.live.server import EngineServer as EngineServer
from kappaskin.live.status import LOST as LOST
from kappaskin.live.status import STREAMING as STREAMING
from kappaskin.live.status import LinkStatus as LinkStatus
from kappaskin.live.status import Status as Status
from kappaskin.live.streaming import Stream as Stream
from kappaskin.live.streaming import stream as stream
from kappaskin.live.timing import ComputedFrames as ComputedFrames
