"""One table of what an estimate reports: what is in it is in every file and message."""

import dataclasses
import json
import math
import runpy
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from kappaskin import load_scene
from kappaskin.frames import COMPONENTS, Estimate
from kappaskin.pipeline import REPORTED, getters, readouts, stored
from kappaskin.publish.foxglove_channels import CHANNELS
from kappaskin.publish.message import CONTACT, SECOND, SWITCHES
from kappaskin.recording import messages as m
from kappaskin.recording.export.tables import columns

TESTS = Path(__file__).parents[2]
GUIDE = runpy.run_path(str(TESTS / "guide_quantities.py"))

COLUMNS = [
    "time",
    "sequence",
    "setup",
    "device_time",
    "host_time",
    "taken",
    "taken_sd",
    "counts",
    "nominal",
    "curvature",
    "fresh",
    "residual",
    "suspect",
    "coefficients",
    "noise",
    "converged",
    "drift",
    "present",
    "single",
    "near_rim",
    "force_is_lower_bound",
    "force_is_upper_bound",
    "snaps_through",
    "spare",
    "position",
    "position_sd",
    "position_95",
    "force",
    "force_sd",
    "force_95",
    "displacement",
    "displacement_sd",
    "load_radius",
    "load_radius_95",
    "point",
    "frame",
    "metric",
    "curvature_form",
    "torsion_form",
    "covariance",
    "principal",
    "principal_sd",
    "angle",
    "second_present",
    "second_position",
    "second_position_sd",
    "second_position_95",
    "second_force",
    "second_force_sd",
    "second_force_95",
]
"""Names of columns of CSV and HDF5 files and of arrays of NPZ files, which others read."""

UNITS = {
    **dict.fromkeys(("time", "device_time", "host_time", "taken", "taken_sd"), "s"),
    **dict.fromkeys(("nominal", "curvature", "residual", "noise", "drift"), "1/m"),
    **dict.fromkeys(("coefficients", "position", "position_sd", "position_95", "point"), "m"),
    **dict.fromkeys(("displacement", "displacement_sd", "load_radius", "load_radius_95"), "m"),
    **dict.fromkeys(("force", "force_sd", "force_95"), "N"),
    **dict.fromkeys(("curvature_form", "torsion_form", "principal", "principal_sd"), "1/m"),
    **{"covariance": "1/m^2", "angle": "rad"},
    **dict.fromkeys(("second_position", "second_position_sd", "second_position_95"), "m"),
    **dict.fromkeys(("second_force", "second_force_sd", "second_force_95"), "N"),
}

HEADS = """
position_x [m],position_y [m],position_sd_x [m],position_sd_y [m]
position_95_x [m],position_95_y [m]
force [N],force_sd [N],force_95 [N],displacement [m],displacement_sd [m]
load_radius [m],load_radius_95_low [m],load_radius_95_high [m]
point_x [m],point_y [m],point_z [m]
frame_t_x,frame_t_y,frame_t_z,frame_s_x,frame_s_y,frame_s_z,frame_n_x,frame_n_y,frame_n_z
metric_t_x,metric_t_y,metric_s_x,metric_s_y
curvature_form_t_t [1/m],curvature_form_t_s [1/m],curvature_form_s_t [1/m],curvature_form_s_s [1/m]
torsion_form_t [1/m],torsion_form_s [1/m]
""".replace("\n", ",").strip(",")
"""Part of the line at the head of a CSV file."""

KEYS = [
    "timestamp",
    "number",
    "sequence",
    "generation",
    "device_time_s",
    "taken_sd_s",
    "age_s",
    "noise_per_m",
    "drift_per_m",
    "x_m",
    "y_m",
    "x_sd_m",
    "y_sd_m",
    "force_N",
    "force_sd_N",
    "displacement_m",
    "displacement_sd_m",
    "load_radius_m",
    "load_radius_low_m",
    "load_radius_high_m",
    "position_x_m",
    "position_y_m",
    "position_z_m",
    "position_x_sd_m",
    "position_y_sd_m",
    "position_z_sd_m",
    "normal_x",
    "normal_y",
    "normal_z",
    "normal_sd_rad",
    "curvature_1_per_m",
    "curvature_1_sd_per_m",
    "curvature_2_per_m",
    "curvature_2_sd_per_m",
    "direction_1_x",
    "direction_1_y",
    "direction_1_z",
    "direction_2_x",
    "direction_2_y",
    "direction_2_z",
    "direction_sd_rad",
]
"""Keys of the numbers in a message by UDP or Foxglove, which others read."""

FLAGS = [
    *("present", "single", "near_rim"),
    *("force_is_lower_bound", "force_is_upper_bound", "snaps_through", "shape_follows"),
]


@pytest.fixture
def made() -> list:
    sensor = load_scene("centre").sensor()
    return list(columns(SimpleNamespace(sensor=sensor, functions=(5, 4)), ()))  # pyright: ignore


def test_columns_are_called_as_they_always_were(made) -> None:
    assert [column.name for column in made] == COLUMNS
    assert {column.name: column.unit for column in made if column.unit} == UNITS
    heads = ",".join(head for column in made for head in column.heads())
    assert HEADS in heads
    P = made[COLUMNS.index("suspect")].shape[0]
    readings = [f"curvature_{name}_{n} [1/m]" for name in COMPONENTS for n in range(P)]
    assert ",".join(readings) in heads
    assert "coefficients_0_3 [m],coefficients_1_0 [m]" in heads


def test_columns_have_the_types_that_they_always_had(made) -> None:
    kinds = {column.name: column.kind for column in made if column.kind != "<f8"}
    assert kinds == {
        **dict.fromkeys(("sequence", "setup", "spare"), "<i8"),
        **dict.fromkeys(("fresh", "converged", "present", "single", "near_rim"), "?"),
        "second_present": "?",
        **dict.fromkeys(("force_is_lower_bound", "force_is_upper_bound", "snaps_through"), "?"),
        "suspect": "|u1",
    }


def test_messages_have_the_keys_that_they_always_had() -> None:
    assert [number.key for number in CONTACT] == KEYS
    assert list(SWITCHES) == FLAGS
    schema = json.loads(CHANNELS[0].schema)["properties"]
    assert list(schema) == ["kind", "version", "source", *FLAGS, *KEYS, "second"]
    second = ["x_m", "y_m", "x_sd_m", "y_sd_m", "force_N", "force_sd_N"]
    assert [number.key for number in SECOND] == list(schema["second"]["properties"]) == second


def test_names_are_one_of_a_kind_and_every_unit_has_a_suffix() -> None:
    names = [f"{q.name}{suffix}" for q in REPORTED for suffix, _, _ in q.forms]
    assert len(set(names)) == len(names)
    assert all(number.key for quantity in REPORTED for number in quantity.published)


def test_everything_recorded_of_a_contact_can_be_verified() -> None:
    fields = (*m.CONTACT.fields, *m.SECOND_CONTACT.fields)
    recorded = {field.name for field in fields} - {"header"}
    assert recorded <= set(getters())


@pytest.mark.parametrize("page", GUIDE["TABLES"], ids=lambda page: page.name)
def test_the_tables_of_the_guide_are_made_from_the_table(page: Path) -> None:
    assert page.read_text("utf-8") == GUIDE["renewed"](page), "run python tests/guide_quantities.py"


def test_every_field_of_an_estimate_has_its_type_from_the_table() -> None:
    fields = {field.name: field.type for field in dataclasses.fields(Estimate)}
    parts = {n: dataclasses.fields(fields[n]) for n in ("contact", "second", "geometry")}
    paths = {f"{name}.{field.name}" for name in parts for field in parts[name]}
    assert {*stored()} >= paths | (fields.keys() - parts.keys())


FOUND = """
import json
import sys
from pathlib import Path

import h5py
import numpy as np

from kappaskin import Setup, Simulator, load_scene
from kappaskin.live.ring import Ring, slot_type
from kappaskin.pipeline import Pipeline, Reported, getters, readouts, skin_colours
from kappaskin.publish.foxglove_channels import CHANNELS
from kappaskin.publish.message import EstimateMessage, MessageHeader
from kappaskin.recording import ExportRequest
from kappaskin.recording.export.writing import export_steps

recording, folder, guide = map(Path, sys.argv[1:])
found = {}
for suffix in (".csv", ".npz", ".h5"):
    to = folder / f"out{suffix}"
    list(export_steps(ExportRequest(recording, to, preset="everything"), folder))


def doubled(file, name, half):
    return np.array_equal(file[name][()], 2 * file[half][()], equal_nan=True)


with np.load(folder / "out.npz") as npz, h5py.File(folder / "out.h5") as h5:
    for name, file in (("npz", npz), ("hdf5", h5)):
        found[name] = doubled(file, "twice_sd", "force_sd")
        found[name] &= doubled(file, "twice_read", "curvature")
    found["units"] = (h5["twice"].attrs["unit"], h5["twice_read"].attrs["unit"]) == ("N", "1/m")
heads = [line for line in (folder / "out.csv").read_text().splitlines() if line[0] != "#"][0]
found["csv"] = ",twice [N],twice_sd [N]" in heads and "twice_read_xy_3 [1/m]" in heads

scene = load_scene("off-centre")
made = Pipeline(scene.sensor(), Setup(), 1)
estimate = made(Simulator(scene).frame(0, lambda: 1.0))
message = EstimateMessage(estimate, made.fitted, made, MessageHeader("sim", 0.0, 0, True))
said = json.loads(message.contact)
found["udp"] = abs(said["twice_N"] / said["force_N"] - 2) < 1e-4 and "twice_sd_N" in said
described = json.loads(CHANNELS[0].schema)["properties"]["twice_N"]
found["foxglove"] = described["description"] == "twice the force"

ring, slot = Ring.create(), slot_type(made)
ring.lay_out(1, slot)
ring.write(estimate)
paths = ["curvature", "twice_read"]
got, (_, recent, _) = ring.read(1, slot), ring.recent(1, slot, 0, paths)
found["ring"] = np.array_equal(got.twice_read, estimate.twice_read)
found["ring"] &= getters()["twice"](Reported(got)) == 2 * estimate.contact.force
recent = np.concatenate(recent, axis=1)[0]
found["recent"] = np.array_equal(recent, [*got.curvature, *got.twice_read])
ring.destroy()
found["readouts"] = [r.value for r in readouts(got) if r.label == "Twice"] == [
    2 * got.contact.force
]
found["colours"] = skin_colours()["twice_xy"].unit == "1/m"
sys.path.insert(0, str(guide.parent))
import guide_quantities

found["guide"] = "| `twice_N` | twice the force |" in guide_quantities.keys()
found["guide"] &= "| `twice_read` |" in guide_quantities.quantities()
print(json.dumps({name: bool(whether) for name, whether in found.items()}))
"""


@pytest.mark.full
@pytest.mark.slow
def test_quantities_added_to_the_table_are_in_every_file_message_and_slot(
    recording: Path, tmp_path: Path
) -> None:
    pytest.importorskip("h5py")
    code = (TESTS / "added_quantities.py").read_text("utf-8") + FOUND
    given = [str(recording), str(tmp_path), str(TESTS / "guide_quantities.py")]

    done = subprocess.run(
        [sys.executable, "-c", code, *given], capture_output=True, text=True, timeout=180
    )

    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found == dict.fromkeys(found, True)
    assert len(found) == 11


def test_a_contact_near_the_rim_has_words_for_its_force_on_the_screen(messages_of) -> None:
    (made,) = messages_of(load_scene("off-centre"))
    contact = made.estimate.contact
    inside, rim = (
        {each.label: each for each in readouts(dataclasses.replace(made.estimate, contact=of))}
        for of in (contact, dataclasses.replace(contact, near_rim=True))
    )
    assert (inside["Force"].value, inside["Force"].words) == (contact.force, "")
    assert math.isnan(rim["Force"].value)
    assert math.isnan(rim["Force"].half_width)
    assert rim["Force"].words == "edge: no force"
    assert rim["Depth"].words == "edge: no depth"
    assert rim["Contact x"].words == rim["Contact y"].words == "edge: unreliable"
    assert rim["Noise of a reading"].value == inside["Noise of a reading"].value


def test_readouts_are_the_estimate_in_units_of_the_screen(messages_of) -> None:
    (made,) = messages_of(load_scene("off-centre"))
    touch, geometry = made.estimate.contact, made.estimate.geometry
    found = {each.label: each for each in readouts(made.estimate)}
    assert list(found)[:4] == ["Contact x", "Contact y", "Force", "Depth"]
    assert found["Contact y"].value == 1e3 * touch.position[1]
    assert found["Contact y"].half_width == 1e3 * touch.position_95[1]
    assert (found["Force"].value, found["Force"].unit) == (touch.force, "N")
    assert found["Depth"].sd == 1e3 * touch.displacement_sd
    assert found["Smaller \N{GREEK SMALL LETTER KAPPA}"].sd == geometry.principal_sd[1]
    assert math.isnan(found["Noise of a reading"].sd)
