"""Where a rigid object bears on a skin, and what the skin then reads: derivatives, symmetries."""

import math

import numpy as np
import pytest

from kappaskin import LeastSquares, Patch, Plate, PointContact, PointLoad, SensorLayout, basis_for
from kappaskin.contact.elastic_skin import EVEN, ROUND, ElasticSkin, Optimum, arcs, ends, oval, ring
from kappaskin.contact.hypotheses import arc_widths, fit_hypotheses

SQUARE = Patch(0.1, 0.1)
LAYOUT = SensorLayout.regular(SQUARE, 6, 6)
SKIN = ElasticSkin(Plate(SQUARE), LAYOUT, "hinged", 12)
ENDS = np.array([0.05, 0.045, 0.2, 0.4, 0.03**2, 0.15])
UNEVEN = ROUND * [1.2, 1.0, 1.0] + np.linspace(-0.3, 0.3, 12)[:, None] * [0.0, 0.0, 1 / 12]
CONTACTS = {
    "ring": (ring(ROUND), np.array([0.05, 0.045, 0.2, 0.01**2])),
    "uneven ring": (ring(UNEVEN), np.array([0.05, 0.045, -0.2, 0.01**2])),
    "ends": (ends(0.0), ENDS),
    "ends and middle": (ends(0.3), ENDS),
    "arcs": (arcs(EVEN, 0.0), np.append(ENDS, 0.004**2)),
    "oval": (oval, np.append(ENDS, 0.004**2)),
    "arcs and middle": (arcs((1.0, 0.4), 0.3), np.append(ENDS, 0.004**2)),
}
every_contact = pytest.mark.parametrize(("contact", "p"), CONTACTS.values(), ids=CONTACTS)


def slopes(f, p, share=1e-5):
    """The derivatives of `f` along each of `p`, by differences over a `share` of it."""
    steps = share * np.diag(np.abs(p))
    return np.array([(f(p + d) - f(p - d)) / (2 * d.sum()) for d in steps])


@every_contact
def test_forces_add_up_and_their_centre_is_the_contact(contact, p):
    forces = contact(p)

    assert forces.weights.sum() == pytest.approx(p[2])
    np.testing.assert_allclose(forces.weights @ forces.points / p[2], p[:2], atol=1e-12)


@every_contact
def test_forces_move_and_grow_as_their_derivatives_say(contact, p):
    forces = contact(p)

    moves, growth = slopes(lambda p: contact(p).points, p), slopes(lambda p: contact(p).weights, p)

    scale = np.abs(moves).max(axis=(1, 2), keepdims=True) + 1e-12
    np.testing.assert_allclose(forces.moves / scale, moves / scale, atol=1e-6)
    np.testing.assert_allclose(forces.growth, growth, atol=1e-6)


BASIS = basis_for(SQUARE, "hinged", 12, 12)
M = LAYOUT.operator(BASIS)
# A sum of n products is off by n + 2 roundings of what its terms come to without their signs, in
# whatever order a processor adds them: n - 1 sums, a product, and a rounding of either factor.
ROUNDINGS = (BASIS.size + 2) * float(np.finfo(np.float32).eps) / 2


def coefficients(forces):
    """Of the deflection (N,) in m under as many point loads, in double precision."""
    loads = [PointLoad(x, y, f) for (x, y), f in zip(forces.points, forces.weights, strict=True)]
    return Plate(SQUARE).deflection(loads, BASIS).ravel()


@every_contact
def test_readings_change_as_their_derivatives_say(contact, p):
    _, told = SKIN.readings(contact(p))

    changes = slopes(lambda p: coefficients(contact(p)), p)

    expected, rounding = changes @ M.T, ROUNDINGS * np.abs(changes) @ np.abs(M).T
    by_differences = 1e-6 * np.linalg.norm(expected, axis=1, keepdims=True)
    assert (np.abs(told.T - expected) <= by_differences + rounding).all()


@every_contact
def test_readings_are_those_of_as_many_point_loads(contact, p):
    forces, places = contact(p), np.array([[0.02, 0.03], [0.05, 0.05]])
    c = coefficients(forces)

    readings, _ = SKIN.readings(forces)

    assert (np.abs(readings - M @ c) <= ROUNDINGS * np.abs(M) @ np.abs(c)).all()
    np.testing.assert_allclose(SKIN.gives(forces, places), BASIS.at(places) @ c, rtol=1e-9)


@pytest.mark.parametrize(("share", "middle"), [(0.3, 0.0), (-0.2, 0.0), (0.1, 0.25)])
def test_the_arcs_of_an_object_seen_from_its_other_end_change_places(share, middle):
    def widths(angle, share):
        p = np.array([0.05, 0.045, 0.2, angle, 0.04**2, share, 0.01**2])
        found = Optimum(arcs(EVEN, middle), p, np.eye(7), 0.0, 0.0, np.zeros(7))
        return arc_widths(SKIN, found, middle)

    one, other = widths(0.4, share), widths(0.4 + math.pi, -share)

    assert one == pytest.approx(other[::-1], rel=1e-9)
    assert one[0 if share > 0 else 1] == 1.0  # the stronger end's
    assert min(one) < 1.0


@pytest.mark.parametrize(("edge", "doubted"), [("elastic", False), ("hinged", True)])
def test_a_contact_beside_the_rim_is_doubted_where_that_is_held(edge, doubted):
    layout, plate = SensorLayout.regular(SQUARE, 10, 10), Plate(SQUARE, rim_stiffness=2e3)
    basis, load = basis_for(SQUARE, edge, 10, 10), PointLoad(0.003, 0.05, 0.2)
    K = layout.operator(basis) @ plate.deflection([load], basis).ravel()
    fit = LeastSquares(basis_for(SQUARE, edge, 6, 6), layout)(K.reshape(3, -1))

    touch = PointContact(plate, layout, edge)(K.reshape(3, -1), fit)

    assert touch.present
    assert touch.near_rim == doubted


@pytest.mark.parametrize("seed", [115, 180, 510])
def test_a_cylinder_explains_an_edge_as_well_for_an_edge_is_the_narrowest(seed):
    rng, layout = np.random.default_rng(seed), SensorLayout.regular(SQUARE, 10, 10)
    coarse, fine = (ElasticSkin(Plate(SQUARE), layout, "hinged", k) for k in (15, 40))
    place, force, angle = rng.uniform(0.03, 0.07, 2), rng.uniform(0.3, 1.5), rng.uniform(0, 3.1)
    p = np.array([*place, force, angle, rng.uniform(0.004, 0.05) ** 2, rng.uniform(-0.3, 0.3)])
    K = fine.readings(ends(0.0)(p))[0].reshape(3, -1) + rng.normal(0, 0.231, (3, 100))
    fit = LeastSquares(basis_for(SQUARE, "hinged", 8, 8), layout)(K)
    touch = PointContact(Plate(SQUARE), layout)(K, fit)

    found = fit_hypotheses(coarse, fine, K.ravel(), np.ones(300, bool), float(fit.noise), touch)

    assert found.cylinder.best.cost < found.edge.best.cost + 1
