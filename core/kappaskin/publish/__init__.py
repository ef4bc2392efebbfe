"""Estimates to other programs: UDP, Foxglove."""

from kappaskin.publish.access import THIS_MACHINE as THIS_MACHINE
from kappaskin.publish.access import TOKEN as TOKEN
from kappaskin.publish.access import Access as Access
from kappaskin.publish.access import access_of as access_of
from kappaskin.publish.access import token_of as token_of
from kappaskin.publish.message import SourceState as SourceState
from kappaskin.publish.publishing import Latency as Latency
from kappaskin.publish.publishing import Publishing as Publishing
from kappaskin.publish.publishing import PublishStatus as PublishStatus
from kappaskin.publish.publishing import TargetStatus as TargetStatus
from kappaskin.publish.publishing import of_finger as of_finger
from kappaskin.publish.publishing import targets_of as targets_of
from kappaskin.publish.udp import UdpListener as UdpListener
