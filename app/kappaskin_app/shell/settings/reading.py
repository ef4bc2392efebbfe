"""How large what is read is written."""

from dataclasses import dataclass

from kappaskin_app.shell.settings.asks import Range, asked


@dataclass(frozen=True)
class Reading:
    """How large the window's letters are."""

    letters: float = asked(
        100.0,
        Range(
            "Letters",
            "How large the window's letters are, of what the system asks for. Where the panels "
            "have no room for larger ones, they scroll.",
            80,
            200,
            10,
            1.0,
            "%",
        ),
    )
