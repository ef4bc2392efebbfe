"""Publishing of estimates to other programs: receivers and counts."""

import math
import time

from kappaskin.live import Status
from kappaskin.publish import TargetStatus
from kappaskin_app.guard import guarded
from kappaskin_app.shell.form import Form
from kappaskin_app.shell.pages import LIVE
from kappaskin_app.shell.window import MainWindow
from kappaskin_app.widgets.parts import ELLIPSIS, text_label

_NAMES = (
    *("send_udp", "udp_to", "send_cues", "cues_to"),
    *("serve_foxglove", "foxglove_at", "allowed_pages", "send_rerun", "rerun_at"),
)
_EVERY = 0.5  # s between two updates of the counts
_TIP = (
    "Messages sent to each receiver, and those dropped because it was not ready or not found. "
    "Publishing never delays the readings."
)
_LATE = "Latency from the arrival of a frame's bytes until it was sent, 99th percentile."


class PublishFeature:
    name = "publish"

    def install(self, shell: MainWindow) -> None:
        self.publish = shell.panels.add(LIVE, PublishPanel())
        shell.session.publish_refused.connect(guarded(self.publish.show_refusal))


class PublishPanel(Form):
    """Settings of receivers; shows what each gets, and errors."""

    purpose = (
        "Sends the contact with its error bars to other programs, as JSON by UDP, to Foxglove "
        "or to Rerun, and what is to be felt to haptic devices; example receivers come with the "
        "library."
    )
    guide_page = "record"

    def __init__(self) -> None:
        super().__init__("Publish", _NAMES)
        self.counts, self.late = text_label(tip=_TIP), text_label(tip=_LATE)
        for label in (self.counts, self.late):
            label.hide()
            self.body.addWidget(label)
        self._refusal, self._next = "", 0.0

    def show_refusal(self, refusal: str) -> None:
        """Show why nothing is published; empty when it is."""
        self._refusal = f"Not publishing: {refusal}" if refusal else ""
        self._next = 0.0

    def show_status(self, status: Status, simulating: bool) -> None:
        now, news = time.monotonic(), status.publishing
        if now < self._next:
            return
        self._next = now + _EVERY
        late = news.latency.whole
        lines = [line for target in news.targets for line in _words(target)]
        latency = f"99 % within {1e3 * late:.1f} ms" if math.isfinite(late) else ""
        for label, text in ((self.counts, "\n".join(lines)), (self.late, latency)):
            if text != label.text():
                label.setText(text)
            label.setVisible(bool(text))
        refused = [self._refusal, *(target.refusal for target in news.targets)]
        notices = [notice for target in news.targets for notice in target.notices]
        self.show_message("\n".join([*(f"{why}." for why in refused if why), *notices]))


def _words(target: TargetStatus) -> list[str]:
    """Lines about a target and each of its clients; none where it is refused."""
    if target.refusal:
        return []
    if target.opening:
        return [f"{target.target}: connecting{ELLIPSIS}"]
    serving = target.target.startswith("foxglove")
    name = target.target.removeprefix("udp://").removeprefix("foxglove://")
    name = name.replace("cue://", "cues to ").replace("rerun://", "Rerun at ")
    lines = [f"{name}, {len(target.receivers)} connected" if serving else name]
    for receiver in target.receivers:
        who = f"{receiver.name}: " if serving else ""
        trouble = f", {receiver.trouble}" if receiver.trouble else ""
        counts = f"{receiver.sent:,} sent, {receiver.dropped:,} dropped"
        lines.append(f"    {who}{counts}{trouble}")
    if target.cue is not None and math.isfinite(target.cue.most):
        half, most = 1e3 * target.cue.half, 1e3 * target.cue.most
        lines.append(f"    bytes in to cue out: {half:.1f} ms, 99 % within {most:.1f} ms")
        lines.append(f"    {target.cue.missed:,} not in time, {target.cue.state}")
    return lines
