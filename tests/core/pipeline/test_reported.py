"""One table of what an estimate reports: what is in it is in every file and message."""

import dataclasses
import json
import math
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

from kappaskin import load_scene
from kappaskin.frames import Estimate
from kappaskin.pipeline import REPORTED, ReportedQuantity, getters, readouts, stored
from kappaskin.publish.foxglove_channels import CHANNELS
from kappaskin.publish.message import CONTACT, SECOND, SWITCHES
from kappaskin.recording import messages as m

TESTS = Path(__file__).parents[2]
GUIDE = runpy.run_path(str(TESTS / "guide_quantities.py"))


def test_a_message_of_foxglove_has_the_keys_of_one_by_udp() -> None:
    schema = json.loads(CHANNELS[0].schema)["properties"]
    keys = [*SWITCHES, *(number.key for number in CONTACT)]
    assert list(schema) == ["kind", "version", "source", *keys, "second"]
    assert list(schema["second"]["properties"]) == [number.key for number in SECOND]


@pytest.mark.parametrize(
    ("unit", "key"), [("", "x"), ("W", "x_W"), ("N/m", "x_N_per_m"), ("1/m^2", "x_per_m2")]
)
def test_the_key_of_a_number_ends_in_its_unit(unit: str, key: str) -> None:
    (number,) = ReportedQuantity("x", unit, "what it is", "contact.force").published
    assert number.key == key


def test_each_quantity_is_the_field_of_its_name() -> None:
    others = {"setup": "generation", "point": "position", "load_size": "size"}
    others |= {"direction": "directions"}
    for of in REPORTED:
        name = of.name.removeprefix("second_")
        ends = {of.value: "", of.sd: "_sd", of.half_width: "_95"}
        for path in (path for path in ends if isinstance(path, str) and path != "noise"):
            field = others.get(name, name) + ends[path]
            assert path.rpartition(".")[2] == field, f"expected {of.name} to get {field}"


def test_a_second_contact_has_what_is_its_own() -> None:
    values = [str(of.value) for of in REPORTED if of.group == "second"]
    assert all(value.startswith("second.") for value in values)


def test_names_are_one_of_a_kind() -> None:
    names = [f"{q.name}{suffix}" for q in REPORTED for suffix, _, _ in q.forms]
    assert len(set(names)) == len(names)


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
    first = ["Contact x", "Contact y", "Force", "Depth"]
    assert list(found)[:4] == first, "others come after these on the screen"
    assert found["Contact y"].value == 1e3 * touch.position[1]
    assert found["Contact y"].half_width == 1e3 * touch.position_95[1]
    assert (found["Force"].value, found["Force"].unit) == (touch.force, "N")
    assert found["Depth"].sd == 1e3 * touch.displacement_sd
    assert found["Smaller \N{GREEK SMALL LETTER KAPPA}"].sd == geometry.principal_sd[1]
    assert math.isnan(found["Noise of a reading"].sd)
