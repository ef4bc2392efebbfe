"""Sources of frames: a serial port, a simulation; the wire format and its devices."""

from kappaskin.sources import wire as wire
from kappaskin.sources.clock import ClockState as ClockState
from kappaskin.sources.clock import RecordedClock as RecordedClock
from kappaskin.sources.commands import SCAN_LISTS_PER_SECOND as SCAN_LISTS_PER_SECOND
from kappaskin.sources.decoder import Accounting as Accounting
from kappaskin.sources.decoder import Decoder as Decoder
from kappaskin.sources.diagnosis import Diagnosis as Diagnosis
from kappaskin.sources.diagnosis import WireMonitor as WireMonitor
from kappaskin.sources.information import sensor_from_json as sensor_from_json
from kappaskin.sources.information import sensor_to_json as sensor_to_json
from kappaskin.sources.interpreter import Interpreter as Interpreter
from kappaskin.sources.ports import BAUD_RATES as BAUD_RATES
from kappaskin.sources.ports import Port as Port
from kappaskin.sources.ports import SerialConnection as SerialConnection
from kappaskin.sources.pseudo_device import PseudoDevice as PseudoDevice
from kappaskin.sources.serial_source import SerialSource as SerialSource
from kappaskin.sources.simulated import SimulatedSource as SimulatedSource
from kappaskin.sources.simulated import VirtualClock as VirtualClock
from kappaskin.sources.source import InputRecorder as InputRecorder
from kappaskin.sources.source import Source as Source
from kappaskin.sources.source import open_source as open_source
from kappaskin.sources.source import register_scheme as register_scheme
