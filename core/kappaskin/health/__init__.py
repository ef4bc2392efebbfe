"""Health of the channels: dead, stuck, noisy, saturated, swapped or drifting ones."""

from kappaskin.health.findings import Finding as Finding
from kappaskin.health.findings import Health as Health
from kappaskin.health.leaving_out import Kinds as Kinds
from kappaskin.health.leaving_out import LeftOut as LeftOut
from kappaskin.health.leaving_out import leave_out as leave_out
from kappaskin.health.monitor import Monitor as Monitor
