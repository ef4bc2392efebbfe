"""Contact: position, force, object, and local geometry of the skin."""

from kappaskin.contact.geometry import NO_GEOMETRY as NO_GEOMETRY
from kappaskin.contact.geometry import CurvatureFormMap as CurvatureFormMap
from kappaskin.contact.geometry import contact_geometry as contact_geometry
from kappaskin.contact.geometry import local_geometry as local_geometry
from kappaskin.contact.geometry import surface_geometry as surface_geometry
from kappaskin.contact.imprint import ImprintObjects as ImprintObjects
from kappaskin.contact.imprint import Imprints as Imprints
from kappaskin.contact.imprint import contacts_of as contacts_of
from kappaskin.contact.imprint import object_finder as object_finder
from kappaskin.contact.intrinsic import ForceTorqueSensor as ForceTorqueSensor
from kappaskin.contact.intrinsic import IntrinsicContact as IntrinsicContact
from kappaskin.contact.intrinsic import Wrench as Wrench
from kappaskin.contact.large_deflection import LargeDeflection as LargeDeflection
from kappaskin.contact.load_detection import LoadDetector as LoadDetector
from kappaskin.contact.objects import KINDS as KINDS
from kappaskin.contact.objects import NO_OBJECT as NO_OBJECT
from kappaskin.contact.objects import ContactObject as ContactObject
from kappaskin.contact.objects import ObjectFinder as ObjectFinder
from kappaskin.contact.objects import placed_object as placed_object
from kappaskin.contact.point import NO_CONTACT as NO_CONTACT
from kappaskin.contact.point import PointContact as PointContact
from kappaskin.contact.two import Contacts as Contacts
from kappaskin.contact.two import as_one as as_one
