"""The paper's equations and numbers as printed: what they would give, and why they are not meant.

For teaching. Everything else computes with what is meant.
"""

import math
from typing import Any

import numpy as np

from kappaskin.bases import SineBasis
from kappaskin.frames import Array
from kappaskin.mechanics import Plate
from kappaskin.skin import Patch
from kappaskin.studies.tables import APPLIED, PAPER_1, RADIUS, fingertip_scene

_U = APPLIED[0] / 1e3  # m, Table 2's first case
_ARC = Patch(math.pi * RADIUS, 0.02, RADIUS, strip=True)
_EIGHT = SineBasis(_ARC, 8, 1)
_THETA = np.linspace(0.0, math.pi, 101)


def _rms_mm(u: Array) -> float:
    return 1e3 * float(np.sqrt(np.mean(u**2)))


def _equation_6() -> dict[str, Any]:
    scene = fingertip_scene(1e3 * _U)
    truth = scene.plate.deflection(scene.loads, scene.basis)
    M = scene.layout.curvature_operator(_EIGHT)[:10]
    K = scene.layout.curvature_operator(scene.basis)[:10] @ truth.ravel()
    length = np.linalg.norm(M, axis=0)
    # Dropping what curvature does not see, as a pseudo-inverse with a tolerance does.
    c = np.linalg.pinv(M, rcond=1e-9) @ K
    S = np.sin(np.outer(_THETA, np.arange(1, 9)))
    return {
        "where": "Eq. 6 on the fingertip",
        "printed": "c = (M^T M)^-1 M^T K with all 8 functions",
        "meant": "the same with c_1 = -(c_3/3 + c_5/5 + c_7/7), as pinned ends decide",
        "gives": {
            "rank of the 8 columns of M": int(np.linalg.matrix_rank(M)),
            "length of the column k = 1 over that of k = 2": float(length[0] / length[1]),
            "RMS error in mm of the 0.63 mm load, without noise, when k = 1 is dropped": _rms_mm(
                S @ c - S[:, :3] @ truth.ravel()
            ),
        },
        "why": "sin(theta) moves half a circle as a whole and bends nothing: its column of M is "
        "zero, M^T M has no inverse, and dropping the function drops a part of the shape",
    }


def _equation_9() -> dict[str, Any]:
    nu, E, h = 0.3, 1.0, 1.0
    D = Plate.of_material(Patch(1.0, 1.0), E, nu, h).rigidity
    printed = E * h**3 / (12 * (1 + nu**2))
    return {
        "where": "Eq. 9",
        "printed": "D = E h^3 / 12 (1 + v^2)",
        "meant": "D = E h^3 / (12 (1 - v^2))",
        "gives": {
            "D as printed over D, v = 0.3": printed / D,
            "D as printed over that of beams side by side, E h^3 / 12": 12 * printed,
        },
        "why": "a plate cannot narrow sideways as it bends, so that it is stiffer than beams side "
        "by side, not softer",
    }


def _equation_10() -> dict[str, Any]:
    # Its own displacement under the load is u(pi/2) = a0.
    a0, theta = _U, _THETA
    u = a0 * (np.sin(theta) + 3 * np.cos(theta))
    u_2 = -u
    change = (u_2 + u) / RADIUS**2
    # Eq. 11 as printed, on both sides of Eq. 6, at the ten elements.
    at = math.pi * (np.arange(10) + 0.5) / 10
    k = np.arange(1, 9)
    K = a0 * (np.sin(at) + 3 * np.cos(at)) * (1 / RADIUS - 1 / RADIUS**2)
    M = np.sin(np.outer(at, k)) * (1 / RADIUS - k**2 / RADIUS**2)
    c = np.linalg.lstsq(M, K)[0]
    return {
        "where": "Eq. 10",
        "printed": "u = a0 (sin theta + 3 cos theta)",
        "meant": "u = a0 (3 sin 3 theta - sin theta), with the printed a0",
        "gives": {
            "u at theta = 0 in mm, for 0.63 mm under the load": 1e3 * float(u[0]),
            "u at theta = pi in mm": 1e3 * float(u[-1]),
            "largest change of curvature in 1/m": float(np.abs(change).max()),
            "RMS error in mm of 8 sines fitted to it by Eqs. 6 and 11": _rms_mm(
                np.sin(np.outer(theta, k)) @ c - u
            ),
        },
        "why": "the ends would move three times as far as the middle, u(0) = 3 a0 = -u(pi), but "
        "they are held; and sin theta and cos theta move the arc as a whole, so that no gage "
        "would read anything. Minimising the bending energy gives the printed a0 with the shape "
        "that is meant",
    }


def _equation_11() -> dict[str, Any]:
    a0, mm = -_U / 4, 1e3
    u, u_2 = -4 * a0, 28 * a0  # of Eq. 10 as meant, at the load
    in_metres = u_2 / RADIUS**2 + u / RADIUS
    in_mm = (u_2 * mm) / (RADIUS * mm) ** 2 + (u * mm) / (RADIUS * mm)
    return {
        "where": "Eq. 11",
        "printed": "kappa = (1/R0^2) u'' + (1/R0) u",
        "meant": "kappa = (1/R0^2) (u'' + u)",
        "gives": {
            "at the load in 1/m, for 0.63 mm, computed in metres": in_metres,
            "the same computed in millimetres, in 1/m": in_mm * mm,
            "what is meant, in 1/m": (u_2 + u) / RADIUS**2,
        },
        "why": "u''/R0^2 is in 1/m but u/R0 is a pure number: their sum changes with the unit of "
        "length, here even its sign",
    }


def _slips() -> list[dict[str, Any]]:
    (w, e, _), (w_2, e_2, _) = PAPER_1["centre", True], PAPER_1["off-centre", True]
    return [
        {
            "where": "Table 1, centred load with noise",
            "printed": f"w_max {w:.2f} mm with an error of {e:+.2f} mm",
            "meant": f"w_max {4.70 + e:.2f} mm",
            "gives": {"error that the printed w_max has, in mm": w - 4.70},
            "why": "4.70 mm were applied, and the error is their difference",
        },
        {
            "where": "Table 1, off-centre load with noise",
            "printed": f"an error of {e_2:+.2f} mm with w_max {w_2:.2f} mm",
            "meant": f"an error of {w_2 - 4.89:+.2f} mm",
            "gives": {"w_max that the printed error has, in mm": 4.89 + e_2},
            "why": "4.89 mm were applied, and the error is their difference",
        },
    ]


def misprints() -> list[dict[str, Any]]:
    """What is misprinted: `where`, as `printed` and as `meant`, what it `gives`, and `why` not."""
    return [_equation_6(), _equation_9(), _equation_10(), _equation_11(), *_slips()]
