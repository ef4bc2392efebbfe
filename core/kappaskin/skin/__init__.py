"""The skin: its own coordinates, its outline, and surfaces on it."""

from kappaskin.skin.mesh import MeshSkin as MeshSkin
from kappaskin.skin.mesh_file import UNITS as UNITS
from kappaskin.skin.mesh_file import MeshFault as MeshFault
from kappaskin.skin.mesh_file import MeshSurface as MeshSurface
from kappaskin.skin.mesh_file import faults as faults
from kappaskin.skin.mesh_file import held_edges as held_edges
from kappaskin.skin.mesh_file import read_surface as read_surface
from kappaskin.skin.mesh_file import repaired as repaired
from kappaskin.skin.patch import Base as Base
from kappaskin.skin.patch import Cap as Cap
from kappaskin.skin.patch import Disk as Disk
from kappaskin.skin.patch import Meridian as Meridian
from kappaskin.skin.patch import Outline as Outline
from kappaskin.skin.patch import Patch as Patch
from kappaskin.skin.patch import Polygon as Polygon
from kappaskin.skin.patch import doubled_area as doubled_area
from kappaskin.skin.surface import Distances as Distances
from kappaskin.skin.surface import RestMesh as RestMesh
from kappaskin.skin.surface import distances as distances
from kappaskin.skin.surface import interpolated as interpolated
from kappaskin.skin.surface import snapped_to_rim as snapped_to_rim
