"""What is drawn over the skin lies where it says, and only while it is wanted."""

import numpy as np
import pytest

from kappaskin import Cap, Patch, load_scene
from kappaskin.contact import ContactObject
from kappaskin.mechanics import PlacedObject, Sphere
from kappaskin_app.features.membrane.overlays import _normals, underside
from kappaskin_app.shell.drawn_skin import DrawnSkin
from kappaskin_app.shell.window import MainWindow

FLAT, ARC = Patch(0.1, 0.1), Patch(0.04, 0.03, 0.0129)
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


def _drawn(window: MainWindow) -> dict[str, bool]:
    over = window.view.overlays
    actors = {
        "directions": over.directions.actor,
        "frame": over.frame.actor,
        "object": over.found.actor,
        "pressed": over.pressed.actor,
    }
    return {name: bool(actor and actor.visibility) for name, actor in actors.items()}


@pytest.mark.full
def test_objects_are_drawn_at_first_the_rest_once_wanted_and_nothing_when_nothing_comes(
    opened, until
) -> None:
    window: MainWindow = opened("sim:demo")
    over = window.view.overlays
    first = {"directions": False, "frame": False, "object": True, "pressed": True}
    until(lambda: _drawn(window) == first)
    assert over.found.actor.prop.style == "Wireframe"  # it lies on the true one
    assert 0.3 < over.pressed.actor.prop.opacity < 0.7
    window.actions_by_name["pressed"].trigger()
    until(lambda: _drawn(window) == first | {"pressed": False})
    assert over.found.actor.prop.style == "Surface"
    for name in ("directions", "frame", "pressed"):
        window.actions_by_name[name].trigger()
    until(lambda: all(_drawn(window).values()))
    window.actions_by_name["disconnect"].trigger()
    until(lambda: not any(_drawn(window).values()))


@pytest.mark.full
def test_an_object_of_unknown_radius_is_not_drawn(opened, until, monkeypatch) -> None:
    monkeypatch.setattr(ContactObject, "sure", property(lambda self: bool(self.kind)))
    window: MainWindow = opened("sim:demo")
    window.editing.write(window.history.settings.written.text.replace("= 0.5", "= 0.1"))
    found: list[ContactObject] = []
    window.display.object_found.connect(lambda what, _: found.append(what))
    until(lambda: bool(found) and found[-1].kind == "sphere" and np.isnan(found[-1].radius))
    until(lambda: not _drawn(window)["object"] and _drawn(window)["pressed"])


def test_the_normals_of_a_drawn_object_point_to_one_side_of_it() -> None:
    skin, place = DrawnSkin(FLAT, 65, 65), np.array([0.05, 0.05])
    points = underside(PlacedObject(BALL, place, 0.0), skin, 1.0)
    centre = points[0] + (0.0, 0.0, 20.0)
    towards = (centre - points) / 20.0
    np.testing.assert_allclose(np.vecdot(_normals(points), towards), 1.0, atol=0.05)


@pytest.mark.parametrize("place", [(0.0105, 0.0105), (0.0135, 0.0085)])
def test_a_ball_on_a_cap_is_drawn_round_however_the_skin_is_exaggerated(place) -> None:
    cap = Cap(0.008, 1.3)
    skin = DrawnSkin(cap, 65, 65)
    points = underside(PlacedObject(Sphere(0.006), np.array(place), 0.0), skin, 6.0)
    assert points is not None
    centre = points[0] + 6.0 * np.array(cap.base(*place).normal)
    np.testing.assert_allclose(np.linalg.norm(points - centre, axis=1), 6.0, atol=1e-6)


def test_the_legend_takes_one_line_in_a_small_window(window, until) -> None:
    window.resize(1024, 700)
    entries = window.legend.buttons
    until(lambda: entries["show_truth"].isVisible() and entries["show_load"].isVisible())
    until(lambda: window.size().width() == 1024 and window.legend.height() < 2 * _line(entries))
    shown = [button for button in entries.values() if button.isVisible()]
    assert len({button.y() for button in shown}) == 1
    for button in shown:  # icon, gap, words and a frame
        words = button.fontMetrics().horizontalAdvance(button.text())
        assert button.width() >= button.iconSize().width() + 4 + words + 4


@pytest.mark.parametrize("size", [(1024, 700), (1280, 800)])
def test_the_legend_takes_one_line_in_the_presenter(window, until, size) -> None:
    window.presenter.enter()
    window.showNormal()
    window.resize(*size)
    entries = window.legend.buttons
    for button in entries.values():  # as the demonstration has them
        button.show()
    until(lambda: window.width() == size[0] and window.legend.width() < 0.6 * size[0])
    until(lambda: window.legend.height() < 2 * _line(entries))
    assert len({button.y() for button in entries.values()}) == 1


def _line(entries) -> int:
    return entries["show_fit"].height()
