"""A file of readings to a file of shapes: the right numbers, or a reason and no file."""

import io
import math
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin import (
    Cap,
    DiscLoad,
    Disk,
    Fast,
    Patch,
    Plate,
    PointLoad,
    RankDeficient,
    Refusal,
    SensorLayout,
    Simulator,
    SineBasis,
    basis_for,
    load_scene,
)
from kappaskin.contact import KINDS
from kappaskin.estimation import METHODS
from kappaskin.pipeline import reconstruct
from kappaskin.skin import MeshSkin
from meshes import ellipsoid
from navier import HingedPlate, Load

RNG = np.random.default_rng(7)
A, B, P, T = 0.12, 0.09, 40, 5
SIZE = np.array([A, B])
POSITIONS = RNG.uniform((0.05 * A, 0.05 * B), (0.95 * A, 0.95 * B), (P, 2))
NI, NJ = 4, 3


def operator(positions: np.ndarray = POSITIONS) -> np.ndarray:
    """M (3 P, Ni Nj) written out from Eqs. 1 to 5, one function after the other."""
    x, y = positions.T
    columns = []
    for i in range(1, NI + 1):
        for j in range(1, NJ + 1):
            p, q = i * np.pi / A, j * np.pi / B
            xx = -(p**2) * np.sin(p * x) * np.sin(q * y)
            yy = -(q**2) * np.sin(p * x) * np.sin(q * y)
            xy = p * q * np.cos(p * x) * np.cos(q * y)
            columns.append(np.concatenate([xx, yy, xy]))
    return np.column_stack(columns)


M = operator()
TRUTH = RNG.normal(0, 1e-3, (T, NI * NJ))
CURVATURE = (TRUTH @ M.T + RNG.normal(0, 0.3, (T, 3 * P))).reshape(T, 3, P)
GOOD: dict[str, Any] = {"size": SIZE, "positions": POSITIONS, "curvature": CURVATURE}


@pytest.fixture
def saved(tmp_path) -> Callable[..., Path]:
    """Writes the readings, with changes; a change to None leaves a name out."""

    def save(**changes: Any) -> Path:
        path = tmp_path / "readings.npz"
        np.savez(path, **{k: v for k, v in (GOOD | changes).items() if v is not None})
        return path

    return save


def shapes(found: dict[str, np.ndarray]) -> dict[str, tuple[int, ...]]:
    return {name: values.shape for name, values in found.items()}


def weighted(frame: int, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients and their covariance by NumPy's least squares, rows scaled by `weight`."""
    rows = weight.ravel() > 0
    w, k = weight.ravel()[rows], CURVATURE[frame].ravel()[rows]
    answer = np.linalg.lstsq(M[rows] * w[:, None], k * w)[0]
    return answer, np.linalg.inv((M[rows] * w[:, None]).T @ (M[rows] * w[:, None]))


# Good readings


def test_the_shapes_are_those_of_numpys_least_squares(saved) -> None:
    found = reconstruct(saved(), (NI, NJ))
    answer = np.linalg.lstsq(M, CURVATURE.reshape(T, -1).T)[0].T
    assert np.allclose(found["coefficients"].reshape(T, -1), answer, rtol=1e-9, atol=1e-15)
    residual = CURVATURE - (answer @ M.T).reshape(T, 3, P)
    assert np.allclose(found["residual"], residual, rtol=0, atol=1e-9)


def test_the_arrays_have_the_shapes_and_types_that_are_promised(saved) -> None:
    found = reconstruct(saved(), (NI, NJ), (31, 21))
    assert shapes(found) == {
        "coefficients": (T, NI, NJ),
        "sd": (T, NI, NJ),
        "residual": (T, 3, P),
        "grid_x": (31,),
        "grid_y": (21,),
        "w": (T, 21, 31),
    }
    assert {values.dtype for values in found.values()} == {np.dtype(float)}


def test_without_a_grid_there_is_no_surface(saved) -> None:
    assert reconstruct(saved(), (NI, NJ)).keys() == {"coefficients", "sd", "residual"}


def test_the_surface_is_the_sum_of_its_functions(saved) -> None:
    found = reconstruct(saved(), (NI, NJ), (13, 11))
    x, y, c = found["grid_x"], found["grid_y"], found["coefficients"]
    assert (x[0], x[-1], y[0], y[-1]) == (0, A, 0, B)
    w = np.zeros((T, 11, 13))
    for i in range(NI):
        for j in range(NJ):
            product = np.outer(np.sin((j + 1) * np.pi * y / B), np.sin((i + 1) * np.pi * x / A))
            w += c[:, i, j, None, None] * product
    assert np.allclose(found["w"], w, rtol=0, atol=1e-15)


def test_one_frame_without_its_axis_is_one_shape(saved) -> None:
    one = reconstruct(saved(curvature=CURVATURE[2]), (NI, NJ), (5, 6))
    assert shapes(one)["coefficients"] == (1, NI, NJ)
    assert shapes(one)["residual"] == (1, 3, P)
    assert shapes(one)["w"] == (1, 6, 5)
    every = reconstruct(saved(), (NI, NJ), (5, 6))
    assert np.allclose(one["w"][0], every["w"][2], rtol=0, atol=1e-15)


def test_missing_readings_are_left_out_frame_by_frame(saved) -> None:
    missing = RNG.random((T, 3, P)) < 0.2
    missing[3] = False
    found = reconstruct(saved(curvature=np.where(missing, np.nan, CURVATURE)), (NI, NJ))
    for frame in range(T):
        answer, _ = weighted(frame, (~missing[frame]).astype(float))
        assert np.allclose(found["coefficients"][frame].ravel(), answer, rtol=1e-8, atol=1e-14)
    assert np.array_equal(np.isnan(found["residual"]), missing)


def test_without_sigma_the_error_bar_is_the_residuals(saved) -> None:
    found = reconstruct(saved(), (NI, NJ))
    spare = 3 * P - NI * NJ
    for frame in range(T):
        answer, unit = weighted(frame, np.ones((3, P)))
        variance = np.sum((CURVATURE[frame].ravel() - M @ answer) ** 2) / spare
        expected = np.sqrt(variance * np.diag(unit))
        assert np.allclose(found["sd"][frame].ravel(), expected, rtol=1e-9)


SIGMAS = {
    "one number": np.array(0.3),
    "one for each reading": RNG.uniform(0.1, 1.0, (3, P)),
    "one for each reading of each frame": RNG.uniform(0.1, 1.0, (T, 3, P)),
    "some infinite": np.where(RNG.random((3, P)) < 0.1, np.inf, 0.3),
    "whole numbers": np.ones((3, P), int),
}


@pytest.mark.parametrize("case", SIGMAS)
def test_sigma_weighs_the_readings_and_gives_the_error_bars(saved, case: str) -> None:
    sigma = SIGMAS[case]
    found = reconstruct(saved(sigma=sigma), (NI, NJ))
    assert shapes(found) == {
        "coefficients": (T, NI, NJ),
        "sd": (T, NI, NJ),
        "residual": (T, 3, P),
    }
    for frame, own in enumerate(np.broadcast_to(sigma, (T, 3, P))):
        answer, covariance = weighted(frame, 1 / own)
        assert np.allclose(found["coefficients"][frame].ravel(), answer, rtol=1e-8, atol=1e-14)
        assert np.allclose(found["sd"][frame].ravel(), np.sqrt(np.diag(covariance)), rtol=1e-8)


def test_readings_of_any_number_type_and_order_are_the_same_readings(saved) -> None:
    expected = reconstruct(saved(curvature=np.round(CURVATURE)), (NI, NJ))["coefficients"]
    for other in (
        np.asfortranarray(np.round(CURVATURE)),
        np.round(CURVATURE).astype(">f8"),
        np.round(CURVATURE).astype(np.int16),
        np.round(CURVATURE).astype(np.float16),
    ):
        found = reconstruct(saved(curvature=other), (NI, NJ))["coefficients"]
        assert np.allclose(found, expected, rtol=1e-9, atol=1e-15)


def test_compressed_files_and_names_beside_ours_are_read(saved, tmp_path) -> None:
    path = tmp_path / "compressed.npz"
    np.savez_compressed(path, **GOOD, notes=np.array("by hand"))
    expected = reconstruct(saved(), (NI, NJ))
    assert np.array_equal(reconstruct(path, (NI, NJ))["sd"], expected["sd"])


# Readings that cannot be used


def changed(where: Any, value: float, shape: tuple[int, ...] = (3, P)) -> np.ndarray:
    array = np.full(shape, 0.3)
    array[where] = value
    return array


OUTSIDE = POSITIONS.copy()
OUTSIDE[7] = (0.2, 0.05)
LOST = CURVATURE.copy()
LOST[3, :, 3:] = np.nan

BAD: dict[str, tuple[dict[str, Any], str]] = {
    "no size": ({"size": None}, r"has no 'size' \(it has \['curvature', 'positions'\]\)"),
    "no positions": ({"positions": None}, "has no 'positions'"),
    "no curvature": ({"curvature": None}, "has no 'curvature'"),
    "size a number": ({"size": 0.1}, r"size of shape \(2,\) in m, or \(1,\) for a strip, got \(\)"),
    "three sizes": (
        {"size": [0.1, 0.1, 0.1]},
        r"size of shape \(2,\) in m, or \(1,\) for a strip, got \(3,\)",
    ),
    "size zero": ({"size": [0.0, 0.1]}, "two sides above zero"),
    "size negative": ({"size": [0.1, -0.1]}, "two sides above zero"),
    "size NaN": ({"size": [np.nan, 0.1]}, "two sides above zero"),
    "size infinite": ({"size": [np.inf, 0.1]}, "two sides above zero"),
    "size below numbers": ({"size": [1e-160, 0.1]}, "two sides above zero"),
    "positions a number": ({"positions": 0.05}, r"positions of shape \(P, 2\) in m, got \(\)"),
    "positions a list": ({"positions": [0.05, 0.05]}, r"positions of shape \(P, 2\)"),
    "positions in space": ({"positions": np.full((P, 3), 0.05)}, r"positions of shape \(P, 2\)"),
    "no elements": ({"positions": np.ones((0, 2))}, r"P >= 1, got \(0, 2\)"),
    "positions outside": (
        {"positions": OUTSIDE},
        r"1 of 40 elements lie outside.*element 7 is at \(0.2, 0.05\) m",
    ),
    "positions in mm": ({"positions": 1e3 * POSITIONS}, "positions are in metres"),
    "positions NaN": ({"positions": np.full((P, 2), np.nan)}, "40 of 40 elements lie outside"),
    "curvature flat": ({"curvature": CURVATURE[0].ravel()}, r"\(3, 40\) for 40 positions"),
    "curvature too deep": ({"curvature": CURVATURE[None]}, r"got \(1, 5, 3, 40\)"),
    "two components": ({"curvature": CURVATURE[:, :2]}, r"got \(5, 2, 40\)"),
    "elements too few": ({"curvature": CURVATURE[..., 1:]}, r"for 40 positions, got \(5, 3, 39\)"),
    "no frames": ({"curvature": CURVATURE[:0]}, r"got \(0, 3, 40\)"),
    "curvature complex": ({"curvature": CURVATURE + 0j}, "curvature to be real .* complex128"),
    "curvature text": (
        {"curvature": CURVATURE.astype(str)},
        "curvature to be real numbers, got <U",
    ),
    "curvature truth": ({"curvature": CURVATURE > 0}, "curvature to be real numbers, got bool"),
    "curvature dates": ({"curvature": CURVATURE.astype("M8[s]")}, "got datetime64"),
    "curvature objects": ({"curvature": CURVATURE.astype(object)}, "cannot be read as NPZ"),
    "curvature records": ({"curvature": np.zeros((3, P), "f8,f8")}, "real numbers"),
    "nothing left": ({"curvature": np.full((T, 3, P), np.nan)}, "frame 0: .*no readings are left"),
    "one bad frame": ({"curvature": LOST}, "frame 3: .*9 readings determine"),
    "sigma zero": ({"sigma": 0.0}, "sigma above zero"),
    "sigma negative": ({"sigma": changed((1, 5), -0.3)}, "sigma above zero in 1/m, got"),
    "sigma NaN": ({"sigma": changed((1, 5), np.nan)}, "sigma above zero in 1/m, got"),
    "sigma all infinite": ({"sigma": np.inf}, "no readings are left"),
    "sigma in a list": ({"sigma": [0.3]}, r"sigma to be one number or \(3, 40\), got \(1,\)"),
    "sigma transposed": ({"sigma": np.ones((P, 3))}, r"got \(40, 3\)"),
    "sigma for other frames": (
        {"sigma": np.ones((4, 3, P))},
        r"sigma of shape \(5, 3, 40\) as curvature has.* got \(4, 3, 40\)",
    ),
    "sigma for no frame": ({"sigma": np.ones((0, 3, P, 1))}, r"got \(0, 3, 40, 1\)"),
    "sigma text": ({"sigma": "0.3"}, "sigma to be real numbers, got <U3"),
    "sigma bad in one frame": (
        {"sigma": changed((2, 1, 5), 0.0, (T, 3, P))},
        "frame 2: expected every sigma above zero",
    ),
    "sigma leaving one frame too little": (
        {"sigma": changed((4, slice(None), slice(3, None)), np.inf, (T, 3, P))},
        "frame 4: .*9 readings determine",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_readings_that_cannot_be_used_are_refused_with_the_reason(saved, case: str) -> None:
    changes, reason = BAD[case]
    with pytest.raises(Refusal, match=reason):
        reconstruct(saved(**changes), (NI, NJ))


def packed(save: Callable[..., None] = np.savez_compressed, **changes: Any) -> bytes:
    buffer = io.BytesIO()
    save(buffer, **GOOD | changes)
    return buffer.getvalue()


def one_array() -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, CURVATURE)
    return buffer.getvalue()


def claiming(shape: str) -> bytes:
    """An archive whose curvature claims a shape in its header, and holds nothing."""
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".encode()
    header += b" " * (-(10 + len(header) + 1) % 64) + b"\n"
    member = b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header
    buffer = io.BytesIO(packed())
    with zipfile.ZipFile(buffer, "a") as archive:
        archive.writestr("sigma.npy", member)
    return buffer.getvalue()


NO_ARCHIVES = {
    "empty": b"",
    "text": b"x,y,kxx\n0.1,0.2,0.3\n",
    "one array": one_array(),
    "a pickle": b"\x80\x04\x95\x00.",
    "a pickle in text": b"cos\nsystem\n(S'true'\ntR.",
    "another archive": b"PK\x05\x06" + bytes(18),
    "half": packed()[: len(packed()) // 2],
    "all but its last byte": packed()[:-1],
    "an array of less than nothing": claiming("(-1,)"),
    "an array without a shape": claiming("None"),
}


@pytest.mark.parametrize("case", NO_ARCHIVES)
def test_what_is_no_archive_is_refused(tmp_path, case: str) -> None:
    path = tmp_path / "readings.npz"
    path.write_bytes(NO_ARCHIVES[case])
    with pytest.raises(
        Refusal, match=r"npz: (cannot be read as NPZ|has no 'size').* expected size"
    ) as refused:
        reconstruct(path, (NI, NJ))
    assert "pickle" not in str(refused.value)


@pytest.mark.parametrize("shape", [f"({10**8},)", f"({10**30},)", f"(-1, {10**9})"])
def test_an_archive_that_claims_too_much_is_refused_unread(tmp_path, shape: str) -> None:
    path = tmp_path / "readings.npz"
    path.write_bytes(claiming(shape))
    with pytest.raises(Refusal, match=r"to take at most 256 MB, but sigma of shape .*; `--limit`"):
        reconstruct(path, (NI, NJ))


def test_nothing_in_a_file_is_ever_executed(tmp_path) -> None:
    class Trap:
        def __reduce__(self) -> tuple[Any, ...]:
            return (Path.touch, (tmp_path / "sprung",))

    np.savez(tmp_path / "trap.npz", **GOOD | {"sigma": np.array([Trap()], object)})
    with pytest.raises(Refusal, match="cannot be read as NPZ"):
        reconstruct(tmp_path / "trap.npz", (NI, NJ))
    assert not (tmp_path / "sprung").exists()


@pytest.mark.parametrize("name", ["", "nothing.npz"])
def test_what_is_not_there_is_refused(tmp_path, name: str) -> None:
    with pytest.raises(Refusal, match=r"there is no such file|cannot be read"):
        reconstruct(tmp_path / name, (NI, NJ))


SMALL = {"curvature": CURVATURE[:1, :, :12], "positions": POSITIONS[:12]}
ARCHIVES = st.sampled_from([packed(save, **SMALL) for save in (np.savez, np.savez_compressed)])
PLACES = st.integers(0, 10**6)


@given(ARCHIVES, st.lists(st.tuples(PLACES, st.integers(1, 255)), max_size=3))
def test_damage_anywhere_is_refused_or_does_no_harm(tmp_path_factory, archive, damages) -> None:
    data = bytearray(archive)
    for at, flip in damages:
        data[at % len(data)] ^= flip
    path = tmp_path_factory.getbasetemp() / "damaged.npz"
    path.write_bytes(data)
    try:
        found = reconstruct(path, (2, 2))
    except Refusal:
        return
    assert shapes(found)["coefficients"] == (1, 2, 2)


@given(ARCHIVES, PLACES)
def test_a_file_cut_off_anywhere_is_refused(tmp_path_factory, archive: bytes, end: int) -> None:
    path = tmp_path_factory.getbasetemp() / "cut.npz"
    path.write_bytes(archive[: end % len(archive)])
    with pytest.raises(Refusal, match="cannot be read as NPZ"):
        reconstruct(path, (2, 2))


# Questions that cannot be answered


@pytest.mark.parametrize(
    ("basis", "reason"),
    [
        ((0, 8), "at least 1 x 1 functions, got 0 x 8"),
        ((-1, 8), "at least 1 x 1 functions, got -1 x 8"),
        ((-3, -3), "at least 1 x 1 functions"),
        ((12, 11), "at most 120 functions for 120 readings per frame, got 12 x 11 = 132"),
        ((10**6, 10**6), "at most 120 functions"),
        ((10**400, 1), "at most 120 functions"),
    ],
)
def test_a_basis_the_readings_cannot_decide_is_refused_before_it_costs(saved, basis, reason):
    path = saved()
    tracemalloc.start()
    try:
        with pytest.raises(Refusal, match=reason):
            reconstruct(path, basis)
        assert tracemalloc.get_traced_memory()[1] < 5e6
    finally:
        tracemalloc.stop()


def test_a_basis_that_only_few_elements_tell_apart_is_refused_with_a_way_out(saved) -> None:
    row = np.column_stack([np.linspace(0.01, 0.11, P), np.full(P, B / 2)])
    with pytest.raises(RankDeficient, match="cannot distinguish these functions; use a smaller"):
        reconstruct(saved(positions=row), (4, 8))


@pytest.mark.parametrize(
    ("grid", "reason"),
    [
        ((1, 1), "at least 2 x 2 points, got 1 x 1"),
        ((101, 1), "at least 2 x 2 points"),
        ((0, 5), "at least 2 x 2 points"),
        ((-5, 5), "at least 2 x 2 points"),
        ((10**6, 10**6), "coarser grid"),
        ((10**12, 2), "coarser grid"),
        ((-(10**12), -2), "coarser grid|at least 2 x 2"),
    ],
)
def test_a_grid_that_cannot_be_is_refused_before_it_costs(saved, grid, reason) -> None:
    path = saved()
    tracemalloc.start()
    try:
        with pytest.raises(Refusal, match=reason):
            reconstruct(path, (NI, NJ), grid)
        assert tracemalloc.get_traced_memory()[1] < 5e6
    finally:
        tracemalloc.stop()


def test_an_operator_that_would_not_fit_is_refused_before_it_costs(tmp_path) -> None:
    many = RNG.uniform(0, 0.09, (20_000, 2))
    np.savez(
        tmp_path / "many.npz", **GOOD | {"positions": many, "curvature": np.zeros((3, 20_000))}
    )
    with pytest.raises(Refusal, match="at most 134217728 numbers in one array, got 2400000000"):
        reconstruct(tmp_path / "many.npz", (200, 200))


# Skins that are not flat


ARC = np.pi * 12.9e-3


def on_the_arc(count: int = 10) -> np.ndarray:
    return (np.arange(count) + 0.5) * ARC / count


def test_a_pinned_fingertip_strip_comes_back(saved) -> None:
    s = on_the_arc()
    curvature = np.full((1, 3, 10), np.nan)
    curvature[0, 0] = 24 * 0.125e-3 * np.sin(3 * s / 12.9e-3) / 12.9e-3**2  # Eq. 11, corrected

    path = saved(size=[ARC], radius=12.9e-3, positions=s, curvature=curvature)
    found = reconstruct(path, (8, 1), (11, 2))

    assert found["coefficients"].shape == (1, 8, 1)
    x = found["grid_x"]
    true = 0.5e-3 * (np.sin(x / 12.9e-3) - 3 * np.sin(3 * x / 12.9e-3)) / 4
    assert np.allclose(found["w"][0, 0], true, rtol=0, atol=1e-15)


def test_a_cylinder_skin_is_not_read_as_a_flat_one(saved) -> None:
    flat, bent = reconstruct(saved(), (NI, NJ)), reconstruct(saved(radius=0.05), (NI, NJ))
    infinite = reconstruct(saved(radius=np.inf), (NI, NJ))

    assert np.array_equal(infinite["coefficients"], flat["coefficients"])
    assert not np.allclose(bent["coefficients"], flat["coefficients"], rtol=1e-2)


def test_the_two_radii_of_a_dome_come_from_the_file(saved) -> None:
    x, y = POSITIONS.T
    waves = [(i, j) for i in range(1, NI + 1) for j in range(1, NJ + 1)]
    w = np.stack([np.sin(i * np.pi * x / A) * np.sin(j * np.pi * y / B) for i, j in waves], axis=1)
    read = (M + np.concatenate([w / 0.5**2, w / 0.4**2, 0 * w])) @ TRUTH[0]

    found = reconstruct(saved(radius=[0.5, -0.4], curvature=read.reshape(3, P)), (NI, NJ))

    assert np.allclose(found["coefficients"].ravel(), TRUTH[0], rtol=0, atol=1e-15)


def test_a_cap_comes_from_the_file(saved) -> None:
    cap = Cap(0.008, 1.2)
    layout = SensorLayout.in_spiral(cap, 40)
    basis = basis_for(cap, "clamped", NI, NJ)
    read = layout.operator(basis) @ TRUTH[0]
    of = {"size": [cap.a, cap.b], "radius": 0.008, "angle": 1.2, "positions": layout.positions}

    found = reconstruct(saved(**of, curvature=read.reshape(3, -1)), (NI, NJ), edge="clamped")

    np.testing.assert_allclose(found["coefficients"].ravel(), TRUTH[0], rtol=0, atol=1e-14)


@pytest.fixture(scope="module")
def pad() -> MeshSkin:
    return MeshSkin(*ellipsoid(18, (9e-3, 7e-3, 6e-3), 1.2), 1e-3)


def test_a_mesh_comes_from_the_file(pad, saved) -> None:
    layout = SensorLayout.spread(pad, 40)
    read = layout.operator(basis_for(pad, "clamped", NI, NJ)) @ TRUTH[0]
    of = {"mesh": pad.text, "positions": layout.positions, "size": None}

    found = reconstruct(saved(**of, curvature=read.reshape(3, -1)), (NI, NJ), edge="clamped")

    np.testing.assert_allclose(found["coefficients"].ravel(), TRUTH[0], rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"mesh": "a mesh", "size": None}, "expected the text of a mesh"),
        ({"mesh": 1.0, "size": None}, "expected mesh to be one text, got float64"),
        ({"mesh": ["a", "b"], "size": None}, "expected mesh to be one text"),
        ({"mesh": "a mesh"}, "expected the mesh alone, got size too"),
        ({"size": None}, "has no 'size'"),
    ],
)
def test_a_file_of_no_mesh_is_refused(saved, changes: dict[str, Any], reason: str) -> None:
    with pytest.raises(Refusal, match=reason):
        reconstruct(saved(**changes), (NI, NJ))


@pytest.mark.parametrize(
    ("changes", "arguments", "reason"),
    [
        ({"angle": 1.2}, {}, "one radius, angle and stretch of a cap, and no outline"),
        ({"angle": 1.2, "radius": 0.008}, {}, "size 0.0192 x 0.0192 m, twice from pole to rim"),
        ({"radius": 0.01}, {}, "is a full circle at radius"),
        ({"radius": -1.0}, {}, "is a full circle at radius"),
        ({"radius": np.nan}, {}, "is a full circle at radius"),
        ({"radius": [1.0, 2.0, 3.0]}, {}, r"one radius in m or two, got shape \(3,\)"),
        ({"radius": [0.1, 2.0]}, {}, "expected at most 1%, which are radii of at least"),
        ({"size": [0.1]}, {}, r"positions of shape \(P, 1\)"),
        ({"inplane": "glued"}, {"contact": True}, "inplane among held, diaphragm, free"),
        ({"inplane": 1.0}, {}, "expected inplane to be one text, got float64"),
        ({"thickness": [1e-3, 1e-3]}, {"contact": True}, r"one thickness, got shape \(2,\)"),
        ({"thickness": -1e-3}, {"contact": True}, "a thickness above zero"),
        ({"poisson": 0.7}, {"contact": True}, "Poisson's ratio <= 0.5, got 0.7"),
        ({}, {"edge": "glued"}, "expected an edge of .* among hinged.*got 'glued'"),
        ({}, {"method": "magic"}, "a method among least-squares.*got 'magic'"),
    ],
)
def test_what_no_skin_or_no_method_is_is_refused(saved, changes, arguments, reason) -> None:
    with pytest.raises(Refusal, match=reason):
        reconstruct(saved(**changes), (NI, NJ), **arguments)


def test_the_contact_of_each_frame_is_written_with_the_geometry_there(saved) -> None:
    patch = Patch(0.1, 0.1)
    layout, plate = SensorLayout.regular(patch, 10, 10), HingedPlate(rigidity=5e-3)
    loads = [Load(0.03, 0.06, 0.2), Load(0.05, 0.05, 0.1)]
    curvature = np.stack([plate.readings(load, layout.positions) for load in loads])
    path = saved(size=[0.1, 0.1], positions=layout.positions, curvature=curvature, rigidity=5e-3)

    found = reconstruct(path, (8, 8), contact=True)

    assert np.allclose(found["contact"], [[0.03, 0.06], [0.05, 0.05]], atol=2e-5)
    assert np.allclose(found["force"], [0.2, 0.1], rtol=1e-3)
    assert found["normal"][1] == pytest.approx([0, 0, 1], abs=1e-3)
    assert np.all(found["principal"] < 0)  # pressed in, it is hollow seen from outside
    assert "force" not in reconstruct(saved(), (NI, NJ), contact=True)
    assert found["single"].tolist() == [True, True]
    assert found["near_rim"].tolist() == [False, False]


def test_what_touches_the_skin_is_written_for_each_frame(saved) -> None:
    patch = Patch(0.1, 0.1)
    layout, truth = SensorLayout.regular(patch, 10, 10), SineBasis(patch, 30, 30)
    ends = [PointLoad(0.04, 0.04, 0.1), PointLoad(0.06, 0.04, 0.1)]  # of a rigid blade
    curvature = np.random.default_rng(0).normal(0, 0.05, (3, 3, 100))
    for frame, loads in zip(curvature, (ends, [DiscLoad(0.045, 0.05, 0.012, 0.2)]), strict=False):
        deflection = Plate(patch).deflection(loads, truth)
        frame += (layout.operator(truth) @ deflection.ravel()).reshape(3, 100)
    path = saved(size=[0.1, 0.1], positions=layout.positions, curvature=curvature)

    found = reconstruct(path, (8, 8), objects=True)

    assert found["object"].tolist() == ["edge", "sphere", ""]
    assert found["object_probability"][0, KINDS.index("edge")] > 0.5
    assert found["object_length"][0] == pytest.approx(0.02, abs=1e-3)
    assert math.remainder(found["object_axis"][0], math.pi) == pytest.approx(0, abs=0.05)
    low, high = found["object_radius_95"][1]
    assert low < found["object_radius"][1] < high
    assert np.isnan(found["object_probability"][2]).all()
    assert np.isnan(found["object_radius_95"][2]).all()
    assert np.isfinite(found["contact"][:2]).all()  # it needs the contacts
    assert np.isnan(found["contact"][2]).all()


@pytest.mark.parametrize("method", ["least-squares", "bayes", "robust"])
def test_an_object_is_that_of_the_readings_less_their_drift(saved, method) -> None:
    patch = Patch(0.1, 0.1)
    layout, truth = SensorLayout.regular(patch, 10, 10), SineBasis(patch, 30, 30)
    deflection = Plate(patch).deflection([DiscLoad(0.045, 0.05, 0.012, 0.2)], truth)
    read = (layout.operator(truth) @ deflection.ravel()).reshape(3, 100)
    read += np.random.default_rng(0).normal(0, 0.05, read.shape)
    drift = 2 * np.outer([1.0, -0.6, 0.3], 1 + layout.positions[:, 0] / 0.1)

    found, still = (
        reconstruct(
            saved(size=[0.1, 0.1], positions=layout.positions, curvature=curvature),
            (8, 8),
            method=method,
            objects=True,
        )
        for curvature in (read + drift, read)
    )

    assert found["drift"][0] > 0
    assert still["drift"][0] == 0
    assert found["object"].tolist() == still["object"].tolist() == ["sphere"]
    low, high = still["object_radius_95"][0]
    assert low < found["object_radius"][0] < high


def test_a_disk_and_a_polygon_are_read_by_their_outline(saved) -> None:
    disk = Disk(0.05)
    layout, basis = SensorLayout.regular(disk, 10, 10), basis_for(disk, "clamped", 4, 4)
    c = np.random.default_rng(3).normal(0, 1e-4, basis.size)
    curvature = (layout.operator(basis) @ c).reshape(3, -1)
    path = saved(size=[0.1, 0.1], positions=layout.positions, curvature=curvature, outline=0.05)

    found = reconstruct(path, (4, 4), (21, 21), edge="clamped")

    assert np.allclose(found["coefficients"].ravel(), c, rtol=0, atol=1e-12)
    assert np.isnan(found["w"][0, 0, 0])
    centre = float(basis.at(np.array([[0.05, 0.05]]))[0] @ c)
    assert found["w"][0, 10, 10] == pytest.approx(centre, abs=1e-10)  # drawn in single precision
    with pytest.raises(Refusal, match="the box of its outline"):
        reconstruct(saved(outline=0.07), (4, 4))
    with pytest.raises(Refusal, match="cross"):
        reconstruct(saved(outline=[[0, 0], [0.1, 0.1], [0.1, 0], [0, 0.1]]), (4, 4))


def test_heights_of_a_cantilever_are_read_as_a_beams_under_a_load_at_its_tip(saved) -> None:
    a, F_over_EI = 0.3, 0.5
    x = (np.arange(12) + 0.5) * a / 12
    path = saved(
        size=[a],
        positions=x[:, None],
        curvature=None,
        values=(F_over_EI * x**2 * (3 * a - x) / 6)[None],
        element=np.arange(12),
        quantity=np.full(12, "height"),
        direction=np.zeros(12),
    )

    found = reconstruct(path, (10, 1), (7, 2), edge="cantilever")

    at = found["grid_x"]
    beam = F_over_EI * at**2 * (3 * a - at) / 6
    np.testing.assert_allclose(found["w"][0, 0], beam, rtol=0, atol=1e-3 * beam[-1])
    with pytest.raises(Refusal, match="among hinged, sliding, clamped, elastic; got 'cantilever'"):
        reconstruct(saved(), (4, 4), edge="cantilever")


def test_a_large_grid_is_read_by_fast_transforms_though_no_matrix_would_fit(tmp_path) -> None:
    patch = Patch(0.1, 0.1)
    layout, basis = SensorLayout.regular(patch, 128, 128), SineBasis(patch, 120, 120)
    truth = np.random.default_rng(0).normal(0, 1e-9, (120, 120))
    order = np.random.default_rng(1).permutation(len(layout))
    K = Fast(basis, layout).predicted(truth)[:, order]
    path = tmp_path / "grid.npz"
    np.savez(path, size=[0.1, 0.1], positions=layout.positions[order], curvature=K)

    out = reconstruct(path, (120, 120), method="fast")

    np.testing.assert_allclose(out["coefficients"][0], truth, rtol=0, atol=1e-18)
    with pytest.raises(Refusal, match="in the operator"):
        reconstruct(path, (120, 120))


@pytest.mark.parametrize("method", METHODS)
def test_every_method_reads_a_file(tmp_path, method: str) -> None:
    scene = load_scene("centre")
    simulator, sensor = Simulator(scene), scene.sensor()
    K = [sensor.nominal(simulator.frame(n, lambda: 0.0)).reshape(3, -1) for n in range(3)]
    path = tmp_path / "frames.npz"
    np.savez(path, size=[0.1, 0.1], positions=scene.layout.positions, curvature=K)

    out = reconstruct(path, (8, 8), (33, 33), method=method, contact=True)

    assert out["w"].max(axis=(1, 2)) * 1e3 == pytest.approx(4.70, abs=0.15)
    np.testing.assert_allclose(out["contact"], 0.05, atol=1e-3)


# Other readings than curvature

ELEMENT = np.concatenate([np.arange(P), np.arange(P), RNG.integers(0, P, 60)])
QUANTITY = np.repeat(["height", "slope", "curvature", "twist"], [P, P, 30, 30])
DIRECTION = RNG.uniform(-4, 8, len(ELEMENT))
R = len(ELEMENT)
SIGMA = np.select(
    [QUANTITY == "height", QUANTITY == "slope"],
    [RNG.uniform(1e-5, 5e-5, R), RNG.uniform(1e-3, 4e-3, R)],
    RNG.uniform(0.1, 0.4, R),
)


def height(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Displacement (R, Ni Nj) at `x`, `y` (R,) of each function, written out from Eq. 1."""
    columns = [
        np.sin(i * np.pi * x / A) * np.sin(j * np.pi * y / B)
        for i in range(1, NI + 1)
        for j in range(1, NJ + 1)
    ]
    return np.column_stack(columns)


def derivative(x: np.ndarray, y: np.ndarray, order: tuple[int, int]) -> np.ndarray:
    """Its derivative of an `order` up to two, a sine shifted by a quarter wave for each."""
    columns = []
    for i in range(1, NI + 1):
        for j in range(1, NJ + 1):
            p, q = i * np.pi / A, j * np.pi / B
            along_x = p ** order[0] * np.sin(p * x + order[0] * np.pi / 2)
            along_y = q ** order[1] * np.sin(q * y + order[1] * np.pi / 2)
            columns.append(along_x * along_y)
    return np.column_stack(columns)


def written_out() -> np.ndarray:
    """The operator (R, Ni Nj) of all readings, row by row as the guide defines them."""
    x, y = POSITIONS[ELEMENT].T
    c, s = np.cos(DIRECTION)[:, None], np.sin(DIRECTION)[:, None]
    xx, xy, yy = (derivative(x, y, order) for order in ((2, 0), (1, 1), (0, 2)))
    by_name = {
        "height": height(x, y),
        "slope": c * derivative(x, y, (1, 0)) + s * derivative(x, y, (0, 1)),
        "curvature": c**2 * xx + 2 * c * s * xy + s**2 * yy,
        "twist": xy,
    }
    return np.array([by_name[q][r] for r, q in enumerate(QUANTITY)])


OPERATOR = written_out()
VALUES = TRUTH @ OPERATOR.T + RNG.normal(size=(T, R)) * SIGMA
MIXED: dict[str, Any] = {
    "curvature": None,
    "values": VALUES,
    "element": ELEMENT,
    "quantity": QUANTITY,
    "direction": DIRECTION,
    "sigma": SIGMA,
}


def dense(frame: int, sigma: np.ndarray, values: np.ndarray, A: np.ndarray) -> Any:
    """Coefficients and standard deviations by NumPy's least squares of weighted rows A."""
    used = np.isfinite(values[frame])
    rows = (A / sigma[:, None])[used]
    answer = np.linalg.lstsq(rows, (values[frame] / sigma)[used])[0]
    return answer, np.sqrt(np.diag(np.linalg.inv(rows.T @ rows)))


def agrees(found: dict[str, np.ndarray], frame: int, expected: Any) -> bool:
    answer, sd = expected
    c, own = found["coefficients"][frame].ravel(), found["sd"][frame].ravel()
    scale, N = np.abs(answer[: NI * NJ]).max(), NI * NJ
    return np.allclose(c, answer[:N], rtol=0, atol=1e-9 * scale) and np.allclose(
        own, sd[:N], rtol=1e-9
    )


def test_any_readings_give_the_shapes_of_dense_weighted_least_squares(saved) -> None:
    missing = RNG.random((T, R)) < 0.1
    values = np.where(missing, np.nan, VALUES)
    found = reconstruct(saved(**MIXED | {"values": values}), (NI, NJ), (31, 21))
    assert all(agrees(found, t, dense(t, SIGMA, values, OPERATOR)) for t in range(T))
    assert shapes(found) == {
        "coefficients": (T, NI, NJ),
        "sd": (T, NI, NJ),
        "residual": (T, R),
        "grid_x": (31,),
        "grid_y": (21,),
        "w": (T, 21, 31),
    }
    left = values - found["coefficients"].reshape(T, -1) @ OPERATOR.T
    assert np.allclose(found["residual"] / SIGMA, left / SIGMA, atol=1e-9, equal_nan=True)


def test_each_frame_may_have_its_own_sigma_and_one_frame_no_axis(saved) -> None:
    sigma = SIGMA * RNG.uniform(0.5, 2, (T, R))
    found = reconstruct(saved(**MIXED | {"sigma": sigma}), (NI, NJ))
    assert all(agrees(found, t, dense(t, sigma[t], VALUES, OPERATOR)) for t in range(T))
    one = reconstruct(saved(**MIXED | {"values": VALUES[2]}), (NI, NJ))
    assert agrees(one, 0, dense(2, SIGMA, VALUES, OPERATOR))


def test_95_percent_intervals_hold_that_many_coefficients(saved) -> None:
    frames = 400
    truth = RNG.normal(0, 1e-3, (frames, NI * NJ))
    values = truth @ OPERATOR.T + RNG.normal(size=(frames, R)) * SIGMA
    values[:, QUANTITY == "height"] += RNG.normal(0, 1e-2, (frames, 1))
    found = reconstruct(
        saved(**MIXED | {"values": values, "datum": np.array(["height"])}), (NI, NJ)
    )
    off = np.abs(found["coefficients"].reshape(frames, -1) - truth)
    assert 0.93 <= np.mean(off < 1.96 * found["sd"].reshape(frames, -1)) <= 0.97


def test_a_free_datum_is_eliminated_as_one_more_column(saved) -> None:
    own = (QUANTITY == "height").astype(float)
    A, values = np.column_stack([OPERATOR, own]), VALUES + 0.02 * own
    values[1, :7] = np.nan
    path = saved(**MIXED | {"values": values, "datum": "height"})
    found = reconstruct(path, (NI, NJ))
    assert all(agrees(found, t, dense(t, SIGMA, values, A)) for t in range(T))
    for t in range(T):
        left = values[t] - A @ dense(t, SIGMA, values, A)[0]
        assert np.allclose(found["residual"][t] / SIGMA, left / SIGMA, atol=1e-8, equal_nan=True)


def test_heights_need_no_direction_and_without_sigma_no_sigma(saved) -> None:
    own = QUANTITY == "height"
    only = {name: MIXED[name][..., own] for name in ("values", "element", "quantity")}
    found = reconstruct(saved(**MIXED | only | {"direction": None, "sigma": None}), (NI, NJ))
    answer = np.linalg.lstsq(OPERATOR[own], VALUES[:, own].T)[0].T
    assert np.allclose(found["coefficients"].reshape(T, -1), answer, rtol=0, atol=1e-12)


def pressed(frames: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Loads x, y and F (frames, 3) on a hinged plate, and its readings and sigma (frames, R)."""
    plate = HingedPlate(A, B, 5e-3, modes=120)
    loads = RNG.uniform((0.3 * A, 0.3 * B, 0.2), (0.7 * A, 0.7 * B, 0.6), (frames, 3))
    names = [f"{q}@{np.degrees(t)}" for q, t in zip(QUANTITY, DIRECTION, strict=True)]
    values = np.empty((frames, R))
    for name in dict.fromkeys(names):
        own = np.flatnonzero([each == name for each in names])
        for row, (x, y, force) in zip(values, loads, strict=True):
            modes = plate.coefficients(Load(x, y, force, radius=3e-3))
            row[own] = plate.read(modes, POSITIONS[ELEMENT[own]], name)
    sigma = SIGMA * RNG.uniform(0.5, 2, (frames, R))
    return loads, values + sigma * RNG.normal(size=(frames, R)), sigma


def test_contacts_and_forces_of_other_readings_are_right_where_the_skin_is_a_known_plate(saved):
    loads, values, sigma = pressed(12)
    heights = np.where(QUANTITY == "height", 5e-3, 0.0)
    readings = MIXED | {"values": values + heights, "sigma": sigma, "datum": "height"}
    found = reconstruct(saved(**readings, rigidity=5e-3), (8, 8), objects=True)
    off = np.column_stack([found["contact"], found["force"]]) - loads
    off /= np.column_stack([found["contact_sd"], found["force_sd"]])
    assert (np.abs(off) < 1.96).mean() > 0.85
    assert np.square(off).mean() < 1.6
    assert np.array_equal(found["contacts"][:, 0], found["contact"])


def test_without_a_rigidity_contacts_of_other_readings_are_those_of_the_shape(saved) -> None:
    _, values, sigma = pressed(2)
    readings = MIXED | {"values": values, "sigma": sigma}
    found = reconstruct(saved(**readings), (NI, NJ), objects=True)
    expected = reconstruct(saved(), (NI, NJ), objects=True)
    for name in set(expected) - {"residual"}:
        assert found[name].shape == (2, *expected[name].shape[1:]), name
    for name in ("contact", "displacement", "load_radius_95", "principal"):
        assert np.isfinite(found[name]).all(), name
    assert "force" not in found
    assert "forces" not in found


FEW = np.arange(5)
BAD_VALUES: dict[str, tuple[dict[str, Any], str]] = {
    "no element": ({"element": None}, "has no 'element'"),
    "no quantity": ({"quantity": None}, "has no 'quantity'"),
    "no direction": ({"direction": None}, "has no 'direction', which a curvature needs"),
    "both kinds": ({"curvature": CURVATURE}, "got curvature and values, element"),
    "another quantity": (
        {"quantity": np.where(QUANTITY == "height", "depth", QUANTITY)},
        "among height, slope, curvature, twist, got 'depth'",
    ),
    "quantities by number": ({"quantity": np.zeros(R)}, "quantity to be text, got float64"),
    "an element beyond": ({"element": np.full(R, P)}, r"from 0 to 39, .*count from 0"),
    "half an element": ({"element": np.full(R, 0.5)}, "whole numbers from 0"),
    "an element of NaN": ({"element": np.full(R, np.nan)}, "whole numbers from 0"),
    "elements too few": ({"element": ELEMENT[1:]}, r"of shape \(139,\) as element has"),
    "a direction of NaN": ({"direction": np.full(R, np.nan)}, "direction in rad from x for each"),
    "values too few": ({"values": VALUES[:, 1:]}, r"\(T, 140\) or \(140,\) .*got \(5, 139\)"),
    "values too deep": ({"values": VALUES[None]}, r"got \(1, 5, 140\)"),
    "sigma zero": ({"sigma": np.zeros(R)}, "sigma above zero in m or m/m or 1/m, got zero"),
    "sigma of another shape": ({"sigma": np.ones(7)}, r"one number or \(140,\), got \(7,\)"),
    "no sigma": ({"sigma": None}, "sigma of readings that differ in unit, m or m/m or 1/m"),
    "a datum unread": ({"datum": ["tilt"]}, "only of quantities that are read, got 'tilt'"),
    "a few heights": (
        {
            "values": VALUES[:, :5],
            "element": FEW,
            "quantity": np.full(5, "height"),
            "direction": np.zeros(5),
            "sigma": np.ones(5),
        },
        r"at most 5 functions for 5 readings.*no reading determines function [1-4] x [1-3]$",
    ),
    "a frame with few": (
        {"values": np.where(np.arange(R) < 8, VALUES, np.nan)},
        r"frame 0: .*with 8 readings .*no reading determines function [1-4] x [1-3]$",
    ),
}


@pytest.mark.parametrize("case", BAD_VALUES)
def test_values_that_cannot_be_used_are_refused_with_the_reason(saved, case: str) -> None:
    changes, reason = BAD_VALUES[case]
    with pytest.raises(Refusal, match=reason):
        reconstruct(saved(**MIXED | changes), (NI, NJ))
