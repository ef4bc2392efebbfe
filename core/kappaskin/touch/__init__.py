"""From the readings to what touches the skin."""

from kappaskin.touch.point import NO_TOUCH as NO_TOUCH
from kappaskin.touch.point import PointContact as PointContact
