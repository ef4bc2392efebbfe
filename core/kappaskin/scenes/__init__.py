"""Scenes: a skin, its loads and objects, and the effects on its readings; scene to frames."""

from kappaskin.scenes.effect_plan import Plan as Plan
from kappaskin.scenes.effect_plan import kept_effects as kept_effects
from kappaskin.scenes.effect_plan import plan as plan
from kappaskin.scenes.effect_plan import planned as planned
from kappaskin.scenes.read import SCENES as SCENES
from kappaskin.scenes.read import TABLE_1_NOISE as TABLE_1_NOISE
from kappaskin.scenes.read import check_elements as check_elements
from kappaskin.scenes.read import check_sides as check_sides
from kappaskin.scenes.read import load_scene as load_scene
from kappaskin.scenes.read import read_scene as read_scene
from kappaskin.scenes.read import read_scene_text as read_scene_text
from kappaskin.scenes.read import scene_file as scene_file
from kappaskin.scenes.read import scene_of as scene_of
from kappaskin.scenes.scene import AppliedLoads as AppliedLoads
from kappaskin.scenes.scene import EffectSelection as EffectSelection
from kappaskin.scenes.scene import LoadingHistory as LoadingHistory
from kappaskin.scenes.scene import Playback as Playback
from kappaskin.scenes.scene import Scene as Scene
from kappaskin.scenes.scene import scaled_to as scaled_to
from kappaskin.scenes.schema import PARTS as PARTS
from kappaskin.scenes.simulator import Simulator as Simulator
from kappaskin.scenes.stimulus import Indenter as Indenter
from kappaskin.scenes.stimulus import Orbit as Orbit
from kappaskin.scenes.stimulus import Stimulus as Stimulus
from kappaskin.scenes.write import write_scene as write_scene
