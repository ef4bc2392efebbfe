"""Each element pressed once, to see whether it answers where the channel map says."""

from kappaskin.press.channel_map import Verdict as Verdict
from kappaskin.press.judge import ELSEWHERE as ELSEWHERE
from kappaskin.press.judge import NOTHING as NOTHING
from kappaskin.press.judge import OK as OK
from kappaskin.press.judge import SKIPPED as SKIPPED
from kappaskin.press.judge import UNCLEAR as UNCLEAR
from kappaskin.press.judge import Pressed as Pressed
from kappaskin.press.listener import Phase as Phase
from kappaskin.press.procedure import PressTest as PressTest
from kappaskin.press.procedure import elements_to_press as elements_to_press
