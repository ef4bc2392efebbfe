"""Where the skin is looked at from."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Looked:
    """The direction `look`, in which all of the skin is seen; once turned by hand, the `camera`.

    Its numbers are the view's own; none of them where it was not turned.
    """

    look: str = "left"
    camera: tuple[float, ...] = ()
