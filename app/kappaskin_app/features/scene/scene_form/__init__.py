"""Forms over the text of a scene: what it says as editors, and an edit as the new text."""

from kappaskin_app.features.scene.scene_form.form import SceneForm as SceneForm
