"""What is drawn over the skin lies where it says, and only while it is wanted."""

import numpy as np
import pytest

from kappaskin import Patch, load_scene
from kappaskin.contact import ContactObject
from kappaskin.mechanics import PlacedObject
from kappaskin_app.features.membrane.overlays import underside
from kappaskin_app.shell.drawn_skin import DrawnSkin
from kappaskin_app.shell.window import MainWindow

FLAT, ARC = Patch(0.1, 0.1), Patch(0.04, 0.03, 0.0129)
WANTED = ("directions", "band", "frame", "object", "pressed")
BALL = load_scene("sphere").stimuli[0].what.rigid  # of 20 mm


@pytest.mark.parametrize("patch", [FLAT, ARC], ids=["flat", "arc"])
@pytest.mark.parametrize("times", [1.0, 6.0])
def test_an_object_touches_the_drawn_skin_and_enters_it_nowhere(patch: Patch, times: float) -> None:
    skin = DrawnSkin(patch, 65, 65)
    x, y = np.meshgrid(*patch.grid(65, 65))
    skin.height = -times * 1.5 * np.sin(np.pi * x / patch.a) * np.sin(np.pi * y / patch.b)
    place = np.array([0.55 * patch.a, 0.5 * patch.b])
    points = underside(PlacedObject(BALL, place, 0.0), skin, times)
    assert points is not None
    rest, out = skin.at_rest(place[None])
    above = (points - rest) @ out[0]
    assert above[0] == pytest.approx(skin.height_at(place[None])[0], abs=0.15 * times)
    if patch is FLAT:
        over = patch.contains(points[:, :2] / 1e3)
        gap = points[over, 2] - skin.height_at(points[over, :2] / 1e3)
        assert -0.05 * times < gap.min() < 0.05 * times
        sag = points[:, 2] - points[0, 2]
        far = np.linalg.norm(points[:, :2] - 1e3 * place, axis=1)
        np.testing.assert_allclose(sag, times * (20 - np.sqrt(400 - far**2)), atol=1e-9)


@pytest.mark.full
def test_nothing_is_drawn_over_the_skin_until_it_is_wanted_and_then_all_of_it(
    opened, until, monkeypatch
) -> None:
    # This ball is too large to be sure of; what is not sure is not drawn.
    monkeypatch.setattr(ContactObject, "sure", property(lambda self: bool(self.kind)))
    window: MainWindow = opened("sim:sphere")
    until(lambda: window.display.badge.state == "SIM" and window.session.estimate.contact.present)
    over = window.view.overlays
    assert not over.frame.actor.visibility
    assert over.directions.actor is None
    for name in WANTED:
        window.actions_by_name[name].trigger()

    def seen() -> list[bool]:
        sheets = (over.found, over.pressed)
        actors = [over.frame.actor, over.frame.cone, over.directions.actor]
        return [bool(actor.visibility) for actor in [*actors, *(s.actor for s in sheets)]]

    until(lambda: over.directions.actor is not None and all(seen()))
    window.actions_by_name["disconnect"].trigger()
    until(lambda: not any(seen()))
    for _ in WANTED:
        window.history.stack.undo()
    assert not window.history.settings.show_directions
