"""The house keeps its order: seventeen rooms, no circles, and its counts."""

import ast
from collections import Counter, defaultdict
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = {"kappaskin": ROOT / "core" / "kappaskin", "kappaskin_app": ROOT / "app/kappaskin_app"}
ROOMS = (
    *("cli", "studies", "live", "publish", "recording", "hand", "pipeline", "calibration"),
    "health",
    *("sources", "scenes", "contact", "estimation", "sensing", "mechanics", "bases", "skin"),
)

# What the house may come to at most; who brings a count down brings its limit down. The house is
# to have 340 modules and 32,000 statements. A feature that raises a count says why beside it.
LIMITS = {
    # mechanics: shell and stretching; contact: influence, stretched, lower_bound, imprint, and
    # readings on a grid of elements by small matrices;
    # studies: summed; sources: interpreter, lines of other formats, a sensor's description, inputs,
    # readings that a program pushes; live: the loop of a program; recording: foreign and importing,
    # files of other programs; _plugins. Recognition of a board's lines, and the dialog of it.
    # The strip chart. mechanics: caps.
    # skin: meshes and their files; bases: finite elements of shells, functions on meshes; the app's
    # dialog of a mesh. The hand in the window.
    # hand: its description, contacts in its frame, what it holds, how that moves.
    # Simulated hands, an operator and a gamepad, haptic cues, engines for a window in another room.
    "modules": 390,
    # Shells and plates that stretch, a load's size, slopes on shells, revisions of estimates;
    # ovals beside objects, and whether an object fits; errors told beforehand, of calibrations on
    # other paths, and of effects that act on one another.
    # Readings: heights, slopes, curvatures along any direction, from an unknown zero.
    # Contacts by the shape alone.
    # Sensors with a line format of their own: its decoders and encoders, and their description.
    # Any reading in scenes, pipeline, files and window; described readings, their noise, zero and
    # calibration; datagrams, standard input and files. What others measured, in the gallery.
    # Studies, plans and hard cases of any reading; its colours, ranges and residuals in the window.
    # From Python: readings that a program pushes, estimates in its loop; plug-ins. Import of text,
    # arrays, tables, bags of ROS 2 and MCAP files of others. Finite slopes in any readings; noises
    # of their own; datagrams in recordings; pictures of maps. Cantilevers; a fibre in the gallery.
    # The connection wizard: what a board's lines are, from the port to the live skin; bags dropped
    # on the window. Feeds that outlive a fork and a full buffer; plug-ins that fail, by name.
    # Objects named in half the time; what a frame costs, in the status; computing what is asked.
    # Simulations that go slower instead of losing frames. One chart widget with zoom, cursor and
    # export; the strip chart.
    # Numbers by their error bars, names of objects that last; recordings with one key, what may be
    # done with them, and exports by purpose.
    # A source that streams until the requested one answers; the list of devices.
    # Skins that curve both ways: caps and their functions, readings, contacts and large deflection;
    # objects named on them, profiles of loads, designs of their elements, a mesh for Foxglove.
    # Skins of any shape: files of meshes and what is wrong with them, finite elements of shells,
    # functions, contacts and designs on them; the dialog that opens one; glTF of every skin.
    # Several fingers at once: a recording of all by a process of its own, commands for each; the
    # hand in the window. Meshes held in part, elements placed by contacts, patches along a mesh.
    # Hands of several skins: their description, URDF, the object that they hold, rolling, its map.
    # Hands in 3-D and in the strip chart, settings of all fingers; a simulated hand in balance with
    # friction; an operator by pad, keys, gamepad and UDP within limits; cues that fade; engines
    # served to another room and their link; lessons on hands; depths under loads on caps.
    "statements": 54_200,
    # _files: one way to read and write files; _text: text from outside; _plugins: what other
    # packages add. For all rooms and the app.
    "loose modules of core": 11,
    "loose modules of the app": 8,
    "names of the library": 55,
    "class names with two meanings": 8,
    "attributes of the window": 14,
    "floors of core": 16,
    "floors of the app": 12,
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
_DEVICES = ("kappaskin_app.shell.sound",)
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
    "kappaskin._files": "touches a file of the cache that it has read",
    "kappaskin.live.resume": "makes a key that only this user can read",
    "kappaskin.recording.disk": "a live recording is written as it comes, under its name and .part;"
    " all files of an export or import get their names at once",
    "kappaskin.recording.writing": "the same",
    "kappaskin.recording.repair": "the same",
    "kappaskin.recording.export.surfaces": "in a scratch folder, which export.writing empties",
    "kappaskin.recording.export.tables": "the same",
    "kappaskin.recording.export.lerobot": "the same",
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


@pytest.mark.full
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


_PRINTERS = ("kappaskin.cli.common", "kappaskin.studies.drills.host")


def test_text_reaches_a_terminal_by_one_helper() -> None:
    found = {
        module: [
            node.lineno
            for node in ast.walk(tree)
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
            if node.func.id == "print"
        ]
        for module, tree in modules().items()
        if module not in _PRINTERS
    }
    assert {module: lines for module, lines in found.items() if lines} == {}


def test_labels_show_markup_as_it_is() -> None:
    """A label that is no `Label` takes what looks like markup, as in a device's name, for such."""
    found = {
        module: [
            node.lineno
            for node in ast.walk(tree)
            if (isinstance(node, ast.Call) and ast.unparse(node.func) == "QLabel")
            or (isinstance(node, ast.ClassDef) and "QLabel" in map(ast.unparse, node.bases))
        ]
        for module, tree in modules().items()
    }
    assert [module for module, lines in found.items() if lines] == ["kappaskin_app.widgets.parts"]
    assert len(found["kappaskin_app.widgets.parts"]) == 1


def test_every_painter_ends_with_its_block() -> None:
    """One that an exception keeps alive paints on a device that Qt has deleted."""
    calls, blocks = set[tuple[str, int]](), set[tuple[str, int]]()
    for name, tree in modules().items():
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "QPainter":
                calls.add((name, node.lineno))
            elif isinstance(node, ast.With):
                blocks |= {(name, item.context_expr.lineno) for item in node.items}
    assert calls
    assert calls <= blocks


def test_core_is_seventeen_rooms() -> None:
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


def attributes_of(name: str) -> set[str]:
    """The attributes that a class gives itself, with those of the classes of ours under it."""
    classes = [
        node
        for tree in modules().values()
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef) and node.name == name
    ]
    own = {
        node.attr
        for found in classes
        for node in ast.walk(found)
        if isinstance(node, ast.Attribute)
        and isinstance(node.ctx, ast.Store)
        and isinstance(node.value, ast.Name)
        and node.value.id == "self"
    }
    bases = [base.id for found in classes for base in found.bases if isinstance(base, ast.Name)]
    return own.union(*map(attributes_of, bases))


def test_the_house_stays_small() -> None:
    import kappaskin

    came = {
        "modules": len(modules()),
        "statements": sum(map(statements, modules().values())),
        "loose modules of core": loose("kappaskin"),
        "loose modules of the app": loose("kappaskin_app"),
        "names of the library": len(kappaskin.__all__),
        "class names with two meanings": sum(count > 1 for count in class_names().values()),
        "attributes of the window": len(attributes_of("MainWindow")),
        "floors of core": floors("kappaskin"),
        "floors of the app": floors("kappaskin_app"),
    }
    assert {what: came[what] for what in came if came[what] > LIMITS[what]} == {}


Graph = dict[str, set[str]]


@cache
def imported(module: str) -> set[str]:
    """The modules of ours that a module imports from, also for its types alone."""
    whole = {
        f"{source}.{name}" if f"{source}.{name}" in modules() else source
        for source, name in imports(modules()[module])
    }
    return (whole & modules().keys()) - {module}


@cache
def package_of(module: str) -> str:
    """The package that a module is in; of a package's face the package itself."""
    return module if is_package(module) else module.rpartition(".")[0]


def is_package(module: str) -> bool:
    whose, *parts = module.split(".")
    return (PACKAGES[whose].joinpath(*parts) / "__init__.py").exists()


def package_graph() -> Graph:
    """Which package imports from which; a face that has names of its own parts does not count."""
    graph: Graph = defaultdict(set)
    for module in modules():
        package = package_of(module)
        for other in map(package_of, imported(module)):
            inside = other.startswith(f"{package}.") and module == package
            if other != package and other not in PACKAGES and not inside:
                graph[package].add(other)
    return {package: others for package, others in graph.items() if package not in PACKAGES}


def room_graph() -> Graph:
    """Which room, or module that is in none, imports from which; commands start from none."""

    def room_of(module: str) -> str:
        return ".".join(module.split(".")[:2])

    graph: Graph = defaultdict(set)
    for module in modules().keys() - {*PACKAGES, "kappaskin.__main__"}:
        others = {room_of(other) for other in imported(module)} - {*PACKAGES, room_of(module)}
        graph[room_of(module)] |= others
    return graph


def floors(whose: str) -> int:
    """How many rooms stand one on the other; those of core do not count in the app."""
    graph, at = room_graph(), dict[str, int]()
    for room in TopologicalSorter(graph).static_order():
        below = [at[other] for other in graph[room] if other.startswith(f"{whose}.")]
        at[room] = 1 + max(below, default=0)
    return max(at[room] for room in graph if room.startswith(f"{whose}."))


# Each of the two has the other's class as the type of an argument or attribute, no more.
_TYPES_ALONE = {
    ("kappaskin.estimation.fit", "kappaskin.estimation.estimator"),
    ("kappaskin.pipeline.reported", "kappaskin.pipeline.quantities"),
}


def test_no_package_is_in_a_circle() -> None:
    graph = package_graph()
    assert len(graph) > 40
    TopologicalSorter(graph).prepare()  # raises an error that names the circle


def test_no_module_is_in_a_circle() -> None:
    graph = {
        module: {other for other in imported(module) if (module, other) not in _TYPES_ALONE}
        for module in modules()
    }
    TopologicalSorter(graph).prepare()


_PUT = ("put_left", "put_right", "put_beside", "put_below", "put_above")
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
