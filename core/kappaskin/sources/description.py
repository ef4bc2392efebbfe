"""Sensor description: a TOML file on a device that has a line format of its own."""

import hashlib
import json
import math
import re
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import chain
from pathlib import Path
from typing import Any, cast

import numpy as np

from kappaskin._files import read_file
from kappaskin._schema import Key, Part, Unit, Within
from kappaskin._toml import TomlTable, parsed
from kappaskin._toml import table as toml_table
from kappaskin.errors import Refusal
from kappaskin.frames import COMPONENTS, Indices
from kappaskin.scenes import find_file, read_elements, read_skin
from kappaskin.sensing import (
    QUANTITIES,
    DigitalReadings,
    Sensor,
    SensorLayout,
    kind_of_reading,
    name_of_reading,
)
from kappaskin.skin import MeshSkin
from kappaskin.sources.decoder import Decoder
from kappaskin.sources.lines import (
    CHECKSUMS,
    TIMES,
    BinaryDecoder,
    Columns,
    JsonDecoder,
    LineDecoder,
    TextDecoder,
)

FORMAT = 1
SUFFIX = ".toml"
_LARGEST = 2**20  # bytes
_MOST_COLUMNS = 2**16
_SEQUENCE = "sequence"
_READING = re.compile(r"([^:]{1,40}):(\d{1,6})(?:\.\.(\d{1,6}))?")
_TABLES = tuple(dict.fromkeys((*COMPONENTS, *QUANTITIES)))  # of [readings]
_STEPS = {"1/m": 1e-6, "m": 1e-8, "m/m": 1e-8}  # of the counts that stand for readings
_STEP = 1e-7  # in readings of several units
_ALIKE = 9  # decimals of directions that are one
_BAUD = Within(50, 2**24, "baud", whole=True)
_FACTOR = Within(-1e12, 1e12)

TOP = Part(
    "Sensor description",
    {
        "format": Key("Format", "The format of the file: 1.", kind=int),
        "title": Key("Title", "Name of the sensor; the file's name if omitted.", kind=str),
    },
)
LINE = Part(
    "Line",
    {
        "kind": Key(
            "Kind",
            "Format of a record: a line of `text` with numbers, a line with a `json` object, or a "
            "`binary` record.",
            kind=str,
            choices=(("text", "Text"), ("json", "JSON"), ("binary", "Binary")),
        ),
        "separator": Key(
            "Separator",
            "Text between two numbers of a line; a space is any number of spaces and tabs. "
            "Recognised if omitted. Numbers have a decimal point.",
            kind=str,
            default="",
        ),
        "columns": Key(
            "Columns",
            "What the numbers of a record are, in order: `time` (s), `time_ms`, `time_us`, "
            "`sequence`, an empty text for one that is ignored, or readings such as `xx:4` or "
            "`height:0..35` of elements 4, and 0 to 35. Readings are `xx`, `yy`, `xy` or `twist`, "
            "`height`, `slope@DEGREES` and `curvature@DEGREES` along a direction from x.",
            kind=tuple[str, ...],
            default=(),
        ),
        "fields": Key(
            "Fields",
            "For JSON instead of columns: the key of each value, such as `skin.k` for k in skin, "
            "and its columns. A value is a number or a list of them.",
        ),
        "struct": Key(
            "Struct",
            "For binary: the format of a record, as of Python's struct, without sync bytes and "
            "checksum: `<H36h` is little-endian, a 16-bit number, then 36 with sign.",
            kind=str,
            default="",
        ),
        "sync": Key(
            "Sync", "For binary: the first bytes of a record, in hex.", kind=str, default=""
        ),
        "checksum": Key(
            "Checksum",
            "For binary: what follows a record, in its byte order, over all of the struct.",
            kind=str,
            default="none",
            choices=tuple((name, name) for name in CHECKSUMS),
        ),
        "rate": Key(
            "Rate",
            "Of a file without times: records per second.",
            Unit.same("1/s"),
            kind=float,
            default=0.0,
            limits=Within(1e-3, 1e5, or_zero=True),
        ),
        "baud": Key(
            "Baud rate",
            "Rate of the serial port; USB ports ignore it.",
            Unit.same("baud"),
            kind=int,
            default=115_200,
            limits=_BAUD,
        ),
        "id": Key(
            "Identifier",
            "Key of the sensor's tare and calibration; the serial number of the USB port if "
            "omitted, else a number made from this file.",
            kind=str,
            default="",
        ),
    },
)
READINGS = Part(
    "Readings",
    {
        "scale": Key(
            "Scale",
            "Reading per unit of the device's number: in m of heights, m/m of slopes, 1/m of "
            "curvatures.",
            kind=float,
            default=1.0,
            limits=_FACTOR,
        ),
        "offset": Key(
            "Offset",
            "Reading where the device sends 0, in the same unit.",
            kind=float,
            default=0.0,
            limits=_FACTOR,
        ),
        "noise": Key(
            "Noise",
            "Standard deviation of a reading, in the same unit; estimated if omitted. Readings of "
            "several units, or of one with different noise, are weighed by it and need it all.",
            kind=float,
            default=0.0,
            limits=Within(1e-12, 1e6, or_zero=True),
        ),
        "datum": Key(
            "Datum",
            "Whether the zero of the readings is known, or `free`: then each frame has an unknown "
            "offset, one for heights and one for each direction of slopes or curvatures.",
            kind=str,
            default="fixed",
            choices=(("fixed", "Fixed"), ("free", "Free")),
        ),
        "calibration": Key(
            "Calibration",
            "In `[readings]` alone: file of a calibration of this sensor, whose gains and offsets "
            "are taken off the readings after scale and offset.",
            kind=str,
            default="",
        ),
    },
)


@dataclass(frozen=True, eq=False)
class Description:
    """A sensor as its description's `text` has it, and the format of its lines."""

    text: str
    sensor: Sensor
    baud_rate: int
    columns: Columns
    kind: str
    paths: tuple[tuple[tuple[str, ...], int], ...]
    rate: float
    separator: str
    struct: str
    sync: bytes
    checksum: str

    def decoder(self, whole: bool = False, by_datagrams: bool = False) -> LineDecoder:
        """A decoder of its lines; `whole` where the bytes begin with the beginning of one."""
        if self.kind == "text":
            made = TextDecoder(self.columns, self.separator, whole)
        elif self.kind == "json":
            made = JsonDecoder(self.columns, self.paths, whole)
        else:
            made = BinaryDecoder(self.columns, self.struct, self.sync, self.checksum)
        made.by_datagrams = by_datagrams
        return made


SCHEME = "sensor:"
"""Prefix of the names of sources of described sensors."""
_DESCRIBED = ("sim:", "hand:", "replay:", "feed:", SCHEME)


def described_source(file: Path, source: str) -> str:
    """The name of a `source` of a sensor with the description in a `file`, for `open_source`.

    A `Refusal` for a source that has a description of its own.
    """
    if source.startswith(_DESCRIBED):
        raise Refusal(f"expected a port or URL with a sensor's description, got {source}")
    return f"{SCHEME}{file}:{source}"


def parts_of(name: str) -> tuple[str, str]:
    """The file and the port or URL in the name of a source of a described sensor.

    Both are empty where that is none.
    """
    file, found, url = name.removeprefix(SCHEME).partition(f"{SUFFIX}:")
    named = name.startswith(SCHEME) and found and url
    return (f"{file}{SUFFIX}", url) if named else ("", "")


def is_description(file: Path) -> bool:
    """Whether a TOML file describes a sensor's lines: it has a table [line]."""
    try:
        return "line" in tomllib.loads(read_file(file, _LARGEST).decode("utf-8-sig"))
    except (OSError, ValueError, RecursionError):
        return False


def load_description(file: Path, serial_number: str = "") -> Description:
    """The description in a TOML `file`; raises a `Refusal` with the line at fault.

    `serial_number` as of `description_of`.
    """
    try:
        text = read_file(file, _LARGEST).decode("utf-8-sig")
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise Refusal(f"{file}: cannot be read as a sensor's description ({why})") from error
    text = _with_files(_with_calibration(text.replace("\r\n", "\n"), file), file)
    return description_of(text, str(file), serial_number)


# Recordings keep the text of a description, and need no other file: so the gains and offsets of the
# calibration that it names are put behind it, and what files of the skin and the elements have.
_CALIBRATION = "\n[calibration]  # as it was in its file\n"


def _with_calibration(text: str, file: Path) -> str:
    table = TomlTable(parsed(text, file), text, str(file)).table("readings")
    if not (name := READINGS.value(table, "calibration")):
        return text
    path = file.parent / name
    try:
        found = tomllib.loads(read_file(path, _LARGEST).decode())
        device, each = found["device"], found["line"]
        values = {key: device[key] for key in ("name", "serial_number")}
        values |= {key: each[key] for key in ("gain", "offset")}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise table.refusal(
            f"{path}: cannot be read as a calibration ({error})", "calibration"
        ) from error
    if loops := [name for name in ("hysteresis", "creep") if name in found]:
        raise table.refusal(
            f"{path} corrects {loops[0]}, which depends on the past; expected gains and offsets "
            "alone: leave it out here, and load that file in the window",
            "calibration",
        )
    return f"{text}{toml_table(_CALIBRATION.rstrip(), values)}"


_REPLACED = ("file", "along")
_KEPT = "\n[kept.{}]  # what its file has"


def _with_files(text: str, file: Path) -> str:
    top = TomlTable(parsed(text, file), text, str(file))
    skin, elements = top.table("skin"), top.table("elements")
    if "file" not in skin and "file" not in elements:
        return text
    find = partial(find_file, file.parent, False)
    patch = read_skin(skin, find)[0].patch
    if "file" in skin:
        text += toml_table(_KEPT.format("skin"), {"mesh": cast("MeshSkin", patch).text})
    if "file" in elements:
        layout, _ = read_elements(elements, patch, find, skin)
        turns = {} if layout.turns is None else {"turns": layout.turns.tolist()}
        kept = {"positions": layout.positions.tolist(), **turns}
        text += toml_table(_KEPT.format("elements"), kept)
    return text


def _with_kept(values: dict[str, Any], top: TomlTable) -> None:
    """Put what [kept] has of files in the place of their names in `values`, the table `top`."""
    kept = top.table("kept")
    for part in ("skin", "elements"):
        for table in (top, kept):
            table.table(part)  # or refused here
        if part in kept:
            own = {
                key: value for key, value in values.get(part, {}).items() if key not in _REPLACED
            }
            values[part] = own | values["kept"][part]
    kept.done()


_VALUES = "\n[values]  # a record: sequence number, time in s, and the numbers of the columns\n"
_VALUES_SYNC, _VALUES_CHECKSUM = "b55e", "crc32"


def of_values(description: Description) -> Description:
    """The description of records of values, in the order of the columns of `description`.

    They are what a program pushes or a file holds, not bytes of the device. Where the columns have
    a sequence number or the time these are used, else those in front of the values.
    """
    sensor = description.sensor
    return description_of(f"{sensor.description}{_VALUES}", sensor.name, sensor.serial_number)


def _no_file(table: TomlTable, key: str) -> Path:
    raise table.refusal("expected a description with its mesh; load it from its file", key)


@lru_cache(8)
def description_of(text: str, name: str, serial_number: str = "") -> Description:
    """The description with this `text`, of the file `name`.

    `serial_number` is that of the sensor where the text has no `id`.
    """
    values = parsed(text, Path(name))
    top = TomlTable(values, text, name)
    if (version := TOP.value(top, "format")) != FORMAT:
        raise top.refusal(f"expected format = {FORMAT}, got {version}", "format")
    _with_kept(values, top)
    skin = top.table("skin")
    plate, edge = read_skin(skin, _no_file)
    # Without a given rigidity that of the default skin is no information.
    plate = replace(plate, unknown_material=plate.unknown_material or "rigidity" not in skin)
    elements = top.table("elements")
    if "reads" in elements:
        raise elements.refusal("expected none: the columns determine what is read", "reads")
    layout, _ = read_elements(elements, plate.patch, _no_file, skin)
    line = top.table("line")
    kind = LINE.value(line, "kind")
    names, paths = _names(line, kind)
    settings = {key: LINE.value(line, key) for key in ("rate", "separator", "struct", "checksum")}
    sync = LINE.value(line, "sync")
    if "values" in top:
        top.table("values").done()
        kind, sync = "binary", _VALUES_SYNC
        settings |= {"struct": f"<Id{len(names)}d", "checksum": _VALUES_CHECKSUM}
        sequence = "" if _SEQUENCE in names else _SEQUENCE
        time = "" if set(names) & set(TIMES) else "time"
        names = (sequence, time, *names)
    readings = _Conversion(top.table("readings"))
    with line.blamed("fields" if kind == "json" else "columns"):
        layout, columns = _columns(names, layout, readings)
    own = LINE.value(line, "id") or serial_number or hashlib.sha256(text.encode()).hexdigest()[:12]
    if readings.calibration:
        layout, columns = _calibrated(layout, columns, top.table("calibration"), own)
    title = TOP.value(top, "title", default=Path(name).name.removesuffix(SUFFIX))
    sensor = Sensor(
        layout,
        columns.readings,
        plate,
        edge,
        rate=math.inf,
        name=title,
        serial_number=own,
        firmware=f"{kind} lines",
        simulated=False,
        description=text,
    )
    with top.blamed("readings"):
        _ = sensor.sigma  # or refused here
    try:
        start = bytes.fromhex(sync)
    except ValueError as error:
        raise line.refusal(f"expected bytes in hex such as aa55: {error}", "sync") from error
    baud = LINE.value(line, "baud")
    line.done()
    readings.done()
    top.done()
    found = Description(text, sensor, baud, columns, kind, paths, sync=start, **settings)
    with line.blamed("struct" if kind == "binary" else "kind"):
        found.decoder()
    return found


def _names(
    line: TomlTable, kind: str
) -> tuple[tuple[str, ...], tuple[tuple[tuple[str, ...], int], ...]]:
    """The columns of all numbers of a record, and of JSON the path to each group of them."""
    if kind != "json":
        names = cast("tuple[str, ...]", LINE.value(line, "columns"))
        if not names:
            raise line.refusal('expected columns = ["time_ms", "xx:0..35", ...], got none')
        return _expanded(line, "columns", names), ()
    fields = line.table("fields")
    if not len([*fields]):
        raise line.refusal('expected fields = { "skin.k" = "xx:0..35" }, got none')
    groups = {path: _expanded(fields, path, (fields.get(path, str),)) for path in fields}
    paths = tuple((tuple(path.split(".")), len(names)) for path, names in groups.items())
    return tuple(chain.from_iterable(groups.values())), paths


def _expanded(table: TomlTable, key: str, names: tuple[str, ...]) -> tuple[str, ...]:
    """The names of single columns: a range of elements stands for one column each."""
    found: list[str] = []
    for name in names:
        if name in ("", _SEQUENCE, *TIMES):
            found.append(name)
            continue
        if not (match := _READING.fullmatch(name)):
            raise table.refusal(
                f"expected {', '.join((*TIMES, _SEQUENCE))}, an empty text, or a reading such as "
                f"xx:4 or height:0..35, got {name!r:.60}",
                key,
            )
        with table.blamed(key):
            kind_of_reading(match[1])  # or refused here
        what, first, last = match[1], int(match[2]), int(match[3] or match[2])
        if last < first:
            raise table.refusal(f"expected a range that goes up, got {name!r}", key)
        if len(found) + last - first >= _MOST_COLUMNS:
            raise table.refusal(f"expected at most {_MOST_COLUMNS} columns, got {name!r}", key)
        found += [f"{what}:{k}" for k in range(first, last + 1)]
    return tuple(found)


def _numbers_of(elements: int, shape: tuple[int, int] | None) -> list[int]:
    """The number in a layout of each element k = i_x n + i_y of m x n, or of one of a list."""
    if shape is None:
        return list(range(elements))
    return np.arange(elements).reshape(shape[1], shape[0]).T.ravel().tolist()


def _calibrated(
    layout: SensorLayout, columns: Columns, table: TomlTable, own: str
) -> tuple[SensorLayout, Columns]:
    """The same of a calibrated sensor: reading = offset + gain times what is read."""
    name, of = table.get("name", str), table.get("serial_number", str)
    if of != own:
        raise table.refusal(
            f"expected a calibration of this sensor, {own}, got one of {name} {of}; give id in "
            "[line] before you calibrate it, as this file is another with every change"
        )
    gain, offset = (np.array(table.get(key, tuple[float, ...])) for key in ("gain", "offset"))
    table.done()
    if not len(gain) == len(offset) == layout.channels:
        raise table.refusal(
            f"expected {layout.channels} gains and offsets, got {len(gain)} and {len(offset)}; "
            "calibrate the sensor again"
        )
    live = layout.live & np.isfinite(gain).reshape(layout.frame_shape)
    gain = np.where(np.isfinite(gain) & (gain != 0), gain, 1.0)[columns.channels]
    scale, zero = columns.scale / gain, (columns.offset - offset[columns.channels]) / gain
    return replace(layout, live=live), replace(columns, scale=scale, offset=zero)


class _Conversion:
    """What [readings] says of each column: in the table of its quantity, else for all."""

    def __init__(self, table: TomlTable) -> None:
        self._table = table
        self._own = {name: table.table(name) for name in _TABLES if name in table}
        self._used = set[str]()
        self.calibration: str = READINGS.value(table, "calibration")

    def of(self, what: str, key: str) -> Any:
        """The value of a `key` for readings such as xx or slope@30."""
        name = what.partition("@")[0]
        table, value = self._table, READINGS.value(self._table, key)
        if name in self._own:
            self._used.add(name)
            table, value = self._own[name], READINGS.value(self._own[name], key, default=value)
        if key == "scale" and not value:
            raise table.refusal("expected a scale other than 0", key)
        return value

    def noise(self, each: Iterable[str]) -> tuple[tuple[str, float], ...]:
        """The given noise of what the columns read: of each quantity, or of each that differs."""
        given = {what: float(self.of(what, "noise")) for what in each}
        if not any(given.values()):
            return ()
        found, alike = dict[str, float](), dict[str, set[float]]()
        for what, noise in given.items():
            name = name_of_reading(*kind_of_reading(what))
            if not noise or found.setdefault(name, noise) != noise:
                raise self._table.refusal(
                    "expected one noise of all readings of a kind, where that of any is given, got "
                    f"{', '.join(f'{noise:g} of {what}' for what, noise in given.items())}"
                )
            alike.setdefault(kind_of_reading(what)[0], set()).add(noise)
        return tuple(
            {
                quantity if len(alike[quantity := name.partition("@")[0]]) == 1 else name: noise
                for name, noise in found.items()
            }.items()
        )

    def done(self) -> None:
        """Refuse what is not asked for, and tables of what no column reads."""
        for name, table in self._own.items():
            if name not in self._used:
                raise table.refusal("expected a quantity that a column reads")
            table.done()
        self._table.done(*_TABLES)


def _reading(
    each: list[str], elements: Indices, layout: SensorLayout, readings: _Conversion
) -> tuple[SensorLayout, Indices]:
    """The layout with one reading of `each` name at each of `elements` (n,), and their channels."""
    kinds = [kind_of_reading(what) for what in each]
    datums = dict[str, str]()
    for what, (quantity, _) in zip(each, kinds, strict=True):
        datum = readings.of(what, "datum")
        if datums.setdefault(quantity, datum) != datum:
            raise Refusal(f"expected one datum of all readings of {quantity}, got fixed and free")
    free = [quantity for quantity, datum in datums.items() if datum == "free"]
    turns, all_of = layout.turns, layout.live.any(axis=-1)
    components = {COMPONENTS[k] for k in np.flatnonzero(all_of)} if turns is None else set[str]()
    alike = len({readings.of(what, "noise") for what in each}) == 1
    if alike and not free and set(each) == components:
        numbers = np.array([COMPONENTS.index(what) for what in each])
        channels = numbers * len(layout) + elements
        live = layout.live & np.isin(np.arange(layout.channels), channels).reshape(3, -1)
        return replace(layout, live=live), channels
    quantities, directions = zip(*kinds, strict=True)
    read = layout.reading(elements, quantities, directions, free)
    read = read if turns is None else read.turned(turns)
    return read.without(layout.dead), np.arange(len(each))


def _columns(
    names: tuple[str, ...], layout: SensorLayout, readings: _Conversion
) -> tuple[SensorLayout, Columns]:
    """The elements of the `layout` with what the columns read of them, and those columns."""
    for single in (_SEQUENCE, *TIMES):
        if names.count(single) > 1:
            raise Refusal(f"expected one column {single}, got {names.count(single)}")
    times = [name for name in TIMES if name in names]
    if len(times) > 1:
        raise Refusal(f"expected one column of time, got {' and '.join(times)}")
    places = [place for place, name in enumerate(names) if ":" in name]
    if not places:
        raise Refusal("expected columns with readings such as xx:0..35, got none")
    numbers = _numbers_of(len(layout), layout.shape)
    each, elements = list[str](), list[int]()
    read: dict[tuple[str, float, int], str] = {}
    for place in places:
        what, _, number = names[place].partition(":")
        if int(number) >= len(numbers):
            raise Refusal(f"expected elements from 0 to {len(numbers) - 1}, got {names[place]}")
        quantity, direction = kind_of_reading(what)
        same = quantity, round(direction % (2 * math.pi), _ALIKE), int(number)
        if same in read:
            raise Refusal(f"expected each reading once, got {read[same]} and {names[place]}")
        read[same] = names[place]
        each.append(what)
        elements.append(numbers[int(number)])
    layout, channels = _reading(each, np.array(elements), layout, readings)
    units = set(layout.kind_units)
    digital = DigitalReadings(
        _STEPS[units.pop()] if len(units) == 1 else _STEP,
        readings.noise(each),
    )
    columns = Columns(
        names,
        np.array(places, np.intp),
        channels,
        np.array([readings.of(what, "scale") for what in each]),
        np.array([readings.of(what, "offset") for what in each]),
        digital,
        names.index(times[0]) if times else -1,
        TIMES[times[0]] if times else 1.0,
        names.index(_SEQUENCE) if _SEQUENCE in names else -1,
    )
    return layout, columns


# Between the description and what is recorded of a sensor


_TEXT = ("description", "name", "serial_number")
_DATAGRAMS = "datagrams"  # is there, and true, where it sends them


def described_text(sensor: Sensor, by_datagrams: bool = False) -> str:
    """The information text of a described `sensor`, as recordings have it."""
    values = {key: getattr(sensor, key) for key in _TEXT}
    values |= {_DATAGRAMS: True} if by_datagrams else {}
    return json.dumps(values, separators=(",", ":"))


def described_sensor(table: TomlTable) -> Sensor:
    """The sensor of an information text that `described_text` made."""
    text, name, serial_number = (table.get(key, str) for key in _TEXT)
    if _DATAGRAMS in table:
        table.get(_DATAGRAMS, bool)
    table.done()
    return description_of(text, name, serial_number).sensor


def decoder_of(sensor: Sensor, text: str) -> Decoder | LineDecoder:
    """The decoder of what a sensor with this information `text` sends."""
    if not sensor.description:
        return Decoder()
    found = description_of(sensor.description, sensor.name, sensor.serial_number)
    by_datagrams = bool(json.loads(text).get(_DATAGRAMS))
    return found.decoder(by_datagrams=by_datagrams)
