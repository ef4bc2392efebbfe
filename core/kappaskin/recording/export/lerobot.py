"""Exported data sets in the form of LeRobot 3.0: a folder of Parquet and JSON files."""

import importlib
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kappaskin.errors import optional
from kappaskin.recording.export.tables import Block, Column, TableWriter

_WINDOW = 100  # frames that a rate is taken over: they may come in bursts
_EARLY = 1e-6  # share of a period by which a frame may come late: times are rounded
_READINGS = ("curvature", "reading")
_FILE = "{}/chunk-{{chunk_index:03d}}/file-{{file_index:03d}}.parquet"
_DATA, _EPISODES = _FILE.format("data"), _FILE.format("meta/episodes")
_FIRST = {"chunk_index": 0, "file_index": 0}
_TASK = {"name": "task", "field_name": "task", "pandas_type": "unicode", "numpy_type": "object"}
_BY_TASK = {"index_columns": ["task"], "columns": [_TASK], "column_indexes": []}  # for Pandas
_RESAMPLED = (
    "Rows are 1 / fps apart, from the first frame on. Each has the newest frame that had arrived "
    "by then: frames may be skipped, or repeated, as where the connection was lost. recorded_time "
    "is when that frame arrived, in s since the recording began. What is not known is 0 in "
    "observation.state and observation.readings, and false in known.state and known.readings."
)


class LeRobotFolder(TableWriter):
    """The recording as one episode: a row each 1 / fps s, with the newest frame by then."""

    block = 2**25
    names = (
        *("time", *_READINGS, "present", "position", "position_sd", "force", "force_sd"),
        *("displacement", "displacement_sd"),
    )

    def begin(self, scratch: Path) -> None:
        self._arrow = optional("pyarrow", "parquet", "a .lerobot folder")
        self._parquet: Any = importlib.import_module("pyarrow.parquet")
        readings = [column for column in self.columns if column.name in _READINGS]
        state = [column for column in self.columns if column.name not in ("time", *_READINGS)]
        self._groups = {"state": state, "readings": readings}
        self._features: dict[str, dict[str, Any]] = {}
        for name, columns in self._groups.items():
            about = _named(columns)
            self._features[f"observation.{name}"] = {"dtype": "float32"} | about
            self._features[f"known.{name}"] = {"dtype": "bool"} | about | {"units": None}
        one = {"shape": [1], "names": None}
        self._features["recorded_time"] = {"dtype": "float64"} | one | {"units": ["s"]}
        self._features["timestamp"] = {"dtype": "float32"} | one | {"units": ["s"]}
        for name in ("frame_index", "episode_index", "index", "task_index"):
            self._features[name] = {"dtype": "int64"} | one
        self._fps, self._start, self._length = round(1 / (self.request.every or 1)), 0.0, 0
        self._last: Block = {}
        self._statistics: dict[str, list[tuple[NDArray[np.float64], ...]]] = {}
        path, episodes = (self.path / name.format(**_FIRST) for name in (_DATA, _EPISODES))
        path.parent.mkdir(parents=True)
        episodes.parent.mkdir(parents=True)
        self._schema = self._arrow.schema(
            [(name, self._kind(feature)) for name, feature in self._features.items()]
        )
        self._file = path.open("xb")
        self._table = self._parquet.ParquetWriter(self._file, self._schema, compression="zstd")

    def _kind(self, feature: dict[str, Any]) -> Any:
        kind, (count,) = self._arrow.from_numpy_dtype(np.dtype(feature["dtype"])), feature["shape"]
        return kind if count == 1 else self._arrow.list_(kind, count)

    def write(self, block: Block) -> None:
        if not self._last:
            self._start = float(block["time"][0])
            if not self.request.every:
                self._fps = _rate(block["time"])
        frames = {
            name: np.concatenate([self._last.get(name, values[:0]), values])
            for name, values in block.items()
        }
        self._last = {name: values[-1:] for name, values in frames.items()}
        time = np.maximum.accumulate(frames["time"])
        end = int((time[-1] - self._start) * self._fps + _EARLY) + 1
        while self._length < end:
            rows = np.arange(self._length, min(end, self._length + self.rows_at_once))
            due = self._start + (rows + _EARLY) / self._fps
            newest = np.searchsorted(time, due, side="right") - 1
            self._write_rows(rows, {name: values[newest] for name, values in frames.items()})
            self._length += len(rows)

    def _write_rows(self, rows: NDArray[np.int64], frames: Block) -> None:
        found: Block = {}
        for name, columns in self._groups.items():
            flat = [frames[column.name].reshape(len(rows), -1) for column in columns]
            values = np.concatenate(flat, axis=1, dtype=np.float32, casting="unsafe")
            found[f"known.{name}"] = np.isfinite(values)
            found[f"observation.{name}"] = np.where(found[f"known.{name}"], values, np.float32(0))
        found |= {"recorded_time": frames["time"], "timestamp": (rows / self._fps).astype("<f4")}
        found |= {"frame_index": rows, "index": rows}
        found |= {"episode_index": 0 * rows, "task_index": 0 * rows}
        arrays: list[Any] = []
        for name, feature in self._features.items():
            values = found[name].reshape(len(rows), -1)
            each = values.astype(np.float64)
            of = each.min(axis=0), each.max(axis=0), each.mean(axis=0), each.var(axis=0)
            self._statistics.setdefault(name, []).append((*of, np.array([len(rows)])))
            flat, (count,) = self._arrow.array(values.ravel()), feature["shape"]
            lists = self._arrow.FixedSizeListArray
            arrays.append(flat if count == 1 else lists.from_arrays(flat, count))
        self._table.write_table(self._arrow.table(arrays, schema=self._schema))

    def end(self) -> None:
        self._table.close()
        task = f"recording {self.info.facts['recording']}"
        statistics = {name: _joined(parts) for name, parts in self._statistics.items()}
        episode = {
            "episode_index": 0,
            "tasks": [task],
            "length": self._length,
            "dataset_from_index": 0,
            "dataset_to_index": self._length,
            **{f"{of}/{name}": n for of in ("data", "meta/episodes") for name, n in _FIRST.items()},
            **{f"stats/{of}/{k}": v for of, each in statistics.items() for k, v in each.items()},
        }
        info = {
            "codebase_version": "v3.0",
            "robot_type": self.info.sensor.name,
            "total_episodes": 1,
            "total_frames": self._length,
            "total_tasks": 1,
            "chunks_size": 1000,
            "data_files_size_in_mb": 100,
            "video_files_size_in_mb": 200,
            "fps": self._fps,
            "splits": {"train": "0:1"},
            "data_path": _DATA,
            "video_path": None,
            "features": self._features,
        }
        tasks = self._arrow.table({"task_index": [0], "task": [task]})
        tasks = tasks.replace_schema_metadata({"pandas": json.dumps(_BY_TASK)})
        self._parquet.write_table(tasks, self.path / "meta/tasks.parquet")
        episodes = self._arrow.Table.from_pylist([episode])
        self._parquet.write_table(episodes, self.path / _EPISODES.format(**_FIRST))
        for name, content in {
            "info.json": info,
            "stats.json": statistics,
            "kappaskin.json": self.info.facts | {"resampled": _RESAMPLED},
        }.items():
            (self.path / "meta" / name).write_text(f"{json.dumps(content)}\n", encoding="utf-8")

    def close(self) -> None:
        self._file.close()


def _named(columns: list[Column]) -> dict[str, Any]:
    """Shape, names and units of the numbers of some columns, side by side."""
    names = [f"{column.name}{label}" for column in columns for label in column.labels or ("",)]
    units = [u for c in columns for u in c.units or [c.unit] * len(c.labels or ("",))]
    return {"shape": [len(names)], "names": names, "units": units}


def _rate(time: NDArray[np.float64]) -> int:
    """The median rate of frames that came at `time` (n,) in s, in whole frames/s."""
    k = min(_WINDOW, len(time) - 1)
    period = np.median(time[k:] - time[:-k]) / k if k else 0.0
    return max(round(1 / float(period)), 1) if period > 0 else 1


def _joined(parts: list[tuple[NDArray[np.float64], ...]]) -> dict[str, list[float]]:
    """Statistics of all rows from those of parts: smallest, largest, mean, variance, count."""
    low, high, means, variances, counts = map(np.array, zip(*parts, strict=True))
    mean = np.average(means, axis=0, weights=counts[:, 0])
    variance = np.average(variances + (means - mean) ** 2, axis=0, weights=counts[:, 0])
    found = {"min": low.min(axis=0), "max": high.max(axis=0), "mean": mean}
    found |= {"std": np.sqrt(variance), "count": counts.sum(axis=0)}
    return {name: values.tolist() for name, values in found.items()}
