"""Forms that edit the text of a scene."""

from kappaskin_app.features.scene.scene_form.form import SceneForm as SceneForm
