"""The script that is copied, run in a process of its own beside the session that it is of."""

import ast
import math
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QApplication

import kappaskin
from kappaskin import Engine, Estimate, Refusal, Tare
from kappaskin.calibration.calibration import fingerprint
from kappaskin.scenes import scene_file
from kappaskin_app.features.export.scripting import script_of
from kappaskin_app.shell.background import Tasks
from kappaskin_app.shell.history import History
from kappaskin_app.shell.session import Session
from kappaskin_app.shell.settings import Settings
from kappaskin_app.shell.settings.scene import Written
from kappaskin_app.shell.simulation import scene_of, with_consequences, written
from kappaskin_app.shell.window import MainWindow

_RUN = """
import sys
import numpy as np
sys.path.insert(0, sys.argv[1])
if __name__ == "__main__":
    from script import estimates
    for e in estimates(40.0):
        if np.isfinite(e.contact.force) and e.sequence >= int(sys.argv[2]):
            np.savez(sys.argv[1] + "/out.npz", coefficients=e.coefficients, surface=e.surface,
                     position=e.contact.position, force=e.contact.force, noise=e.noise,
                     rms=e.error_rms, sequence=e.sequence)
            break
"""
_STILL: dict[str, Any] = {"load_case": "off-centre", "noise_kind": "none"}


@dataclass
class Asked:
    """A session without a window, and its history."""

    history: History
    session: Session
    noted: bool = False

    def show(self, settings: Settings) -> None:
        self.history.apply(settings)

    def shown(self) -> bool:
        """Whether what comes in is what was asked for last."""
        session, estimate, status = self.session, self.session.estimate, self.session.status
        if not (self.noted or session.making):
            session.engine.note("asked for")  # told once the engine has taken all before it
            self.noted = True
        noted = [event.time for event in status.events if event.kind == "note"]
        return (
            estimate is not None
            and bool(noted)
            and estimate.host_time > noted[-1]
            and status.setup == session.engine.requested.setup
            and estimate.generation == status.generation
            and math.isfinite(estimate.contact.force)
        )

    def text(self, folder: Path) -> str:
        script = script_of(self.session, self.history.settings, folder)
        for name, content in script.files.items():
            (folder / name).write_bytes(content)
        return script.text


@pytest.fixture
def asked(qapp: QApplication) -> Iterator[Asked]:
    history = History(Settings())
    tasks = Tasks(qapp)
    asked = Asked(history, Session(history, Engine(), tasks))
    asked.session.connect_to("sim:")
    yield asked
    tasks.close()
    asked.session.close()


def _numbers(text: str, folder: Path, sequence: int = 0) -> dict[str, Any]:
    """What a script says of a frame from `sequence` on, run in a process of its own."""
    (folder / "script.py").write_text(text, encoding="utf-8")
    (folder / "run.py").write_text(_RUN)
    order = [sys.executable, str(folder / "run.py"), str(folder), str(sequence)]
    ran = subprocess.run(order, capture_output=True, text=True, timeout=60, check=False)
    assert ran.returncode == 0, ran.stderr
    with np.load(folder / "out.npz") as found:
        return dict(found)


def _same_bits(found: dict[str, Any], estimate: Estimate) -> bool:
    touch = estimate.contact
    parts = (estimate.coefficients, estimate.surface, touch.position, touch.force)
    names = ("coefficients", "surface", "position", "force")
    return all(
        found[n].tobytes() == np.asarray(p).tobytes() for n, p in zip(names, parts, strict=True)
    )


def _pressed() -> Settings:
    """A ball that stands pressed in, without noise: changed, so that its file does not say so."""
    ready = written(scene_file("sphere"))
    text = ready.text.partition("path =")[0]
    text = text.replace("[effects.gaussian-noise]\nrms = 0.1  # 1/m\n", "")
    return Settings(written=Written(text, ready.file))


def _of_another_skin() -> Settings:
    settings = Settings(**_STILL, method="bayes", functions_x=9, functions_y=7)
    changed = with_consequences(settings, scene_of(settings), "shape", "cylinder")
    return replace(settings, **changed, foam=20e3)


@pytest.mark.cases("_pressed")
@pytest.mark.parametrize("make", [lambda: Settings(**_STILL), _of_another_skin, _pressed])
def test_of_what_stands_still_a_script_computes_the_same_bits(
    asked: Asked, until, tmp_path: Path, make: Callable[[], Settings]
) -> None:
    asked.show(make())
    until(asked.shown)
    assert not asked.session.refusal
    assert _same_bits(_numbers(asked.text(tmp_path), tmp_path), asked.session.estimate)


@pytest.mark.full
def test_with_noise_a_script_computes_as_well(asked: Asked, until, tmp_path: Path) -> None:
    asked.show(Settings())  # its noise is drawn from when a scene begins: not the same bits
    until(asked.shown)
    found, estimate = _numbers(asked.text(tmp_path), tmp_path), asked.session.estimate
    assert found["noise"] == pytest.approx(estimate.noise, rel=0.3)
    assert found["force"] == pytest.approx(0.150, rel=0.05)
    assert found["rms"] < 1e-4  # 18 um in the median, 78 um at most of 8,000 frames


@pytest.mark.full
def test_a_script_of_a_recording_computes_the_same_bits_of_the_same_frame(
    asked: Asked, until, recording: Path, tmp_path: Path
) -> None:
    session, engine = asked.session, asked.session.engine
    session.connect_to(f"replay:{recording}")
    until(lambda: session.status.replay is not None and session.estimate is not None)
    text = asked.text(tmp_path)
    assert f'engine.connect("replay:{recording}")' in text
    found = _numbers(text, tmp_path, 20)
    sequence = int(found["sequence"])  # late if the script is slow, and of either source
    computed = []
    for begun in (at for at in (0.0, 1.8) if at + sequence / 100 < session.status.replay.length):
        engine.seek(0.0, 0.0)  # so that what comes then is not what came before
        until(lambda: session.estimate.sequence < 4)
        engine.seek(begun + (sequence - 3) / 100, 0.0)  # of 100 frames in a second
        until(lambda: sequence - 8 <= session.estimate.sequence <= sequence)
        while (at := session.estimate.sequence) < sequence:
            engine.step(1)
            until(lambda at=at: session.estimate.sequence > at)
        computed.append(_same_bits(found, session.estimate))
    assert any(computed)


def _names(text: str) -> set[str]:
    """What a script imports from kappaskin."""
    nodes = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.ImportFrom)]
    return {a.name for node in nodes if node.module == "kappaskin" for a in node.names}


def _used(text: str) -> set[str]:
    return {node.id for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Name)}


_OFFERED = set(kappaskin.__all__)
_QUOTED = "title = \"It's \\\\ '''\"\n"


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        (Settings(written=written(scene_file("coin"))), ('load_scene("coin")', "planned(SCENE)")),
        (
            Settings(region="skin", region_radius=0.0123, send_udp=True),
            (
                'REGION = Region(around="skin", radius=0.0123)',
                "engine.publish(['udp://127.0.0.1:9870'])",
            ),
        ),
        (
            Settings(functions_x=5, method="robust", fit_edge="clamped"),
            ('SETUP = Setup(Ni=5, Nj=8, edge="clamped", method="robust")',),
        ),
        (Settings(written=Written(_QUOTED, Path("a.toml"))), (repr(_QUOTED),)),
        (
            Settings(serve_foxglove=True, allowed_pages="https://a"),
            ("engine.publish(['foxglove://127.0.0.1:8765'], ['https://a'])",),
        ),
        (
            Settings(written=Written("", Path("a.toml"), frozenset({Path("b.stl")}))),
            ('a.toml"), trust=True)',),
        ),
    ],
)
def test_a_script_is_short_and_says_what_is_asked_for(
    asked: Asked, settings: Settings, said: tuple[str, ...]
) -> None:
    asked.history.apply(settings)
    asked.session.refusal = ""  # of the text that is no scene
    text = asked.text(Path("nowhere"))
    assert _names(text) == _used(text) & _OFFERED
    assert len(text.splitlines()) < 66
    for words in said:
        assert words in text


def test_a_port_is_named_and_no_scene_with_it(asked: Asked) -> None:
    asked.session.source = "/dev/ttyACM0"
    text = asked.text(Path("nowhere"))
    assert 'engine.connect("/dev/ttyACM0")' in text
    assert "SCENE" not in text


def test_without_a_source_there_is_nothing_to_copy(asked: Asked) -> None:
    asked.session.source = ""
    with pytest.raises(Refusal, match="expected an open source"):
        asked.text(Path("nowhere"))


def test_a_tare_in_use_is_in_a_file_that_the_script_reads(
    asked: Asked, until, tmp_path: Path
) -> None:
    until(lambda: asked.session.status.sensor is not None)
    sensor = asked.session.status.sensor
    zero = np.full(sensor.channels, 0.25)
    now = datetime(2026, 11, 22, tzinfo=UTC)
    of = (sensor.name, sensor.serial_number, fingerprint(sensor.layout))
    asked.history.change("Tare", -1, tare=Tare(*of, now, None, 100, 0.2, zero, 0.1 * zero))
    assert asked.session.engine.requested.setup.tare is not None
    made: dict[str, Any] = {}
    exec(asked.text(tmp_path), made)
    assert made["SETUP"] == asked.session.engine.requested.setup


@pytest.mark.full
def test_the_action_puts_a_script_on_the_clipboard(window: MainWindow) -> None:
    window.actions_by_name["copy-python"].trigger()
    text = QGuiApplication.clipboard().text()
    assert _names(text) == {"Engine", "Setup", "planned", "read_scene"}
    assert window.statusBar().currentMessage().startswith("Copied a script of")


def test_a_script_prints_the_noise_in_the_unit_of_what_is_read(
    asked: Asked, until, tmp_path: Path
) -> None:
    asked.session.connect_to("sim:tilts")
    until(lambda: (it := asked.session.status.sensor) is not None and it.layout.reads is not None)
    assert "noise {1000 * e.noise:.3f} mrad" in asked.text(tmp_path)
