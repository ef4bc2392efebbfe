"""The shape that a load makes: plates, loads, rigid objects."""

from kappaskin.mechanics.indentation import Indentation as Indentation
from kappaskin.mechanics.loads import LineLoad as LineLoad
from kappaskin.mechanics.loads import Load as Load
from kappaskin.mechanics.loads import PointLoad as PointLoad
from kappaskin.mechanics.mesh import Mesh as Mesh
from kappaskin.mechanics.objects import Block as Block
from kappaskin.mechanics.objects import Cylinder as Cylinder
from kappaskin.mechanics.objects import Punch as Punch
from kappaskin.mechanics.objects import RigidObject as RigidObject
from kappaskin.mechanics.objects import Sphere as Sphere
from kappaskin.mechanics.objects import Wedge as Wedge
from kappaskin.mechanics.plate import Compliance as Compliance
from kappaskin.mechanics.plate import Plate as Plate
from kappaskin.mechanics.press import Placed as Placed
from kappaskin.mechanics.press import Press as Press
from kappaskin.mechanics.relief import HeightMap as HeightMap
from kappaskin.mechanics.spread import DiscLoad as DiscLoad
from kappaskin.mechanics.spread import GaussianLoad as GaussianLoad
from kappaskin.mechanics.spread import RectangleLoad as RectangleLoad
