"""Export of recordings: tables of frames, and meshes of the skin."""

from kappaskin.recording.export.request import ExportRequest as ExportRequest
from kappaskin.recording.export.writing import Exported as Exported
from kappaskin.recording.export.writing import ExportTask as ExportTask
