"""The folder of a study: its text, and one file for every task that was done."""

import json
import os
from dataclasses import asdict
from pathlib import Path
from typing import Any

from kappaskin.errors import Refusal
from kappaskin.studies.design.study import Study, read_study
from kappaskin.studies.design.task import Measured, Moments, Task

_ABOUT = "about.json"
_TEXT = "study.toml"


class Folder:
    """Results by task, at `path`; each file is written whole or not at all.

    A task whose parameters, block, measures and version are those of an earlier one finds its
    result, whatever else has changed in the study meanwhile.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    @classmethod
    def opened(cls, path: Path, study: Study) -> "Folder":
        """The folder for the results of `study`, made where there is none."""
        folder = cls(path)
        try:
            path.mkdir(parents=True, exist_ok=True)
            if any(path.iterdir()) and (owner := folder.name) != study.name:
                raise Refusal(
                    f"{path}: expected an empty folder or one of the study {study.name}, got that "
                    f"of {owner}; choose another by --out"
                )
            folder._write(path / _ABOUT, json.dumps({"study": study.name}))
            folder._write(path / _TEXT, study.text)
        except OSError as error:
            raise Refusal(
                f"{path}: expected a folder that can be written to ({error}); choose another"
            ) from error
        return folder

    @property
    def name(self) -> str:
        """The name of the study that it belongs to."""
        try:
            return str(json.loads((self.path / _ABOUT).read_text("utf-8"))["study"])
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise Refusal(
                f"{self.path}: expected the folder of a study, which kappaskin study made; this is "
                f"none ({error})"
            ) from error

    def study(self) -> Study:
        """The study that was last computed here."""
        name, file = self.name, self.path / _TEXT
        try:
            return read_study(file.read_text("utf-8"), Path(f"{name}.toml"))
        except OSError as error:
            raise Refusal(f"{file}: cannot be read ({error}); run the study again") from error

    def _file(self, task: Task) -> Path:
        return self.path / "results" / task.key[:2] / f"{task.key}.json"

    def result(self, task: Task) -> Measured | str | None:
        """What the task measured, or why it failed; None where neither is known."""
        try:
            said: dict[str, Any] = json.loads(self._file(task).read_text("utf-8"))
            if "failed" in said:
                return str(said["failed"])
            return {name: Moments(**moments) for name, moments in said["measured"].items()}
        except (OSError, ValueError, KeyError, TypeError):
            return None  # to be computed anew

    def keep(self, task: Task, result: Measured | str) -> None:
        """Write what the task measured, or why it failed."""
        failed = isinstance(result, str)
        found = (
            {"failed": result}
            if isinstance(result, str)
            else {"measured": {name: asdict(moments) for name, moments in result.items()}}
        )
        about = {"version": task.version, "block": task.block, "point": json.loads(task.document)}
        file = self._file(task)
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            self._write(file, json.dumps(about | found, allow_nan=failed))
        except OSError as error:
            raise Refusal(
                f"{file}: cannot be written ({error}); make room and run the study again, which "
                "goes on from here"
            ) from error

    @staticmethod
    def _write(file: Path, text: str) -> None:
        part = file.with_name(f".{file.name}.part")
        part.write_text(text, "utf-8")
        os.replace(part, file)
