"""Health of the channels: dead, stuck, noisy, saturated, swapped or drifting ones."""

from kappaskin.health.findings import Finding as Finding
from kappaskin.health.findings import Health as Health
from kappaskin.health.findings import Kinds as Kinds
from kappaskin.health.findings import LeftOut as LeftOut
from kappaskin.health.findings import leave_out as leave_out
from kappaskin.health.monitor import Monitor as Monitor
