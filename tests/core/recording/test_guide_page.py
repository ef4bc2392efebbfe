"""The page on recordings says what is so, and its example runs."""

import re
from importlib.resources import files

from kappaskin.recording import messages as m
from kappaskin.recording.writing import FORMAT, RecordingFile

PAGE = (files("kappaskin_resources") / "recording" / "recording.md").read_text("utf-8")


def test_every_channel_is_on_the_page_and_no_other() -> None:
    rows = dict(re.findall(r"^\| `(/kappaskin/\w+)` \| `([\w/]+)` \|", PAGE, re.MULTILINE))
    assert rows == {topic.name: topic.kind.name for topic in m.TOPICS}
    assert f"({FORMAT})" in PAGE
    assert f"`{m.FRAME}`" in PAGE


def test_its_example_prints_every_contact(tmp_path, monkeypatch, capsys) -> None:
    file = RecordingFile(tmp_path / "press.mcap")
    for n in range(3):
        contact = m.pack_contact(0, n, [0.0] * 4, [n > 0, True, *[False] * 5], 5, [n / 2] * 40)
        file.put(m.CONTACTS, float(n), contact)
    file.close()
    monkeypatch.chdir(tmp_path)
    [example] = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    exec(example, {})
    lines = capsys.readouterr().out.splitlines()
    told = [line.split(maxsplit=1)[1] for line in lines]
    assert told == ["[0.5, 0.5] 0.5 0.5", "[1.0, 1.0] 1.0 1.0"]
