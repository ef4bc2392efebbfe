"""The figures: what they draw is what the library says, and nobody has to mend them by hand."""

import itertools
import json
import math
import re
import subprocess
import sys
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.backends.backend_agg import RendererAgg

from kappaskin import Refusal, load_scene
from kappaskin.cli import main
from kappaskin.sensing import SECOND_GENERATION
from kappaskin.studies import FIGURES, write_figures
from kappaskin.studies.figures import style
from kappaskin.studies.figures.hysteresis import initial_curvature
from kappaskin.studies.figures.reconstruction import SEED
from kappaskin.studies.figures.skins import patch_run

pytestmark = pytest.mark.slow

DOUBLE_COLUMN = 174 / 25.4
SVG = "{http://www.w3.org/2000/svg}"
R0 = 12.9e-3


class Noting(RendererAgg):
    """Draws, and notes what is written where: text, size in points, corners (4, 2) in dots."""

    def __init__(self, figure) -> None:
        super().__init__(*map(float, figure.bbox.size), figure.dpi)
        self.texts = []
        figure.draw(self)

    def draw_text(self, gc, x, y, s, prop, angle, ismath=False, mtext=None) -> None:
        w, h, d = self.get_text_width_height_descent(s, prop, ismath)
        turn = np.radians(angle)
        along, up = (np.cos(turn), np.sin(turn)), (-np.sin(turn), np.cos(turn))
        box = np.array([(0, -d), (w, -d), (w, h - d), (0, h - d)]) @ np.array([along, up])
        self.texts.append((s, prop.get_size(), np.add(box, (x, self.height - y))))


@pytest.fixture(scope="module")
def drawn():
    """Every figure, drawn in memory, with what was written on it."""
    found = {}
    for name, draw in FIGURES.items():
        with style.sheet() as figure:
            draw(figure)
            found[name] = figure, Noting(figure).texts
    return found


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder that this process wrote every figure to."""
    out = tmp_path_factory.mktemp("figures") / "made" / "for it"
    paths = write_figures(out, FIGURES)
    assert sorted(out.iterdir()) == sorted(paths)
    return out


def line(axes, label):
    (found,) = [line for line in axes.get_lines() if line.get_label() == label]
    return np.array(found.get_data())


def said(drawn, name):
    return "\n".join(text for text, *_ in drawn[name][1])


def overlap(a, b):
    """Whether two rectangles, given by their corners, are less than a dot apart."""
    for along in (a[1] - a[0], a[2] - a[1], b[1] - b[0], b[2] - b[1]):
        along = along / np.linalg.norm(along)
        p, q = np.sort(a @ along), np.sort(b @ along)
        if min(p[-1], q[-1]) - max(p[0], q[0]) < -1:
            return False
    return True


# files


@pytest.mark.parametrize("name", FIGURES)
def test_each_figure_is_a_two_column_svg_whose_text_is_text(folder, name) -> None:
    root = ElementTree.parse(folder / f"{name}.svg").getroot()

    words = " ".join("".join(text.itertext()) for text in root.iter(f"{SVG}text"))

    assert root.tag == f"{SVG}svg"
    assert float(root.get("width").removesuffix("pt")) / 72 == pytest.approx(DOUBLE_COLUMN)
    assert re.search(r"\[(mm|1/m)\]", words)
    assert "matplotlib" not in (folder / f"{name}.svg").read_text().lower().split("<defs>")[0]


@pytest.mark.parametrize("name", FIGURES)
def test_each_figure_is_a_png_of_300_dots_per_inch(folder, name) -> None:
    content = (folder / f"{name}.png").read_bytes()

    assert content.startswith(b"\x89PNG\r\n\x1a\n")
    assert int.from_bytes(content[16:20], "big") == int(DOUBLE_COLUMN * 300)


@pytest.mark.full
def test_another_process_writes_the_same_bytes_without_pyplot(folder, tmp_path) -> None:
    code = (
        "import sys; from kappaskin.cli import main\n"
        f"main(['figures', '--out', {str(tmp_path)!r}, '--json'])\n"
        "assert 'matplotlib.pyplot' not in sys.modules"
    )

    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, check=True, timeout=100
    )

    written = json.loads(done.stdout)
    assert written == [str(tmp_path / f"{n}.{kind}") for n in FIGURES for kind in ("svg", "png")]
    for path in tmp_path.iterdir():
        assert path.read_bytes() == (folder / path.name).read_bytes(), path.name
    assert done.stderr == b""


def test_a_users_own_style_changes_nothing_and_stays(folder, tmp_path, monkeypatch) -> None:
    monkeypatch.setitem(mpl.rcParams, "font.size", 31.0)
    monkeypatch.setitem(mpl.rcParams, "axes.grid", True)
    before = dict(mpl.rcParams)

    write_figures(tmp_path, ["fig9"])

    assert dict(mpl.rcParams) == before
    for kind in ("svg", "png"):
        assert (tmp_path / f"fig9.{kind}").read_bytes() == (folder / f"fig9.{kind}").read_bytes()


# what a reviewer sends back


@pytest.mark.parametrize("name", FIGURES)
def test_every_axis_has_a_unit(drawn, name) -> None:
    labels = []
    for axes in drawn[name][0].axes:
        here = [axes.get_xlabel(), axes.get_ylabel()]
        here += [axes.get_zlabel()] if axes.name == "3d" else []
        assert any(here) or not axes.axison
        labels += [label for label in here if label]

    assert len(labels) >= 3
    for label in labels:
        assert re.search(r"\[(mm|µm|1/m|°|%)\]$", label), label


@pytest.mark.parametrize("name", FIGURES)
def test_no_text_is_small_leaves_the_sheet_or_touches_another(drawn, name) -> None:
    figure, texts = drawn[name]

    for text, size, box in texts:
        assert size >= 6.5, text
        assert (box >= 0).all(), text
        assert (box <= figure.bbox.size).all(), text
    for (a, _, first), (b, _, second) in itertools.combinations(texts, 2):
        assert not overlap(first, second), f"{a!r} touches {b!r}"


def test_the_colours_are_the_apps() -> None:
    pytest.importorskip("PySide6")
    from kappaskin_app import theme

    for mine, theirs in ((style.DIVERGING, theme.DIVERGING), (style.SEQUENTIAL, theme.SEQUENTIAL)):
        colours = style.colour_map(mine)(np.arange(256), bytes=True)[:, :3].astype(int)

        assert np.abs(colours - theirs).max() <= 1


# numbers


def least_squares(M, K):
    return np.linalg.lstsq(M, K, rcond=None)[0]


def test_fig1_reads_the_strip_and_draws_what_least_squares_makes_of_it(drawn) -> None:
    *_, curvature, deflection = drawn["fig1"][0].axes
    elements, readings = curvature.containers[0].lines[0].get_data()
    k = np.arange(1, 9) * math.pi / 0.1
    c = least_squares(-(k**2) * np.sin(np.outer(1e-3 * elements, k)), readings)

    x, w = line(deflection, "reconstructed")

    np.testing.assert_allclose(w, 1e3 * np.sin(np.outer(1e-3 * x, k)) @ c, atol=1e-9)
    assert elements == pytest.approx(np.arange(5, 100, 10))
    x, true = line(deflection, "true")
    assert np.interp(42, x, true) == pytest.approx(4.70, abs=1e-3)


def test_fig1_names_the_thicknesses_of_the_bridge(drawn) -> None:
    bridge = SECOND_GENERATION.bridge

    for thickness in (bridge.substrate_thickness, bridge.gage_thickness, bridge.thickness):
        assert f"{1e3 * thickness:.3f} mm" in said(drawn, "fig1")


def test_fig2_tells_the_tensor_of_one_of_its_elements(drawn) -> None:
    shown = said(drawn, "fig2")
    number = r"(−?[\d.]+)"
    (found,) = re.findall(rf"xx {number}, yy {number}, xy {number} 1/m", shown)
    principal = re.findall(rf"κ[₁₂] = {number} ± {number} 1/m at {number}°", shown)
    xx, yy, xy = (float(text.replace("−", "-")) for text in found)

    for (value, limit, angle), expected in zip(
        principal, np.linalg.eigvalsh([[xx, xy], [xy, yy]]), strict=True
    ):
        value, limit, angle = (float(t.replace("−", "-")) for t in (value, limit, angle))
        assert value == pytest.approx(expected, abs=0.15)  # of numbers rounded to 0.1
        assert 0.5 < limit < 2
        way = np.cos(np.radians(angle)), np.sin(np.radians(angle))
        assert way @ np.array([[xx, xy], [xy, yy]]) @ way == pytest.approx(value, abs=0.2)


def test_fig2_is_as_curved_as_its_truth_within_the_error_bars() -> None:
    found = patch_run()
    exact = patch_run(noise=1e-9)

    error = found.principal[0] - exact.principal[0]
    assert np.all(np.abs(error) < 3 * found.principal_sd)
    assert found.tiles.shape[0] == len(found.tensor) == 80
    mean = np.trace(found.tensor, axis1=1, axis2=2) / 2
    assert np.abs(mean).max() < 100  # the ends of the colours


def test_fig6_states_the_error_of_the_surfaces_it_draws(drawn) -> None:
    scene = load_scene("centre")
    i = np.arange(1, 16)
    k = 10 * math.pi * i
    a = np.outer(np.sin(math.pi * i / 2), np.sin(math.pi * i / 2)) / np.add.outer(i**2, i**2) ** 2
    a *= 4.70e-3 / np.sum(a * np.outer(np.sin(math.pi * i / 2), np.sin(math.pi * i / 2)))

    def operator(x, y, k):
        X, Y = np.sin(np.outer(x, k)), np.sin(np.outer(y, k))
        cosines = np.cos(np.outer(x, k)) * k, np.cos(np.outer(y, k)) * k
        parts = [(-X * k**2, Y), (X, -Y * k**2), cosines]
        return np.vstack([np.einsum("pi,pj->pij", *part).reshape(len(x), -1) for part in parts])

    p = scene.layout.positions.T
    noise = np.random.default_rng(scene.seed).uniform(-0.4, 0.4, 300)
    c = least_squares(operator(*p, k[:8]), operator(*p, k) @ a.ravel() + noise)
    S = np.sin(np.outer(np.linspace(0, 0.1, 101), k))
    error = 1e6 * (S[:, :8] @ c.reshape(8, 8) @ S[:, :8].T - S @ a @ S.T).T

    *_, panel, _ = drawn["fig6"][0].axes
    np.testing.assert_allclose(panel.images[0].get_array(), error, atol=1e-6)
    stated = f"{error[50, 50]:+.0f} µm at the load, RMS {np.sqrt(np.mean(error**2)):.1f} µm"
    assert stated.replace("-", "−") in said(drawn, "fig6")


def test_fig6_shows_both_surfaces_on_one_scale(drawn) -> None:
    reference, fitted, *_ = drawn["fig6"][0].axes

    for get in ("get_xlim", "get_ylim", "get_zlim"):
        assert getattr(reference, get)() == getattr(fitted, get)()
    for axes in (reference, fitted):
        height = axes.collections[0]._faces[..., 2]  # noqa: SLF001 - there is no other way to them
        assert axes.get_zlim()[0] <= height.min() + 0.01 < height.max() < axes.get_zlim()[1]
        assert height.max() == pytest.approx(4.70, abs=0.1)


def test_fig8_tells_the_gaps_and_the_line_of_the_loops_it_draws(drawn) -> None:
    loop = drawn["fig8"][0].axes[0]
    x, there = line(loop, "falling")
    applied, read = line(loop, "second prototype")
    slope, offset = np.polyfit(applied, read, 1)

    ends, drawn_line = line(loop, "least-squares line")
    np.testing.assert_allclose(drawn_line, offset + slope * ends, atol=1e-9)
    back = dict(line(loop, "rising").T)
    pairs = [
        (k, (back[k] - reading) / slope) for k, reading in zip(x, there, strict=True) if k in back
    ]
    inner = max(abs(gap) for k, gap in pairs if k > 0)
    outer = max(abs(gap) for k, gap in pairs if k < 0)
    assert f"second {inner:.1f} / {outer:.1f} 1/m" in said(drawn, "fig8")
    assert 6.5 < inner < 7.5  # the paper's "about 7 1/m"
    assert outer < inner


def test_fig8_tells_errors_on_cylinders_that_were_not_calibrated_on(drawn) -> None:
    loop, errors = drawn["fig8"][0].axes
    calibrated = np.round(line(loop, "second prototype")[0], 6)
    rms = {}
    for drawn_line in errors.get_lines()[1:]:
        applied, error = drawn_line.get_data()
        assert set(calibrated) & set(np.round(applied, 6)) == {0.0}
        told = f"RMS {np.sqrt(np.mean(error**2)):.2f} 1/m"
        assert drawn_line.get_label().endswith(told)
        rms[drawn_line.get_label().split(":")[0]] = np.sqrt(np.mean(error**2))

    # Noise of 0.23 1/m, averaged over 50 frames.
    assert 0.23 / math.sqrt(50) < rms["hysteresis compensated"] < 0.15
    assert rms["straight line"] > 2


def test_fig9_draws_what_least_squares_makes_of_ten_readings(drawn) -> None:
    """From Eqs. 10 and 11 as corrected; pinned ends decide the first function."""
    rng = np.random.default_rng(SEED)
    theta, k = (np.arange(10) + 0.5) * math.pi / 10, np.arange(1, 9)
    free = np.vstack([np.where(k % 2, -1 / k, 0)[1:], np.eye(7)])
    bends = (1 - k**2) / R0**2 * np.sin(np.outer(theta, k)) @ free
    for u, axes in zip((0.63, 1.27, 1.90), drawn["fig9"][0].axes[1::2], strict=True):
        reading = 24 * (1e-3 * u / 4) * np.sin(3 * theta) / R0**2
        reading = reading + rng.uniform(-1, 1, (3, 10))[0] * math.sqrt(3) * 4.5

        degrees, shown = line(axes, "reconstructed")

        S = np.sin(np.outer(np.radians(degrees), k)) @ free
        np.testing.assert_allclose(shown, 1e3 * S @ least_squares(bends, reading), atol=1e-9)
        np.testing.assert_allclose(
            line(axes, "true")[1],
            u / 4 * (np.sin(np.radians(degrees)) - 3 * np.sin(3 * np.radians(degrees))),
            atol=1e-12,
        )
        sd = 4.5e3 * np.sqrt(np.einsum("pi,ij,pj->p", S, np.linalg.inv(bends.T @ bends), S))
        edges = axes.collections[0].get_paths()[0].vertices[1:182, 1]
        np.testing.assert_allclose(edges, shown - 1.96 * sd, atol=1e-9)
        found = f"found {shown[90]:.2f} ± {1.96 * sd[90]:.2f} mm"
        assert found in said(drawn, "fig9")


def test_fig9_is_true_to_scale(drawn) -> None:
    for axes in drawn["fig9"][0].axes[::2]:
        (x0, z0), (x1, z1) = axes.transData.transform([(0, 0), (1, 1)])
        assert x1 - x0 == pytest.approx(z1 - z0)
        x, z = line(axes, "at rest")
        np.testing.assert_allclose(np.hypot(x, z), 12.9)


def test_initial_curvature_draws_the_rows_of_the_study(drawn) -> None:
    readings, shape = drawn["initial-curvature"][0].axes
    pinned = [row for row in initial_curvature() if row["ends"] == "pinned"]
    shown = (
        (readings, "first cycle", "reading_rms", 1),
        (readings, "settled cycle", "reading_rms", 1),
        (shape, "first cycle", "rms_mm", 1e3),
        (shape, "settled cycle", "rms_mm", 1e3),
        (shape, "once released", "rest_rms_mm", 1e3),
    )
    for axes, label, column, unit in shown:
        rows = [
            row for row in pinned if row["cycle"] == ("first" if "first" in label else "settled")
        ]
        x, y = line(axes, label)
        np.testing.assert_array_equal(x, [row["base_curvature"] for row in rows])
        np.testing.assert_array_equal(y, [unit * row[column] for row in rows])
        assert 0 < y.min() < y.max() < axes.get_ylim()[1]


# refusals


@pytest.fixture
def refused(capsys):
    """Runs the command, which must refuse: what it says."""

    def run(*arguments: object) -> str:
        code = main(["figures", *map(str, arguments)])
        printed, told = capsys.readouterr()
        assert (code, printed) == (2, "")
        return told

    return run


def test_only_the_figures_asked_for_are_drawn_each_once(tmp_path, capsys) -> None:
    assert main(["figures", "--out", str(tmp_path), "--only", "fig9", "fig9"]) == 0

    paths = [str(tmp_path / f"fig9.{kind}") for kind in ("svg", "png")]
    assert capsys.readouterr().out.splitlines() == paths
    assert sorted(map(str, tmp_path.iterdir())) == sorted(paths)


def test_an_unknown_figure_is_refused_with_those_known_before_a_folder_is_made(
    refused, tmp_path
) -> None:
    told = refused("--out", tmp_path / "new", "--only", "fig9", "fig99")

    assert f"expected figures among {', '.join(FIGURES)}; got 'fig99'" in told
    assert not (tmp_path / "new").exists()
    assert "got none" in refused("--out", tmp_path / "new", "--only")


@pytest.mark.parametrize("place", ["file", "file/inside", "/proc/here"])
def test_a_folder_that_cannot_be_written_to_is_refused(refused, tmp_path, place) -> None:
    (tmp_path / "file").write_text("mine")

    told = refused("--out", tmp_path / place, "--only", "fig9")

    assert "expected a folder that can be written to" in told
    assert (tmp_path / "file").read_text() == "mine"


def test_a_folder_in_a_files_place_is_refused_and_kept(refused, tmp_path) -> None:
    (tmp_path / "fig9.svg").mkdir()

    assert "fig9.svg" in refused("--out", tmp_path, "--only", "fig9")
    assert [path.name for path in tmp_path.iterdir()] == ["fig9.svg"]


def test_a_figure_that_fails_leaves_the_folder_as_it_was(refused, tmp_path, monkeypatch) -> None:
    (tmp_path / "fig9.svg").write_text("older")

    def fails(_: object) -> None:
        raise Refusal("no such run")

    monkeypatch.setitem(FIGURES, "fig1", fails)

    assert "no such run" in refused("--out", tmp_path, "--only", "fig9", "fig1")
    assert [path.name for path in tmp_path.iterdir()] == ["fig9.svg"]
    assert (tmp_path / "fig9.svg").read_text() == "older"


def test_without_matplotlib_the_remedy_is_told_and_no_folder_made(
    refused, tmp_path, monkeypatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)

    assert "pip install 'kappaskin[plots]'" in refused("--out", tmp_path / "new")
    assert not (tmp_path / "new").exists()
