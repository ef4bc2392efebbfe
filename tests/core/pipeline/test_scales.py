"""Numbers at the edge in a file of readings: shapes that scale, or a refusal with its reason."""

from pathlib import Path

import numpy as np
import pytest

from kappaskin import Patch, Plate, PointLoad, Refusal, SensorLayout, SineBasis
from kappaskin.estimation import METHODS
from kappaskin.pipeline import reconstruct

SQUARE = Patch(0.1, 0.1)
TENS = SensorLayout.regular(SQUARE, 10, 10)
every_method = pytest.mark.parametrize("method", [m for m in METHODS if m != "as-printed"])


def readings():
    basis = SineBasis(SQUARE, 15, 15)
    c = Plate(SQUARE).deflection([PointLoad(0.04, 0.06, 0.45)], basis)
    K = (TENS.operator(basis) @ c.ravel()).reshape(3, -1)
    return K + np.random.default_rng(0).normal(0, 0.231, K.shape)


def found(tmp_path: Path, method: str = "least-squares", **changes: object):
    arrays = {"size": [0.1, 0.1], "positions": TENS.positions, "curvature": readings()}
    file = tmp_path / "in.npz"
    np.savez(file, **{name: np.asarray(value) for name, value in (arrays | changes).items()})
    return reconstruct(file, (8, 8), (11, 11), "hinged", method, contact="rigidity" in changes)


@every_method
@pytest.mark.parametrize("k", [-400, -100, 0, 100, 240])
def test_shapes_scale_with_their_readings(method: str, k: int, tmp_path: Path) -> None:
    out = found(tmp_path, method, curvature=np.ldexp(readings(), k))

    assert all(np.isfinite(values).all() for values in out.values())
    if method == "finite-slope":  # which sees slopes: another shape
        return
    whole = found(tmp_path, method)
    for name in ("coefficients", "sd", "residual", "w"):
        size = np.abs(whole[name]).max()
        np.testing.assert_allclose(np.ldexp(out[name], -k), whole[name], 0, 1e-9 * size)


@every_method
@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"curvature": np.ldexp(readings(), 600)}, "expected readings of at most 1e.77 1/m"),
        ({"sigma": 5e-324}, "expected every sigma from"),
        ({"sigma": 1e300}, "expected every sigma from"),
        ({"rigidity": 1e300}, r"expected a rigidity in N m, if above zero from 1e-50 to 1e.50"),
        ({"rigidity": 1e-300}, r"expected a rigidity in N m, if above zero from 1e-50 to 1e.50"),
    ],
    ids=["readings", "small sigma", "large sigma", "stiff", "soft"],
)
def test_what_cannot_be_computed_with_is_refused(
    method: str, changes: dict[str, object], why: str, tmp_path: Path
) -> None:
    with pytest.raises(Refusal, match=why):
        found(tmp_path, method, **changes)


@pytest.mark.parametrize("value", [5e-324, 1e-300, 1e-51, 1e51, 1e300])
@pytest.mark.parametrize("name", ["rigidity", "tension", "foundation", "rim_stiffness"])
def test_a_stiffness_beyond_all_sense_is_refused(name: str, value: float) -> None:
    with pytest.raises(Refusal, match="if above zero from 1e-50"):
        Plate(SQUARE, **{name: value})
