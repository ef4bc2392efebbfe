"""Scores of a method on the presses of the benchmark; needs NumPy alone.

`python score.py RESULTS.npz` scores results for the open half that is beside this file;
`python score.py RESULTS.npz ANSWERS.npz` those for presses with other answers.
"""

import sys
from pathlib import Path

import numpy as np

NEAR = 5e-3  # m, within which a contact is found
REACH = 1.96  # standard deviations to either side in a 95 % interval
OPEN = Path(__file__).with_name("open.npz")
HEAD = """\
             presses  count  found   place    90 %   force   depth  covered  force  depth
                          %      %      mm      mm       %       %  place %      %      %"""


def order_of(told, true):
    """Which of the contacts told (2, 2) is which of the true ones (N, 2), by the least distance."""
    far = np.nan_to_num(np.linalg.norm(told[:, None] - true, axis=-1), nan=1e3)
    if len(true) == 1:
        return [int(far[:, 0].argmin())]
    return [0, 1] if far[0, 0] + far[1, 1] <= far[1, 0] + far[0, 1] else [1, 0]


def errors(results, answers):
    """Of each true contact its press, and errors and standard deviations of x, y, force, depth.

    (N,), (N, 4) and (N, 4), in m and shares of force and depth; NaN where nothing was told.
    """
    presses, off, sds = [], [], []
    for i, count in enumerate(answers["count"]):
        told = results["place"][i].astype(float)
        told[results["count"][i] :] = np.nan
        for true, j in enumerate(order_of(told, answers["place"][i, :count])):
            by = answers["force"][i, true], answers["depth"][i, true]
            forces = results["force"][i, j] / by[0] - 1, results["depth"][i, j] / by[1] - 1
            sd = [results[name][i, j] for name in ("force_sd", "depth_sd")]
            presses.append(i)
            off.append([*(told[j] - answers["place"][i, true]), *forces])
            sds.append([*results["place_sd"][i, j], *np.divide(sd, np.abs(by))])
    return np.array(presses), np.array(off), np.array(sds)


def completed(results):
    """The results with NaN for what a method does not tell: force, depth, standard deviations."""
    nothing = np.full(results["place"].shape[:2], np.nan)
    found = dict.fromkeys(("force", "depth", "force_sd", "depth_sd"), nothing)
    return found | {"place_sd": np.full(results["place"].shape, np.nan)} | dict(results)


def row(name, which, results, answers):
    """One line of the table, of the presses `which` (N,)."""
    presses, off, sd = errors(results, answers)
    here = which[presses]
    off, sd = off[here], sd[here]
    away = np.hypot(*off[:, :2].T)
    found = away < NEAR
    off, sd, away = off[found], sd[found], away[found]

    def share(inside):
        return f"{100 * np.mean(inside):.0f}" if len(inside) else "-"

    def middle(values, share=50, digits=1):
        values = values[np.isfinite(values)]
        return f"{np.percentile(values, share):.{digits}f}" if len(values) else "-"

    def covered(columns):
        told = np.isfinite(sd[:, columns]) & np.isfinite(off[:, columns])
        return share((np.abs(off[:, columns]) <= REACH * sd[:, columns])[told])

    right = results["count"][which] == answers["count"][which]
    words = (
        *(f"{which.sum():>8}", f"{share(right):>7}", f"{share(found):>7}"),
        *(f"{middle(1e3 * away, at, 2):>8}" for at in (50, 90)),
        *(f"{middle(100 * np.abs(off[:, column])):>8}" for column in (2, 3)),
        *(f"{covered([0, 1]):>9}", f"{covered([2]):>7}", f"{covered([3]):>7}"),
    )
    return f"{name:<12}" + "".join(words)


def table(results, answers):
    """The scores as text: each skin and kind of press, each noise, and all."""
    results = completed(results)
    skins, kinds, noises = answers["skin"], answers["kind"], answers["noise"]
    lines = [HEAD]
    for skin in dict.fromkeys(sorted(skins, key=["flat", "bent", "dome"].index)):
        for kind in ("point", "disc", "object", "two"):
            which = (skins == skin) & (kinds == kind)
            if which.any():
                lines.append(row(f"{skin} {kind}", which, results, answers))
    lines += [row(f"noise {n:g}", noises == n, results, answers) for n in np.unique(noises)]
    return "\n".join([*lines, row("all", noises > 0, results, answers)])


def load(file):
    """The arrays of a file."""
    with np.load(file, allow_pickle=False) as found:
        return {name: found[name] for name in found.files}


def main(results, answers=OPEN):
    """Print the table."""
    results, answers = load(results), load(answers)
    presses, came = len(answers["skin"]), results["place"].shape
    if results["count"].shape != (presses,) or came != (presses, 2, 2):
        sys.exit(
            f"expected count ({presses},) and place ({presses}, 2, 2), one row for each press; "
            f"got {results['count'].shape} and {came}"
        )
    print(table(results, answers))


if __name__ == "__main__":
    main(*sys.argv[1:])
