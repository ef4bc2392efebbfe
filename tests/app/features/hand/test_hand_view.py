"""The picture of a hand: skins at their places, contacts, what is held, and the camera."""

from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QPointF, Qt
from PySide6.QtTest import QTest

from kappaskin import Pipeline, Simulator, load_scene
from kappaskin.hand import HeldObject, ObjectFit, placement
from kappaskin.pipeline import usual_setup
from kappaskin_app.features.hand.hand_view import HandView, ShownFinger
from kappaskin_app.theme import DARK, apply_look
from kappaskin_app.widgets.tint import Tint

PLACES = {"left": placement((-0.15, 0, 0), (0, 0, 0)), "right": placement((0.05, 0, 0), (0, 0, 1))}
TINT = Tint("sequential", (0.0, 1.0), "mm")


@pytest.fixture(scope="module")
def estimate():
    scene = load_scene("centre")
    pipeline = Pipeline(scene.sensor(), usual_setup(scene.sensor()))
    return pipeline(Simulator(scene).frame(0, lambda: 0.0))


@pytest.fixture
def view(qapp):
    apply_look(DARK)
    view = HandView()
    view.resize(400, 300)
    view.show()
    yield view
    view.close_plotter()
    view.close()
    view.deleteLater()


def shown(estimate, **faded):
    patch = load_scene("centre").plate.patch
    return {
        name: ShownFinger(where, patch, estimate, TINT, faded.get(name, False))
        for name, where in PLACES.items()
    }


def draw(view, fingers, held=None):
    view.due = 0.0
    view.show_hand(fingers, held)


def camera(view):
    return view.plotter.renderer.GetActiveCamera().GetPosition()


def test_each_skin_and_its_force_are_at_their_places(view, estimate):
    draw(view, shown(estimate))
    for name, where in PLACES.items():
        drawn, geometry = view.fingers[name], estimate.geometry
        at = 1e3 * (where.rotation @ geometry.position + where.position)
        np.testing.assert_allclose(drawn.arrow.user_matrix[:3, 3], at)
        along = drawn.arrow.user_matrix[:3, 2]
        np.testing.assert_allclose(along / np.linalg.norm(along), where.rotation @ geometry.normal)
        np.testing.assert_allclose(drawn.actor.user_matrix[:3, 3], 1e3 * where.position)
        assert drawn.arrow.visibility


def test_a_stale_finger_is_faded_and_has_no_force(view, estimate):
    draw(view, shown(estimate, left=True))
    left, right = view.fingers["left"], view.fingers["right"]
    assert left.actor.prop.opacity < right.actor.prop.opacity == 1.0
    assert (left.arrow.visibility, right.arrow.visibility) == (False, True)


def test_the_finger_under_the_mouse_is_told_and_none_beside(view, estimate):
    draw(view, shown(estimate))
    for name, finger in view.fingers.items():
        middle = finger.where @ [*finger.skin.points().mean(axis=0), 1.0]
        assert view.finger_at(view.place_of(middle[:3])) == name
    assert view.finger_at(QPointF(1.0, 1.0)) == ""


@pytest.mark.parametrize("kind", ["sphere", "cylinder", "plane", "edge"])
def test_what_is_held_is_drawn_at_its_place(view, estimate, kind):
    curvature = {"plane": 0.0, "edge": np.inf}.get(kind, 25.0)
    size = {"plane": 3, "sphere": 4, "cylinder": 5, "edge": 4}[kind]
    fit = ObjectFit(kind, np.array([0.0, 0, 0.1]), np.eye(3), curvature, np.eye(size) * 1e-9, 1, 2)
    held = HeldObject({kind: fit}, 12, 0.1)
    assert held.kind == kind
    draw(view, shown(estimate), held)
    seen = {name: actor for name, actor in view.held.actors.items() if actor.visibility}
    assert list(seen) == [kind]
    depth = 40.0 if kind in ("sphere", "cylinder") else 0.0
    np.testing.assert_allclose(seen[kind].user_matrix[:3, 3], [0, 0, 100.0 - depth])

    draw(view, shown(estimate), replace(held, fits={}, reason="expected two contacts or more"))
    assert not any(actor.visibility for actor in view.held.actors.values())


def test_keys_and_mouse_turn_the_camera_and_home_shows_all(view, estimate):
    draw(view, shown(estimate))
    first = camera(view)
    for key in (Qt.Key.Key_Left, Qt.Key.Key_Up, Qt.Key.Key_Plus):
        before = camera(view)
        QTest.keyClick(view, key)
        assert camera(view) != before
    QTest.keyClick(view, Qt.Key.Key_Home)
    np.testing.assert_allclose(camera(view), first)

    clicked = list[str]()
    view.clicked.connect(clicked.append)
    QTest.mousePress(view, Qt.MouseButton.LeftButton, pos=view.rect().center())
    QTest.mouseMove(view, view.rect().center() * 1.3)
    QTest.mouseRelease(view, Qt.MouseButton.LeftButton, pos=view.rect().center() * 1.3)
    assert camera(view) != first
    assert clicked == []


def test_the_whole_hand_is_in_the_picture_of_any_size(view, estimate):
    for size in ((400, 300), (800, 200), (250, 500)):
        view.resize(*size)
        draw(view, shown(estimate))
        for finger in view.fingers.values():
            points = np.column_stack([finger.skin.points(), np.ones(finger.skin.on.size)])
            seen = [view.in_view(point) for point in (points @ finger.where.T)[::50, :3]]
            assert np.abs(seen).max() < 1.0
