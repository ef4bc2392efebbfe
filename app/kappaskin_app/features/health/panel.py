"""Health panel: list of faulty channels, loss of accuracy, and the press test."""

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QAbstractItemView, QHBoxLayout, QSizePolicy, QVBoxLayout, QWidget

from kappaskin.health import Health
from kappaskin.live import STREAMING, Status
from kappaskin_app.features.health.press import ChannelMapTest, PressPage
from kappaskin_app.guard import guarded
from kappaskin_app.widgets.parts import sentence, text_label
from kappaskin_app.widgets.table import Table

_COLUMNS = ("Element", "Channel", "Fault", "Since", "Measured")
_TIP = (
    "Channels that are dead, stuck, noisy, saturated, swapped, drifting or offset. They are "
    "excluded from the estimate until they agree with their neighbours again, which for "
    "a dead, stuck or swapped channel is detected only while it is loaded. Select one to mark it."
)


class HealthPanel(QWidget):
    """The faulty channels, their effect on accuracy, and the press test.

    `pointed` emits the element of the selected row, -1 for none.
    """

    pointed = Signal(int)

    def __init__(self) -> None:
        super().__init__()
        self.words, self.press = text_label("", _TIP), PressPage()
        self.table = self._made_table()
        self._shown = Health()
        left = QVBoxLayout()
        left.setSpacing(4)
        left.addWidget(self.words)
        left.addWidget(self.table, 1)
        around = QHBoxLayout(self)
        around.setContentsMargins(8, 4, 8, 6)
        around.setSpacing(12)
        around.addLayout(left, 3)
        around.addWidget(self.press, 2)
        self._show(Health(), 0.0, streaming=False)

    def _made_table(self) -> Table:
        last = len(_COLUMNS) - 1
        table = Table("findings", "Faulty channels", _COLUMNS, right=(0,), stretched=(last,))
        table.setToolTip(_TIP)
        table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        table.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        table.setWordWrap(False)
        # As high as there is room: it scrolls by itself.
        table.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Ignored)
        table.itemSelectionChanged.connect(guarded(self._point))
        return table

    def connect_to(self, press_test: ChannelMapTest) -> None:
        """Show the progress of `press_test`, and pass the user's requests to it."""
        self.press.connect_to(press_test)

    def show_status(self, status: Status, inside: bool) -> None:
        if self.isVisible():
            self._show(status.health, status.reported, status.state == STREAMING)
        self.press.show_status(status, inside)

    def _show(self, health: Health, now: float, streaming: bool = True) -> None:
        words = sentence(str(health)) if streaming else "No readings arrive, so nothing is checked."
        if health.findings and not streaming:
            words += " The faults found last are listed."
        if len(health.findings) < health.count:
            words += f" The first {len(health.findings)} are listed."
        if words != self.words.text():
            self.words.setText(words)
        rows = []
        for finding in health.findings:
            age = max(0.0, now - finding.since)
            since = f"{age:.0f} s" if age < 90 else f"{age / 60:.0f} min"
            kind = f"{finding.kind}, not excluded" if finding.retained else finding.kind
            texts = (str(finding.element), finding.component, kind, since, finding.figure)
            rows.append([text.replace("-", "\N{MINUS SIGN}") for text in texts])
        self.table.show_rows(rows)
        self._shown = health

    def _point(self) -> None:
        rows = self.table.selectionModel().selectedRows()
        findings = self._shown.findings
        there = [index.row() for index in rows if index.row() < len(findings)]
        self.pointed.emit(findings[there[0]].element if there else -1)
