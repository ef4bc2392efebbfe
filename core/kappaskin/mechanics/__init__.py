"""What shape a load makes."""

from kappaskin.mechanics.loads import LineLoad as LineLoad
from kappaskin.mechanics.loads import Load as Load
from kappaskin.mechanics.loads import PointLoad as PointLoad
from kappaskin.mechanics.plate import Compliance as Compliance
from kappaskin.mechanics.plate import Plate as Plate
from kappaskin.mechanics.rigid import Block as Block
from kappaskin.mechanics.rigid import Cylinder as Cylinder
from kappaskin.mechanics.rigid import HeightMap as HeightMap
from kappaskin.mechanics.rigid import Indentation as Indentation
from kappaskin.mechanics.rigid import Mesh as Mesh
from kappaskin.mechanics.rigid import Placed as Placed
from kappaskin.mechanics.rigid import Press as Press
from kappaskin.mechanics.rigid import Punch as Punch
from kappaskin.mechanics.rigid import RigidObject as RigidObject
from kappaskin.mechanics.rigid import Sphere as Sphere
from kappaskin.mechanics.rigid import Wedge as Wedge
from kappaskin.mechanics.spread import DiscLoad as DiscLoad
from kappaskin.mechanics.spread import GaussianLoad as GaussianLoad
from kappaskin.mechanics.spread import RectangleLoad as RectangleLoad
