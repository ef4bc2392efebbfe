"""Forces that leave out how the skin stretches, softens or snaps through."""

import math
from dataclasses import replace

import numpy as np
import pytest

from kappaskin import Cap, Disk, Patch, Pipeline, Plate, PointLoad, Setup, Simulator
from kappaskin import load_scene as scene_called
from kappaskin.bases import basis_for
from kappaskin.contact import NO_CONTACT, LargeDeflection
from kappaskin.frames import Contact
from kappaskin.mechanics import Stretching

SQUARE, H = Patch(0.1, 0.1), 0.25e-3


def told(force, sd, w):
    place = np.full(2, 0.05)
    return Contact(place, 0 * place, force, sd, w, 1e-6, 297, True, False)


def stretched(force, at, inplane="held", edge="hinged"):
    """The displacement at the load in m, and the force in N that it takes without stretching."""
    plate = Plate(SQUARE, thickness=H, inplane=inplane)
    basis = basis_for(SQUARE, edge, 15, 15)
    modal = PointLoad(*at).modal(basis)
    w = np.vdot(modal, Stretching(plate, basis)(force * modal))
    return w, w / np.vdot(modal, plate.compliance(basis)(modal))


@pytest.mark.cases(
    "clamped-held-at0", "hinged-held-at1", "clamped-free-at1", "hinged-diaphragm-at0"
)
@pytest.mark.parametrize("at", [(0.05, 0.05), (0.02, 0.08)])
@pytest.mark.parametrize("inplane", ["held", "diaphragm", "free"])
@pytest.mark.parametrize("edge", ["hinged", "clamped"])
def test_the_law_tells_what_stretching_changes(at, inplane, edge):
    bounded = LargeDeflection(Plate(SQUARE, inplane=inplane), edge)
    for force, share in ((0.01, 0.35), (0.1, 0.35), (0.2, 0.5)):
        w, without = stretched(force, at, inplane, edge)
        change = force - without

        assert not bounded(told(without, change * (1 + 2 * share), w)).force_is_lower_bound
        assert bounded(told(without, change * (1 - share), w)).force_is_lower_bound


def test_the_number_stays_as_it_is():
    contact = told(0.1, 1e-3, 1e-3)

    marked = LargeDeflection(Plate(SQUARE), "hinged")(contact)

    assert replace(marked, force_is_lower_bound=False) is not contact
    assert (marked.force, marked.force_sd, marked.displacement) == (0.1, 1e-3, 1e-3)
    assert marked.force_is_lower_bound


def test_a_pull_is_judged_as_a_press_is():
    bounded = LargeDeflection(Plate(SQUARE), "hinged")
    assert bounded(told(-0.1, 1e-3, -1e-3)).force_is_lower_bound


@pytest.mark.parametrize(
    "plate",
    [
        Plate(SQUARE, thickness=H),
        Plate(Patch(0.04, 0.03, 0.0129)),
        Plate(SQUARE, 0.0, tension=5.0),
        Plate(Patch(0.1, 0.02, strip=True), inplane="diaphragm"),
    ],
    ids=["of known thickness", "bent", "drum head", "strip that slides in"],
)
def test_what_accounts_for_its_stretch_or_has_none_is_not_marked(plate):
    assert not LargeDeflection(plate, "hinged")(told(0.1, 1e-3, 5e-3)).force_is_lower_bound


@pytest.mark.parametrize("thickness", [None, 2 * H])
def test_a_disk_is_marked_also_where_its_thickness_is_given(thickness):
    bounded = LargeDeflection(Plate(Disk(0.05), thickness=thickness), "clamped")
    assert bounded(told(0.1, 1e-3, 5e-4)).force_is_lower_bound
    assert not bounded(told(0.1, 1e-3, 2e-5)).force_is_lower_bound


def test_without_a_contact_there_is_nothing_to_mark():
    assert LargeDeflection(Plate(SQUARE), "hinged")(NO_CONTACT) is NO_CONTACT
    unknown = LargeDeflection(Plate(SQUARE), "hinged")(told(math.nan, math.nan, math.nan))
    assert not unknown.force_is_lower_bound


@pytest.mark.parametrize(("force", "marked"), [(0.15, True), (0.001, False)])
def test_a_pipeline_marks_the_force_of_a_skin_of_unknown_thickness(force, marked):
    scene = scene_called("centre").touched_by(PointLoad(0.05, 0.05, force))
    frame = Simulator(scene).frame(0, lambda: 0.0)

    unknown = Pipeline(scene.sensor(), Setup())(frame).contact
    known = Plate(scene.plate.patch, scene.plate.rigidity, thickness=H)
    accounted = Pipeline(replace(scene, plate=known).sensor(), Setup())(frame).contact

    assert unknown.force_is_lower_bound == marked
    assert not accounted.force_is_lower_bound


# Domes, saddles and troughs


DOME = Plate(Patch(0.1, 0.1, (3, 3)))
MIDDLE = (0.05, 0.05)


def at_depth(plate, depth, at=MIDDLE, sd=1e-9, edge="hinged"):
    """A contact whose force moves a linear shell by `depth` thicknesses, and what becomes of it."""
    basis = basis_for(plate.patch, edge, 9, 9)
    modal = PointLoad(*at).modal(basis)
    force = depth * H / float(np.vdot(modal, plate.compliance(basis)(modal)))
    linear = replace(told(force, sd, depth * H), position=np.array(at))
    return linear, LargeDeflection(plate, edge)(linear)


@pytest.mark.parametrize("depth", [0.05, 0.3, 1.0, -0.05, -0.3, -1.0])
@pytest.mark.parametrize("at", [MIDDLE, (0.03, 0.06)])
def test_what_a_linear_shell_leaves_out_is_in_the_error_bar_of_a_dome(depth, at):
    linear, found = at_depth(DOME, depth, at)

    # In its middle Reissner's dome softens by a half of w/h.
    share = found.force_sd / abs(linear.force)
    assert share == pytest.approx(0.55 * abs(depth), rel=0.35)
    assert found.force == linear.force
    assert found.force_is_upper_bound == (depth > 0)
    assert found.force_is_lower_bound == (depth < 0)
    assert (
        found.force_bound
        == ("\N{LESS-THAN OR EQUAL TO} ", "\N{GREATER-THAN OR EQUAL TO} ")[depth < 0]
    )


def test_an_error_within_the_error_bar_marks_nothing_and_counts():
    linear, _ = at_depth(DOME, 0.1)
    wide = replace(linear, force_sd=0.1 * linear.force)

    found = LargeDeflection(DOME, "hinged")(wide)

    assert not found.force_bound
    assert not found.no_force
    assert 1.05 * wide.force_sd < found.force_sd < 1.3 * wide.force_sd


@pytest.mark.parametrize(("sign", "radius"), [(1, (3, 3)), (-1, (-3, -3))])
def test_where_a_skin_snaps_through_there_is_no_force(sign, radius):
    plate = Plate(Patch(0.1, 0.1, radius))
    _, soft = at_depth(plate, sign * 1.5)
    _, snapped = at_depth(plate, sign * 4)

    assert soft.force_is_upper_bound
    assert not soft.no_force
    assert snapped.no_force == "snaps through: no force"
    assert math.isnan(snapped.force)
    assert math.isnan(snapped.force_sd)
    assert snapped.position.tolist() == list(MIDDLE)
    assert not snapped.force_bound


def test_a_saddle_as_deep_one_way_as_the_other_only_stiffens():
    for depth in (1.0, -1.0, 7.0):
        _, found = at_depth(Plate(Patch(0.1, 0.1, (1, -1))), depth)
        assert found.force_is_lower_bound


def test_how_wide_and_how_large_a_deep_dome_is_changes_nothing():
    plates = Plate(Patch(0.1, 0.1, (0.4, 0.4))), Plate(Patch(0.2, 0.25, (1.5, 1.5)))
    shares = []
    for plate in plates:
        patch, E_h = plate.patch, plate.membrane_stiffness * (1 - plate.poisson**2)
        # Reissner (1946): 4 E h^2 / (R sqrt(3 (1 - nu^2))) is what a dome resists.
        k = 4 * E_h * H / (patch.radii[0] * math.sqrt(3 * (1 - plate.poisson**2)))
        linear = replace(told(0.3 * k * H, 1e-9, 0.0), displacement=math.nan)
        linear = replace(linear, position=np.array([patch.a / 2, patch.b / 2]))
        shares.append(LargeDeflection(plate, "hinged")(linear).force_sd / linear.force)
    assert shares[0] == pytest.approx(shares[1], rel=0.02)
    assert shares[0] == pytest.approx(0.55 * 0.3, rel=0.15)


@pytest.mark.parametrize("edge", ["hinged", "clamped"])
def test_a_cap_softens_as_a_dome_of_its_radius(edge):
    cap, dome = Plate(Cap(0.1, 0.4)), Plate(Patch(0.1, 0.1, (0.4, 0.4)))
    shares = []
    for plate, of in ((cap, edge), (dome, "hinged")):
        patch = plate.patch
        linear = replace(
            told(0.1 / patch.radii[0], 1e-9, 1e-4), position=np.array([patch.a, patch.b]) / 2
        )
        found = LargeDeflection(plate, of)(linear)
        assert found.force_is_upper_bound
        shares.append(found.force_sd / linear.force)
    assert shares[0] == pytest.approx(shares[1], rel=0.02)


@pytest.mark.parametrize(
    "plate",
    [
        replace(DOME, unknown_material=True),
        replace(DOME, rigidity=0.0, tension=5.0),
    ],
    ids=["unknown material", "drum head"],
)
def test_a_curved_skin_of_which_no_stiffness_is_known_is_not_marked(plate):
    contact = told(0.1, 1e-3, 1e-3)
    assert LargeDeflection(plate, "hinged")(contact) is contact


def test_a_dome_without_a_contact_has_nothing_to_mark():
    assert LargeDeflection(DOME, "hinged")(NO_CONTACT) is NO_CONTACT


def test_a_pipeline_marks_the_force_of_a_dome_pressed_deep_and_estimates_none_deeper():
    found = []
    for force in (2e-3, 0.02, 0.3):
        scene = scene_called("centre")
        layout = replace(scene.layout, patch=DOME.patch)
        scene = replace(scene, plate=DOME, layout=layout).touched_by(PointLoad(*MIDDLE, force))
        frame = Simulator(scene).frame(0, lambda: 0.0)
        found.append(Pipeline(scene.sensor(), Setup())(frame).contact)
    assert [one.force_is_upper_bound for one in found] == [False, True, False]
    assert [one.snaps_through for one in found] == [False, False, True]
    assert math.isnan(found[2].force)
