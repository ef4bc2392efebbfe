"""Which channels of a skin are not to be trusted, found while it is used."""

from kappaskin.health.findings import Finding as Finding
from kappaskin.health.findings import Health as Health
from kappaskin.health.leaving_out import LeftOut as LeftOut
from kappaskin.health.leaving_out import leave_out as leave_out
from kappaskin.health.monitor import Monitor as Monitor
