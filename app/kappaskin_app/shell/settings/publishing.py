"""Whom estimates are sent to, besides being shown."""

from dataclasses import dataclass

from kappaskin_app.shell.settings.asks import Switch, Text, asked


@dataclass(frozen=True)
class Sending:
    """Two ways to send, each with where to; off until somebody asks."""

    send_udp: bool = asked(
        False,
        Switch(
            "Datagrams (UDP)",
            "Send contact, shape and error bars of every estimate as JSON, one datagram each: to a "
            "robot, or to PlotJuggler's UDP server as it is.",
        ),
    )
    udp_to: str = asked(
        "127.0.0.1:9870",
        Text("To", "HOST:PORT that gets them; several are separated by commas."),
    )
    serve_foxglove: bool = asked(
        False,
        Switch(
            "Foxglove",
            "Serve Foxglove and others that speak its WebSocket protocol: the same messages, the "
            "skin in 3D and a log. In Foxglove, open a connection to ws:// and the address below.",
        ),
    )
    foxglove_at: str = asked(
        "127.0.0.1:8765",
        Text(
            "At",
            "HOST:PORT of this machine to serve at. 127.0.0.1 serves this machine alone, 0.0.0.0 "
            "whoever can reach it.",
        ),
    )

    @property
    def targets(self) -> list[str]:
        """The targets that are asked for, as the engine calls them."""
        udp = [f"udp://{place.strip()}" for place in self.udp_to.split(",")]
        foxglove = [f"foxglove://{self.foxglove_at.strip()}"]
        return (udp if self.send_udp else []) + (foxglove if self.serve_foxglove else [])
