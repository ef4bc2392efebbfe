"""What a person chose, as a scene to simulate."""

from dataclasses import replace
from typing import Any

from kappaskin import (
    GaussianNoise,
    LineLoad,
    PointLoad,
    Scene,
    UniformNoise,
    load_scene,
)
from kappaskin_app.settings import FREE_CASES, LOAD_CASES, Settings

_MARGIN = 0.03  # share of the patch along each edge that a dragged load keeps out of


def _effects(settings: Settings) -> tuple[UniformNoise | GaussianNoise, ...]:
    kinds = {"uniform": UniformNoise, "gaussian": GaussianNoise}
    if settings.noise_kind not in kinds or not settings.noise_rms:
        return ()
    return (kinds[settings.noise_kind](settings.noise_rms),)


def _free_loads(settings: Settings) -> tuple[PointLoad | LineLoad, ...]:
    s = settings
    if s.load_case == "free-line":
        return (LineLoad(s.x, s.y, s.x_end, s.y_end, s.force),)
    if s.load_case == "two-points":
        return PointLoad(s.x, s.y, s.force / 2), PointLoad(s.x_end, s.y_end, s.force / 2)
    return (PointLoad(s.x, s.y, s.force),)


def scene_of(settings: Settings) -> Scene:
    """The scene that `settings` describe, on the skin of Table 1."""
    free = settings.load_case in FREE_CASES
    scene = load_scene("" if free else settings.load_case)
    if free:
        scene = replace(scene, name=settings.load_case, loads=_free_loads(settings), motion=None)
    return replace(scene, effects=_effects(settings), seed=settings.noise_seed)


def settings_for(source: str) -> Settings:
    """The settings to begin with on `source`: a simulated scene's load case, else as they are."""
    case = source.removeprefix("sim:")
    ready = source.startswith("sim:") and case in dict(LOAD_CASES)
    return Settings(load_case=case) if ready else Settings()


def dragged(settings: Settings, x: float, y: float, grabbed_end: bool) -> dict[str, Any]:
    """The settings that change when the load is dragged to (x, y) in m; it becomes a free one.

    A line moves as a whole, of two points the one that was grabbed.
    """
    patch = load_scene().plate.patch
    s = settings

    def inside(value: float, side: float) -> float:
        return min(max(value, _MARGIN * side), (1 - _MARGIN) * side)

    x, y = inside(x, patch.a), inside(y, patch.b)
    if s.load_case == "two-points" and grabbed_end:
        return {"x_end": x, "y_end": y}
    if s.load_case not in ("line", "free-line"):
        case = s.load_case if s.load_case == "two-points" else "point"
        return {"load_case": case, "x": x, "y": y}
    half_x, half_y = (
        (0.04, -0.04) if s.load_case == "line" else ((s.x_end - s.x) / 2, (s.y_end - s.y) / 2)
    )
    x = min(max(x, abs(half_x)), patch.a - abs(half_x))
    y = min(max(y, abs(half_y)), patch.b - abs(half_y))
    return {
        "load_case": "free-line",
        "x": x - half_x,
        "y": y - half_y,
        "x_end": x + half_x,
        "y_end": y + half_y,
    }
