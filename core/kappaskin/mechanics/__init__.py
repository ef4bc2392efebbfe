"""Mechanics: the shape of a skin under loads and under rigid objects."""

from kappaskin.mechanics.cap import CapWaves as CapWaves
from kappaskin.mechanics.height_maps import HeightMap as HeightMap
from kappaskin.mechanics.height_maps import Mesh as Mesh
from kappaskin.mechanics.indentation import Indentation as Indentation
from kappaskin.mechanics.indentation import IndentationSolver as IndentationSolver
from kappaskin.mechanics.indentation import PlacedObject as PlacedObject
from kappaskin.mechanics.loads import DiscLoad as DiscLoad
from kappaskin.mechanics.loads import GaussianLoad as GaussianLoad
from kappaskin.mechanics.loads import LineLoad as LineLoad
from kappaskin.mechanics.loads import Load as Load
from kappaskin.mechanics.loads import PointLoad as PointLoad
from kappaskin.mechanics.loads import RectangleLoad as RectangleLoad
from kappaskin.mechanics.plate import INPLANE as INPLANE
from kappaskin.mechanics.plate import USUAL_THICKNESS as USUAL_THICKNESS
from kappaskin.mechanics.plate import Compliance as Compliance
from kappaskin.mechanics.plate import Plate as Plate
from kappaskin.mechanics.rigid_objects import Block as Block
from kappaskin.mechanics.rigid_objects import Cylinder as Cylinder
from kappaskin.mechanics.rigid_objects import Punch as Punch
from kappaskin.mechanics.rigid_objects import RigidObject as RigidObject
from kappaskin.mechanics.rigid_objects import Sphere as Sphere
from kappaskin.mechanics.rigid_objects import Wedge as Wedge
from kappaskin.mechanics.shell import Shell as Shell
from kappaskin.mechanics.stretching import Stretching as Stretching
from kappaskin.mechanics.stretching import deflection_of as deflection_of
from kappaskin.mechanics.stretching import shapes_under as shapes_under
