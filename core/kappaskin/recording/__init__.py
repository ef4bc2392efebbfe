"""Recordings: MCAP files written, read, replayed, verified, repaired and exported, imported."""

from kappaskin.recording.disk import ReservedFile as ReservedFile
from kappaskin.recording.disk import is_written as is_written
from kappaskin.recording.export.request import ExportRequest as ExportRequest
from kappaskin.recording.export.writing import Exported as Exported
from kappaskin.recording.export.writing import ExportTask as ExportTask
from kappaskin.recording.foreign import FileLines as FileLines
from kappaskin.recording.foreign import is_foreign as is_foreign
from kappaskin.recording.importing import Imported as Imported
from kappaskin.recording.importing import ImportRequest as ImportRequest
from kappaskin.recording.importing import ImportTask as ImportTask
from kappaskin.recording.reading import Recording as Recording
from kappaskin.recording.reading import contacts_in as contacts_in
from kappaskin.recording.reading import made_by as made_by
from kappaskin.recording.recompute import RecordingSummary as RecordingSummary
from kappaskin.recording.recompute import Verification as Verification
from kappaskin.recording.recompute import recorded_setups as recorded_setups
from kappaskin.recording.recompute import summary_of as summary_of
from kappaskin.recording.recorder import Recorder as Recorder
from kappaskin.recording.repair import Repaired as Repaired
from kappaskin.recording.repair import RepairTask as RepairTask
from kappaskin.recording.replay import Replay as Replay
from kappaskin.recording.replay import ReplayedSource as ReplayedSource
from kappaskin.recording.writing import RecordingStatus as RecordingStatus
from kappaskin.recording.writing import part_of as part_of
from kappaskin.recording.writing import repair_command as repair_command
from kappaskin.recording.writing import unused as unused
