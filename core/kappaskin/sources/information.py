"""Device information: a sensor's description, its schema, and its JSON on the wire."""

import json
import math
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from kappaskin._schema import Key, Part, Unit, Within, fields_of
from kappaskin._toml import TomlTable, json_table
from kappaskin.bases import check_edge
from kappaskin.errors import Refusal, SourceError
from kappaskin.mechanics import Plate
from kappaskin.scenes import PARTS, check_elements, check_sides
from kappaskin.sensing import QUANTITIES, DigitalReadings, Sensor, SensorLayout, Transduction
from kappaskin.skin import Cap, Disk, MeshSkin, Patch, Polygon
from kappaskin.sources.description import described_sensor, described_text

_SKIN, _ELEMENTS = PARTS["skin"], PARTS["elements"]
_CHAIN = ("bridge", "multiplexer", "amplifier", "converter")
_METRE, _PER_METRE = Unit("m", "mm", 1e-3), Unit.same("1/m")

SENSOR = Part(
    "Sensor",
    {
        "name": Key("Name", "Name of the sensor.", kind=str),
        "serial_number": Key("Serial number", "Key of its calibrations and tares.", kind=str),
        "firmware": Key("Firmware", "Version of the firmware.", kind=str),
        "simulated": Key("Simulated", "Whether the sensor is simulated.", kind=bool),
        "rate": Key(
            "Frame rate",
            "Highest rate of frames with all channels.",
            Unit.same("frames/s"),
            kind=float,
        ),
        "rigidity": replace(
            _SKIN.key("rigidity"),
            tip="Bending stiffness of the skin. Without it its material is unknown, and so are "
            "forces.",
            default=None,
        ),
        "size": _SKIN.key("size"),
        "base_curvature": Key(
            "Base curvature",
            "Curvature at rest along x of a skin bent to an arc: one over its radius. Of a shallow "
            "skin, a dome or saddle, the two along x and y.",
            _PER_METRE,
            kind=float | tuple[float, float],
            default=0.0,
        ),
        "strip": Key(
            "Strip",
            "Whether the skin is held at its two ends along x and constant along y.",
            kind=bool,
            default=False,
        ),
        "outline": Key(
            "Outline",
            "For a skin that is not a rectangle: `disk`, or x, y of each corner, in order.",
            _METRE,
            kind=str | tuple[tuple[float, float], ...],
            default=None,
        ),
        "cap": Key(
            "Cap",
            "For a domed skin: the radius of its equator in m, the angle from pole to rim in rad "
            "and the stretch, 1 of a sphere.",
            kind=tuple[float, float, float],
            default=None,
        ),
        "mesh": _SKIN.key("mesh"),
        **{
            name: _SKIN.key(name)
            for name in (
                *("edge", "fluid", "tension", "foundation", "poisson"),
                *("rim_stiffness", "axial_stiffness", "thickness", "inplane"),
            )
        },
        "grid": replace(_ELEMENTS.key("grid"), default=None),
        "positions": replace(_ELEMENTS.key("positions"), default=None),
        "gage_length": _ELEMENTS.key("gage_length"),
        "cell": replace(_ELEMENTS.key("cell"), default=None),
        "reads": replace(_ELEMENTS.key("reads"), default=None),
        "turns": _ELEMENTS.key("turns"),
        "readings": Key(
            "Readings",
            "Of readings that come as numbers, instead of the electronics: `resolution`, and "
            "`noise`, a table of standard deviations by quantity.",
            default=None,
        ),
        "dead_channels": Key(
            "Dead channels",
            "Readings without a working gage: `kind * P + element`, from 0.",
            kind=tuple[int, ...],
        ),
        "channel_map": Key(
            "Channel map",
            "Number of the reading that each wire channel measures; the same number if omitted.",
            kind=tuple[int, ...],
            default=None,
        ),
        **{
            name: Key(PARTS[name].label, f"All keys of a scene's `[electronics.{name}]`.")
            for name in _CHAIN
        },
    },
    either=(("grid", "positions"),),
)
"""All keys of a sensor's description, in the order in which they are written."""

_READS = Within(1e-3, 1e9, "1/m")


def sensor_to_json(sensor: Sensor) -> str:
    """The information text of `sensor`: SI units, channels counted component by component.

    Of one with a description of its own, that.
    """
    if sensor.description:
        return described_text(sensor)
    layout, patch, wired = sensor.layout, sensor.layout.patch, sensor.channel_map
    both = patch.curvatures
    owners = (layout, patch, sensor.plate, sensor)
    values = {
        name: getattr(one, name) for one in owners for name in SENSOR.keys if hasattr(one, name)
    }
    values |= {
        "size": (patch.a, patch.b),
        "base_curvature": both if isinstance(patch.radius, tuple) else patch.arc_curvature,
        "outline": _outline(patch),
        "cap": (patch.equator, patch.angle, patch.stretch) if isinstance(patch, Cap) else None,
        "mesh": patch.text if isinstance(patch, MeshSkin) else None,
        "grid": layout.shape,
        "positions": None if layout.shape else layout.positions.tolist(),
        "turns": None if layout.turns is None else layout.turns.tolist(),
        "dead_channels": np.flatnonzero(~layout.live.ravel()).tolist(),
        "channel_map": None if wired is None else wired.tolist(),
        "inplane": sensor.plate.inplane or None,
        "rigidity": None if sensor.plate.unknown_material else sensor.plate.rigidity,
    }
    if layout.reads:
        values["reads"] = layout.each_reads
        values["cell"] = layout.cell if any(layout.cell) else None
    else:
        values |= {"reads": None, "cell": None}
    if isinstance(chain := sensor.transduction, DigitalReadings):
        values["readings"] = {"resolution": chain.resolution, "noise": dict(chain.noise)}
        values |= dict.fromkeys(_CHAIN)
    else:
        values |= {name: asdict(getattr(chain, name)) for name in _CHAIN} | {"readings": None}
    written = {name: values[name] for name in SENSOR.keys if values[name] is not None}
    return json.dumps(written, separators=(",", ":"))


def _outline(patch: Patch) -> Any:
    """The corners of a polygon, or "disk"; None for a rectangle, a cap and a mesh."""
    if type(patch) is Disk:
        return "disk"
    return patch.vertices if type(patch) is Polygon else None


def sensor_from_json(text: str) -> Sensor:
    """The sensor that `text` describes; a `SourceError` where it cannot be understood."""
    try:
        table = json_table(text, floats_may_be_whole=True)
        return described_sensor(table) if "description" in table else _sensor(table)
    except (ValueError, ArithmeticError) as error:
        raise SourceError(
            f"the device's information cannot be used: {error}; its firmware must send what "
            "version 1 of the wire format specifies"
        ) from error


def _sensor(table: TomlTable) -> Sensor:
    own = {*_CHAIN, "readings"}
    values = {name: SENSOR.value(table, name) for name in SENSOR.keys if name not in own}
    patch = _patch(values)
    check_sides(patch)
    check_edge(patch, values["edge"])
    known = {name: values[name] for name in fields_of(Plate).keys() & values.keys()}
    if unknown := known["rigidity"] is None:
        del known["rigidity"]
    plate = Plate(patch, **known, unknown_material=unknown)
    wired = values["channel_map"]
    names = [  # half a pair of surrogates, which JSON may have, could be written to no file
        values[name].encode(errors="backslashreplace").decode()
        for name in ("name", "serial_number", "firmware")
    ]
    return Sensor(
        _layout(patch, values),
        _transduction(table),
        plate,
        values["edge"],
        values["rate"],
        *names,
        simulated=values["simulated"],
        channel_map=None if wired is None else np.array(wired, np.intp),
    )


def _patch(values: dict[str, Any]) -> Patch:
    size, H, outline = values["size"], values["base_curvature"], values["outline"]
    if values["mesh"] is not None:
        return MeshSkin.of_text(values["mesh"])
    if values["cap"] is not None:
        cap = Cap(*values["cap"])
        if H or values["strip"] or outline is not None or not np.allclose(size, (cap.a, cap.b)):
            raise Refusal(
                f"expected a {cap.name}, of size {[cap.a, cap.b]} and without base_curvature, "
                f"strip and outline, got size {[*size]}, base curvature {H}"
            )
        return cap
    if outline is None:
        Rx, *Ry = (1 / one if one else math.inf for one in np.ravel(H).tolist())
        return Patch(*size, radius=(Rx, Ry[0]) if Ry else Rx, strip=values["strip"])
    if isinstance(outline, str) and outline != "disk":
        raise Refusal(f"expected the outline 'disk' or a list of corners, got {outline!r:.80}")
    patch = Disk(size[0] / 2) if outline == "disk" else Polygon(outline)
    if H or values["strip"] or size != (patch.a, patch.b):
        raise Refusal(
            f"expected a flat {patch.name}, of size {[patch.a, patch.b]}, got size {[*size]}, base "
            f"curvature {H} and strip {values['strip']}"
        )
    return patch


def _layout(patch: Patch, values: dict[str, Any]) -> SensorLayout:
    if values["grid"] is not None:
        check_elements(*values["grid"])
        layout = SensorLayout.regular(patch, *values["grid"])
    elif values["positions"] is not None:
        layout = SensorLayout.scattered(patch, values["positions"])
    else:
        raise Refusal("expected the grid or the positions of the elements, got neither")
    averaged = {key: values[key] for key in ("gage_length", "cell") if values[key]}
    layout = replace(layout, **averaged)
    if values["reads"]:
        layout = layout.reading_each(values["reads"])
    layout = layout.turned(values["turns"]) if values["turns"] else layout
    dead, channels = values["dead_channels"], range(layout.channels)
    if unknown := [channel for channel in dead if channel not in channels]:
        raise Refusal(
            f"expected dead channels from 0 to {channels[-1]}, got {unknown!s:.80}; count "
            "them kind by kind"
        )
    live = np.isin(channels, np.array(dead, np.intp), invert=True)
    return replace(layout, live=live.reshape(layout.frame_shape))


def _transduction(table: TomlTable) -> Transduction | DigitalReadings:
    if "readings" in table:
        digital = table.table("readings")
        noise = digital.table("noise")
        each = tuple((name, noise.get(name, float)) for name in QUANTITIES if name in noise)
        readings = digital.make(DigitalReadings, noise=each)
        noise.done()
        digital.done()
        return readings
    parts = ((name, PARTS[name]) for name in _CHAIN)
    made: dict[str, Any] = {
        name: part.make(table.table(name), part.made[0], complete=True) for name, part in parts
    }
    found = Transduction(**made)
    reads = abs(found.resolution) * max(map(abs, found.limits))
    if reads not in _READS:
        raise Refusal(
            f"expected electronics with a range of {_READS}, got {reads:g}; give bridge, "
            "amplifier and converter in SI units"
        )
    return found
