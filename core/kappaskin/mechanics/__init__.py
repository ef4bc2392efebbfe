"""What shape a load makes."""

from kappaskin.mechanics.loads import LineLoad as LineLoad
from kappaskin.mechanics.loads import Load as Load
from kappaskin.mechanics.loads import PointLoad as PointLoad
from kappaskin.mechanics.plate import Compliance as Compliance
from kappaskin.mechanics.plate import Plate as Plate
from kappaskin.mechanics.spread import DiscLoad as DiscLoad
from kappaskin.mechanics.spread import GaussianLoad as GaussianLoad
from kappaskin.mechanics.spread import RectangleLoad as RectangleLoad
