"""A contact as numbers with an error bar each: place, force, normal, curvature."""

import math

from kappaskin.estimation import Fit
from kappaskin.frames import Estimate

UNKNOWN = math.pi / math.sqrt(12)
"""In rad, the spread of a line that may point anywhere: an error bar of a direction at most."""

VALUES = (
    ("x_m", "%.7g", "where the contact is, along the skin"),
    ("y_m", "%.7g", "where the contact is, across the skin"),
    ("x_sd_m", "%.3g", "standard deviation of x_m"),
    ("y_sd_m", "%.3g", "standard deviation of y_m"),
    ("force_N", "%.6g", "of the contact, above zero where it presses"),
    ("force_sd_N", "%.3g", "standard deviation of force_N"),
    ("displacement_m", "%.6g", "of the skin at the contact, above zero inward"),
    ("displacement_sd_m", "%.3g", "standard deviation of displacement_m"),
    ("position_x_m", "%.7g", "the contact's place in space, on the deflected skin"),
    ("position_y_m", "%.7g", "see position_x_m"),
    ("position_z_m", "%.7g", "see position_x_m; z is 0 at the top of the skin at rest"),
    ("position_x_sd_m", "%.3g", "standard deviation of position_x_m"),
    ("position_y_sd_m", "%.3g", "standard deviation of position_y_m"),
    ("position_z_sd_m", "%.3g", "standard deviation of position_z_m"),
    ("normal_x", "%.6f", "outward unit normal of the deflected skin at the contact"),
    ("normal_y", "%.6f", "see normal_x"),
    ("normal_z", "%.6f", "see normal_x"),
    ("normal_sd_rad", "%.3g", "standard deviation of the normal's tilt"),
    ("curvature_1_per_m", "%.6g", "larger principal curvature of the skin at the contact"),
    ("curvature_1_sd_per_m", "%.3g", "standard deviation of curvature_1_per_m"),
    ("curvature_2_per_m", "%.6g", "smaller principal curvature"),
    ("curvature_2_sd_per_m", "%.3g", "standard deviation of curvature_2_per_m"),
    ("direction_1_x", "%.6f", "unit vector along the larger principal curvature"),
    ("direction_1_y", "%.6f", "see direction_1_x"),
    ("direction_1_z", "%.6f", "see direction_1_x"),
    ("direction_2_x", "%.6f", "unit vector along the smaller principal curvature"),
    ("direction_2_y", "%.6f", "see direction_2_x"),
    ("direction_2_z", "%.6f", "see direction_2_x"),
    ("direction_sd_rad", "%.3g", "standard deviation of both about the normal; at most 0.907"),
)
"""Key, how it is written, and what it says, of each number of a contact."""

_NOTHING = [math.nan] * len(VALUES)


def contact_values(estimate: Estimate, fit: Fit) -> list[float]:
    """The numbers of `VALUES`, NaN when there is no contact; `fit` is what they rest on."""
    touch = estimate.touch
    if not touch.present:
        return _NOTHING
    return [
        *touch.position.tolist(),
        *touch.position_sd.tolist(),
        touch.force,
        touch.force_sd,
        touch.displacement,
        touch.displacement_sd,
        *_in_space(estimate, fit),
        *_principal(estimate),
    ]


def _in_space(estimate: Estimate, fit: Fit) -> list[float]:
    """Position (3) and its error bars (3) in m, normal (3), and in rad how far it may be tilted.

    To first order, from what the readings' noise makes of the displacement f and its slopes there,
    and of the place x, y itself, as if these were independent:
        dr = r_x dx + r_y dy - n0 df,    |dn| = |d(f_x, f_y) + K [metric] (dx, dy)|,
    where [r_x r_y] = [t e] [metric] and n0 is the normal of the skin at rest.
    """
    geometry, patch = estimate.geometry, fit.estimator.basis.patch
    x, y = estimate.touch.position.tolist()
    x_sd, y_sd = estimate.touch.position_sd.tolist()
    f_sd, *slopes_sd = fit.sd_of(fit.estimator.basis.jet(x, y)[:3]).tolist()
    t, e, normal = geometry.frame.tolist()
    (L, m), (_, k) = geometry.metric.tolist()
    (xx, xy), (_, yy) = geometry.curvature_form.tolist()
    angle = (x - patch.a / 2) * patch.base_curvature
    n0 = math.sin(angle), 0.0, math.cos(angle)
    spread = [
        math.hypot(L * t[i] * x_sd, (m * t[i] + k * e[i]) * y_sd, n0[i] * f_sd) for i in range(3)
    ]
    tilt = L * xx * x_sd, L * xy * x_sd, (m * xx + k * xy) * y_sd, (m * xy + k * yy) * y_sd
    return [
        *geometry.position.tolist(),
        *spread,
        *normal,
        math.hypot(*slopes_sd, *tilt),
    ]


def _principal(estimate: Estimate) -> list[float]:
    """Both principal curvatures, each with its error bar; both directions, and theirs in rad.

    As `LocalGeometry` tells them, written out in numbers: this is done for every frame.
    """
    geometry = estimate.geometry
    (xx, xy), (_, yy) = geometry.curvature_form.tolist()
    C = geometry.covariance.tolist()
    (ax, ay, az), (bx, by, bz), _ = geometry.frame.tolist()
    d, mean = (xx - yy) / 2, (xx + yy) / 2
    h, angle = math.hypot(d, xy), math.atan2(xy, d) / 2
    c, s = math.cos(angle), math.sin(angle)
    turn = _root(C, -xy, xy, 2 * d)
    return [
        mean + h,
        _root(C, c * c, s * s, 2 * c * s),
        mean - h,
        _root(C, s * s, c * c, -2 * c * s),
        *(c * ax + s * bx, c * ay + s * by, c * az + s * bz),
        *(c * bx - s * ax, c * by - s * ay, c * bz - s * az),
        min(UNKNOWN, turn / (4 * h * h)) if h else UNKNOWN,
    ]


def _root(C: list[list[float]], xx: float, yy: float, xy: float) -> float:
    """Standard deviation of what changes with xx, yy and xy so much, by their covariance."""
    (a, b, c), (_, d, e), (_, _, f) = C
    diagonal = a * xx * xx + d * yy * yy + f * xy * xy
    return math.sqrt(max(0.0, diagonal + 2 * (b * xx * yy + c * xx * xy + e * yy * xy)))
