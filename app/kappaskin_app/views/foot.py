"""The foot of the window: what is said in passing, what touches the skin, what is being done."""

from PySide6.QtWidgets import QStatusBar, QWidget

from kappaskin_app.columns import row
from kappaskin_app.views.activity import Activity
from kappaskin_app.views.line import Line
from kappaskin_app.views.notice import Notice

_OBJECT = (
    "What the readings say touches the skin, with 95 % interval and the second guess's "
    "probability; and the principal curvatures of the skin at the contact."
)


class Foot(QStatusBar):
    """Shows a `notice`, the `object` that touches, what takes long (`activity`), and `failures`."""

    def __init__(self, notice: Notice, failures: QWidget) -> None:
        super().__init__()
        # There from the start, or its first message would push the rest up.
        self.addWidget(notice)
        self.object, self.activity = Line(), Activity()
        self.object.setToolTip(_OBJECT)
        self.addPermanentWidget(self.object, 1)
        foot = row(self.activity, failures)
        # As high from the start: a bar that grows shows all again that a message hides.
        foot.setMinimumHeight(max(w.sizeHint().height() for w in (foot, failures)))
        self.addPermanentWidget(foot)
        # What it takes of the bar, all that the rest leaves, a passing message needs.
        self.messageChanged.connect(lambda text: self.object.setHidden(bool(text)))
