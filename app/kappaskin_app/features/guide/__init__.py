"""The guide in the window."""

from collections.abc import Iterator
from functools import partial

from kappaskin_app.features.guide.panel import GuidePanel, Page, page_called, pages
from kappaskin_app.guard import guarded
from kappaskin_app.shell.finder import FinderEntry
from kappaskin_app.shell.parts import HELP
from kappaskin_app.shell.window import MainWindow

_ABOUT = "How to connect, calibrate and record; what the numbers mean; troubleshooting"


class GuideFeature:
    name = "guide"

    def install(self, shell: MainWindow) -> None:
        self._shell, self.guide = shell, GuidePanel()
        shell.docks.put_beside("guide", "Guide", self.guide, "Ctrl+F1", _ABOUT, HELP, share=0.34)
        shell.guide_requested.connect(guarded(lambda name: self.read(page_called(name))))
        shell.menus.entry_sources.append(self._entries)

    def read(self, page: Page, heading: str = "") -> None:
        """Show a page of the guide, from a heading in it on."""
        self.guide.read(page, heading)
        self._shell.docks.reveal("guide")

    def _entries(self) -> Iterator[FinderEntry]:
        for page in pages():
            for heading in ("", *page.headings):
                name = f"guide:{page.file.stem}{'#' if heading else ''}{heading}"
                place = f"Guide, {page.title}" if heading else "Guide"
                read = partial(self.read, page, heading)
                yield FinderEntry(name, heading or page.title, place, read)
