"""Export of recordings: tables of frames, data sets, and meshes of the skin."""

from kappaskin.recording.export.request import PRESETS as PRESETS
from kappaskin.recording.export.request import ExportRequest as ExportRequest
from kappaskin.recording.export.writing import Exported as Exported
from kappaskin.recording.export.writing import ExportTask as ExportTask
from kappaskin.recording.export.writing import Forecast as Forecast
from kappaskin.recording.export.writing import ForecastTask as ForecastTask
