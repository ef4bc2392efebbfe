"""What a scene file may ask for at most: beyond, numbers mean nothing or take minutes."""

from kappaskin.errors import Refusal
from kappaskin.scenes.effects import Within
from kappaskin.skin import Disk, Patch, Polygon

RATE = Within(1e-3, 1e6, "frames/s")
SEED = Within(0, 2**64, whole=True)
HOLD, DWELL, RADII = Within(0, 1e6, "s"), Within(1e-3, 1e6, "s"), Within(1e-4, 1e3, "m")
SKIN_LIMITS = {
    "rigidity": Within(1e-12, 1e6, "N m"),
    "tension": Within(1e-9, 1e6, "N/m"),
    "foundation": Within(1e-9, 1e12, "N/m^3"),
    "axial_stiffness": Within(1e-9, 1e12, "N/m"),
    "rim_stiffness": Within(1e-9, 1e12, "N/m^2"),
}
"""What the numbers of a skin must be within where they are not zero."""

_SIDE = Within(1e-4, 10, "m")
_MOST_ELEMENTS = 2**16 // 3  # as many as the wire's format can tell apart
_MOST_VALUES = 2**25  # of functions at channels, a quarter of a gigabyte
_MOST_FUNCTIONS, _MOST_THAT_MIX = 64**2, 20**2  # some seconds to make the skin of


def check_sides(patch: Patch) -> None:
    """Refuse a skin that no sensor is as large or small as."""
    if patch.a not in _SIDE or patch.b not in _SIDE:
        raise Refusal(
            f"expected sides of {_SIDE}, got {patch.a:g} x {patch.b:g} m; lengths are in metres"
        )


def check_elements(m: int, n: int = 1) -> None:
    """Refuse more elements than a device could send the readings of."""
    if m * n > _MOST_ELEMENTS:
        raise Refusal(f"expected at most {_MOST_ELEMENTS} elements, got {m} x {n}; take fewer")


def check_functions(patch: Patch, edge: str, counts: tuple[int, int], elements: int) -> None:
    """Refuse more functions of the true shape than a few seconds and some memory are enough for."""
    whole = isinstance(patch, Disk | Polygon)
    mix = whole or patch.base_curvature or edge != "hinged"
    most = _MOST_THAT_MIX if mix else _MOST_FUNCTIONS
    most = min(most, _MOST_VALUES // (3 * elements))
    if min(counts) > 0 and counts[0] * counts[1] > most:
        raise Refusal(
            f"expected at most {most} functions in all of the true shape of this skin with "
            f"{elements} elements, got {counts[0]} x {counts[1]}; take fewer"
        )
