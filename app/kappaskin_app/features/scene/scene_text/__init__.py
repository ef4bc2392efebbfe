"""Edits of the text of a scene; comments, order and all else stay as written."""

from kappaskin_app.features.scene.scene_text.changes import OFF as OFF
from kappaskin_app.features.scene.scene_text.changes import ON as ON
from kappaskin_app.features.scene.scene_text.changes import PLANNED as PLANNED
from kappaskin_app.features.scene.scene_text.changes import forced as forced
from kappaskin_app.features.scene.scene_text.places import instead as instead
from kappaskin_app.features.scene.scene_text.places import pressed as pressed
from kappaskin_app.features.scene.scene_text.places import shifted as shifted
