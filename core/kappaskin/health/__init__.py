"""Health: which channels are dead, stuck, noisy, saturated, swapped or drifting."""

from kappaskin.health.findings import Exclusion as Exclusion
from kappaskin.health.findings import FaultCodes as FaultCodes
from kappaskin.health.findings import Health as Health
from kappaskin.health.findings import exclude as exclude
from kappaskin.health.monitor import HealthMonitor as HealthMonitor
