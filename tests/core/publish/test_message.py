"""What is published of a frame: true numbers, honest error bars, and JSON that anybody reads."""

import base64
import json
import math
import re
import time
from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kappaskin import Cap, Disk, Patch, Plate, PointLoad, Scene, SensorLayout, Setup, load_scene
from kappaskin.contact import surface_geometry
from kappaskin.estimation import METHODS
from kappaskin.pipeline.reported import UNKNOWN
from kappaskin.publish import SourceState, foxglove, message, publishing
from kappaskin.publish import foxglove as client
from kappaskin.publish import foxglove_channels as channels
from kappaskin.publish import foxglove_channels as cloud
from kappaskin.publish import publishing as target
from kappaskin.publish.message import CONTACT, LARGEST, MOST_FUNCTIONS, SECOND, SWITCHES, text_of
from kappaskin.scenes.effects import GaussianNoise

GUIDE = (files("kappaskin_resources") / "publishing" / "messages.md").read_text("utf-8")
PRESSED = load_scene("off-centre")
FLOATS = st.floats(allow_nan=True, allow_infinity=True)


def bent(patch: Patch) -> Scene:
    noise, layout = (GaussianNoise(0.3),), SensorLayout.regular(patch, 10, 10)
    return Scene("bent", Plate(patch), layout, effects=noise).touched_by(PointLoad(0.014, 0.017, 1))


SKINS = {
    "flat": PRESSED,
    "bent": bent(Patch(0.04, 0.03, 12.9e-3)),
    "dome": bent(Patch(0.04, 0.03, (0.1, 0.08))),
    "saddle": bent(Patch(0.04, 0.03, (-0.1, 0.08))),
    "cap": bent(Cap(0.016, 1.2)),
}
on_each_skin = pytest.mark.parametrize("scene", SKINS.values(), ids=SKINS)


def refuse(constant: str) -> float:
    raise AssertionError(f"{constant} is no JSON")


def read(data: bytes) -> dict[str, object]:
    return json.loads(data, parse_constant=refuse)


def vector(told: dict[str, object], name: str) -> np.ndarray:
    return np.array([told[f"{name}_{axis}"] for axis in "xyz"])


@on_each_skin
def test_a_contact_says_what_the_estimate_says(messages_of, scene: Scene) -> None:
    (made,) = messages_of(scene)
    told, touch, geometry = read(made.contact), made.estimate.contact, made.estimate.geometry
    assert touch.present
    assert told["present"] is True
    assert (told["x_m"], told["y_m"]) == pytest.approx(tuple(touch.position), rel=1e-6)
    assert (told["x_sd_m"], told["y_sd_m"]) == pytest.approx(tuple(touch.position_sd), rel=5e-3)
    assert told["force_N"] == pytest.approx(touch.force, rel=1e-5)
    assert told["displacement_sd_m"] == pytest.approx(touch.displacement_sd, rel=5e-3)
    position = np.array([told[f"position_{axis}_m"] for axis in "xyz"])
    assert position == pytest.approx(geometry.position, rel=1e-6)
    assert vector(told, "normal") == pytest.approx(geometry.normal, abs=1e-6)
    for k in (0, 1):
        name = f"curvature_{k + 1}"
        assert told[f"{name}_per_m"] == pytest.approx(geometry.principal[k], rel=1e-5)
        assert told[f"{name}_sd_per_m"] == pytest.approx(geometry.principal_sd[k], rel=5e-3)
        along = vector(told, f"direction_{k + 1}")
        assert along == pytest.approx(geometry.directions[k], abs=1e-6)


@on_each_skin
def test_error_bars_are_what_noise_does_to_the_geometry(messages_of, scene: Scene) -> None:
    (made,) = messages_of(scene)
    told, basis, touch = read(made.contact), made.pipeline.basis, made.estimate.contact
    rng, count = np.random.default_rng(1), 1000
    shapes = rng.multivariate_normal(made.fit.coefficients.ravel(), made.fit.covariance, count)
    places = rng.normal(touch.position, touch.position_sd, (count, 2))

    def geometry(shape: np.ndarray, place: np.ndarray):
        return surface_geometry(basis, shape.reshape(basis.shape), place, made.fit.covariance_of)

    moved = [geometry(*each) for each in zip(shapes, places, strict=True)]
    spread = np.std([each.position for each in moved], axis=0)
    claimed = [told[f"position_{axis}_sd_m"] for axis in "xyz"]
    assert spread == pytest.approx(claimed, rel=0.1)
    tilt = np.linalg.norm(np.std([each.normal for each in moved], axis=0))
    assert tilt == pytest.approx(told["normal_sd_rad"], rel=0.1)
    # The bars of curvature and directions are those of the shape, at the place.
    there = [geometry(shape, touch.position) for shape in shapes]
    turns = np.array([each.angle for each in there]) - made.estimate.geometry.angle
    turned = np.std(np.arcsin(np.sin(2 * turns)) / 2)
    assert turned == pytest.approx(told["direction_sd_rad"], rel=0.15)


def test_where_both_curvatures_are_equal_no_direction_is_known(messages_of) -> None:
    def round_there(estimate):
        geometry = replace(estimate.geometry, curvature_form=np.diag([-8.0, -8.0]))
        return replace(estimate, geometry=geometry)

    (made,) = messages_of(PRESSED, change=round_there)
    told = read(made.contact)
    assert told["direction_sd_rad"] == pytest.approx(UNKNOWN, abs=1e-3)
    assert np.linalg.norm(vector(told, "direction_1")) == pytest.approx(1, abs=1e-5)


def test_without_a_contact_its_numbers_are_null_and_it_is_json_all_the_same(messages_of) -> None:
    (made,) = messages_of(load_scene("off-centre").touched_by())
    told = read(made.contact)
    assert told["present"] is False
    assert told["force_N"] is told["normal_sd_rad"] is told["direction_2_z"] is None
    assert isinstance(told["noise_per_m"], float)
    assert [key for key in told if key not in ("kind", "version", "source", *SWITCHES)] == [
        *(field.key for field in CONTACT),
        "second",
    ]


def test_a_second_contact_is_told_beside_the_first(messages_of) -> None:
    (made,) = messages_of(load_scene("two-contacts"))
    second, estimate = read(made.contact)["second"], made.estimate
    assert [one.force for one in estimate.contacts] == [
        estimate.contact.force,
        estimate.second.force,
    ]
    assert isinstance(second, dict)
    assert list(second) == [number.key for number in SECOND]
    assert second["force_N"] == pytest.approx(estimate.second.force, rel=1e-5)
    assert (second["x_m"], second["y_m"]) == pytest.approx(
        tuple(estimate.second.position), rel=1e-6
    )
    assert len(made.contact) <= 2000


def test_keys_are_one_of_a_kind_and_their_values_flat(messages_of) -> None:
    (made,) = messages_of(PRESSED)
    told = read(made.contact)
    assert len({field.key for field in CONTACT}) == len(CONTACT)
    assert told.pop("second") is None
    assert not {k for k, v in told.items() if not isinstance(v, bool | int | float | str)}
    for key, value in read(made.shape).items():
        assert isinstance(value, int | float | str) or key.endswith("_m")


def test_the_time_is_when_the_scan_began_and_the_age_is_since_then(messages_of) -> None:
    begun = time.monotonic()
    (made,) = messages_of(PRESSED)
    before = time.time()
    told = read(made.contact)
    after, since = time.time(), time.monotonic() - begun
    assert told["taken_sd_s"] == 1e-4
    assert before - 0.1 < told["timestamp"] + told["age_s"] < after + 0.1
    assert 0 < told["age_s"] < since


def test_where_nothing_tells_when_the_scan_began_the_reading_is_the_time(messages_of) -> None:
    def unknown(estimate):
        return replace(estimate, taken=math.nan, taken_sd=math.inf)

    (made,) = messages_of(PRESSED, change=unknown)
    told, host_time = read(made.contact), made.estimate.host_time
    assert told["taken_sd_s"] is None
    assert told["timestamp"] == pytest.approx(message.epoch() + host_time, abs=0.1)


def test_the_shape_gives_the_surface_back(messages_of) -> None:
    (made,) = messages_of(PRESSED)
    told, pipeline = read(made.shape), made.pipeline
    shape = told["functions_x"], told["functions_y"]
    assert told["edge"] == pipeline.sensor.edge
    coefficients = np.reshape(told["coefficients_m"], shape)
    x, y = pipeline.sensor.layout.patch.grid(65, 65)
    surface = pipeline.basis.on_grid(x, y)(coefficients)
    assert surface == pytest.approx(made.estimate.surface, abs=1e-7)
    sd = np.reshape(told["coefficients_sd_m"], shape)
    assert sd == pytest.approx(made.fit.sd, rel=5e-3)
    assert told["number"] == read(made.contact)["number"]


def test_as_many_functions_as_promised_fit_in_a_datagram(messages_of) -> None:
    (made,) = messages_of(PRESSED, setup=Setup(10, 8))
    assert made.estimate.coefficients.size == MOST_FUNCTIONS
    assert made.shape_follows
    assert len(made.shape) <= LARGEST
    assert len(made.contact) <= 1452  # of an Ethernet frame what IPv6 leaves
    (larger,) = messages_of(PRESSED, setup=Setup(10, 10))
    assert not larger.shape_follows
    assert read(larger.contact)["shape_follows"] is False


@pytest.mark.parametrize("method", METHODS)
def test_every_estimator_has_something_to_say(messages_of, method: str) -> None:
    scene = replace(PRESSED, layout=PRESSED.layout.without([12, 55]))
    if method == "fast":
        scene = PRESSED  # whole grids only
    told = messages_of(scene, 3, Setup(6, 6, method=method))[-1]
    assert read(told.contact)["normal_sd_rad"] > 0
    assert all(sd > 0 for sd in read(told.shape)["coefficients_sd_m"])


@pytest.mark.parametrize("patch", [Patch(0.1, 0.02, strip=True), Disk(0.05)], ids=["strip", "disk"])
def test_skins_of_other_shapes_have_something_to_say(messages_of, patch: Patch) -> None:
    if patch.strip:
        layout = SensorLayout.regular(patch, 12, 1)
    else:
        places = np.random.default_rng(0).uniform(0.02, 0.08, (30, 2))
        layout = SensorLayout.scattered(patch, places)
    reference = (15, 1) if patch.strip else (15, 15)
    scene = Scene("other", Plate(patch), layout, reference=reference)
    scene = scene.touched_by(PointLoad(0.05, patch.b / 2, 0.1))
    (told,) = messages_of(scene, 1, Setup(4, 4))
    assert read(told.contact)["number"] == 0
    assert read(told.shape)["functions_x"] == 4
    points = json.loads(cloud.SkinMessages()(cloud.SKIN, told))
    data = np.frombuffer(base64.b64decode(points["data"]), "<f4").reshape(-1, len(cloud.NAMES))
    assert np.isfinite(data).all()
    assert (len(data) < cloud.POINTS**2) == isinstance(patch, Disk)


@given(st.lists(FLOATS, max_size=20))
def test_numbers_of_any_kind_become_json(values: list[float]) -> None:
    told = json.loads(f"[{text_of(values, '%.6g')}]", parse_constant=refuse)
    assert len(told) == len(values)
    for value, said in zip(values, told, strict=True):
        assert (said is None) == (not math.isfinite(value))
        assert said is None or said == pytest.approx(value, rel=1e-5)


def test_the_state_of_the_source_is_json_with_every_number_promised() -> None:
    lost = SourceState("lost", "", "x" * 5000, None, 0.0, -math.inf)
    told = read(lost.encoded())
    assert (told["state"], told["source"]) == ("lost", "")
    assert told["since_last_frame_s"] is told["width_x_m"] is None
    assert len(lost.encoded()) < LARGEST
    there = read(
        SourceState("streaming", "sim", "", PRESSED.sensor(), 500.0, time.monotonic()).encoded()
    )
    assert (there["source"], there["rate_per_s"], there["width_x_m"]) == ("sim", 500.0, 0.1)
    assert set(there) == set(told)


@pytest.mark.parametrize(
    ("patch", "curvatures"),
    [
        (Patch(0.1, 0.1), (0.0, 0.0)),
        (Patch(0.04, 0.03, 0.04), (25.0, 0.0)),
        (Patch(0.1, 0.1, (0.5, -0.4)), (2.0, -2.5)),
    ],
    ids=["flat", "cylinder", "saddle"],
)
def test_the_state_of_the_source_has_both_curvatures_of_the_skin(patch, curvatures) -> None:
    sensor = Scene("", Plate(patch), SensorLayout.regular(patch, 4, 4)).sensor()

    told = read(SourceState("streaming", "sim", "", sensor, 500.0, 0.0).encoded())

    assert (told["base_curvature_per_m"], told["base_curvature_y_per_m"]) == curvatures


# The guide


def test_the_guide_names_every_key_with_the_words_of_the_code() -> None:
    rows = dict(re.findall(r"^\| `(\w+)` \| (.*) \|$", GUIDE, re.MULTILINE))
    assert rows.pop("source").startswith("`live`, `sim`")
    assert rows.pop("second").startswith("null, or a weaker contact")
    assert rows == SWITCHES | {field.key: field.text for field in CONTACT}
    for key in (*message.STATUS_NUMBERS, "coefficients_sd_m", "functions_x", "edge", "state"):
        assert f"`{key}`" in GUIDE


def test_the_guide_names_every_topic_with_its_schema() -> None:
    rows = re.findall(r"^\| `(/[\w/]+)` \| `([\w./]+)` \|", GUIDE, re.MULTILINE)
    assert rows == [(channel.topic, channel.name) for channel in channels.CHANNELS]
    for name in cloud.NAMES[3:]:
        assert f"`{name}`" in GUIDE


def test_the_figures_in_the_guide_are_those_of_the_code() -> None:
    text = " ".join(GUIDE.split())
    one = cloud.POINTS
    for words in (
        f"Kappaskin publishes, version {message.VERSION}",
        f"at most {LARGEST} bytes",
        f"More than {MOST_FUNCTIONS} coefficients",
        f"At most {foxglove.MOST_CLIENTS} clients",
        f"after {client.PING:g} s of silence",
        f"within {client.SILENT:g} s",
        f"than {client.PER_SECOND // 1024} KiB in a second",
        f"than {client.LARGEST // 1024} KiB",
        f"{one} x {one} points",
        f"{UNKNOWN:.3f} rad",
        f"{1 / foxglove.FRAME:.0f} times a second at most: {one}",
        f"port {target.PORTS['udp']}, protocol json",
        f"127.0.0.1:{target.PORTS['foxglove']}",
        *client.PROTOCOLS,
    ):
        assert words in text, words
    assert publishing.SHAPES == 1 / 100  # a hundred times a second


def test_a_force_that_is_unknown_is_null_beside_the_place(messages_of) -> None:
    plate = replace(PRESSED.plate, unknown_material=True)
    (made,) = messages_of(replace(PRESSED, plate=plate))
    told = read(made.contact)
    assert told["present"] is True
    assert told["force_N"] is None
    assert told["force_sd_N"] is None
    assert isinstance(told["x_m"], float)
    assert isinstance(told["displacement_m"], float)
    assert "nan" not in made.contact.decode().lower()


# A hand.


def test_every_message_of_a_finger_names_it(messages_of) -> None:
    (made,) = messages_of(PRESSED)
    named = message.EstimateMessage(
        made.estimate, made.fit, made.pipeline, replace(made.mark, finger="thumb")
    )
    state = SourceState("streaming", "sim", "", None, 500.0, 0.0)
    for with_name, without in (
        (named.contact, made.contact),
        (named.shape, made.shape),
        (replace(state, finger="thumb").encoded(), state.encoded()),
    ):
        told = read(with_name)
        assert told.pop("finger") == "thumb"
        assert set(told) == set(read(without))
        assert b"finger" not in without
    assert len(named.contact) < LARGEST
    assert "`finger`" in GUIDE


def test_each_finger_has_a_server_of_its_own_and_one_receiver() -> None:
    names = ["udp://127.0.0.1:9870", "foxglove://"]
    assert target.of_finger(names, 0) == ["udp://127.0.0.1:9870", "foxglove://127.0.0.1:8765"]
    assert target.of_finger(names, 2) == ["udp://127.0.0.1:9870", "foxglove://127.0.0.1:8767"]
    with pytest.raises(target.Refusal, match="a port from 1 to 65535"):
        target.of_finger(["foxglove://:65535"], 1)
