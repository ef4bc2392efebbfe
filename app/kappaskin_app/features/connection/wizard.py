"""New sensor: from the lines of an unknown board to its description, in three steps."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PySide6.QtCore import (
    QModelIndex,
    QPersistentModelIndex,
    QPointF,
    QRectF,
    Qt,
    QTimer,
    Signal,
)
from PySide6.QtGui import QCloseEvent, QFontDatabase, QPainter, QPalette, QPen, QPolygonF
from PySide6.QtWidgets import (
    QAbstractItemView,
    QCheckBox,
    QComboBox,
    QDialog,
    QDoubleSpinBox,
    QFileDialog,
    QFormLayout,
    QHBoxLayout,
    QLineEdit,
    QPlainTextEdit,
    QSpinBox,
    QStackedWidget,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QVBoxLayout,
    QWidget,
)

from kappaskin._files import write_whole
from kappaskin._text import printable
from kappaskin.errors import Refusal
from kappaskin.frames import Array
from kappaskin.recording import FileLines, is_foreign
from kappaskin.sources import (
    FEED,
    READS,
    NewSensor,
    Port,
    RawLines,
    RecognisedLines,
    by_rows,
    columns_of,
    description_text,
)
from kappaskin_app.features.connection.panel import PortSearch
from kappaskin_app.guard import guarded
from kappaskin_app.shell.background import Tasks
from kappaskin_app.shell.folders import proposed
from kappaskin_app.widgets.parts import ELLIPSIS, Label, button, in_a_row, sentence
from kappaskin_app.widgets.surface_map import SurfaceMap
from kappaskin_app.widgets.table import Table

_PLACE = re.compile(r"^.*?line \d+: (?:[\w.]+: )?")  # in the text of a description
_PERIOD = 100  # ms between two looks at what arrived
_SHOWN = 14  # raw lines
_COURSE = 100  # newest numbers of a column that are drawn
_CELL = 24  # px of the map's picture along a side of an element, so that it has edges
_NOW = 5  # numbers that are now
_SURE, _SHARE = 4.0, 0.3  # times the noise, and share of the most, of a column that answers
_QUIET = 10.0  # times the scatter, that the map shows at least
_HELD = 300  # looks for which a column may answer before that is its rest
_STEPS = ("1 Port", "2 Columns", "3 Skin")
_NUMBER, _NAME, _VALUE, _TRACE, _ROLE = range(5)
_IGNORED, _COUNTED = "Ignored", "Line count"
_MEANINGS = {
    _IGNORED: "",
    "Time in s": "time",
    "Time in ms": "time_ms",
    "Time in \N{MICRO SIGN}s": "time_us",
    _COUNTED: "sequence",
    "Height": "height",
    "Slope along x": "slope@0",
    "Slope along y": "slope@90",
    "Curvature xx": "xx",
    "Curvature yy": "yy",
    "Curvature xy": "xy",
}
_UNITS = {
    "height": {"\N{MICRO SIGN}m": 1e-6, "mm": 1e-3, "m": 1.0},
    "slope": {"degrees": np.pi / 180, "mrad": 1e-3, "rad": 1.0},
    "curvature": {"1/m": 1.0, "1/mm": 1e3},
}
_HINTS = (
    "Plug the board in, or type its port or URL, such as /dev/ttyACM0, COM3 or udp://:9870.",
    "Let go of the skin, then press it: columns that respond are highlighted. Select rows to "
    "change them.",
    "Press the skin: the map shows where. Element 0 is at low x and low y, at the lower left.",
)
_FILE_HINTS = (
    "The first rows of the file. For a board, plug it in, or type its port or URL.",
    "Select rows to change what they are.",
    "Element 0 is at low x and low y, at the lower left.",
)

_SHAPES = (
    "The skin is a flat rectangle with a grid of elements. For any other, such as a mesh from a "
    "file, edit [skin] and [elements] of the saved file, as in Help > Guide, Your own sensor."
)


class _Trace(QStyledItemDelegate):
    """Draws the course of a column in its cell."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.numbers: Array = np.empty((0, 0))

    def paint(
        self,
        painter: QPainter,
        option: QStyleOptionViewItem,
        index: QModelIndex | QPersistentModelIndex,
    ) -> None:
        super().paint(painter, option, index)
        if index.row() >= self.numbers.shape[1]:
            return
        values = self.numbers[-_COURSE:, index.row()]
        there = np.flatnonzero(np.isfinite(values))
        if len(there) < 2:
            return
        area: QRectF = QRectF(option.rect).adjusted(4, 3, -4, -3)  # pyright: ignore
        low, high = float(values[there].min()), float(values[there].max())
        x = area.left() + there / (_COURSE - 1) * area.width()
        y = area.bottom() - (values[there] - low) / ((high - low) or 1.0) * area.height()
        painter.save()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(QPen(option.palette.color(QPalette.ColorRole.Highlight), 1.2))  # pyright: ignore
        painter.drawPolyline(QPolygonF([QPointF(*at) for at in np.column_stack([x, y]).tolist()]))
        painter.restore()


class NewSensorDialog(QDialog):
    """Three steps: the port with its raw lines, what the columns are, the skin.

    `opening` brings the port before it is opened; `made` the file of a description, its port, and
    the topic of a bag. A file of lines or messages may take the place of the port.
    """

    opening = Signal(str)
    made = Signal(Path, str, str)

    def __init__(self, tasks: Tasks, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("new_sensor")
        self.setWindowTitle("New sensor")
        self.resize(860, 620)
        self.lines: RawLines | FileLines | None = None
        self.found = RecognisedLines()
        self.columns: tuple[str, ...] = ()
        self._known: set[str] | None = None
        self._rest: Array | None = None  # what the columns are while nothing answers
        self._held = 0  # looks since something answers
        self.step, self.hint, self.fact = Label(), Label(wordWrap=True), Label(wordWrap=True)  # pyright: ignore[reportCallIssue]
        self.step.setTextFormat(Qt.TextFormat.RichText)
        self.pages = QStackedWidget()
        for page in (self._port_page(), self._column_page(), self._skin_page()):
            self.pages.addWidget(page)
        for widget, tip in self._tips():
            widget.setToolTip(tip)
        self.back = button("&Back", "back", "The step before.")
        self.next = button("&Next", "next", "The next step.")
        self.cancel = button("Cancel", "cancel", "Close without saving (Esc).")
        self.back.clicked.connect(guarded(lambda *_: self._turn(-1)))
        self.next.clicked.connect(guarded(lambda *_: self._turn(+1)))
        self.cancel.clicked.connect(guarded(lambda *_: self.reject()))
        buttons = QHBoxLayout()
        buttons.addStretch(1)
        for each in (self.back, self.next, self.cancel):
            each.setAutoDefault(False)
            buttons.addWidget(each)
        layout = QVBoxLayout(self)
        for widget in (self.step, self.hint):
            layout.addWidget(widget)
        layout.addWidget(self.pages, 1)
        layout.addWidget(self.fact)
        layout.addLayout(buttons)
        self.search = PortSearch(self.ports, tasks, self)
        self.search.found.connect(guarded(self.show_ports))
        self._timer = QTimer(self, interval=_PERIOD)  # pyright: ignore[reportCallIssue]
        self._timer.timeout.connect(guarded(self.look))
        self._show_step()

    # The pages.

    def _port_page(self) -> QWidget:
        page = QWidget()
        self.ports = QComboBox(editable=True, insertPolicy=QComboBox.InsertPolicy.NoInsert)  # pyright: ignore[reportCallIssue]
        self.ports.setObjectName("new_sensor_port")
        self.ports.setAccessibleName("Port or URL of the board")
        self.ports.setCompleter(None)  # pyright: ignore[reportArgumentType]
        self.ports.activated.connect(guarded(lambda *_: self._read_port()))
        self.read = button("&Read", "read_port", "Show what this port or URL sends (Enter).")
        self.read.clicked.connect(guarded(lambda *_: self._read_port()))
        self.ports.lineEdit().returnPressed.connect(guarded(self._read_port))  # pyright: ignore
        self.topics = QComboBox(sizeAdjustPolicy=QComboBox.SizeAdjustPolicy.AdjustToContents)  # pyright: ignore[reportCallIssue]
        self.topics.setAccessibleName("Topic of the messages")
        self.topics.setVisible(False)
        self.topics.activated.connect(guarded(lambda *_: self._read_topic()))
        self.raw = QPlainTextEdit(readOnly=True)  # pyright: ignore[reportCallIssue]
        self.raw.setAccessibleName("Lines as they arrive")
        self.raw.setPlaceholderText("The lines of the board are shown here as they arrive.")
        self.raw.setFont(QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont))
        self.raw.setLineWrapMode(QPlainTextEdit.LineWrapMode.NoWrap)
        layout = QVBoxLayout(page)
        layout.setContentsMargins(0, 0, 0, 0)
        above = QHBoxLayout()
        above.addWidget(self.ports, 1)
        above.addWidget(self.topics)
        above.addWidget(self.read)
        layout.addLayout(above)
        layout.addWidget(self.raw, 1)
        return page

    def _column_page(self) -> QWidget:
        page = QWidget()
        self.reads, self.order = QComboBox(), QComboBox()
        self.reads.addItems(list(READS))
        self.reads.setAccessibleName("What the elements read")
        self.order.addItems(["All of one kind together", "All of one element together"])
        self.order.setAccessibleName("Order of the columns")
        for box in (self.reads, self.order):
            box.activated.connect(guarded(lambda *_: self._guess()))
        heads = ("Column", "Name", "Now", "Course", "What it is")
        self.table = Table("columns", "Columns", heads, right=(0, 2), stretched=(_TRACE,))
        self.table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self._trace = _Trace(self.table)
        self.table.setItemDelegateForColumn(_TRACE, self._trace)
        self.meaning, self.element = QComboBox(), QSpinBox(maximum=999_999)  # pyright: ignore[reportCallIssue]
        self.meaning.addItems(list(_MEANINGS))
        self.meaning.setAccessibleName("What the selected columns are")
        self.element.setPrefix("from element ")
        self.element.setAccessibleName("Element of the first selected column")
        self.assign = button("&Set", "set_columns", "Set what the selected columns are.")
        self.assign.clicked.connect(guarded(lambda *_: self._assign()))
        layout = QVBoxLayout(page)
        layout.setContentsMargins(0, 0, 0, 0)
        guess = in_a_row(Label("Elements read"), self.reads, Label("Order"), self.order)
        guess.addStretch(1)
        change = in_a_row(Label("Selected columns are"), self.meaning, self.element, self.assign)
        change.addStretch(1)
        layout.addLayout(guess)
        layout.addWidget(self.table, 1)
        layout.addLayout(change)
        return page

    def _skin_page(self) -> QWidget:
        page, form = QWidget(), QFormLayout()
        self.form = form
        self.name = QLineEdit("My sensor")
        self.sides = [_length(40.0), _length(40.0)]
        self.grid = [QSpinBox(minimum=1, maximum=4096) for _ in range(2)]  # pyright: ignore[reportCallIssue]
        self.along = QComboBox()
        self.along.addItems(["Above it (along y first)", "To its right (along x first)"])
        self.scale = _Factor(decimals=9, minimum=-1e9, maximum=1e9, value=1.0)  # pyright: ignore[reportCallIssue]
        self.scale.setStepType(QDoubleSpinBox.StepType.AdaptiveDecimalStepType)
        self.unit = QComboBox()
        self.rate = QDoubleSpinBox(decimals=3, minimum=1e-3, maximum=1e5, value=100.0)  # pyright: ignore[reportCallIssue]
        self.rate.setSuffix(" rows/s")
        self.free = QCheckBox("The zero is unknown in each frame")
        self.free.setToolTip(
            "Each frame has an unknown offset, as where the distance of a camera is not known."
        )
        self.known = QCheckBox("Its rigidity is")
        self.known.setToolTip("Where it is known, forces are estimated too.")
        self.rigidity = QDoubleSpinBox(decimals=6, minimum=1e-6, maximum=1e6, value=3.7e-3)  # pyright: ignore[reportCallIssue]
        self.rigidity.setSuffix(" N m")
        self.rigidity.setAccessibleName("Rigidity of the skin")
        self.rigidity.setEnabled(False)
        self.known.toggled.connect(self.rigidity.setEnabled)
        names = ("Size in x", "Size in y", "Elements in x", "Elements in y", "Next element is")
        names += ("Scale", "Unit", "Rate")
        boxes = (*self.sides, *self.grid, self.along, self.scale, self.unit, self.rate)
        for words, box in zip(names, boxes, strict=True):
            box.setAccessibleName(words)
        times = "\N{MULTIPLICATION SIGN}"
        form.addRow("Name", self.name)
        pairs = (in_a_row(a, Label(times), b) for a, b in (self.sides, self.grid))
        for words, pair in zip(("Size in mm", "Elements"), pairs, strict=True):
            for place in (0, 2):
                pair.setStretch(place, 1)
            form.addRow(words, pair)
        form.addRow("Next element is", self.along)
        form.addRow("A number of 1 means", in_a_row(self.scale, self.unit))
        form.addRow("Rate", self.rate)
        form.addRow("", self.free)
        form.addRow("Skin", in_a_row(self.known, self.rigidity))
        form.addRow("", shapes := Label(_SHAPES, wordWrap=True))  # pyright: ignore[reportCallIssue]
        shapes.setObjectName("hint")
        self.map = SurfaceMap("Readings now", "", "Change of the readings since the beginning.")
        layout = QHBoxLayout(page)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addLayout(form, 1)
        layout.addWidget(self.map, 1)
        return page

    def _tips(self) -> list[tuple[QWidget, str]]:
        return [
            (self.ports, "A port found on this machine, or a port or URL typed here."),
            (self.topics, "The messages of this bag that have the readings."),
            (self.raw, "The newest lines, as they arrive."),
            (self.reads, "What each element reads; the columns are guessed by it."),
            (self.order, "How the readings of several kinds follow each other in a line."),
            (self.table, "A row for each column. Select rows to change what they are."),
            (self.meaning, "What the selected columns are; Set applies it."),
            (self.element, "Element of the first selected column; the next ones follow."),
            (self.name, "Name of the sensor, shown wherever it is connected."),
            (self.sides[0], "Length of the skin in x."),
            (self.sides[1], "Length of the skin in y."),
            (self.grid[0], "Number of elements in x."),
            (self.grid[1], "Number of elements in y."),
            (self.along, "Where element 1 is, beside element 0."),
            (self.scale, "Reading for a number of 1 from the board."),
            (self.unit, "Unit of a reading."),
            (self.rate, "Rows of the file per second, as it has no times."),
            (self.rigidity, "Bending rigidity D = E h\u00b3 / (12 (1 \u2212 \u03bd\u00b2))."),
        ]

    # The port.

    def show_ports(self, ports: list[Port]) -> None:
        """List these ports; one that was just plugged in is read, unless another one is."""
        names = [port.port for port in ports if not port.port.startswith(FEED)]
        known, self._known = self._known, set(names)
        if known is not None and self._known == known:
            return
        text = self.ports.currentText()
        self.ports.clear()
        self.ports.addItems(names)
        self.ports.setCurrentText(text)
        new = [name for name in names if known is not None and name not in known]
        if len(new) == 1 and self.lines is None:
            self.ports.setCurrentText(new[0])
            self._read_port()

    def _read_port(self) -> None:
        url = self.ports.currentText().strip()
        if not url or (self.lines is not None and self.lines.url == url):
            return
        self._let_go()
        if (file := Path(url)).is_file() or is_foreign(file):
            self._begin(FileLines(file))
        else:
            self.opening.emit(url)
            self._begin(RawLines(url))

    def _read_topic(self) -> None:
        if self.lines is not None:
            self._begin(FileLines(Path(self.lines.url), self.topics.currentText()))

    def _begin(self, lines: RawLines | FileLines) -> None:
        """Look at these lines from now on."""
        self.lines = lines
        topics = lines.topics if isinstance(lines, FileLines) else []
        self.topics.clear()
        self.topics.addItems(topics)
        self.topics.setVisible(len(topics) > 1)
        if isinstance(lines, FileLines):
            self.topics.setCurrentText(lines.topic)
        self.found, self.columns = RecognisedLines(), ()
        self.raw.clear()
        self.look()
        self._show_step()

    def _let_go(self) -> None:
        if self.lines is not None:
            self.lines.close()
            self.lines = None

    # What arrives.

    def look(self) -> None:
        """Show what has arrived since the last look."""
        if self.lines is None:
            return
        self.lines.poll()
        found = self.lines.recogniser.found()
        if found.kind:
            was, self.found = self.found, found
            # What a person has seen is no more guessed anew, as after a board was plugged in again.
            first = self.pages.currentIndex() == 0 and found.roles not in ((), was.roles)
            if found.labels != was.labels or first:
                self._guess()
            self._follow_rest()
        if self.pages.currentIndex() == 0:
            newest = [line for _, line in list(self.lines.recogniser.lines)[-_SHOWN:]]
            self.raw.setPlainText("\n".join(printable(line) for line in newest))
        self._trace.numbers = self.found.numbers
        if self.pages.currentIndex() == 1:
            self._show_columns()
        elif self.pages.currentIndex() == 2:
            self._show_map()
        self._show_fact()

    def _show_fact(self) -> None:
        text, ready = self.found.text, bool(self.found.roles)
        if self.found.kind and not ready:
            text += f" Looking for times{ELLIPSIS}"
        if self.lines is not None and self.lines.trouble:
            text = self.lines.trouble
        elif self.lines is not None and not (now := self.lines.recogniser.found()).kind:
            text, ready = now.text, ready and not now.trouble
        if self.pages.currentIndex() == 2 and ready:
            wrong, ready = self._miscounted()
            text = wrong or text
            try:
                if ready:
                    self._text()
            except Refusal as refusal:
                text, ready = sentence(_PLACE.sub("", str(refusal))), False
        self.fact.setText(printable(text) if self.lines is not None else "")
        self.next.setEnabled(ready)

    # The columns.

    def _guess(self) -> None:
        """What the columns are, from what the elements read."""
        reads = READS[self.reads.currentText()]
        self._rest = None
        self.columns = columns_of(self.found, reads, bool(self.order.currentIndex()))
        count = sum(":" in column for column in self.columns) // len(reads)
        first = next((m for m in range(round(count**0.5), 0, -1) if count % m == 0), 1)
        for box, value in zip(self.grid, (max(count // first, 1), first), strict=True):
            box.setValue(value)
        self._offer_units()

    def _offer_units(self) -> None:
        quantity = next((c.partition(":")[0] for c in self.columns if ":" in c), "height")
        kind = quantity.partition("@")[0]
        units = _UNITS.get(kind, _UNITS["curvature"])
        if [self.unit.itemText(n) for n in range(self.unit.count())] != list(units):
            self.unit.clear()
            for name, factor in units.items():
                self.unit.addItem(name, factor)

    def _assign(self) -> None:
        """Set what the selected columns are, from an element on."""
        rows = sorted({index.row() for index in self.table.selectedIndexes()})
        meaning, columns = _MEANINGS[self.meaning.currentText()], list(self.columns)
        single = self.meaning.currentText() != _IGNORED and meaning in ("sequence", *_times())
        for n, row in enumerate(rows[:1] if single else rows):
            reading = meaning and not single
            columns[row] = f"{meaning}:{self.element.value() + n}" if reading else meaning
        self.columns = tuple(columns)
        self._offer_units()
        self._show_columns()

    def _show_columns(self) -> None:
        numbers = self.found.numbers
        now = numbers[-1] if len(numbers) else np.empty(0)
        rows = enumerate(zip(self.found.labels, now, self.columns, strict=False))
        self.table.show_rows(
            [
                (str(row), label * (label != str(row)), f"{value:.6g}", "", column or "ignored")
                for row, (label, value, column) in rows
            ]
        )
        answering = self.answering()
        light = QPalette.ColorRole.Highlight, QPalette.ColorRole.HighlightedText
        plain = QPalette.ColorRole.Base, QPalette.ColorRole.Text
        for row in range(self.table.rowCount()):
            paper, ink = map(self.palette().brush, light if row in answering else plain)
            for column in (_NUMBER, _VALUE):
                if item := self.table.item(row, column):
                    item.setBackground(paper)
                    item.setForeground(ink)
        self.table.viewport().update()

    def _follow_rest(self) -> None:
        """Follow what the columns are at rest, while none answers or one does for very long.

        Not right after a press, when most of the newest numbers are of that.
        """
        numbers = np.nan_to_num(self.found.numbers)  # a missing one is no answer
        if len(numbers) < 4 * _NOW:
            return
        self._held, rest = self._held + 1 if self.answering() else 0, self._rest
        usual = np.median(numbers[-_COURSE:], axis=0)
        if rest is None or self._held > _HELD or not (self._held or self._answers(usual)):
            self._rest, self._held = usual, 0

    def answering(self) -> list[int]:
        """The columns that differ now by far more than they scatter; none of times and counts."""
        rest = self._rest
        return [] if rest is None or len(rest) != len(self.columns) else self._answers(rest)

    def _answers(self, rest: Array) -> list[int]:
        """Those that differ now from what they are at `rest` (columns,)."""
        numbers = np.nan_to_num(self.found.numbers)
        if len(numbers) < 4 * _NOW:
            return []
        noise = _scatter(numbers)
        moved = np.abs(np.mean(numbers[-_NOW:], axis=0) - rest)
        moved[[":" not in column for column in self.columns]] = 0.0
        most = moved.max(initial=0.0)
        return np.flatnonzero((moved > _SURE * noise) & (moved > _SHARE * most)).tolist()

    # The skin.

    def _sensor(self) -> NewSensor:
        x, y = (1e-3 * box.value() for box in self.sides)
        return NewSensor(
            self.name.text().strip() or "My sensor",
            (round(x, 9), round(y, 9)),
            (self.grid[0].value(), self.grid[1].value()),
            self._placed(),
            float(f"{self.scale.value() * (self.unit.currentData() or 1.0):.9g}"),
            self.rigidity.value() if self.known.isChecked() else None,
            self.free.isChecked(),
            self.lines.baud if self.lines is not None else 115_200,
            self.rate.value() if self._untimed else None,
        )

    def _placed(self) -> tuple[str, ...]:
        """The columns, with elements by their places: along y first."""
        grid = self.grid[0].value(), self.grid[1].value()
        return by_rows(self.columns, grid) if self.along.currentIndex() else self.columns

    def _miscounted(self) -> tuple[str, bool]:
        """What is wrong with the number of elements, and whether they all have a place."""
        numbers = {column.partition(":")[2] for column in self.columns if ":" in column}
        m, n = (box.value() for box in self.grid)
        count, fits = len(numbers), all(int(number) < m * n for number in numbers)
        if not fits:
            return f"{count} elements have columns, but Elements is {m} x {n} = {m * n}.", False
        missing = f"Of {m} x {n} = {m * n} elements {m * n - count} have no column."
        return missing if count < m * n else "", True

    @property
    def _untimed(self) -> bool:
        """Whether the rows of a file have no times."""
        of_file = isinstance(self.lines, FileLines) and not self.lines.timed
        return of_file and not set(self.columns) & set(_times())

    def _text(self) -> str:
        return description_text(self.found, self._sensor())

    def _show_map(self) -> None:
        """The change of the first kind of reading on the grid, in its unit."""
        m, n = (box.value() for box in self.grid)
        numbers, values = self.found.numbers, np.full(m * n, np.nan)
        first = next((c.partition(":")[0] for c in self.columns if ":" in c), "")
        if len(numbers) and self._rest is not None:
            change = np.mean(np.nan_to_num(numbers[-3:]), axis=0) - self._rest
            for place, column in enumerate(self._placed()):
                what, found, element = column.partition(":")
                if found and what == first and int(element) < m * n:
                    values[int(element)] = change[place] * self.scale.value()
        scatter = float(np.median(_scatter(numbers))) if len(numbers) > 1 else 0.0
        most = float(np.nan_to_num(np.abs(values)).max(initial=0.0))
        most = max(most, _QUIET * scatter * abs(self.scale.value())) or 1.0
        sides = (self.sides[0].value(), self.sides[1].value())
        nowhere = np.full(2, np.nan)
        self.map.title.setText(f"Change of {first} now, in {self.unit.currentText()}")
        cells = values.reshape(m, n).T.repeat(_CELL, 0).repeat(_CELL, 1)
        self.map.show_surface(cells, (-most, most), "diverging", nowhere, sides)

    # The steps.

    def _turn(self, by: int) -> None:
        if self.pages.currentIndex() + by == len(_STEPS):
            self._save()
            return
        self.pages.setCurrentIndex(self.pages.currentIndex() + by)
        self._show_step()
        self.look()

    def _show_step(self) -> None:
        at, of_file = self.pages.currentIndex(), isinstance(self.lines, FileLines)
        each = (f"<b>{words}</b>" if n == at else words for n, words in enumerate(_STEPS))
        self.step.setText("&nbsp; › &nbsp;".join(each))
        self.hint.setText((_FILE_HINTS if of_file else _HINTS)[at])
        self.form.setRowVisible(self.rate, self._untimed)
        self.back.setEnabled(at > 0)
        what = "import" if of_file else "connect"
        self.next.setText(f"&Save and {what}{ELLIPSIS}" if at == len(_STEPS) - 1 else "&Next")
        first: Sequence[QWidget] = (self.ports, self.table, self.name)
        first[at].setFocus()
        self._show_fact()

    def _save(self) -> None:
        if self.lines is None:
            return
        name = "".join(c if c.isalnum() or c in " -_" else "-" for c in self._sensor().title)
        proposal, kind = str(proposed(f"{name}.toml")), "Sensor description (*.toml)"
        chosen, _ = QFileDialog.getSaveFileName(
            self, "Save the description of the sensor", proposal, kind
        )
        if not chosen:
            return
        file = Path(chosen) if chosen.endswith(".toml") else Path(f"{chosen}.toml")
        try:
            write_whole(file, self._text())
        except Refusal as refusal:
            self.fact.setText(printable(str(refusal)))
            return
        url, topic = self.lines.url, getattr(self.lines, "topic", "")
        self.accept()
        self.made.emit(file, url, topic)

    def begin(self, file: Path | None = None) -> None:
        """Show the dialog, with the port that was typed last, or the lines of a `file`."""
        self._show_step()
        self.show()
        self.raise_()
        self.ports.setFocus()
        self._timer.start()
        self.search.refresh()
        if file is not None:
            self.ports.setCurrentText(str(file))
            self._read_port()

    def done(self, result: int) -> None:
        self._timer.stop()
        self._let_go()
        self.found, self.columns = RecognisedLines(), ()
        self.raw.clear()
        self.pages.setCurrentIndex(0)
        self._show_step()
        super().done(result)

    def closeEvent(self, event: QCloseEvent) -> None:
        self.done(QDialog.DialogCode.Rejected)
        super().closeEvent(event)


def _scatter(numbers: Array) -> Array:
    """How much each of the columns (n, columns) scatters, without what moves slowly."""
    return np.percentile(np.abs(np.diff(np.nan_to_num(numbers), axis=0)), 90, axis=0)


def _times() -> list[str]:
    return [meaning for meaning in _MEANINGS.values() if meaning.startswith("time")]


class _Factor(QDoubleSpinBox):
    """A number without zeros at its end."""

    def textFromValue(self, val: float) -> str:
        return self.locale().toString(val, "g", 9)


def _length(value: float) -> QDoubleSpinBox:
    return QDoubleSpinBox(decimals=2, minimum=0.1, maximum=1e5, value=value)  # pyright: ignore[reportCallIssue]
