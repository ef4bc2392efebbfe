"""What is estimated, sent to those who want it: datagrams of JSON, and Foxglove."""

from kappaskin.publish.message import Message as Message
from kappaskin.publish.message import State as State
from kappaskin.publish.publisher import Publisher as Publisher
from kappaskin.publish.publisher import Receiver as Receiver
from kappaskin.publish.publishing import Latency as Latency
from kappaskin.publish.publishing import Published as Published
from kappaskin.publish.publishing import Publishing as Publishing
from kappaskin.publish.publishing import PublishNews as PublishNews
from kappaskin.publish.target import targets_of as targets_of
