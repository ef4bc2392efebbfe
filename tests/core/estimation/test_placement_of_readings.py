"""Placement of elements that read heights and slopes, and how accurate they will be."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from kappaskin import LeastSquares, Patch, Refusal, SensorLayout, SineBasis, basis_for, predicted_sd
from kappaskin.estimation import place_elements, singular_values
from kappaskin.sensing import kind_of_reading

A, B = 0.1, 0.08
PATCH, BASIS = Patch(A, B), SineBasis(Patch(A, B), 3, 2)
HEIGHT, SLOPE = 5e-6, 5e-4  # m and rad of noise
APART = 0.02
KI, KJ = np.pi * np.arange(1, 4) / A, np.pi * np.arange(1, 3) / B
READS = {
    "height": (["height"], [HEIGHT]),
    "slopes": (["slope@0", "slope@90"], [SLOPE, SLOPE]),
    "mixed": (["height", "slope@0", "slope@90"], [HEIGHT, SLOPE, SLOPE]),
}


def layout_of(read, m, n):
    return SensorLayout.regular(PATCH, m, n).reading_each(READS[read][0])


def sigma_of(read, elements):
    return np.repeat(READS[read][1], elements)


def read_by_hand(read, places):
    """What elements at `places` (P, 2) read of each sine, over its noise, (P, k, 6)."""
    x, y = (places[:, axis, None, None] for axis in (0, 1))
    ki, kj = KI[:, None], KJ[None]
    sines = {
        "height": np.sin(ki * x) * np.sin(kj * y),
        "slope@0": ki * np.cos(ki * x) * np.sin(kj * y),
        "slope@90": kj * np.sin(ki * x) * np.cos(kj * y),
    }
    names, noise = READS[read]
    each = [sines[name] / s for name, s in zip(names, noise, strict=True)]
    return np.stack(each, axis=1).reshape(len(places), len(names), -1)


@pytest.mark.parametrize("read", READS)
def test_the_predicted_deviation_is_that_of_orthogonal_sines(read):
    m, n = 6, 5
    fit = LeastSquares(BASIS, layout_of(read, m, n), sigma_of(read, m * n))
    points = np.array([[0.02, 0.03], [0.05, 0.04], [0.09, 0.01]])
    # At the centres of the tiling sines and their slopes have a mean square of 1/4, each times k.
    of_height = 1 / HEIGHT**2 if read != "slopes" else 0.0
    of_slopes = np.add.outer(KI**2, KJ**2) / SLOPE**2 if read != "height" else 0.0
    variance = np.broadcast_to(4 / (m * n) / (of_height + of_slopes), (3, 2))
    squares = np.sin(np.multiply.outer(points[:, 0], KI))[:, :, None] ** 2
    squares = squares * np.sin(np.multiply.outer(points[:, 1], KJ))[:, None] ** 2

    expected = np.sqrt(np.sum(variance * squares, axis=(1, 2)))

    np.testing.assert_allclose(predicted_sd(fit, 1.0, points), expected, rtol=1e-9)


def volume(information):
    return -np.linalg.slogdet(information)[1]


def variance(information):  # the mean over the skin, where all sines weigh the same
    return np.log(np.trace(np.linalg.inv(information), axis1=1, axis2=2))


@pytest.mark.cases("height-A", "slopes-D", "mixed-A", "heights of unknown zero-D")
@pytest.mark.parametrize(("by", "bad"), [("D", volume), ("A", variance)])
@pytest.mark.parametrize("read", [*READS, "heights of unknown zero"])
def test_no_other_places_determine_more(read, by, bad):
    P = 6  # as many heights as functions, or one more for the zero
    layout = layout_of(read, P, 1) if read in READS else layout_of("height", P := P + 1, 1)
    if free := read not in READS:
        layout, read = layout.reading(layout.element, "height", free=["height"]), "height"
    places = SensorLayout.regular(PATCH, 5, 4).positions
    rows, k = read_by_hand(read, places), len(READS[read][0])

    def badness(chosen):
        M = rows[np.array(chosen)].reshape(len(chosen), P * k, -1)
        M = M - M.mean(axis=1, keepdims=True) if free else M
        information = M.swapaxes(1, 2) @ M
        poor = np.linalg.cond(information) > 1e9
        return np.where(poor, np.inf, bad(information + poor[:, None, None] * np.eye(6)))

    placed = place_elements(layout, BASIS, by, APART, sigma_of(read, P))

    found = [int(np.hypot(*(places - place).T).argmin()) for place in placed.positions]
    np.testing.assert_allclose(placed.positions, places[found], atol=1e-12)
    others = set(range(20)) - set(found)
    exchanged = [[m if p == n else p for p in found] for n in found for m in others]
    least, of_found = badness(exchanged).min(), badness([found])[0]
    best = badness(list(combinations(range(20), P))).min()
    assert least > of_found - 1e-4
    assert of_found < best + 0.3  # which exchanges one by one need not reach


@pytest.mark.parametrize("by", ["clustered", "D"])
def test_placed_elements_read_what_they_did(by):
    layout = layout_of("mixed", 3, 2)
    layout = layout.reading(
        layout.element, layout.reads.quantity, layout.reads.direction, ["slope"]
    )
    layout = replace(layout, cell=(0.02, 0.01), gage_length=0.004)

    placed = place_elements(layout, BASIS, by, 0.012, sigma_of("mixed", 6))

    assert placed.each_reads == READS["mixed"][0]
    assert placed.reads.free == ("slope",)
    assert (placed.cell, placed.gage_length) == (layout.cell, layout.gage_length)
    assert placed.shape is None
    assert not np.array_equal(placed.positions, layout.positions)


MIXED = ["height", "slope@0", "slope@90"]  # of `read_by_hand`
HAVE = [[0], [1, 2], [0], [1], [2], [0, 1, 2], [0]]  # which of these each element reads


@pytest.mark.parametrize(("by", "bad"), [("D", volume), ("A", variance)])
def test_no_other_places_determine_more_of_elements_that_differ(by, bad):
    element = np.repeat(np.arange(7), [len(each) for each in HAVE])
    kinds = [kind_of_reading(MIXED[k]) for each in HAVE for k in each]
    noise = np.array([READS["mixed"][1][k] for each in HAVE for k in each])
    noise[element == 6] *= 3  # a height of another noise
    layout = SensorLayout.regular(PATCH, 7, 1).reading(element, *zip(*kinds, strict=True))
    places = SensorLayout.regular(PATCH, 5, 4).positions
    rows = read_by_hand("mixed", places)

    def badness(chosen):
        read = [rows[place, have] / (3 if p == 6 else 1)
                for p, (place, have) in enumerate(zip(chosen, HAVE, strict=True))]  # fmt: skip
        M = np.concatenate(read)
        return float(bad((M.T @ M)[None])[0])

    placed = place_elements(layout, BASIS, by, APART, noise)

    # Each element is where it is placed, with its own readings: not sorted by place.
    found = [int(np.hypot(*(places - place).T).argmin()) for place in placed.positions]
    np.testing.assert_allclose(placed.positions, places[found], atol=1e-12)
    np.testing.assert_array_equal(placed.reads.quantity, layout.reads.quantity)
    others = set(range(20)) - set(found)
    exchanged = [[m if p == n else p for p in found] for n in found for m in others]
    assert min(map(badness, exchanged)) > badness(found) - 1e-4
    assert np.isfinite(badness(found))


@pytest.mark.parametrize(
    ("sigma", "words"),
    [
        (None, "expected the sigma of readings that differ in unit, m or m/m, to place"),
        (np.ones(5), "one number or of shape"),
        (0.0, "above zero"),
    ],
)
def test_what_readings_weigh_must_be_known(sigma, words):
    with pytest.raises(Refusal, match=words):
        place_elements(layout_of("mixed", 2, 2), BASIS, "D", APART, sigma)


def test_heights_determine_how_an_elastic_rim_moves():
    basis = basis_for(PATCH, "elastic", 4, 4)
    layout = SensorLayout.regular(PATCH, 8, 8)

    of_curvature, _ = singular_values(basis, layout)
    of_height, shapes = singular_values(basis, layout.reading_each(["height"]))

    assert len(of_height) == len(of_curvature) == len(shapes)
    assert (of_height > 1e-6 * of_height[0]).all()
    assert (of_curvature > 1e-6 * of_curvature[0]).sum() == len(of_curvature) - 3
