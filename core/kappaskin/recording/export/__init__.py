"""Recordings to files that other programs read: tables of every frame, and the skin as a mesh."""

from kappaskin.recording.export.exporting import Exporting as Exporting
from kappaskin.recording.export.repairing import Repairing as Repairing
from kappaskin.recording.export.wanted import Wanted as Wanted
from kappaskin.recording.export.writing import Exported as Exported
