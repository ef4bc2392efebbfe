"""The skin in the window: of another shape, loaded by the mouse, seen from every side."""

from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt

from kappaskin import Disk, Patch
from kappaskin.bases import edges_of
from kappaskin.scenes.cylinders import CylinderStep
from kappaskin_app.shell.status_bar import SteadyWarning
from kappaskin_app.shell.window import MainWindow
from kappaskin_app.theme import current
from kappaskin_app.widgets.lettering import CAPTION


def _shown(window: MainWindow) -> bool:
    """Whether the load is drawn where the settings have it."""
    settings, contact = window.history.settings, window.session.estimate.true_contact
    handles = window.membrane.drag.handles
    drawn = len(handles) > 0 and np.allclose(handles[0], [settings.x, settings.y])
    return drawn and np.allclose(contact, [settings.x, settings.y])


@pytest.mark.full
def test_a_load_dragged_on_the_skin_is_where_the_mouse_let_go(
    window: MainWindow, until, qtbot, pixel_of
) -> None:
    window.history.change("Point", -1, load_case="point", x=0.05, y=0.05)
    until(lambda: _shown(window))
    view, count = window.membrane, window.history.stack.count()
    start = pixel_of(window, view.drag.handles[0]) - QPoint(0, 8)
    qtbot.mousePress(view.plotter, Qt.MouseButton.LeftButton, pos=start)
    for step in range(1, 9):
        qtbot.mouseMove(view.plotter, start + QPoint(9 * step, 2 * step))
        until(lambda: _shown(window))
    qtbot.mouseRelease(view.plotter, Qt.MouseButton.LeftButton, pos=start + QPoint(72, 16))
    moved = window.history.settings
    assert moved.x > 0.06
    assert window.history.stack.count() == count + 1
    until(lambda: _shown(window))
    end = pixel_of(window, view.drag.handles[0])
    assert (end - start - QPoint(72, 24)).manhattanLength() <= 12
    window.history.stack.undo()
    assert window.history.settings.x == 0.05


def test_the_mark_of_a_contact_near_the_rim_is_grey(shared_window: MainWindow, until) -> None:
    mark = shared_window.membrane._contacts[0]  # noqa: SLF001

    def near(x: float) -> bool:
        shared_window.history.change("Place", -1, load_case="point", x=x, y=0.05, force=0.05)
        until(lambda: _shown(shared_window))
        until(lambda: mark.prop.color == (current().faint if x < 0.01 else "#1fd17a"))
        return shared_window.session.estimate.contact.near_rim

    assert [near(x) for x in (0.05, 0.004, 0.05)] == [False, True, False]
    until(lambda: " N" in shared_window.readouts.text("force"))


def test_letters_typed_over_the_skin_do_not_reach_vtk(shared_window: MainWindow, qtbot) -> None:
    shared_window.membrane.plotter.setFocus()
    for key in "3wspfvr":
        qtbot.keyClick(shared_window.membrane.plotter, key)
    assert not shared_window.membrane.plotter.ren_win.GetStereoRender()


def test_a_load_cannot_be_dragged_when_nothing_comes_in(window: MainWindow, until) -> None:
    until(lambda: len(window.membrane.drag.handles) == 1)
    window.actions_by_name["disconnect"].trigger()
    until(lambda: not len(window.membrane.drag.handles))
    until(lambda: not window.load.isVisible())


@pytest.mark.full
def test_two_points_are_not_called_one(window: MainWindow, until) -> None:
    window.history.change("Two", -1, load_case="two-points", x=0.03, y=0.03, x_end=0.07, y_end=0.07)
    until(lambda: window.readouts.text("contact").count("(") == 2)
    window.history.change("One", -1, load_case="centre")
    until(lambda: "\N{PLUS-MINUS SIGN}" in window.readouts.text("contact"))


def test_turning_the_camera_does_not_move_the_load(shared_window: MainWindow, qtbot) -> None:
    settings, corner = shared_window.history.settings, QPoint(20, 20)
    qtbot.mousePress(shared_window.membrane.plotter, Qt.MouseButton.LeftButton, pos=corner)
    qtbot.mouseMove(shared_window.membrane.plotter, corner + QPoint(60, 30))
    qtbot.mouseRelease(
        shared_window.membrane.plotter, Qt.MouseButton.LeftButton, pos=corner + QPoint(60, 30)
    )
    assert shared_window.history.settings.camera != settings.camera
    assert replace(shared_window.history.settings, camera=settings.camera) == settings


@pytest.mark.full
def test_a_load_too_near_the_rim_is_warned_of_and_no_more_further_inside(
    window: MainWindow, until
) -> None:
    notice = window.display.notice
    window.history.change("Load", -1, load_case="point", x=0.003, y=0.05, force=0.03)
    until(lambda: "near the rim: unreliable" in notice.text())
    assert "near rim" in window.readouts.text("contact")
    assert notice.toolTip()
    window.history.change("Load", -1, x=0.05)
    until(lambda: "near the rim" not in notice.text())


def test_a_simulation_slower_than_real_time_is_marked(window: MainWindow) -> None:
    session, notice = window.session, window.display.notice
    window.display.delay = SteadyWarning(0.5, 0.0)
    session.status = replace(session.status, pace=0.64)
    window.display.show_numbers_soon()
    session.reported.emit(session.status)
    assert "imulated at 0.6 x real time" in notice.text()
    session.status = replace(session.status, pace=0.97)
    window.display.show_numbers_soon()
    session.reported.emit(session.status)
    assert "real time" not in notice.text()


def test_a_load_over_the_rim_is_explained_where_it_is_placed(
    shared_window: MainWindow, until
) -> None:
    shared_window.history.change("Load", -1, load_case="disc", x=0.001)
    until(lambda: "extends over the rim" in shared_window.load.message.text())
    shared_window.history.stack.undo()
    until(lambda: not shared_window.load.message.text())


@pytest.mark.full
def test_only_edges_that_the_skin_can_have_are_offered(window: MainWindow, until) -> None:
    def offered(panel, name: str) -> list[str]:
        box = panel.editor(name)
        return [box.itemData(i) for i in range(box.count()) if box.model().item(i).isEnabled()]

    shape, basis = window.shape, window.basis
    assert offered(shape, "edge") == list(edges_of(Patch(0.1, 0.1)))
    window.history.change("Edges", -1, edge="elastic", fit_edge="elastic")
    window.requests.set("shape", "cylinder")
    assert (window.history.settings.edge, window.history.settings.fit_edge) == ("hinged", "")
    _met(window, until)
    assert offered(shape, "edge") == ["hinged", "sliding", "clamped"]
    until(lambda: offered(basis, "fit_edge") == ["", "hinged", "sliding", "clamped"])


def _met(window: MainWindow, until) -> None:
    """Wait until the skin of the settings is drawn with an estimate."""
    settings = window.history.settings

    def drawn() -> bool:
        patch, estimate = window.membrane.skin.patch, window.session.estimate
        here = (patch.a, patch.b) == (settings.side_x, settings.side_y)
        count = settings.elements_x * settings.elements_y
        return here and estimate is not None and estimate.curvature.shape == (3, count)

    until(drawn)


@pytest.mark.full
def test_another_skin_is_drawn_bent_and_undone_flat_again(
    window: MainWindow, until, qtbot, colours_in
) -> None:
    was = window.history.settings
    box = window.shape.editor("shape")
    window.panels.setCurrentIndex(1)
    qtbot.keyClick(box, "C")
    _met(window, until)
    assert window.membrane.skin.patch.radius == pytest.approx(0.0129)
    assert "radius 12.9 mm" in window.connection.device.text()
    drawn = len(window.membrane.ages)
    until(lambda: len(window.membrane.ages) > drawn + 3)
    until(lambda: colours_in(window, window.membrane) > 500)
    assert window.session.status.accounting.bytes_discarded == 0
    qtbot.keyClick(box, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert window.history.settings == was
    _met(window, until)
    assert not window.membrane.skin.patch.arc_curvature


@pytest.mark.full
def test_a_skin_that_cannot_be_is_refused_in_its_panel_and_the_last_one_stays(
    window: MainWindow, until
) -> None:
    message = window.shape.message
    window.requests.set("shape", "cylinder")
    _met(window, until)
    window.requests.set("base_radius", 0.004)
    until(lambda: "larger base radius" in message.text())
    assert window.session.scene.plate.patch.radius == pytest.approx(0.0129)
    window.history.change("Case", -1, load_case="point")
    assert "larger base radius" in message.text()
    window.history.stack.undo()
    window.history.stack.undo()
    until(lambda: not message.text())


@pytest.mark.full
def test_too_few_elements_for_the_basis_are_said_where_they_are_chosen(
    window: MainWindow, until
) -> None:
    window.history.change("Few", -1, elements_x=3, elements_y=4)
    _met(window, until)
    for panel in (window.elements, window.basis):
        until(lambda message=panel.message: "3 x 4 elements" in message.text())
    assert window.session.estimate.coefficients.size < 36
    assert len(window.heatmaps["xx"].cells.grab().toImage().size().toTuple()) == 2


@pytest.mark.full
def test_a_round_skin_is_made_beside_the_window_and_drawn_round(
    window: MainWindow, until, colours_in
) -> None:
    window.history.change("Disk", -1, shape="disk", rim_radius=0.043)  # no other test made it
    message = window.shape.message
    until(lambda: "Computing this skin" in message.text())
    until(lambda: isinstance(window.membrane.skin.patch, Disk))
    until(lambda: window.session.estimate is not None and not message.text())
    until(lambda: colours_in(window, window.membrane) > 300)
    assert window.session.estimate.curvature.shape == (3, 80)
    until(lambda: "principal curvatures" in window.display.status_bar.object.text())
    window.requests.set("edge", "elastic")
    until(lambda: "elastic" in message.text())
    assert window.session.scene.edge == "hinged"


@pytest.mark.full
def test_a_load_dragged_on_a_bent_skin_is_where_the_mouse_let_go(
    window: MainWindow, until, qtbot, pixel_of
) -> None:
    window.requests.set("shape", "cylinder")
    window.history.change("Point", -1, load_case="point", force=0.3)
    _met(window, until)
    until(lambda: _shown(window))
    view = window.membrane
    start = pixel_of(window, view.drag.handles[0])
    qtbot.mousePress(view.plotter, Qt.MouseButton.LeftButton, pos=start)
    for step in range(1, 9):
        qtbot.mouseMove(view.plotter, start + QPoint(-9 * step, 4 * step))
        until(lambda: _shown(window))
    qtbot.mouseRelease(view.plotter, Qt.MouseButton.LeftButton, pos=start + QPoint(-72, 32))
    assert window.history.settings.x < 0.017
    until(lambda: _shown(window))
    end = pixel_of(window, view.drag.handles[0])
    assert (end - start - QPoint(-72, 32)).manhattanLength() <= 12


@pytest.mark.full
def test_escape_puts_a_dragged_load_back_and_leaves_nothing_to_redo(
    window: MainWindow, until, qtbot, pixel_of
) -> None:
    window.history.change("Point", -1, load_case="point", x=0.05, y=0.05)
    until(lambda: _shown(window))
    view, was, count = window.membrane, window.history.settings, window.history.stack.count()
    start = pixel_of(window, view.drag.handles[0])
    qtbot.mousePress(view.plotter, Qt.MouseButton.LeftButton, pos=start)
    qtbot.mouseMove(view.plotter, start + QPoint(40, 0))
    assert window.history.settings != was
    qtbot.keyClick(view.plotter, Qt.Key.Key_Escape)
    assert window.history.settings == was
    qtbot.mouseMove(view.plotter, start + QPoint(60, 0))
    qtbot.mouseRelease(view.plotter, Qt.MouseButton.LeftButton, pos=start + QPoint(60, 0))
    assert window.history.settings == was
    assert window.history.stack.count() == count
    assert not window.history.stack.canRedo()


@pytest.mark.full
def test_no_height_leaves_the_picture_and_the_true_one_is_written(
    window: MainWindow, until
) -> None:
    window.history.change("High", -1, exaggeration=50, load_case="point", force=0.9)
    until(lambda: window.session.estimate.surface.max() > 0.02)
    view, written = window.membrane, window.membrane.corner
    until(lambda: written.words not in ("", "height \N{MULTIPLICATION SIGN} 6"))
    until(lambda: -view.skin.height.min() > 20)
    assert -view.skin.height.min() <= view.skin.deepest * (1 + 1e-9)
    height, reason = written.words.split("\n")
    assert reason == "most that fits"
    times = float(height.split()[-1])
    assert times == pytest.approx(view.skin.deepest / window.display.ranges.deepest(), rel=5e-3)
    assert written.text.input == written.words
    window.requests.set("exaggeration", 1.0)
    until(lambda: written.text.input == "")


@pytest.mark.full
def test_the_whole_skin_is_seen_from_every_side(window: MainWindow, until) -> None:
    window.requests.set("shape", "cylinder")
    _met(window, until)
    renderer, skin = window.membrane.plotter.renderer, window.membrane.skin
    for name in ("look-from-above", "look-along-y", "look-along-x", "camera"):
        window.actions_by_name[name].trigger()
        seen = []
        for point in skin.points():
            renderer.SetWorldPoint(*point, 1.0)
            renderer.WorldToView()
            seen.append(renderer.GetViewPoint()[:2])
        assert np.abs(seen).max() < 1, name
        assert np.ptp(seen, axis=0).max() > 1, name  # and large
        written = [bool(label.GetVisibility()) for label in window.membrane.sides.labels]
        end_on = {"look-along-x": 1, "look-along-y": 2}.get(name)
        assert written == [number != end_on for number in range(3)], name


def test_axes_and_exaggeration_have_large_letters_in_full_screen(window: MainWindow, until) -> None:
    view = window.membrane
    until(lambda: view.corner.text.input)

    def sizes() -> list[int]:
        return [view.corner.text.prop.font_size, *(one.size for one in view.sides.labels)]

    usual = sizes()
    window.actions_by_name["layout-presenter"].trigger()
    until(lambda: window.presenter_view.active and sizes() != usual)
    wanted = CAPTION * window.presenter_view.unit / 0.72  # by the height of its capitals
    until(lambda: sizes()[0] == pytest.approx(wanted, abs=1))
    most = int(0.2 * view.plotter.width() / 5.2)  # or they would need the room of the skin
    assert sizes()[1:] == [pytest.approx(min(wanted, most), abs=1)] * 3
    assert min(sizes()) > max(usual)
    window.actions_by_name["layout-live"].trigger()
    until(lambda: sizes() == usual)


def test_on_a_calibration_cylinder_there_are_no_contact_numbers(window: MainWindow, until) -> None:
    session = window.session
    until(lambda: session.estimate is not None and session.estimate.contact.present)
    session.lay(CylinderStep(0))
    until(lambda: session.status.setup.quantities == ("surface",))
    until(lambda: not session.estimate.contact.present)
    assert np.isfinite(session.estimate.surface).any()
    session.lay(None)
    until(lambda: session.estimate.contact.present)
