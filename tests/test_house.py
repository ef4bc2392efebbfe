"""The house keeps its order: sixteen rooms, no circles in the app, and its counts."""

import ast
from collections import Counter, defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = {"kappaskin": ROOT / "core" / "kappaskin", "kappaskin_app": ROOT / "app/kappaskin_app"}
ROOMS = (
    *("cli", "studies", "live", "publish", "recording", "pipeline", "calibration", "health"),
    *("sources", "scenes", "contact", "estimation", "sensing", "mechanics", "bases", "skin"),
)

# What the house may come to at most; who brings a count down brings its limit down. The house is
# to have 340 modules and 32,000 statements. A feature that raises a count says why beside it.
LIMITS = {
    "modules": 323,
    "statements": 34_971,
    "loose modules of core": 9,  # _files: one way to write a file, for every room and the app
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


@cache
def imports(tree: ast.Module) -> list[tuple[str, str]]:
    """Each name that is imported from a module of ours, with that module."""
    return [
        (node.module, alias.name)
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module
        for alias in node.names
    ]


# There is no window yet; and a player of sound is a device that is fed, not something computed.
_BESIDE = ("kappaskin_app.shell.background", "kappaskin_app.launch")
_DEVICES = ("kappaskin_app.features.presenter.sound",)
_WAYS = {
    *("Thread", "Timer", "ThreadPoolExecutor", "ProcessPoolExecutor", "Process", "Popen"),
    *("QThread", "QThreadPool", "QRunnable", "QProcess", "BackgroundProcess"),
}


def names(tree: ast.Module) -> set[str]:
    """Every name that a module uses, of whatever object."""
    found = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    found |= {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    return found | {
        alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.Import | ast.ImportFrom)
        for alias in node.names
    }


def test_a_background_task_is_the_one_way_to_run_something_beside_the_window() -> None:
    found = {
        module: sorted(names(tree) & _WAYS)
        for module, tree in modules().items()
        if module.startswith("kappaskin_app.") and module not in (*_BESIDE, *_DEVICES)
    }
    assert {module: ways for module, ways in found.items() if ways} == {}


_WRITE = {"write_text", "write_bytes", "rename", "mkstemp", "touch"}
_WRITERS = {
    "kappaskin._files": "the helper itself",
    "kappaskin.bases.argyris": "touches a file of the cache that it has read",
    "kappaskin.live.resume": "makes a key that only this user can read",
    "kappaskin.recording.disk": "a live recording is written as it comes, under its name and .part",
    "kappaskin.recording.writing": "the same",
    "kappaskin.recording.repair": "the same",
    "kappaskin.recording.export.surfaces": "in a scratch folder, which export.writing empties",
    "kappaskin.recording.export.tables": "the same",
    "kappaskin.recording.export.writing": "gives all files of an export their names at once",
    "kappaskin_app.features.export.filming": "FFmpeg writes the film, which is named once whole",
    "kappaskin_app.shell.log_files": "a log grows",
}


def written(tree: ast.Module) -> Iterator[str]:
    """Every call that writes a file, but to the part that `replacing` gave."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        name = node.func.attr if isinstance(node.func, ast.Attribute) else ""
        name = node.func.id if isinstance(node.func, ast.Name) else name
        of = getattr(node.func, "value", None)
        if isinstance(of, ast.Name) and of.id == "part":
            continue
        arguments = [*node.args, *(keyword.value for keyword in node.keywords)]
        modes = {str(one.value) for one in arguments if isinstance(one, ast.Constant)}
        if name in _WRITE or (name == "open" and modes & {"w", "wb", "x", "xb", "a", "ab", "w+b"}):
            yield f"{name}, line {node.lineno}"
        if name == "ZipFile" and "w" in modes and ast.unparse(node.args[0]) != "part":
            yield f"{name}, line {node.lineno}"


def test_a_file_is_written_whole_by_one_helper() -> None:
    found = {module: list(written(tree)) for module, tree in modules().items()}
    assert {
        module: calls for module, calls in found.items() if calls and module not in _WRITERS
    } == {}
    assert [module for module in _WRITERS if not found[module]] == []
    taken = {
        module
        for module, tree in modules().items()
        for node in ast.walk(tree)
        if isinstance(node, ast.With)
        for item in node.items
        if isinstance(item.optional_vars, ast.Name) and item.optional_vars.id == "part"
        if not ast.unparse(item.context_expr).startswith("replacing(")
    }
    assert taken == set()


def test_core_is_sixteen_rooms() -> None:
    folders = {file.parent.name for file in PACKAGES["kappaskin"].glob("*/__init__.py")}
    assert folders == set(ROOMS)


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


_PUT = ("put_left", "put_right", "put_below", "put_above")
_OTHER_MEANINGS = {"health", "scene", "element"}  # a colouring, what is simulated, a plain word


def texts_of(node: ast.AST) -> set[str]:
    """The strings that stand in a part of a module."""
    return {
        part.value
        for part in ast.walk(node)
        if isinstance(part, ast.Constant) and isinstance(part.value, str)
    }


def test_the_shell_names_no_dock_of_a_feature() -> None:
    docks = {
        text
        for module, tree in modules().items()
        if module.startswith("kappaskin_app.features.")
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and getattr(node.func, "attr", "") in _PUT
        for text in texts_of(ast.Tuple(node.args[:2]))  # its name and its title
    }
    assert len(docks) > 20
    shell = {m: tree for m, tree in modules().items() if m.startswith("kappaskin_app.shell.")}
    knows_docks = {
        m
        for m, tree in shell.items()
        if any(name == "QDockWidget" or "docks" in source for source, name in imports(tree))
        or ".layouts." in m
    } | {"kappaskin_app.shell.docks", "kappaskin_app.shell.window"}
    named = {
        (module, text)
        for module, tree in shell.items()
        for text in texts_of(tree) & docks
        if module in knows_docks or text.lower() not in _OTHER_MEANINGS
    }
    assert named == set()
