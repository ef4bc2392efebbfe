import numpy as np
import pytest
from PySide6.QtCore import QEvent, QPoint, QPointF, Qt
from PySide6.QtGui import QImage, QMouseEvent
from PySide6.QtWidgets import QApplication

from kappaskin import Cap, Patch, SensorLayout
from kappaskin.skin import MeshSkin, Outline
from kappaskin_app.features.heatmaps.heatmap import CellGrid, Heatmap, cells_of
from kappaskin_app.shell.colouring import SHADES
from kappaskin_app.theme import DARK, DIVERGING, apply_look
from meshes import ellipsoid

TINT = SHADES["xx"].tint(1.0)


def _heatmap(layout: SensorLayout) -> Heatmap:
    heatmap = Heatmap("xx")
    heatmap.resize(300, 260)
    apply_look(DARK)
    heatmap.show_layout(layout)
    return heatmap


def _picture(heatmap: Heatmap) -> QImage:
    return heatmap.cells.grab().toImage()


def test_colours_are_symmetric_about_zero() -> None:
    rgb = TINT.rgb(np.array([-2.0, 0.0, 2.0]), "#888888")
    assert rgb.tolist() == [DIVERGING[0].tolist(), DIVERGING[127].tolist(), DIVERGING[255].tolist()]


def test_a_missing_reading_has_its_own_colour() -> None:
    rgb = TINT.rgb(np.array([np.nan, np.inf]), "#59626d")
    assert rgb.tolist() == [[0x59, 0x62, 0x6D]] * 2


def test_each_element_is_one_cell_of_one_colour(qapp: QApplication) -> None:
    layout = SensorLayout.regular(Patch(0.1, 0.1), 4, 4)
    heatmap = _heatmap(layout)
    values = np.linspace(-1, 1, 16)
    heatmap.show_values(values, TINT)
    picture, area = _picture(heatmap), heatmap.cells.area_of_patch()
    for (x, y), value in zip(layout.positions, values, strict=True):
        at = heatmap.cells.pixel_of(area, x, y).toPoint()
        here = [
            picture.pixelColor(at + QPoint(dx, dy)).getRgb()[:3]
            for dx in (-9, 0, 9)
            for dy in (-9, 9)
        ]
        wanted = tuple(TINT.rgb(np.array([value]), "#000000")[0].tolist())
        assert set(here) == {wanted}


def test_scattered_elements_are_drawn_where_they_are(qapp: QApplication) -> None:
    layout = SensorLayout.scattered(Patch(0.1, 0.05), [[0.02, 0.01], [0.08, 0.04]])
    heatmap = _heatmap(layout)
    heatmap.show_values(np.array([-1.0, 1.0]), TINT)
    picture, area = _picture(heatmap), heatmap.cells.area_of_patch()
    found = [
        picture.pixelColor(heatmap.cells.pixel_of(area, x, y).toPoint()).getRgb()[:3]
        for x, y in layout.positions
    ]
    assert found == [tuple(DIVERGING[0].tolist()), tuple(DIVERGING[255].tolist())]


def test_the_element_under_the_mouse_is_emitted_and_its_value_written(
    qapp: QApplication, until, points_at
) -> None:
    layout = SensorLayout.regular(Patch(0.08, 0.08), 4, 4)
    heatmap, pointed = _heatmap(layout), []
    heatmap.show()
    heatmap.pointed.connect(pointed.append)
    area = heatmap.cells.area_of_patch()
    points_at(heatmap.cells, heatmap.cells.pixel_of(area, *layout.positions[6]).toPoint())
    until(lambda: pointed[-1:] == [6])
    heatmap.show_element(6)
    values = np.full(16, np.nan)
    values[6] = -1.25
    heatmap.show_reading(values)
    assert heatmap.value.text() == "\N{MINUS SIGN}1.25 1/m at (50, 30) mm"
    heatmap.show_element(5)
    heatmap.show_reading(values)
    assert heatmap.value.text().startswith("no reading at")
    heatmap.close()


def test_locking_requests_the_limit_shown_and_unlocking_none(qapp: QApplication, qtbot) -> None:
    heatmap, requested = _heatmap(SensorLayout.regular(Patch(0.1, 0.1), 2, 2)), []
    heatmap.lock_wanted.connect(requested.append)
    heatmap.show_values(np.zeros(4), SHADES["xx"].tint(3.0))
    heatmap.lock.click()
    heatmap.show_lock(True)
    heatmap.lock.click()
    assert requested == [3.0, 0.0]


@pytest.mark.parametrize("name", ["displacement", "xx"])
def test_no_minus_stands_before_a_zero(name: str) -> None:
    shade = SHADES[name]
    assert shade.written(-1e-4) == shade.written(0.0)
    assert "\N{MINUS SIGN}" in shade.written(-1.0)


def _cap_layout(count: int) -> SensorLayout:
    """Elements on a spiral of a hemisphere, the last ones near its rim."""
    cap, at = Cap(0.008), np.arange(count) + 0.5
    far, turn = 0.95 * cap.rim_radius * np.sqrt(at / count), 2.4 * at
    places = cap.rim_radius + far[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    return SensorLayout(cap, places, np.ones((3, count), bool))


@pytest.mark.parametrize("count", [1, 2, 60])
def test_every_place_of_a_cap_lies_in_the_cell_of_the_nearest_element(count: int) -> None:
    _check_cells(_cap_layout(count))


@pytest.mark.parametrize("count", [1, 40])
def test_every_place_of_a_mesh_lies_in_the_cell_of_the_nearest_element(count: int) -> None:
    _check_cells(_mesh_layout(count))


def _check_cells(layout: SensorLayout) -> None:
    cells = [Outline(_in_order(cell)) for cell in cells_of(layout)]
    rng = np.random.default_rng(1)
    places = rng.uniform(0, 1, (400, 2)) * (layout.patch.a, layout.patch.b)
    places = places[layout.patch.contains(places)]
    nearest = np.argmin(np.linalg.norm(layout.positions[:, None] - places, axis=-1), axis=0)
    inside = np.stack([cell.inside(places) for cell in cells])
    assert (inside.sum(axis=0) == 1).all()
    np.testing.assert_array_equal(inside.argmax(axis=0), nearest)


def _mesh_layout(count: int) -> SensorLayout:
    mesh = MeshSkin(*ellipsoid(12, (9e-3, 6e-3, 5e-3), 1.2), 1e-3)
    return SensorLayout.spread(mesh, count)


def _in_order(cell: np.ndarray) -> np.ndarray:
    """The corners of a cell, counter-clockwise."""
    x, y = (cell - cell.mean(axis=0)).T
    return cell[np.argsort(np.arctan2(y, x))]


@pytest.mark.parametrize("layout", [_cap_layout(60), _mesh_layout(60)], ids=["cap", "mesh"])
def test_a_domed_skin_has_cells_that_are_pointed_at_up_to_its_rim(
    qapp: QApplication, layout: SensorLayout
) -> None:
    heatmap = _heatmap(layout)
    heatmap.show_values(np.linspace(-1, 1, 60), TINT)
    picture, cells = _picture(heatmap), heatmap.cells
    area, pointed = cells.area_of_patch(), []
    cells.pointed.connect(pointed.append)
    for element, (x, y) in enumerate(layout.positions):
        at = cells.pixel_of(area, x, y).toPoint()
        wanted = TINT.rgb(np.linspace(-1, 1, 60), "#000000")[element].tolist()
        assert picture.pixelColor(at).getRgb()[:3] == tuple(wanted)
        _point(cells, at)
        assert pointed[-1] == element
    _point(cells, area.topLeft().toPoint() + QPoint(3, 3))
    assert pointed[-1] == -1


def _point(cells: CellGrid, at: QPoint) -> None:
    none, button = Qt.KeyboardModifier.NoModifier, Qt.MouseButton.NoButton
    kind, place = QEvent.Type.MouseMove, QPointF(at)
    QApplication.sendEvent(cells, QMouseEvent(kind, place, place, button, button, none))
