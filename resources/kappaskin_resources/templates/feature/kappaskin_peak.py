from PySide6.QtWidgets import QLabel


class PeakFeature:
    """A dock with the largest force so far."""

    name = "peak"

    def install(self, shell):
        self.label, self.most = QLabel("no force yet"), 0.0
        about = "The largest contact force since the window opened"
        shell.docks.put_below("peak", "Largest force", self.label, "Ctrl+Alt+9", about)
        shell.session.estimated.connect(self.show)

    def show(self, estimate):
        if estimate.contact.force > self.most:
            self.most = estimate.contact.force
            self.label.setText(f"{self.most:.3f} N")
