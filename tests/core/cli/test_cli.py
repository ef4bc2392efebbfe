"""The command: what it prints where, and that a refusal leaves nothing but its reason."""

import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest

from kappaskin import Patch, Plate, PointLoad, SensorLayout, SineBasis, load_scene, write_scene
from kappaskin.cli import REFUSED, app, main
from kappaskin.cli.common import ProgressLine
from kappaskin.estimation import METHODS

pytestmark = pytest.mark.slow

SIZE, BASIS = np.array([0.1, 0.1]), SineBasis(Patch(0.1, 0.1), 8, 8)
LAYOUT = SensorLayout.regular(BASIS.patch, 10, 10)
TRUTH = Plate(BASIS.patch).deflection([PointLoad(0.03, 0.06)], BASIS)
READINGS = {
    "size": SIZE,
    "positions": LAYOUT.positions,
    "curvature": (LAYOUT.operator(BASIS) @ TRUTH.ravel()).reshape(3, -1),
}


@pytest.fixture
def npz(tmp_path) -> Callable[..., Path]:
    def save(**changes: Any) -> Path:
        np.savez(tmp_path / "in.npz", **READINGS | changes)
        return tmp_path / "in.npz"

    return save


def outside(*arguments: object, **options: Any) -> subprocess.CompletedProcess[str]:
    """Runs a command in a process of its own."""
    command = [sys.executable, "-m", "kappaskin", *map(str, arguments)]
    return subprocess.run(command, text=True, capture_output=True, timeout=60, **options)


# reconstruct


def test_reconstruct_writes_what_the_readings_were_made_of(run, npz, tmp_path) -> None:
    out = tmp_path / "out.npz"
    code, printed, told = run(
        "reconstruct", npz(), "--basis", "8x8", "--out", out, "--grid", "21x11"
    )
    steep = "kappaskin: slopes reach 0.96: up to 74 % too flat; use finite-slope\n"
    assert (code, printed, told) == (0, "", f"{steep}{out}: 1 shapes\n")
    with np.load(out, allow_pickle=False) as found:
        assert set(found) == {"coefficients", "sd", "residual", "grid_x", "grid_y", "w"}
        assert np.allclose(found["coefficients"], TRUTH[None], rtol=0, atol=1e-12)
        assert found["w"].shape == (1, 11, 21)
        assert np.abs(found["residual"]).max() < 1e-9


def test_reconstruct_says_what_each_method_neglects(run, npz, tmp_path) -> None:
    rng, out = np.random.default_rng(0), ("--out", tmp_path / "out.npz")
    K = READINGS["curvature"] / 3 + rng.normal(0, 0.2, (4, 3, 100))
    words = r"kappaskin: slopes reach 0\.[34]\d?: up to \d % too flat; use finite-slope\n"
    words += ".*4 shapes\n"
    assert re.fullmatch(words, run("reconstruct", npz(curvature=K), *out)[2])
    sigma = np.full(K.shape, 0.2)
    assert re.fullmatch(words, run("reconstruct", npz(curvature=K, sigma=sigma), *out)[2])


@pytest.mark.parametrize("off", [0.5, 2.0])
@pytest.mark.parametrize("shape", [(), (3, 100), (4, 3, 100)])
def test_reconstruct_says_that_a_sigma_contradicts_the_residuals(
    run, npz, tmp_path, shape, off
) -> None:
    rng, out = np.random.default_rng(0), ("--out", tmp_path / "out.npz")
    noise = np.array([0.1, 0.2, 0.4, 0.8])[:, None, None] if len(shape) > 2 else 0.2
    K = READINGS["curvature"] / 30 + noise * rng.normal(size=(4, 3, 100))
    sigma = off * np.broadcast_to(noise, shape)
    told = run("reconstruct", npz(curvature=K, sigma=sigma), *out)[2]
    what = "small, or the functions" if off < 1 else "large, and so are the error bars"
    ratio = r"(2|1\.9|2\.1)" if off < 1 else r"0\.(5|49|48|51)"
    said = rf"kappaskin: residuals are {ratio} times what the given sigma explains: sigma is too "
    assert re.search(said + what, told), told
    right = run("reconstruct", npz(curvature=K, sigma=sigma / off), *out)[2]
    assert "sigma" not in right

    finite = (*out, "--method", "finite-slope")
    assert run("reconstruct", npz(curvature=K), *finite)[2] == f"{out[1]}: 4 shapes\n"
    lost = "kappaskin: no convergence in 4 of 4 frames; least squares shown\n"
    assert run("reconstruct", npz(curvature=1e6 * K), *finite)[2] == f"{lost}{out[1]}: 4 shapes\n"
    faint = run("reconstruct", npz(curvature=K / 100), *out)[2]
    assert faint == f"{out[1]}: 4 shapes\n"


def test_the_basis_is_8x8_and_the_surface_left_out_unless_asked(run, npz, tmp_path) -> None:
    assert run("reconstruct", npz(), "--out", tmp_path / "out.npz")[0] == 0
    with np.load(tmp_path / "out.npz") as found:
        assert set(found) == {"coefficients", "sd", "residual"}
        assert found["sd"].shape == (1, 8, 8)


@pytest.mark.parametrize("basis", ["6x5", "6X5", " 6 x 5 "])
def test_a_basis_may_be_written_in_either_case_and_with_spaces(run, npz, tmp_path, basis) -> None:
    assert run("reconstruct", npz(), "--basis", basis, "--out", tmp_path / "out.npz")[0] == 0
    with np.load(tmp_path / "out.npz") as found:
        assert found["coefficients"].shape == (1, 6, 5)


def test_the_file_is_called_what_was_asked_without_an_ending_added(run, npz, tmp_path) -> None:
    assert run("reconstruct", npz(), "--out", tmp_path / "shape")[0] == 0
    assert (tmp_path / "shape").exists()
    assert not (tmp_path / "shape.npz").exists()


def refused(found: tuple[int, str, str], reason: str) -> None:
    code, printed, told = found
    assert code == REFUSED == 2
    assert printed == ""
    assert reason in told
    assert told.startswith("kappaskin: ")
    assert "Traceback" not in told


@pytest.mark.parametrize(
    ("basis", "reason"),
    [
        ("8", "expected a basis as two numbers such as 8x8, got '8'"),
        ("8x", "expected a basis as two numbers such as 8x8, got '8x'"),
        ("x", "expected a basis as two numbers"),
        ("", "expected a basis as two numbers"),
        ("axb", "expected a basis as two numbers"),
        ("8.5x8", "expected a basis as two numbers"),
        ("8x8x8", "expected a basis as two numbers such as 8x8, got '8x8x8'"),
        ("nanxinf", "expected a basis as two numbers"),
        ("9" * 5000 + "x1", "expected a basis as two numbers"),
        ("0x8", "expected at least 1 x 1 functions, got 0 x 8"),
        ("-1x8", "expected at least 1 x 1 functions, got -1 x 8"),
        ("18x17", "expected at most 300 functions for 300 readings per frame, got 18 x 17 = 306"),
        ("12x12", "cannot distinguish these functions; use a smaller basis"),
        ("1000000x1000000", "expected at most 300 functions"),
    ],
)
def test_a_basis_that_cannot_be_is_refused(run, npz, tmp_path, basis, reason) -> None:
    out = tmp_path / "out.npz"
    refused(run("reconstruct", npz(), "--basis", basis, "--out", out), reason)
    assert not out.exists()


@pytest.mark.parametrize(
    ("grid", "reason"),
    [
        ("101", "expected a grid as two numbers such as 8x8, got '101'"),
        ("1x1", "expected a grid of at least 2 x 2 points, got 1 x 1"),
        ("-4x4", "expected a grid of at least 2 x 2 points, got -4 x 4"),
        ("1000000x1000000", "coarser grid"),
    ],
)
def test_a_grid_that_cannot_be_is_refused(run, npz, tmp_path, grid, reason) -> None:
    out = tmp_path / "out.npz"
    refused(run("reconstruct", npz(), "--out", out, "--grid", grid), reason)
    assert not out.exists()


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"size": [0.1, 0.0]}, "give lengths such as 0.1 x 0.1"),
        ({"positions": 1e3 * LAYOUT.positions}, "positions are in metres"),
        ({"curvature": np.full((3, 100), np.nan)}, "no readings are left; check the connection"),
        ({"curvature": np.zeros((0, 3, 100))}, "got (0, 3, 100)"),
        ({"sigma": -1.0}, "expected every sigma above zero"),
        ({"sigma": np.array(None)}, "cannot be read as NPZ"),
    ],
)
def test_readings_that_cannot_be_used_are_refused(run, npz, tmp_path, changes, reason) -> None:
    out = tmp_path / "out.npz"
    refused(run("reconstruct", npz(**changes), "--out", out), reason)
    assert not out.exists()


def test_a_refusal_leaves_an_earlier_answer_alone(run, npz, tmp_path) -> None:
    out = tmp_path / "out.npz"
    out.write_text("an earlier answer")
    refused(run("reconstruct", npz(size=[0, 0]), "--out", out), "two sides above zero")
    assert out.read_text() == "an earlier answer"


def test_a_file_that_is_no_archive_or_not_there_is_refused(run, tmp_path) -> None:
    (tmp_path / "in.txt").write_text("0.1 0.2 0.3")
    out = tmp_path / "out.npz"
    refused(run("reconstruct", tmp_path / "in.txt", "--out", out), "cannot be read as NPZ")
    refused(run("reconstruct", tmp_path / "none.npz", "--out", out), "there is no such file")
    refused(run("reconstruct", tmp_path, "--out", out), "cannot be read as NPZ")
    assert not out.exists()


@pytest.mark.parametrize("out", ["missing/out.npz", "in.npz/out.npz", "."])
def test_a_place_that_cannot_be_written_is_refused(run, npz, tmp_path, out) -> None:
    before = set(tmp_path.iterdir()) | {npz()}
    refused(run("reconstruct", npz(), "--out", tmp_path / out), "cannot be written")
    assert set(tmp_path.iterdir()) == before


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="has no device that is always full")
def test_a_full_disk_is_a_refusal(run, npz) -> None:
    refused(run("reconstruct", npz(), "--out", "/dev/full"), "cannot be written (No space left")


# The other commands


def test_tables_prints_one_json_list_of_rows(run) -> None:
    code, printed, told = run("tables", "--json")
    rows = json.loads(printed)
    assert (code, told, printed.count("\n")) == (0, "", 1)
    assert isinstance(rows, list)
    cases = [(1, "centre"), (1, "off-centre"), (1, "line"), (2, "0.63"), (2, "1.27"), (2, "1.90")]
    assert [(row["table"], row["case"], row["noise"]) for row in rows] == [
        (*case, noise) for case in cases for noise in (False, True)
    ]


def test_tables_prints_the_papers_numbers_beside_ours(run) -> None:
    code, printed, told = run("tables")
    assert (code, told) == (0, "")
    lines = printed.splitlines()
    assert sum(line.startswith(("centre", "off-centre", "line")) for line in lines) == 6
    assert "(4.59)" in lines[3]
    assert "(-0.11)" in lines[3]
    assert "(0.69)" in printed


def test_tables_as_printed_tells_why_they_cannot_be_meant(run) -> None:
    code, printed, told = run("tables", "--as-printed")
    assert (code, told) == (0, "")
    assert "the ends would move three times as far as the middle" in printed

    code, printed, _ = run("tables", "--as-printed", "--json")
    assert code == 0
    assert {"Eq. 9", "Eq. 10", "Eq. 11"} <= {row["where"] for row in json.loads(printed)}


def test_a_device_of_no_scene_or_an_impossible_rate_is_refused(run) -> None:
    pytest.importorskip("pty", reason="no pseudo-terminals on this system")
    refused(run("device", "nowhere"), "expected a scene among bolt, calibration, camera, centre,")
    refused(run("device", "circle", "--rate", "0"), "a rate of at most 666.7 frames/s, got 0")
    refused(run("device", "circle", "--rate", "1e9"), "a rate of at most 666.7 frames/s, got 1e+09")
    refused(run("device", "circle", "--rate", "nan"), "got nan")
    refused(run("device", "circle", "--rate", "fast"), 'unable to convert "fast" into float')


# The command itself


@pytest.mark.parametrize(
    "arguments",
    [
        ["fly"],
        ["reconstruct"],
        ["reconstruct", "in.npz"],
        ["reconstruct", "a", "b", "--out", "c"],
        ["reconstruct", "in.npz", "--out", "o", "--colour", "red"],
        ["tables", "--jsom"],
        ["--fly"],
    ],
)
def test_a_command_that_is_not_understood_points_to_the_help(run, arguments) -> None:
    known = arguments[0] in ("reconstruct", "tables")
    name = f"kappaskin {arguments[0]}" if known else "kappaskin"
    refused(run(*arguments), f"See `{name} --help`")


def test_every_subcommand_shows_an_example_in_its_help(run) -> None:
    code, printed, _ = run("--help")
    assert code == 0
    names = [name for name in app if not name.startswith("-")]
    assert {"tables", "reconstruct", "device", "doctor"} <= set(names)
    for name in names:
        assert name in printed
        code, text, told = run(name, "--help")
        assert (code, told) == (0, "")
        assert "Example" in text, name


@pytest.mark.parametrize(
    ("panel", "commands"),
    [
        ("Live", {"app", "demo", "replay", "handout", "publish", "serve", "listen"}),
        ("Recordings", {"record", "info", "verify", "repair", "export", "import", "reconstruct"}),
        ("Sensor", {"calibrate", "tare", "press", "monitor", "device"}),
        ("Studies", {"plan", "simulate", "cost", "compare", "stability", "regions", "study",
                     "report", "design"}),
        ("Paper", {"tables", "figures"}),
        ("System", {"doctor", "drill", "new"}),
    ],
)  # fmt: skip
def test_the_help_shows_the_commands_in_panels(run, panel, commands) -> None:
    _, printed, _ = run("--help")

    lines = printed.partition(f"─ {panel} ─")[2].partition("╰")[0].splitlines()[1:]
    assert {line.split()[1] for line in lines if line[2:3] != " "} == commands


def test_progress_is_one_line_that_changes_on_a_terminal(capsys, monkeypatch) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)

    with ProgressLine() as show_progress:
        show_progress("half")
        show_progress("done")

    assert capsys.readouterr().err == "\r\x1b[Khalf\r\x1b[Kdone\n"


@pytest.mark.parametrize(("log_every", "printed"), [(0.0, "half\ndone\n"), (60.0, "")])
def test_progress_in_a_log_is_a_line_now_and_then(capsys, log_every, printed) -> None:
    with ProgressLine(log_every) as show_progress:
        for line in ("half", "done"):
            time.sleep(1e-3)
            show_progress(line)

    assert capsys.readouterr().err == printed


@pytest.mark.parametrize("name", ["reconstruct", "tables"])
def test_the_method_that_is_used_when_none_is_named_is_the_first(name) -> None:
    arguments = {one.name: one for one in app[name].assemble_argument_collection()}

    assert arguments["--method"].field_info.default == next(iter(METHODS))


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_can_be_installed(tmp_path, shell) -> None:
    home = {**os.environ, "HOME": str(tmp_path)}
    for name in ("ZSH_CUSTOM", "XDG_DATA_HOME", "XDG_CONFIG_HOME", "ZDOTDIR"):
        home.pop(name, None)

    found = outside("--install-completion", "--shell", shell, env=home)

    assert (found.returncode, found.stderr) == (0, "")
    file, _, message = found.stdout.partition(": ")
    assert message == "installed; open a new shell to use it\n"
    assert Path(file).is_relative_to(tmp_path)
    script = Path(file).read_text()
    assert "stability" in script
    assert "replay" in script
    assert "--as-printed" in script or "as-printed" in script


def test_a_home_that_cannot_be_written_gets_no_completion(tmp_path) -> None:
    (tmp_path / ".local").write_text("in the way")

    found = outside(
        "--install-completion", "--shell", "bash", env={**os.environ, "HOME": str(tmp_path)}
    )

    assert found.returncode == REFUSED
    assert found.stderr.startswith("kappaskin: completion cannot be written")


def test_the_version_is_that_of_the_distribution(run) -> None:
    assert run("--version") == (0, metadata.version("kappaskin") + "\n", "")


def test_commands_may_follow_one_another_in_one_process(run) -> None:
    assert [run("--version")[0] for _ in range(3)] == [0, 0, 0]


# In a process of its own


def test_a_refusal_is_one_line_on_standard_error_and_exit_code_2(tmp_path) -> None:
    found = outside("reconstruct", "none.npz", "--out", "out.npz", cwd=tmp_path)
    refused((found.returncode, found.stdout, found.stderr), "there is no such file")
    assert found.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_million_by_a_million_functions_do_not_exhaust_the_memory(npz, tmp_path) -> None:
    resource = pytest.importorskip("resource")
    limit = 4 * 2**30

    found = outside(
        *("reconstruct", npz(), "--basis", "1000000x1000000", "--out", tmp_path / "out.npz"),
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)),
    )

    refused((found.returncode, found.stdout, found.stderr), "expected at most 300 functions")
    assert not (tmp_path / "out.npz").exists()


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_reader_who_has_gone_is_no_error(unbuffered: str) -> None:
    read, write = os.pipe()
    os.close(read)
    found = subprocess.run(
        [sys.executable, "-m", "kappaskin", "doctor"],
        stdout=write,
        stderr=subprocess.PIPE,
        env=os.environ | {"PYTHONUNBUFFERED": unbuffered},
        text=True,
        timeout=60,
    )
    os.close(write)
    assert (found.returncode, found.stderr) == (0, "")


@pytest.mark.parametrize(("asked", "threads"), [({}, 1), ({"OPENBLAS_NUM_THREADS": "2"}, 2)])
def test_a_command_computes_in_one_thread_unless_it_is_told_otherwise(asked, threads) -> None:
    if threads > (psutil.cpu_count() or 1):
        pytest.skip("more threads than processors")
    of_blas = {"OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"}
    inherited = {name: value for name, value in os.environ.items() if name not in of_blas}
    told = "import kappaskin.cli, numpy, psutil; print(psutil.Process().num_threads())"

    found = subprocess.check_output([sys.executable, "-c", told], env=inherited | asked)

    assert int(found) == threads


@pytest.mark.parametrize(
    "command",
    [
        ("study", "placement", "--workers"),
        ("simulate", "centre", "--out", "x.npz", "--frames"),
        ("listen", "--udp"),
    ],
    ids=lambda command: command[0],
)
def test_half_a_thing_is_refused(run, command) -> None:
    refused(run(*command, "2.5"), "expected a whole number such as 2, got '2.5'")


def test_an_output_that_is_also_the_input_is_refused(tmp_path, capsys) -> None:
    scene, readings = tmp_path / "a.toml", tmp_path / "a.npz"
    scene.write_text(write_scene(load_scene("centre")))
    assert main(["simulate", str(scene), "--frames", "2", "--out", str(readings)]) == 0
    link = tmp_path / "link.npz"
    link.symlink_to(readings)
    before = {file: file.read_bytes() for file in (scene, readings)}

    for arguments in (
        ["reconstruct", str(readings), "--out", str(readings)],
        ["reconstruct", str(readings), "--out", str(link)],
        ["simulate", str(scene), "--frames", "2", "--out", str(scene)],
        ["calibrate", f"sim:{scene}", "--out", str(scene)],
    ):
        assert main(arguments) == 2
        assert "is also the input; choose another file to write to" in capsys.readouterr().err
    assert {file: file.read_bytes() for file in before} == before
