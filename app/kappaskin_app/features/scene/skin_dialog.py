"""Open skin: from the mesh of a skin in a file to a scene of it."""

import json
import math
from collections.abc import Generator
from dataclasses import fields
from pathlib import Path
from typing import Any, cast

import numpy as np
from PySide6.QtCore import QPoint, QPointF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QImage, QKeyEvent, QMouseEvent, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import (
    QComboBox,
    QDialog,
    QDoubleSpinBox,
    QFileDialog,
    QFormLayout,
    QHBoxLayout,
    QLineEdit,
    QProgressBar,
    QScrollArea,
    QSizePolicy,
    QSpinBox,
    QVBoxLayout,
    QWidget,
)

from kappaskin._files import write_whole
from kappaskin._processes import with_progress
from kappaskin._text import printable
from kappaskin.contact import PointContact
from kappaskin.errors import Refusal
from kappaskin.frames import Array, Indices, Mask
from kappaskin.mechanics import DiscLoad, Load
from kappaskin.scenes import read_scene, scaled_to
from kappaskin.skin import (
    UNITS,
    MeshFault,
    MeshSkin,
    MeshSurface,
    faults,
    held_edges,
    read_surface,
    repaired,
)
from kappaskin_app.guard import guarded
from kappaskin_app.shell.background import BackgroundTask, Tasks
from kappaskin_app.shell.drawn_skin import FROM_THE_LEFT
from kappaskin_app.shell.folders import proposed, recordings_folder
from kappaskin_app.shell.settings.scene import Written
from kappaskin_app.theme import current, follow_look
from kappaskin_app.widgets.parts import ELLIPSIS, Label, button, sentence, text_label

MESHES = (".stl", ".obj", ".ply")
_FILES = f"Mesh of a skin ({' '.join(f'*{suffix}' for suffix in MESHES)})"
_EDGES = {"Clamped": "clamped", "Hinged": "hinged"}
_POISSON = 0.3
_FUNCTIONS, _PER_FUNCTION = 15, 4  # along a side, of the true shape; nodes for each
_RADIUS = 0.12  # of the shorter side: of the disc that presses the new skin
_DEPTH = 0.3  # of its thickness, that it presses
_READ, _PRESSED = 0.05, 0.35  # of the time: when the mesh is read, and its functions computed
_STEPS = (
    '{ step = "press", seconds = 0.6 }',
    '{ step = "hold", seconds = 2.0 }',
    '{ step = "release", seconds = 0.6 }',
    '{ step = "hold", seconds = 0.8 }',
)
_REPAIRS = {
    "merge": "&Merge nodes",
    "remove": "&Remove them",
    "orient": "&Orient triangles",
    "keep largest part": "&Keep the largest part",
    "decimate": "&Decimate",
}
_HINT = (
    "Drag to turn; orange is the inside. Click two places on the rim, counter-clockwise seen from "
    "outside."
)
_SAMPLES, _MOST_DOTS = 1_500_000, 1000
_MOST_DRAWN = 100_000  # triangles
_DOT, _BEHIND = 3.0, 0.3  # px, of a fault; opacity of what is behind the surface
_JUST_BEHIND = 3.0  # px
_NEAR = 14.0  # px from a click to a node of the rim
_STILL = 4  # px that the mouse may move in a click
_PER_PIXEL, _PER_KEY = 0.01, 0.15  # rad
_MARGIN = 0.88  # of the preview, that the skin fills
_KEYS = {
    Qt.Key.Key_Left: (-1, 0),
    Qt.Key.Key_Right: (1, 0),
    Qt.Key.Key_Up: (0, -1),
    Qt.Key.Key_Down: (0, 1),
}


class SurfacePreview(QWidget):
    """A surface that can be turned, with its rim, what of it is held, and places of faults.

    `picked` emits the number of the node of the rim that was clicked.
    """

    picked = Signal(int)

    def __init__(self) -> None:
        super().__init__()
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(260, 220)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAccessibleName("The mesh; the arrow keys turn it")
        self.setToolTip("Drag, or press the arrow keys, to turn. Orange: seen from inside.")
        self.surface = self._shown = cast("MeshSurface | None", None)
        self._box = np.zeros(3), np.zeros(3)
        self.places, self.held = np.empty((0, 3)), np.empty((0, 2), np.intp)
        self._pressed: QPoint | None = None
        self._last, self._image, self._near = QPoint(), QImage(), np.empty((1, 1))
        towards, up = np.array(FROM_THE_LEFT.towards), np.array(FROM_THE_LEFT.up)
        back = towards / np.linalg.norm(towards)
        right = np.cross(up, back)
        right /= np.linalg.norm(right)
        self._axes = np.stack([right, np.cross(back, right), back])
        follow_look(self, self._redraw)

    def sizeHint(self) -> QSize:
        return QSize(420, 400)

    def show_surface(self, surface: MeshSurface | None, places: Array, held: Indices) -> None:
        """Draw a surface, faults at `places` (k, 3) in m, and `held` sides (H, 2) of its rim."""
        self.places, self.held = places, held
        if surface is self._shown:
            self.update()
            return
        self._shown = self.surface = surface
        if surface is not None:
            finite = np.isfinite(surface.nodes @ np.ones(3))
            self.surface = surface.part(np.logical_and.reduce(finite[surface.triangles], axis=1))
        nodes = _finite(surface)
        self._box = nodes.min(axis=0), nodes.max(axis=0)
        self._redraw()

    def _redraw(self) -> None:
        self._image = QImage()
        self.update()

    def seen(self, points: Array) -> Array:
        """Where `points` (k, 3) in m are on the widget: x and y in px, and towards the viewer."""
        low, high = self._box
        size = float(np.linalg.norm(high - low)) or 1.0
        scale = _MARGIN * min(self.width(), self.height()) / size
        found = scale * (points - (low + high) / 2) @ self._axes.T
        return found * (1, -1, 1) + (self.width() / 2, self.height() / 2, 0)

    def paintEvent(self, event: QPaintEvent) -> None:
        with QPainter(self) as painter:
            painter.fillRect(self.rect(), QColor(current().scene))
            if self.surface is None:
                return
            if self._image.size() != self.size():
                self._image = self._picture(self.surface)
            painter.drawImage(0, 0, self._image)
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            for sides, colour, width in (
                (self._rim(self.surface), current().text, 1.2),
                (self.held, current().accent, 5.0),
            ):
                painter.setPen(QPen(QColor(colour), width))
                ends = self.seen(self.surface.nodes[sides].reshape(-1, 3)).reshape(-1, 2, 3)
                hidden = self._is_behind(ends.mean(axis=1))
                for (begin, end), behind in zip(ends.tolist(), hidden.tolist(), strict=True):
                    painter.setOpacity(_BEHIND if behind else 1.0)
                    painter.drawLine(QPointF(*begin[:2]), QPointF(*end[:2]))
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(QColor(current().bad))
            dots = self.seen(self.places[:_MOST_DOTS])
            for (x, y, _), behind in zip(dots.tolist(), self._is_behind(dots), strict=True):
                painter.setOpacity(_BEHIND if behind else 1.0)
                painter.drawEllipse(QPointF(x, y), _DOT, _DOT)

    def _rim(self, surface: MeshSurface) -> Indices:
        """The sides (R, 2) of the rim; none of a mesh with which nothing can be done before."""
        return surface.rim if len(surface.triangles) <= _MOST_DRAWN else np.empty((0, 2), np.intp)

    def _is_behind(self, seen: Array) -> Mask:
        """Whether points (k, 3) as seen are behind the surface."""
        height, width = self._near.shape
        x, y = np.clip(seen[:, :2], 0, (width - 1, height - 1)).astype(int).T
        return seen[:, 2] < self._near[y, x] - _JUST_BEHIND

    def _picture(self, surface: MeshSurface) -> QImage:
        """Its triangles as dots, those nearer over those farther; of very many some."""
        if (every := -(-len(surface.triangles) // _MOST_DRAWN)) > 1:
            surface = MeshSurface(surface.nodes, surface.triangles[::every])
        width, height = self.width(), self.height()
        corners = self.seen(surface.corners.reshape(-1, 3)).reshape(-1, 3, 3)
        flat = corners[..., :2]
        longest = np.linalg.norm(flat - np.roll(flat, 1, axis=1), axis=2).max(axis=1)
        rows = np.clip(np.ceil(1.3 * longest * math.sqrt(every)), 1, 2000)
        rows = np.ceil(rows * min(1.0, np.sqrt(_SAMPLES / max((rows**2).sum(), 1.0)))).astype(int)
        of = np.repeat(np.arange(len(rows)), rows**2)
        number = np.arange(len(of)) - np.repeat(np.cumsum(rows**2) - rows**2, rows**2)
        s, t = (np.array(np.divmod(number, rows[of])) + 0.5) / rows[of]
        s, t = np.where(s + t > 1, (1 - s, 1 - t), (s, t))
        a, u, v = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        x, y, near = (a[of] + s[:, None] * u[of] + t[:, None] * v[of]).T
        order = np.argsort(near, kind="stable")
        at = np.clip(y, 0, height - 1).astype(int) * width + np.clip(x, 0, width - 1).astype(int)
        facing = surface.normals @ self._axes[2]
        facing /= np.maximum(np.linalg.norm(surface.normals, axis=1), 1e-300)
        colours = np.where((facing > 0)[:, None], (120, 160, 205), (214, 138, 60))
        rgb = (colours * (0.3 + 0.7 * np.abs(facing))[:, None]).astype(np.uint32)
        packed = 0xFF000000 | rgb[:, 0] << 16 | rgb[:, 1] << 8 | rgb[:, 2]
        dots = np.zeros(width * height, np.uint32)
        dots[at[order]] = packed[of][order]
        self._near = np.full((height, width), -np.inf)
        self._near.ravel()[at[order]] = near[order]
        form = QImage.Format.Format_ARGB32
        return QImage(dots.tobytes(), width, height, 4 * width, form).copy()

    def _turn(self, dx: float, dy: float) -> None:
        for angle, axis in ((dx, 1), (dy, 0)):
            c, s = np.cos(angle), np.sin(angle)
            i, j = (2, 0) if axis else (1, 2)
            one, other = self._axes[i].copy(), self._axes[j].copy()
            self._axes[i], self._axes[j] = c * one - s * other, s * one + c * other
        self._redraw()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self._pressed = self._last = event.position().toPoint()

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        at = event.position().toPoint()
        moved, self._last = at - self._last, at
        self._turn(_PER_PIXEL * moved.x(), _PER_PIXEL * moved.y())

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        at, surface = event.position().toPoint(), self.surface
        if surface is None or self._pressed is None:
            return
        if (at - self._pressed).manhattanLength() <= _STILL and len(rim := self._rim(surface)):
            nodes = np.unique(rim)
            x, y, near = self.seen(surface.nodes[nodes]).T
            far = np.hypot(x - at.x(), y - at.y())
            # Of two rims behind one another the nearer one.
            far = np.where(far < _NEAR, far - near / max(np.ptp(near), 1e-9), np.inf)
            if np.isfinite(far.min()):
                self.picked.emit(int(nodes[far.argmin()]))

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if (way := _KEYS.get(Qt.Key(event.key()))) is None:
            super().keyPressEvent(event)
        else:
            self._turn(_PER_KEY * way[0], _PER_KEY * way[1])


def _finite(surface: MeshSurface | None) -> Array:
    """The finite nodes (n, 3), or zero where there are none."""
    nodes = surface.nodes if surface else np.zeros((1, 3))
    found = nodes[np.isfinite(nodes).all(axis=1)]
    return found if len(found) else np.zeros((1, 3))


class SkinDialog(QDialog):
    """Asks for what a mesh file does not have, shows its faults, and makes a scene of it.

    `made` emits the scene, once its functions are computed.
    """

    made = Signal(Written)

    def __init__(self, tasks: Tasks, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle("Open a skin")
        self.file, self._next = Path(), 0
        self._read: MeshSurface | None = None  # as in the file, its numbers taken as metres
        self.surface: MeshSurface | None = None  # in m; None before it is read and its unit known
        self._faults: list[MeshFault] | None = None
        self._used, self._repaired = Path(), False  # the file that the scene names
        words, cancelled = "Setting up the skin", "Cancelled; nothing is simulated."
        self._reading = BackgroundTask[Any](tasks, "Reading the mesh", self._take, self._refuse)
        self._making = BackgroundTask[Written | float](
            tasks, words, self._finish, self._refuse, cancelled=cancelled
        )
        self.preview = SurfacePreview()
        self.preview.picked.connect(guarded(self._pick))
        self.about, self.message = text_label(), text_label()
        self.unit = QComboBox()
        self.unit.setToolTip("Unit of length of the file: the one in which the skin has its size.")
        self.thickness = _number(1.0, 1e-3, 100.0, 3, " mm", "Thickness of the skin.")
        self.modulus = _number(3.0, 1e-3, 1e6, 3, " MPa", "Young's modulus of its material.")
        self.edge = QComboBox()
        self.edge.addItems([*_EDGES])
        self.edge.setToolTip("How the held part of the rim is held: clamped, or free to turn.")
        self.elements = QSpinBox(minimum=4, maximum=2000, value=120)  # pyright: ignore[reportCallIssue]
        self.elements.setToolTip("Elements, spread evenly over the skin.")
        self.held = QComboBox()
        self.held.addItems(["Whole rim", "From one point to another"])
        self.held.setToolTip("Which part of the rim is held; the rest is free.")
        self.ends = QLineEdit(), QLineEdit()
        for line, which in zip(self.ends, ("From", "To"), strict=True):
            line.setPlaceholderText("x, y, z in the unit of the file")
            line.setAccessibleName(which)
            line.setToolTip("Where the held part of the rim begins or ends.")
            line.textEdited.connect(guarded(lambda *_: self._show()))
        self.form, self.found = QFormLayout(), QVBoxLayout()
        rows: dict[str, QWidget] = {
            "&Unit": self.unit,
            "&Thickness": self.thickness,
            "&Young's modulus": self.modulus,
            "&Elements": self.elements,
            "&Held": self.held,
            "&From": self.ends[0],
            "T&o": self.ends[1],
            "E&dge": self.edge,
        }
        self._inputs = [*rows.values()]
        for words, widget in rows.items():
            self.form.addRow(words, widget)
        self.unit.currentIndexChanged.connect(guarded(lambda *_: self._examine()))
        self.held.currentIndexChanged.connect(guarded(lambda *_: self._show()))
        self.bar = QProgressBar(maximum=100)  # pyright: ignore[reportCallIssue]
        self.begin_button = button("&Simulate", "simulate-skin", "Simulate this skin.")
        self.cancel_button = button("C&lose", "close-skin", "Close (Esc).")
        self.begin_button.setDefault(True)
        self.cancel_button.setAutoDefault(False)
        self.begin_button.clicked.connect(guarded(lambda *_: self._begin()))
        self.cancel_button.clicked.connect(guarded(lambda *_: self.reject()))
        self._lay_out()

    def _lay_out(self) -> None:
        faults, scroll = QWidget(), QScrollArea()
        faults.setLayout(self.found)
        scroll.setWidget(faults)
        scroll.setWidgetResizable(True)
        scroll.setFrameShape(QScrollArea.Shape.NoFrame)
        left, right, whole = QVBoxLayout(), QVBoxLayout(), QHBoxLayout(self)
        for part in (self.about, self.form, scroll, self.message, self.bar):
            left.addLayout(part) if isinstance(part, QFormLayout) else left.addWidget(part)
        buttons = QHBoxLayout()
        buttons.addStretch()
        buttons.addWidget(self.begin_button)
        buttons.addWidget(self.cancel_button)
        left.addLayout(buttons)
        right.addWidget(self.preview, 1)
        right.addWidget(hint := Label(_HINT, wordWrap=True))
        hint.setObjectName("hint")
        whole.addLayout(left, 1)
        whole.addLayout(right, 1)
        self.resize(920, 560)

    # The mesh.

    def choose(self) -> None:
        """Ask for a file."""
        window, folder = self.parentWidget(), str(recordings_folder())
        file, _ = QFileDialog.getOpenFileName(window, "Open a skin", folder, _FILES)
        if file:
            self.begin(Path(file))

    def begin(self, file: Path) -> None:
        """Read the mesh in a file, and show the dialog."""
        self.file, self._read, self.surface, self._faults, self._next = file, None, None, None, 0
        self.unit.clear()
        self.held.setCurrentIndex(0)
        for line in self.ends:
            line.clear()
        self.about.setText(printable(file.name))
        self._reading.compute(read_surface, file, "m")
        self._show(f"Reading{ELLIPSIS}")
        self.show()
        self.raise_()

    def _examine(self) -> None:
        self._faults, self.surface = None, None
        if self._read is not None and (unit := self.unit.currentData()):
            self.surface = MeshSurface(UNITS[unit] * self._read.nodes, self._read.triangles)
            self._reading.compute(faults, self.surface)
        self._show("" if self.surface is None else f"Looking for faults{ELLIPSIS}")

    def _take(self, found: MeshSurface | list[MeshFault]) -> None:
        if isinstance(found, list):
            self._faults = found
            self._show()
            return
        first, self._read = self._read is None, found
        self._used, self._repaired = self.file, not first
        nodes, triangles = len(found.nodes), len(found.triangles)
        self.about.setText(printable(f"{self.file.name}: {triangles:,} triangles, {nodes:,} nodes"))
        if first:
            self.unit.addItem(f"Select the unit{ELLIPSIS}", "")
            for unit in UNITS:
                self.unit.addItem(unit, unit)
        size = np.ptp(_finite(found), axis=0)
        for row, (unit, scale) in enumerate(UNITS.items(), 1):
            sides = " x ".join(f"{float(f'{1e3 * scale * side:.3g}'):,.10g}" for side in size)
            self.unit.setItemText(row, f"{unit}: the skin is {sides} mm")
        self._examine()

    def _repair(self, fault: MeshFault) -> None:
        if self._read is not None and fault.repair:
            self._reading.compute(repaired, self._read, fault.repair)
            self._show(f"Repairing{ELLIPSIS}")

    def _refuse(self, error: Exception) -> None:
        self._show(str(error))

    # What is held.

    def _pick(self, node: int) -> None:
        if self._read is None:
            return
        self.held.setCurrentIndex(1)
        self.ends[self._next].setText(", ".join(f"{x:.6g}" for x in self._read.nodes[node]))
        self._next = 1 - self._next
        self._show()

    def _arc(self) -> list[list[float]] | None:
        """The points (2, 3) in the unit of the file, None for the whole rim."""
        if self.held.currentIndex() == 0:
            return None
        ends = [[float(x) for x in line.text().split(",")] for line in self.ends if line.text()]
        if [len(end) for end in ends] != [3, 3]:
            raise ValueError
        return ends

    def _held_sides(self, surface: MeshSurface) -> Indices:
        try:
            arc = self._arc()
        except ValueError:
            raise Refusal(
                "expected two points of the rim as x, y, z; click them in the preview, or type them"
            ) from None
        scale = UNITS[self.unit.currentData()]
        return held_edges(surface, "all" if arc is None else scale * np.array(arc))

    # What is shown.

    def _show(self, words: str = "") -> None:
        """Show the state, with a message or the next thing to do."""
        surface, faulty, held = self.surface, self._faults, np.empty((0, 2), np.intp)
        busy = self._making.running or (self._reading.running and bool(words))
        ready = surface is not None and faulty == [] and not busy
        if surface is not None and faulty == []:
            try:
                held = self._held_sides(surface)
            except Refusal as refusal:
                words, ready = words or str(refusal), False
        if self._read is not None and surface is None:
            words = words or "Select the unit of length of the file"
        if faulty:
            words = words or "Repair the faults here, or in a mesh program, to simulate this skin"
        self._show_faults(faulty or [], not busy)
        places = [fault.places for fault in faulty or []]
        self.preview.show_surface(
            self._drawn(surface), np.concatenate([*places, np.empty((0, 3))]), held
        )
        for line in self.ends:
            self.form.setRowVisible(line, self.held.currentIndex() == 1)
        self.bar.setVisible(busy)
        self.bar.setRange(0, 100 if self._making.running else 0)  # of reading no share is known
        for widget in self._inputs:
            widget.setEnabled(not self._making.running)
        self.begin_button.setEnabled(ready)
        self.cancel_button.setText("&Cancel" if self._making.running else "C&lose")
        self.message.setText(printable(sentence(words), keep="\n"))

    def _drawn(self, surface: MeshSurface | None) -> MeshSurface | None:
        return self._read if surface is None else surface

    def _show_faults(self, found: list[MeshFault], may_repair: bool) -> None:
        while (item := self.found.takeAt(0)) is not None:
            if (widget := item.widget()) is not None:
                widget.hide()
                widget.deleteLater()
        for fault in found:
            row, layout = QWidget(), QHBoxLayout()
            row.setLayout(layout)
            layout.setContentsMargins(0, 0, 0, 0)
            layout.addWidget(text_label(sentence(fault.message)), 1)
            if fault.repair:
                repair = button(_REPAIRS[fault.repair], f"repair-{fault.kind}", "The file stays.")
                repair.setEnabled(may_repair)
                repair.setAutoDefault(False)  # or Enter in a line would press it
                repair.clicked.connect(guarded(lambda *_, fault=fault: self._repair(fault)))
                layout.addWidget(repair, 0, Qt.AlignmentFlag.AlignTop)
            self.found.addWidget(row)
        self.found.addStretch()

    # The scene.

    def _begin(self) -> None:
        unit = self.unit.currentData()
        if self._read is None:
            return
        if self._repaired and self._used == self.file:
            self._used = proposed(f"{self.file.stem}-repaired.stl")
            write_whole(self._used, _stl(self._read))
        h, stiff = 1e-3 * self.thickness.value(), 1e6 * self.modulus.value()
        skin: dict[str, Any] = {
            "shape": "mesh",
            "file": str(self._used.resolve()),
            "unit": unit,
            "thickness": h,
            "rigidity": float(f"{stiff * h**3 / 12 / (1 - _POISSON**2):.6g}"),
            "edge": _EDGES[self.edge.currentText()],
        }
        if (arc := self._arc()) is not None:
            skin["held"] = arc
        title = self.file.stem
        self._making.compute(new_scene, title, self._used.resolve(), skin, self.elements.value())
        self._show("Setting up the skin: the first time 10 to 60 s, and none later")
        self.bar.setValue(0)

    def _finish(self, scene: Written | float) -> None:
        if isinstance(scene, float):
            self.bar.setValue(round(100 * scene))
            return
        self._making.stop()
        self.accept()
        self.made.emit(scene)

    def done(self, result: int) -> None:
        if self._making.running:
            self._making.cancel()
            return
        self._reading.stop()
        super().done(result)


def _number(
    value: float, least: float, most: float, decimals: int, unit: str, tip: str
) -> QDoubleSpinBox:
    box = QDoubleSpinBox(decimals=decimals, minimum=least, maximum=most, value=value)  # pyright: ignore[reportCallIssue]
    box.setSuffix(unit)
    box.setToolTip(tip)
    return box


def _stl(surface: MeshSurface) -> bytes:
    """A binary STL file."""
    kind = [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")]
    rows = np.zeros(len(surface.triangles), kind)
    rows["corners"] = surface.corners
    return bytes(80) + np.array(len(rows), "<u4").tobytes() + rows.tobytes()


def _text(
    title: str, skin: dict[str, Any], elements: int, functions: int, load: Load | None = None
) -> str:
    lines = [
        "format = 1",
        f"title = {_quoted(title)}",
        "rate = 100.0  # frames/s",
        f"reference = [{functions}, {functions}]",
        "",
        "[skin]",
        *(f"{key} = {_quoted(value)}" for key, value in skin.items()),
        "",
        "[elements]",
        f"spread = {elements}",
        "",
        "[effects]",
        'choose = "linear"',
        "",
        "[effects.gaussian-noise]",
        "rms = 0.1  # 1/m",
    ]
    if isinstance(load, DiscLoad):
        lines += ["", "[[touch]]", 'what = "disc"']
        each = {field.name: getattr(load, field.name) for field in fields(load)}
        lines += [f"{name} = {value:.4g}" for name, value in each.items()]
        lines += ["path = [", *(f"    {step}," for step in _STEPS), "]"]
    return "\n".join((*lines, ""))


def _quoted(value: object) -> str:
    return json.dumps(value, ensure_ascii=False)


def new_scene(
    title: str, file: Path, skin: dict[str, Any], elements: int
) -> Generator[float | Written]:
    """A scene of the mesh in `file`, pressed in its middle, after shares done from 0 to 1.

    It computes and stores the mesh's functions, and what elements read of loads. `skin` is its
    table, with the path of the file.
    """
    at, trust = file.with_suffix(".toml"), frozenset((file,))
    yield 0.0
    nodes = len(read_surface(file, skin["unit"]).nodes)
    functions = min(_FUNCTIONS, math.isqrt(nodes // _PER_FUNCTION))
    scene = read_scene(_text(title, skin, elements, functions), at, trust)
    yield _READ
    patch = scene.plate.patch
    if not isinstance(patch, MeshSkin):
        raise TypeError(patch)
    middle = np.array([patch.a, patch.b]) / 2
    x, y = patch.places[np.linalg.norm(patch.places - middle, axis=1).argmin()].tolist()
    disc = DiscLoad(x, y, _RADIUS * min(patch.a, patch.b))
    pressed = scene.plate, disc, _DEPTH * patch.thickness, scene.basis
    load = yield from with_progress(_READ, _PRESSED, scaled_to, *pressed)
    read = scene.plate, scene.layout, scene.edge
    yield from with_progress(_PRESSED, 1.0, PointContact, *read)
    yield Written(_text(title, skin, elements, functions, load), at, trust)
