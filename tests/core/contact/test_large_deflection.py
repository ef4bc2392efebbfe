"""Forces that leave out how the skin stretches."""

import math
from dataclasses import replace

import numpy as np
import pytest

from kappaskin import Disk, Patch, Pipeline, Plate, PointLoad, Setup, Simulator
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
