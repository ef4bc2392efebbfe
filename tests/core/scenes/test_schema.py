"""The schema of scene files: one declaration, from which all else about a key comes."""

import re
import runpy
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

from kappaskin import Refusal
from kappaskin._toml import table
from kappaskin.scenes import PARTS, Indenter, load_scene, read_scene
from kappaskin.scenes.effects import EFFECTS

GUIDE = runpy.run_path(str(Path(__file__).parents[2] / "guide_keys.py"))
FROM_ELSEWHERE = {"patch", "transduction", "rigid", "a", "b", "strip", "vertices", "heights"}
FROM_ELSEWHERE |= {"faces", "content", "nodes", "points", "places", "triangles", "rim", "frame"}
FROM_ELSEWHERE |= {"origin"}
"""Fields that a scene tells by other keys, or by a file."""

KINDS = [(part, kind) for part in PARTS for kind in (PARTS[part].kinds or ("",))]


@pytest.mark.parametrize(("part", "kind"), KINDS)
def test_every_field_of_what_a_table_becomes_is_declared_as_a_key_with_words(part, kind):
    made = PARTS[part].kinds[kind].made if kind else None
    names = {field.name for field in fields(made)} if made else set(PARTS[part].keys)
    names |= {field.name for field in fields(Indenter)} if part == "touch" else set()
    every = PARTS[part].keys.keys() | (PARTS[part].kinds[kind].keys.keys() if kind else set())

    for name in names - FROM_ELSEWHERE:
        assert name in every
        assert PARTS[part].key(name, kind).label
        assert PARTS[part].key(name, kind).tip.endswith(".")


def test_the_numbers_of_a_plate_are_keys_of_the_skin():
    plate = {field.name for field in fields(load_scene("centre").plate)}
    assert plate - {"patch"} <= PARTS["skin"].keys.keys()


@pytest.mark.parametrize("name", EFFECTS)
def test_an_effect_is_told_by_a_table_of_its_own_or_by_the_rest_of_a_scene(name):
    effect = EFFECTS[name]
    assert bool(effect.example) != bool(effect.elsewhere)
    assert (name in PARTS["effects"].kinds) == bool(effect.example)


HEAD = "format = 1\n\n[skin]\nsize = [0.1, 0.1]\n\n"
FILES = {"heights", "mesh", "recorded"}
"""What lies beside a scene in a file of its own."""


def with_one(part: str, kind: str, values: dict[str, Any]) -> str:
    """A scene file with one table of this kind."""
    if part == "effects":
        return HEAD + table(f"[effects.{kind}]", values)
    if part == "skin":
        return "format = 1\n" + table("[skin]", {"shape": kind} | values)
    if part == "touch":
        return HEAD + table("[[touch]]", {"what": kind} | values)
    release = {"step": "release", "seconds": 0.5}
    path = {"path": [{"step": kind} | values, release]}
    return HEAD + table("[[touch]]", {"what": "disc"} | PARTS["touch"].needed("disc") | path)


@pytest.mark.parametrize(("part", "kind"), [(p, k) for p, k in KINDS if k and k not in FILES])
def test_the_examples_of_every_kind_are_what_a_reader_takes(part, kind):
    needed = PARTS[part].needed(kind)
    read_scene(with_one(part, kind, needed), Path("a.toml"))

    for name, example in PARTS[part].optional(kind).items():
        if name not in {"shape", *FILES}:
            rest = {key: needed[key] for key in needed if key not in PARTS[part].instead_of(name)}
            if "like" not in rest:  # which tells all of the loops
                read_scene(with_one(part, kind, rest | {name: example}), Path("a.toml"))


def test_what_cannot_stand_beside_a_key_says_the_same_of_it():
    for part in PARTS.values():
        for name in part.keys:
            for other in part.instead_of(name):
                assert other in part.keys
                assert name in part.instead_of(other)
    assert PARTS["touch"].instead_of("force") == {"displacement", "depth"}
    assert not PARTS["touch"].instead_of("x")


TABLES = {"scene": "", "skin": "[skin]\n", "cylinders": "[cylinders]\n"}
LIMITED = [(part, name) for part in TABLES for name in PARTS[part].limits]


@pytest.mark.parametrize(("part", "name"), LIMITED)
def test_numbers_beyond_the_limits_declared_are_refused_with_them(part, name):
    within = PARTS[part].limits[name]
    beyond = f"{within.most * 10:.0f}" if within.whole else f"{within.most * 10:g}"
    said = {table: {} for table in TABLES} | {"skin": {"size": "[0.1, 0.1]"}}
    said[part][name] = f"[{beyond}]" if name == "radii" else beyond
    text = "format = 1\n" + "".join(
        header + "".join(f"{key} = {each}\n" for key, each in said[table].items())
        for table, header in TABLES.items()
        if said[table]
    )

    with pytest.raises(Refusal, match=rf"line \d: .*{name}: expected") as refused:
        read_scene(text, Path("a.toml"))
    assert str(within) in str(refused.value)


def test_the_guide_tells_every_key_as_it_is_declared():
    for page, section in ((GUIDE["PAGE"], GUIDE["told"]()), (GUIDE["OWN"], GUIDE["told_of_own"]())):
        text = page.read_text(encoding="utf-8")
        assert text.endswith(section), "run python tests/guide_keys.py"


@pytest.mark.parametrize("page", GUIDE["OTHERS"], ids=lambda page: page.stem)
def test_the_pages_of_recordings_and_of_the_wire_tell_every_key_as_it_is_declared(page):
    assert page.read_text(encoding="utf-8") == GUIDE["told_of"](page), "run tests/guide_keys.py"


def test_the_guide_names_every_effect_where_it_comes_about():
    page = GUIDE["PAGE"].read_text(encoding="utf-8")
    rows = page.partition("| where | effects |")[2].partition("\n\n")[0]
    assert re.findall(r"`([\w-]+)`", rows) == list(EFFECTS)
