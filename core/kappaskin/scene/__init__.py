"""What is in a scene: a skin, what touches it, and what spoils its readings."""

from kappaskin.scene.choice import LINEAR as LINEAR
from kappaskin.scene.choice import Choice as Choice
from kappaskin.scene.motion import Motion as Motion
from kappaskin.scene.motion import Orbit as Orbit
from kappaskin.scene.plan import Entry as Entry
from kappaskin.scene.plan import Plan as Plan
from kappaskin.scene.plan import effects_of as effects_of
from kappaskin.scene.plan import kept_of as kept_of
from kappaskin.scene.plan import plan as plan
from kappaskin.scene.pressing import Pressed as Pressed
from kappaskin.scene.pressing import Pressing as Pressing
from kappaskin.scene.read import read_scene as read_scene
from kappaskin.scene.ready import DEFAULT_SCENE as DEFAULT_SCENE
from kappaskin.scene.ready import SCENES as SCENES
from kappaskin.scene.ready import TABLE_1_NOISE as TABLE_1_NOISE
from kappaskin.scene.ready import load_scene as load_scene
from kappaskin.scene.ready import scene_file as scene_file
from kappaskin.scene.scene import Scene as Scene
from kappaskin.scene.scene import scaled_to as scaled_to
from kappaskin.scene.stimulus import Indenter as Indenter
from kappaskin.scene.stimulus import Stimulus as Stimulus
from kappaskin.scene.stimulus import contact_of as contact_of
from kappaskin.scene.survey import moments_of as moments_of
from kappaskin.scene.write import write_scene as write_scene
