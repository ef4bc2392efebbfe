"""What accuracy costs in time."""

import sys
from pathlib import Path

from kappaskin.cli.common import FAILED, Pair, Switch, print_json
from kappaskin.errors import Refusal
from kappaskin.scenes import Scene, load_scene
from kappaskin.studies import (
    Cost,
    Measuring,
    Refused,
    check_plot,
    costs_text,
    effect_costs,
    effect_rows,
    effects_text,
    length_of,
    rows,
    settings_to_try,
    usual_setting,
    verdict,
    write_plot,
)


def _measured(scene: Scene) -> list[Cost | Refused]:
    """What every setting costs; on a terminal, a line on standard error tells how far it is."""
    settings, found = settings_to_try(scene), list[Cost | Refused]()
    told = sys.stderr.isatty()
    try:
        with Measuring(scene, settings) as measuring:
            for cost in measuring.wait():
                found.append(cost)
                done = 40 * len(found) // len(settings)
                if told:
                    bar = f"\r[{'#' * done:<40}] {len(found)} of {len(settings)}"
                    print(bar, end="", file=sys.stderr, flush=True)
    except KeyboardInterrupt:
        raise Refusal("stopped before the last setting; nothing was written") from None
    finally:
        if told:
            print(file=sys.stderr)
    return found


def _effects(scene: Scene, json: bool) -> None:
    """Tell what the scene's effects cost."""
    setting = usual_setting(scene)
    found = effect_costs(scene, setting)
    if json:
        print_json(effect_rows(scene, setting, found))
    else:
        print(effects_text(scene, setting, found))


def _settings(scene: Scene, found: list[Cost | Refused], json: bool) -> None:
    """Tell what was found of settings; people are told of the effects too."""
    if json:
        print_json(rows(scene, found))
        return
    print(costs_text(scene, found), end="\n\n", flush=True)
    try:
        _effects(scene, json)
    except Refusal as refusal:  # the settings' table is worth its minute all the same
        print(f"What each effect costs cannot be told: {refusal}")


def cost(
    *,
    scene: str = "",
    effects: Switch = False,
    within: Pair | None = None,
    plot: Path | None = None,
    json: Switch = False,
) -> int:
    """Measure what accuracy costs: error, time and memory of every method and setting.

    Takes about a minute. Bases, elements, precisions and channels are combined with each method;
    marked are the settings that no other one beats in both error and time. A second table tells
    what each effect of the scene costs, and what leaving it out does to the shape.

    Example: `kappaskin cost --within 0.02mm --plot cost.svg`

    Parameters
    ----------
    scene
        The scene to measure on; the default one when left out.
    effects
        Tell of the effects alone, which takes seconds.
    within
        Instead of a table, name the setting that reaches this RMS error in the least time,
        conversion included, such as 0.02mm or 20um; or say what is missing, with exit code 1.
    plot
        The file, SVG or PNG, to draw error against time into.
    json
        Print one JSON list of rows instead of a table, of the settings, or with --effects of the
        effects; with --within one object.
    """
    asked = None if within is None else length_of(within)
    if effects and (asked is not None or plot is not None):
        raise Refusal(
            "expected --effects without --within and --plot, which are about settings; leave it or "
            "them out"
        )
    on = load_scene(scene)
    if effects:
        _effects(on, json)
        return 0
    if plot is not None:
        check_plot(plot)
    found = _measured(on)
    if plot is not None:
        write_plot(plot, on, found)
    if asked is None:
        _settings(on, found, json)
        return 0
    answer = verdict(on, found, asked)
    if json:
        print_json(answer.to_json())
    else:
        print(*answer.said, sep="\n")
    return 0 if answer.reached else FAILED
