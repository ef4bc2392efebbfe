"""Hand: several skins at known places, and what they hold."""

from kappaskin.hand.description import FINGER as FINGER
from kappaskin.hand.description import HAND as HAND
from kappaskin.hand.description import Finger as Finger
from kappaskin.hand.description import HandDescription as HandDescription
from kappaskin.hand.description import Linkage as Linkage
from kappaskin.hand.description import Placement as Placement
from kappaskin.hand.description import angles_from_json as angles_from_json
from kappaskin.hand.description import is_hand as is_hand
from kappaskin.hand.description import load_hand as load_hand
from kappaskin.hand.description import named_hand as named_hand
from kappaskin.hand.description import placement as placement
from kappaskin.hand.exploration import ContactMotion as ContactMotion
from kappaskin.hand.exploration import ObjectMap as ObjectMap
from kappaskin.hand.exploration import ObjectMotion as ObjectMotion
from kappaskin.hand.exploration import contact_motions as contact_motions
from kappaskin.hand.exploration import object_motion as object_motion
from kappaskin.hand.grasp import FingerContact as FingerContact
from kappaskin.hand.grasp import Grasp as Grasp
from kappaskin.hand.grasp import finger_contact as finger_contact
from kappaskin.hand.held_object import HELD as HELD
from kappaskin.hand.held_object import HeldObject as HeldObject
from kappaskin.hand.held_object import ObjectFit as ObjectFit
from kappaskin.hand.held_object import find_held_object as find_held_object
from kappaskin.hand.held_object import fit_object as fit_object
