"""Estimates published to other programs."""

from kappaskin_app.features.publish.panel import PublishPanel
from kappaskin_app.guard import guarded
from kappaskin_app.shell.pages import LIVE
from kappaskin_app.shell.window import MainWindow


class PublishFeature:
    name = "publish"

    def install(self, shell: MainWindow) -> None:
        self.publish = shell.panels.add(LIVE, PublishPanel())
        shell.session.unsent.connect(guarded(self.publish.show_refusal))
