"""Which effects a scene calls for, and why."""

from kappaskin.cli.common import Switch, print_json
from kappaskin.scenes import load_scene
from kappaskin.studies import plan_rows, plan_text


def plan(scene: str = "", *, json: Switch = False) -> None:
    """Tell which effects a scene calls for at the accuracy that it asks for, and why.

    Example: `kappaskin plan tapping`

    Parameters
    ----------
    scene
        The name of a ready scene, or a file that ends in .toml; the default one when left out.
    json
        Print one JSON object, with an entry for every known effect, instead of a table.
    """
    on = load_scene(scene)
    rows = plan_rows(on)
    if json:
        print_json({"scene": on.name, "accuracy": on.choice.accuracy, "effects": rows})
    else:
        print(plan_text(on, rows))
