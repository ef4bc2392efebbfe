"""Rigid objects pressed into a skin, which they push and neither pull nor enter."""

from kappaskin.mechanics.rigid.indentation import Indentation as Indentation
from kappaskin.mechanics.rigid.mesh import Mesh as Mesh
from kappaskin.mechanics.rigid.objects import Block as Block
from kappaskin.mechanics.rigid.objects import Cylinder as Cylinder
from kappaskin.mechanics.rigid.objects import Punch as Punch
from kappaskin.mechanics.rigid.objects import RigidObject as RigidObject
from kappaskin.mechanics.rigid.objects import Sphere as Sphere
from kappaskin.mechanics.rigid.objects import Wedge as Wedge
from kappaskin.mechanics.rigid.press import Placed as Placed
from kappaskin.mechanics.rigid.press import Press as Press
from kappaskin.mechanics.rigid.relief import HeightMap as HeightMap
