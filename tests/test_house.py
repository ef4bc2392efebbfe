"""The house keeps its order: rooms with faces, features apart from each other, and its counts."""

import ast
from collections import Counter, defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = {"kappaskin": ROOT / "core" / "kappaskin", "kappaskin_app": ROOT / "app/kappaskin_app"}
ROOMS = (
    *("cli", "studies", "live", "publish", "recording", "pipeline", "calibration", "health"),
    *("sources", "scenes", "contact", "estimation", "sensing", "mechanics", "bases", "skin"),
)

_FACES = (
    *("kappaskin.scenes.effects", "kappaskin.sources.wire", "kappaskin.recording.messages"),
    "kappaskin.cli.system",
)
"""Parts of rooms that are faces: the effects, two formats of messages, what a machine has."""

# What the house may come to at most; who brings a count down brings its limit down. The house is
# to have 340 modules and 32,000 statements. A feature that raises a count says why beside it.
LIMITS = {
    "modules": 349,
    "statements": 35_338,
    "loose modules of core": 8,
    "loose modules of the app": 8,
    "names of the library": 55,
    "class names with two meanings": 8,
    "attributes of the window": 14,
}


@cache
def modules() -> dict[str, ast.Module]:
    """Every module by its dotted name, parsed."""
    found: dict[str, ast.Module] = {}
    for name, folder in PACKAGES.items():
        for file in sorted(folder.rglob("*.py")):
            parts = file.relative_to(folder).with_suffix("").parts
            dotted = ".".join((name, *(part for part in parts if part != "__init__")))
            found[dotted] = ast.parse(file.read_text("utf-8"))
    return found


def imports(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """Each name that is imported from a module of ours, with that module."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield from ((node.module, alias.name) for alias in node.names)


def room(module: str) -> str:
    """The room of core that a module is in; empty for others."""
    whose, _, rest = module.partition(".")
    first = rest.partition(".")[0]
    return first if whose == "kappaskin" and first in ROOMS else ""


def test_core_is_sixteen_rooms() -> None:
    folders = {file.parent.name for file in PACKAGES["kappaskin"].glob("*/__init__.py")}
    assert folders == set(ROOMS)


@pytest.mark.parametrize("of", ROOMS)
def test_a_room_is_entered_by_its_face(of: str) -> None:
    inside = [
        f"{module} imports {name} from {source}"
        for module, tree in modules().items()
        if room(module) != of
        for source, name in imports(tree)
        if room(source) == of and source not in (f"kappaskin.{of}", *_FACES)
        if module != "kappaskin"
    ]
    assert inside == []


def statements(tree: ast.Module) -> int:
    """How many statements there are, without imports and docstrings."""
    kinds = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
    docstrings = sum(
        ast.get_docstring(node, clean=False) is not None
        for node in ast.walk(tree)
        if isinstance(node, kinds)
    )
    all_of_them = sum(
        isinstance(node, ast.stmt) and not isinstance(node, ast.Import | ast.ImportFrom)
        for node in ast.walk(tree)
    )
    return all_of_them - docstrings


def loose(whose: str) -> int:
    """How many modules stand in no room."""
    return sum(file.name != "__init__.py" for file in PACKAGES[whose].glob("*.py"))


def class_names() -> Counter[str]:
    return Counter(
        node.name
        for tree in modules().values()
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_")
    )


def attributes_of(name: str) -> int:
    """How many attributes a class gives itself."""
    [found] = [
        node
        for tree in modules().values()
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef) and node.name == name
    ]
    return len(
        {
            node.attr
            for node in ast.walk(found)
            if isinstance(node, ast.Attribute)
            and isinstance(node.ctx, ast.Store)
            and isinstance(node.value, ast.Name)
            and node.value.id == "self"
        }
    )


def test_the_house_stays_small() -> None:
    import kappaskin

    came = {
        "modules": len(modules()),
        "statements": sum(map(statements, modules().values())),
        "loose modules of core": loose("kappaskin"),
        "loose modules of the app": loose("kappaskin_app"),
        "names of the library": len(kappaskin.__all__),
        "class names with two meanings": sum(count > 1 for count in class_names().values()),
        "attributes of the window": attributes_of("MainWindow"),
    }
    assert {what: came[what] for what in came if came[what] > LIMITS[what]} == {}


def test_no_package_of_the_app_is_in_a_circle_nor_any_within_the_shell() -> None:
    edges: dict[str, set[str]] = defaultdict(set)
    for module, tree in modules().items():
        for source, name in imports(tree):
            whole = f"{source}.{name}" if f"{source}.{name}" in modules() else source
            if source.startswith("kappaskin_app.shell") and module != whole:
                edges[module].add(whole)
    shell = {module for module in modules() if module.startswith("kappaskin_app.shell.")}
    seen: dict[str, int] = {}

    def visit(module: str, way: tuple[str, ...]) -> None:
        assert module not in way, " -> ".join((*way[way.index(module) :], module))
        if seen.get(module):
            return
        for other in edges[module] & shell:
            visit(other, (*way, module))
        seen[module] = 1

    for module in sorted(shell):
        visit(module, ())
