"""Commands of studies and of the paper's tables and figures."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from kappaskin.cli.common import (
    FAILED,
    Pair,
    ProgressLine,
    Switch,
    Whole,
    check_output,
    pair,
    print_json,
    print_result,
    save_arrays,
    show,
)
from kappaskin.errors import Refusal
from kappaskin.studies import FIGURES

if TYPE_CHECKING:
    from kappaskin.scenes import Scene
    from kappaskin.studies import Cost, Refused


Some = Annotated[tuple[str, ...], Parameter(consume_multiple=True, negative="")]
"""One or more names after the option."""


def plan(scene: str = "", *, trust: Switch = False, json: Switch = False) -> None:
    """Show which effects a scene needs at its requested accuracy, and why.

    Example: `kappaskin plan tapping`

    Parameters
    ----------
    scene
        The name of a ready scene, or a file that ends in .toml; the default one when left out.
    trust
        Let the scene name files outside its folder.
    json
        Print one JSON object, with an entry for every known effect, instead of a table.
    """
    from kappaskin.scenes import load_scene
    from kappaskin.studies import plan_rows, plan_text

    on = load_scene(scene, trust)
    rows = plan_rows(on)
    value = {"scene": on.name, "accuracy": on.choice.accuracy, "effects": rows}
    print_result(value, json, lambda: plan_text(on, rows))


def simulate(
    scene: str = "", *, frames: Whole, out: Path, seed: Whole | None = None, trust: Switch = False
) -> None:
    """Simulate a scene into an NPZ file.

    It contains `counts` and `curvature` (T, 3, P), the `truth` (T, Ni, Nj) in m, `time` (T,) in s,
    the `contact` (T, 2) in m, NaN without a contact or for a dropped frame, and the `plan` as JSON.
    The same seed gives the same bytes.

    Example: `kappaskin simulate tapping --frames 1000 --out taps.npz`

    Parameters
    ----------
    scene
        The name of a ready scene, or a file that ends in .toml; the default one when left out.
    frames
        Number of frames.
    seed
        The seed of the random numbers; the scene's when left out.
    out
        The file to write.
    trust
        Let the scene name files outside its folder.
    """
    from kappaskin.scenes import load_scene
    from kappaskin.studies import simulated_readings

    check_output(out, scene)
    found = simulated_readings(load_scene(scene, trust), frames, seed)
    save_arrays(out, found)
    show(f"{out}: {frames} frames", error=True)


def _measured(scene: "Scene") -> "list[Cost | Refused]":
    """What every setting costs; on a terminal, a progress bar on standard error."""
    from kappaskin._processes import BackgroundProcess
    from kappaskin.studies import Cost, Refused, costs, settings_to_try

    settings, found = settings_to_try(scene), list[Cost | Refused]()
    try:
        with (
            BackgroundProcess("kappaskin-cost", costs, scene, settings) as process,
            ProgressLine() as show_progress,
        ):
            for cost in process.wait():
                found.append(cost)
                done = 40 * len(found) // len(settings)
                show_progress(f"[{'#' * done:<40}] {len(found)} of {len(settings)}")
    except KeyboardInterrupt:
        raise Refusal("stopped before the last setting; nothing was written") from None
    return found


def _effects(scene: "Scene", json: bool) -> None:
    """Print what the scene's effects cost."""
    from kappaskin.studies import effect_costs, effect_rows, effects_text, usual_setting

    setting = usual_setting(scene)
    found = effect_costs(scene, setting)
    rows = effect_rows(scene, setting, found)
    print_result(rows, json, lambda: effects_text(scene, setting, found))


def _settings(scene: "Scene", found: "list[Cost | Refused]", json: bool) -> None:
    """Print what the settings cost; as text, what the effects cost too."""
    from kappaskin.studies import cost_rows, costs_text

    if json:
        print_json(cost_rows(scene, found))
        return
    show(*costs_text(scene, found).split("\n"), "")
    try:
        _effects(scene, json)
    except Refusal as refusal:  # the settings' table is worth its minute all the same
        show(f"What each effect costs cannot be measured: {refusal}")


def cost(
    *,
    scene: str = "",
    effects: Switch = False,
    within: Pair | None = None,
    plot: Path | None = None,
    trust: Switch = False,
    json: Switch = False,
) -> int:
    """Measure the cost of accuracy: error, time and memory of every method and setting.

    Takes many minutes. Bases, elements, precisions and channels are combined with each method;
    the settings that no other one beats in both error and time are marked. A second table shows
    the cost of each effect of the scene, and the error of the shape without it.

    Example: `kappaskin cost --within 0.02mm --plot cost.svg`

    Parameters
    ----------
    scene
        The scene to measure on; the default one when left out.
    effects
        Measure the effects alone, which takes seconds.
    within
        Instead of a table, print the setting that reaches this RMS error in the least time,
        conversion included, such as 0.02mm or 20um; or what is missing, with exit code 1.
    plot
        The file, SVG or PNG, to draw error against time into.
    trust
        Let the scene name files outside its folder.
    json
        Print one JSON list of rows instead of a table, of the settings, or with --effects of the
        effects; with --within one object.
    """
    from kappaskin.scenes import load_scene
    from kappaskin.studies import accuracy_verdict, check_plot, parse_length, write_plot

    accuracy = None if within is None else parse_length(within)
    if effects and (accuracy is not None or plot is not None):
        raise Refusal(
            "expected --effects without --within and --plot, which are about settings; leave it or "
            "them out"
        )
    on = load_scene(scene, trust)
    if effects:
        _effects(on, json)
        return 0
    if plot is not None:
        check_plot(plot)
    found = _measured(on)
    if plot is not None:
        write_plot(plot, on, found)
    if accuracy is None:
        _settings(on, found, json)
        return 0
    answer = accuracy_verdict(on, found, accuracy)
    print_result(answer.to_json(), json, lambda: "\n".join(answer.lines))
    return 0 if answer.reached else FAILED


def compare(*, json: Switch = False) -> None:
    """Compare with other software on the same problems: error, time and memory side by side.

    NumPy's and SciPy's least squares and scikit-fem's finite elements, each configured as well as
    possible. Needs scikit-fem; takes some seconds.

    Example: `kappaskin compare --json`

    Parameters
    ----------
    json
        Print one JSON list of rows instead of a table.
    """
    from kappaskin.studies import compared, compared_text

    rows = compared()
    print_result([asdict(row) for row in rows], json, lambda: compared_text(rows))


def stability(
    *,
    json: Switch = False,
    long: Switch = False,
) -> None:
    """Run hard cases through every method that supports them, and check each result.

    Example: `kappaskin stability --json`

    Parameters
    ----------
    json
        Print one JSON list of rows instead of a table.
    long
        Run the longest cases too: a million frames, up to 512 functions a side.
    """
    from kappaskin.studies import run_stability, stability_text

    with ProgressLine() as show_progress:
        rows = run_stability(long, show_progress)
    print_result(rows, json, lambda: stability_text(rows))


def regions(*, json: Switch = False) -> None:
    """Measure the gain and the cost of scanning a region of interest, on a moving contact.

    Example: `kappaskin regions --json`

    Parameters
    ----------
    json
        Print one JSON list of rows instead of a table.
    """
    from kappaskin.studies import regions_text, run_regions

    rows = run_regions()
    print_result(rows, json, lambda: regions_text(rows))


def design(
    scene: str = "",
    *,
    place: Some = ("scene", "D", "A"),
    basis: Pair = "8x8",
    out: Path | None = None,
    trust: Switch = False,
    json: Switch = False,
) -> None:
    """Predict how surely each place of a skin is felt, by where the elements are.

    The errors of the place and force of the scene's load, pressed all over the skin, and of the
    shape, due to noise alone and without a simulation. As many elements as the scene has are
    placed as in the scene, for the least errors of contacts, D- or A-optimally for the shape, or
    clustered.

    Example: `kappaskin design finger.scene.toml --place scene contact --out felt.ply`

    Parameters
    ----------
    scene
        The name of a ready scene, or a file that ends in .toml; the default one when left out.
    place
        The placements to compare, of scene, contact, clustered, D and A.
    basis
        Number of functions along x and y of the shape; on a mesh their product counts.
    out
        The file to write all errors at each place to: .csv, .npz, or of a mesh .ply, coloured by
        the error of the place by the first placement.
    trust
        Let the scene name files outside its folder.
    json
        Print one JSON list of rows instead of a table.
    """
    from kappaskin.scenes import load_scene
    from kappaskin.studies import check_maps_file, design_maps, maps_rows, maps_text, write_maps

    on = load_scene(scene, trust)
    patch = on.plate.patch
    if out is not None:
        check_output(out, scene)
        check_maps_file(out, patch)
    found = design_maps(on, pair(basis, "a basis"), place)
    if out is not None:
        write_maps(out, patch, found)
    print_result(maps_rows(found), json, lambda: maps_text(on, found))


_LOG_EVERY = 10.0  # s between two lines of progress in a log


def study(
    file: str, *, workers: Whole | None = None, scheduler: str = "", out: Path | None = None
) -> int:
    """Compute a design study: the accuracy of a sensor before it is built.

    A study is a scene with tables [[vary]] of values to sweep, [[draw]] of values to draw at
    random, and [measure] and [stop]. Every result is a file of its own in the folder: a study that
    was stopped resumes, and after a change only the changed parts are computed. The exit code is
    1 if some of it failed.

    Example: `kappaskin study paper-elements --workers 2 --out elements`

    Parameters
    ----------
    file
        The name of a ready study, or a file that ends in .toml.
    workers
        Number of worker processes; the number of cores when left out.
    scheduler
        The address of a Dask scheduler whose workers compute, such as tcp://10.0.0.5:8786; needs
        kappaskin[cluster] here and there.
    out
        The folder of its results; named as the study when left out.
    """
    from kappaskin.studies import StudyFolder, load_study, run_study, study_workers, table_text

    if scheduler and workers is not None:
        raise Refusal("expected --workers or --scheduler, got both; a cluster has its own")
    loaded = load_study(file)
    path = out if out is not None else Path(loaded.name)
    with study_workers(workers, scheduler) as pool:
        folder = StudyFolder.opened(path, loaded)
        try:
            with ProgressLine(_LOG_EVERY) as show_progress:
                points = run_study(loaded, folder, pool, show_progress)
        except KeyboardInterrupt:
            raise Refusal(
                f"stopped; the results so far are in {path}; the same command resumes"
            ) from None
    show(*table_text(loaded, points).split("\n"))
    show(f"kappaskin report {path} writes the report", error=True)
    return FAILED if any(point.failures for point in points) else 0


def report(folder: Path) -> None:
    """Make a page of a study's results: report.html, with a CSV and an SVG of each figure.

    The page needs no network and states everything needed to repeat the study. Results that are
    not computed yet are listed as missing.

    Example: `kappaskin report elements`

    Parameters
    ----------
    folder
        The folder that `kappaskin study` made.
    """
    from kappaskin.studies import write_report

    show(*write_report(folder))


# Commands of the paper: tables, figures


def tables(
    *,
    method: str = "least-squares",
    basis: Pair = "8x8",
    json: Switch = False,
    as_printed: Switch = False,
) -> None:
    """Compute the paper's Tables 1 and 2 and print them next to the printed numbers.

    Example: `kappaskin tables --method bayes --basis 15x15`

    Parameters
    ----------
    method
        The estimator, as in `kappaskin reconstruct`.
    basis
        Number of functions along x and y; on the fingertip of Table 2 those along the arc.
    json
        Print one JSON list of rows instead of tables.
    as_printed
        Instead, list the paper's misprints, what they would give and why they cannot be meant.
    """
    from kappaskin.studies import misprints, misprints_text, paper_tables, tables_text

    rows = misprints() if as_printed else paper_tables(method, pair(basis, "a basis"))
    text = misprints_text if as_printed else tables_text
    print_result(rows, json, lambda: text(rows))


def figures(
    *,
    out: Path,
    only: Some = tuple(FIGURES),
    json: Switch = False,
) -> None:
    """Draw the paper's figures, from our own runs, as SVG and PNG.

    Example: `kappaskin figures --out figures --only fig6 fig9`

    Parameters
    ----------
    out
        The folder to write to; made when there is none.
    only
        The figures to draw; all when left out.
    json
        Print one JSON list of the files instead of one per line.
    """
    from kappaskin.studies import write_figures

    written = [str(path) for path in write_figures(out, only)]
    print_result(written, json, lambda: "\n".join(written))
