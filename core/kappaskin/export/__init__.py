"""Recordings to files that other programs read: tables of every frame, and the skin as a mesh."""

from kappaskin.export.exporting import Exporting as Exporting
from kappaskin.export.repairing import Repairing as Repairing
from kappaskin.export.wanted import Wanted as Wanted
from kappaskin.export.writing import Exported as Exported
