"""What is in a scene: a skin, what touches it, and what spoils its readings."""

from kappaskin.scene.motion import Motion as Motion
from kappaskin.scene.motion import Orbit as Orbit
from kappaskin.scene.scene import DEFAULT_SCENE as DEFAULT_SCENE
from kappaskin.scene.scene import SCENES as SCENES
from kappaskin.scene.scene import TABLE_1_NOISE as TABLE_1_NOISE
from kappaskin.scene.scene import Scene as Scene
from kappaskin.scene.scene import load_scene as load_scene
from kappaskin.scene.scene import scaled_to as scaled_to
from kappaskin.scene.stimulus import Stimulus as Stimulus
from kappaskin.scene.stimulus import contact_of as contact_of
