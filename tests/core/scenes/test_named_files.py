"""Files that a scene names: in its folder or trusted, and never quoted in a refusal."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from kappaskin import Refusal
from kappaskin.scenes import read_scene, scene_file

HEAD = "format = 1\n\n[skin]\nsize = [0.1, 0.1]\n\n[[touch]]\nx = 0.05\ny = 0.05\n"
MESH = HEAD + 'what = "mesh"\ndepth = 1e-3\nunit = 1e-3\nfile = {name!r}\n'
STAMP = HEAD + (
    'what = "heights"\ndepth = 1e-3\nlength = 0.02\nwidth = 0.02\nrelief = 1e-3\nfile = {name!r}\n'
)
MOTION = HEAD + 'what = "point"\nforce = 0.1\nrecorded = {name!r}\n'
READY = scene_file("bolt").parent
KINDS = {"bolt.ply": MESH, "coin.png": STAMP, "exploring.csv": MOTION}
OUTSIDE = "a file in the folder of the scene.*got .*; copy the file there, or give --trust"
LINKS = pytest.mark.skipif(os.name == "nt", reason="a user of Windows may make no links")


@pytest.fixture
def folder(tmp_path) -> Path:
    """The folder of a scene, with a copy of the files that ready scenes name beside it."""
    (tmp_path / "scene").mkdir()
    (tmp_path / "elsewhere").mkdir()
    for name in KINDS:
        shutil.copy(READY / name, tmp_path / "elsewhere")
    return tmp_path / "scene"


def absolute(folder: Path, name: str) -> str:
    return str(folder.parent / "elsewhere" / name)


def absolute_inside(folder: Path, name: str) -> str:
    shutil.copy(READY / name, folder)
    return str(folder / name)


def above(folder: Path, name: str) -> str:
    return f"../elsewhere/{name}"


def there_and_back(folder: Path, name: str) -> str:
    (folder / "in").mkdir()
    shutil.copy(READY / name, folder)
    return f"in/../{name}"


def a_link(folder: Path, name: str) -> str:
    (folder / name).symlink_to(folder.parent / "elsewhere" / name)
    return name


def a_link_of_a_folder(folder: Path, name: str) -> str:
    (folder / "in").symlink_to(folder.parent / "elsewhere", target_is_directory=True)
    return f"in/{name}"


def a_link_to_a_link(folder: Path, name: str) -> str:
    (folder / f"first-{name}").symlink_to(Path("..") / "elsewhere" / name)
    (folder / name).symlink_to(f"first-{name}")
    return name


WAYS = (absolute, absolute_inside, above, there_and_back)
LINKED = (a_link, a_link_of_a_folder, a_link_to_a_link)


@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize("way", [*WAYS, *(pytest.param(way, marks=LINKS) for way in LINKED)])
def test_a_file_outside_the_folder_of_a_scene_needs_trust(
    folder, name: str, way: Callable[[Path, str], str]
) -> None:
    text, file = KINDS[name].format(name=way(folder, name)), folder / "a.toml"

    with pytest.raises(Refusal, match=f"line [0-9]+: touch.1..(file|recorded): .*{OUTSIDE}"):
        read_scene(text, file)
    assert read_scene(text, file, trust=True).stimuli
    real = next(path for path in folder.parent.rglob(name) if not path.is_symlink())
    assert read_scene(text, file, trust={real.resolve()}).stimuli
    with pytest.raises(Refusal, match=OUTSIDE):
        read_scene(text, file, trust={folder / "another"})


@LINKS
@pytest.mark.parametrize("name", KINDS)
def test_files_in_folders_of_the_folder_are_read_also_by_links(folder, name: str) -> None:
    (folder / "in").mkdir()
    shutil.copy(READY / name, folder / "in")
    (folder / "link").symlink_to("in", target_is_directory=True)

    for named in (f"in/{name}", f"link/{name}", f"./in/{name}"):
        assert read_scene(KINDS[name].format(name=named), folder / "a.toml").stimuli


@LINKS
def test_a_scene_in_a_folder_that_is_a_link_reads_what_is_beside_it(folder) -> None:
    shutil.copy(READY / "bolt.ply", folder)
    (folder.parent / "link").symlink_to(folder, target_is_directory=True)

    assert read_scene(MESH.format(name="bolt.ply"), folder.parent / "link" / "a.toml").stimuli


@pytest.mark.parametrize("trust", [False, True])
@pytest.mark.parametrize("name", ["b" * 5000, "ring/bolt.ply", ".", "", "in", "\0", "none.ply"])
def test_a_name_of_no_file_is_refused(folder, name: str, trust: bool) -> None:
    (folder / "in").mkdir()
    if os.name != "nt":
        (folder / "ring").symlink_to("ring")
    with pytest.raises(Refusal, match="expected the name of a file"):
        read_scene(MESH.replace("{name!r}", f'"{name}"').replace("\0", "\\u0000"),
                   folder / "a.toml", trust)  # fmt: skip


def test_whether_a_file_outside_exists_is_not_told(folder) -> None:
    told = set[str]()
    for name in ("bolt.ply", "none.ply"):
        with pytest.raises(Refusal) as refused:
            read_scene(MESH.format(name=f"../elsewhere/{name}"), folder / "a.toml")
        told.add(str(refused.value).replace(name, "NAME"))
    assert len(told) == 1


SECRET = "root:x:0:0"
SECRETS = {
    "lines": f"{SECRET}:root:/root:/bin/bash\n".encode() * 3,
    "a csv": f"time,dx,dy,amount\n0,0,0,0\n1,{SECRET},0,0\n".encode(),
    "an array": b"\x93NUMPY\x01\x00\x76\x00" + f"{{'descr': '{SECRET}', 'fort".encode().ljust(118),
    "a header": b"\x93NUMPY\x01\x00\x76\x00" + f"{SECRET} = [".encode().ljust(118),
    "a picture": b"\x89PNG\r\n\x1a\n" + b"\0\0\0\x0d" + SECRET.encode() * 4,
    "an stl": f"solid a\nfacet normal 0 0 1\nouter loop\nvertex {SECRET} 0 0\n".encode(),
    "a ply": f"ply\nformat ascii 1.0\nelement vertex {SECRET}\nend_header\n{SECRET}\n".encode(),
    "a ply property": (
        f"ply\nformat ascii 1.0\nelement vertex 1\nproperty {SECRET} x\nend_header\n".encode()
    ),
    "an obj": f"v {SECRET} 0 0\nf 1 {SECRET} 3\nmtllib {SECRET}\nusemtl {SECRET}\n".encode(),
}


@pytest.mark.parametrize("content", SECRETS)
@pytest.mark.parametrize("suffix", [".stl", ".ply", ".obj", ".npy", ".png", ".csv"])
def test_a_refusal_does_not_quote_the_file(
    folder, capfd, caplog, suffix: str, content: str
) -> None:
    (folder / f"secret{suffix}").write_bytes(SECRETS[content])
    text = {".csv": MOTION, ".npy": STAMP, ".png": STAMP}.get(suffix, MESH)

    with pytest.raises(Refusal) as refused:
        read_scene(text.format(name=f"secret{suffix}"), folder / "a.toml")

    told = f"{refused.value}{capfd.readouterr()}{caplog.text}"
    assert not any(part in told for part in (SECRET, SECRET[:6], "bash"))
