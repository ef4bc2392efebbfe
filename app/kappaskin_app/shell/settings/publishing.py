"""Settings of publishing: targets of the estimates."""

from dataclasses import dataclass

from kappaskin_app.shell.settings.form_fields import Switch, Text, setting


@dataclass(frozen=True)
class PublishSettings:
    """UDP and Foxglove, each with its address; both are off by default."""

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

    @property
    def targets(self) -> list[str]:
        """The enabled targets, as addresses of the engine."""
        udp = [f"udp://{place.strip()}" for place in self.udp_to.split(",")]
        foxglove = [f"foxglove://{self.foxglove_at.strip()}"]
        return (udp if self.send_udp else []) + (foxglove if self.serve_foxglove else [])

    @property
    def origins(self) -> list[str]:
        """The origins of web pages that may connect to the server."""
        pages = self.allowed_pages.split(",") if self.serve_foxglove else []
        return [page.strip() for page in pages if page.strip()]
