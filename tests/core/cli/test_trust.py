"""--trust: the commands that read a scene let it name files outside its folder only with it."""

import pytest

from kappaskin.cli import REFUSED

pytestmark = pytest.mark.slow

SCENE = """
format = 1
rate = 100.0
[skin]
size = [0.1, 0.1]
[elements]
grid = [3, 3]
[[touch]]
what = "point"
x = 0.05
y = 0.05
force = 0.01
recorded = "../at-rest.csv"
"""
COMMANDS = {
    "plan": ("plan", "{}"),
    "simulate": ("simulate", "{}", "--frames", "1", "--out", "OUT.npz"),
    "cost": ("cost", "--scene", "{}", "--effects"),
    "device": ("device", "{}", "--dwell", "1"),
    "press": ("press", "sim:{}", "--quick"),
    "calibrate": ("calibrate", "sim:{}", "--out", "OUT.toml", "--seconds", "0.1"),
    "tare": ("tare", "sim:{}"),
    "record": ("record", "sim:{}", "OUT.mcap", "--seconds", "0.2"),
    "publish": ("publish", "sim:{}", "--udp", "127.0.0.1:9", "--seconds", "2"),
}


@pytest.mark.parametrize("command", COMMANDS)
def test_a_file_outside_is_refused_unless_there_is_trust(run, tmp_path, command: str) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "a.toml").write_text(SCENE)
    (tmp_path / "at-rest.csv").write_text("time,dx,dy,amount\n0,0,0,0\n1,0,0,0\n")
    scene, out = str(tmp_path / "in" / "a.toml"), str(tmp_path / "out")
    words = [word.format(scene).replace("OUT", out) for word in COMMANDS[command]]

    code, _, told = run(*words)
    assert code == REFUSED
    assert "or give --trust" in told
    assert not list(tmp_path.glob("out*"))

    code, _, told = run(*words, "--trust")
    assert "--trust" not in told
    # Of a skin without cylinders to dwell on, which nothing presses, two refuse then.
    assert (code == REFUSED) is (command in ("device", "cost")), told
