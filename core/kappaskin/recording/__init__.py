"""Recordings: MCAP files written, read, replayed, verified, repaired and exported."""

from kappaskin.recording.cdr import decode as decode
from kappaskin.recording.disk import Disk as Disk
from kappaskin.recording.disk import is_written as is_written
from kappaskin.recording.export.exporting import Exporting as Exporting
from kappaskin.recording.export.repairing import Repairing as Repairing
from kappaskin.recording.export.wanted import Wanted as Wanted
from kappaskin.recording.export.writing import Exported as Exported
from kappaskin.recording.reading import Recording as Recording
from kappaskin.recording.recorder import Recorder as Recorder
from kappaskin.recording.repair import Repaired as Repaired
from kappaskin.recording.repair import repairing as repairing
from kappaskin.recording.replay import REPLAY as REPLAY
from kappaskin.recording.replay import Replay as Replay
from kappaskin.recording.replay import ReplayedSource as ReplayedSource
from kappaskin.recording.setup_text import said_of_setup as said_of_setup
from kappaskin.recording.setup_text import setup_from as setup_from
from kappaskin.recording.setup_text import setups_of as setups_of
from kappaskin.recording.verify import Verdict as Verdict
from kappaskin.recording.verify import verifying as verifying
from kappaskin.recording.writing import Written as Written
from kappaskin.recording.writing import unused as unused
