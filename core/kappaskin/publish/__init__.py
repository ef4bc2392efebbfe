"""Estimates to other programs: UDP, Foxglove."""

from kappaskin.publish.listening import Listener as Listener
from kappaskin.publish.message import State as State
from kappaskin.publish.publisher import Receiver as Receiver
from kappaskin.publish.publishing import Latency as Latency
from kappaskin.publish.publishing import Published as Published
from kappaskin.publish.publishing import Publishing as Publishing
from kappaskin.publish.publishing import PublishNews as PublishNews
from kappaskin.publish.target import targets_of as targets_of
