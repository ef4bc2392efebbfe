"""Settings of publishing: targets of the estimates."""

from dataclasses import dataclass
from itertools import chain, compress

from kappaskin_app.shell.settings.form_fields import Switch, Text, setting


@dataclass(frozen=True)
class PublishSettings:
    """UDP, haptic cues, Foxglove and Rerun, each with its address; all are off by default."""

    send_udp: bool = setting(
        False,
        Switch(
            "Datagrams (UDP)",
            "Send contact, shape and error bars of every estimate as JSON, one datagram each, to a "
            "robot or to PlotJuggler's UDP server.",
        ),
    )
    udp_to: str = setting(
        "127.0.0.1:9870",
        Text("To", "HOST:PORT of the receiver; separate several receivers by commas."),
    )
    send_cues: bool = setting(
        False,
        Switch(
            "Haptic cues",
            "Send a haptic device what is to be felt, a thousand times a second: force, direction, "
            "curvature and slip. They fade to nothing within 100 ms where data are old or lost.",
        ),
    )
    cues_to: str = setting(
        "127.0.0.1:9871",
        Text(
            "Device",
            "HOST:PORT of the device. Limits may follow, as in 127.0.0.1:9871?force=2&rate=100: "
            "force in N, 3 without one, rate of its change in N/s, 100, curvature in 1/m, 200, and "
            "slip in m/s, 0.5. Separate several devices by commas.",
        ),
    )
    serve_foxglove: bool = setting(
        False,
        Switch(
            "Foxglove",
            "Serve Foxglove and other clients of its WebSocket protocol: the same messages, the "
            "skin in 3D and a log. In Foxglove, open a connection to ws:// and the address below.",
        ),
    )
    foxglove_at: str = setting(
        "127.0.0.1:8765",
        Text(
            "At",
            "HOST:PORT of the server. 127.0.0.1 accepts connections of this machine only, 0.0.0.0 "
            "from any machine in the network that has the token: open the URL shown below.",
        ),
    )
    allowed_pages: str = setting(
        "",
        Text(
            "Allowed pages",
            "Origins of web pages that may connect, besides those of this machine; separate "
            "several by commas. https://app.foxglove.dev is Foxglove in the browser, file:// its "
            "desktop app.",
        ),
    )
    send_rerun: bool = setting(
        False,
        Switch(
            "Rerun",
            "Send the viewer of Rerun the skin, the contact, maps of the readings and all "
            "numbers over time. Start the viewer with the command rerun; it may start later.",
        ),
    )
    rerun_at: str = setting("127.0.0.1:9876", Text("Viewer", "HOST:PORT where the viewer listens."))

    @property
    def targets(self) -> list[str]:
        """The enabled targets, as addresses of the engine."""
        udp = [f"udp://{place.strip()}" for place in self.udp_to.split(",")]
        cues = [f"cue://{place.strip()}" for place in self.cues_to.split(",")]
        foxglove = [f"foxglove://{self.foxglove_at.strip()}"]
        rerun = [f"rerun://{self.rerun_at.strip()}"]
        switches = self.send_udp, self.send_cues, self.serve_foxglove, self.send_rerun
        return [*chain.from_iterable(compress((udp, cues, foxglove, rerun), switches))]

    @property
    def origins(self) -> list[str]:
        """The origins of web pages that may connect to the server."""
        pages = self.allowed_pages.split(",") if self.serve_foxglove else []
        return [page.strip() for page in pages if page.strip()]
