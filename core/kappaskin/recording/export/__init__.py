"""Recordings to files that other programs read: tables of every frame, and the skin as a mesh."""

from kappaskin.recording.export.request import ExportRequest as ExportRequest
from kappaskin.recording.export.writing import Exported as Exported
from kappaskin.recording.export.writing import ExportTask as ExportTask
