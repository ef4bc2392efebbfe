"""From the readings to what touches the skin."""

from kappaskin.touch.loaded import Found as Found
from kappaskin.touch.loaded import LoadSeeker as LoadSeeker
from kappaskin.touch.objects import KINDS as KINDS
from kappaskin.touch.objects import NO_OBJECT as NO_OBJECT
from kappaskin.touch.objects import ContactObject as ContactObject
from kappaskin.touch.objects import ObjectFinder as ObjectFinder
from kappaskin.touch.placing import placed as placed
from kappaskin.touch.point import NO_TOUCH as NO_TOUCH
from kappaskin.touch.point import PointContact as PointContact
