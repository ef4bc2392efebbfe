"""Edits of scenes and loads, as commands of the history."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from kappaskin._files import read_file, write_whole
from kappaskin.errors import Refusal
from kappaskin.mechanics import Load
from kappaskin.scenes import named_file
from kappaskin_app.features.scene.scene_text import forced, named, put, replaced, scaled, shifted
from kappaskin_app.guard import guarded
from kappaskin_app.shell.effects import effect_name
from kappaskin_app.shell.history import History
from kappaskin_app.shell.loads import GrabbedStimulus, dragged, largest_factor
from kappaskin_app.shell.selection import LoadHandle
from kappaskin_app.shell.session import Session
from kappaskin_app.shell.settings.scene import Written
from kappaskin_app.shell.simulation import OWN, text_of


class SceneEditing:
    """Turns the user's edits of the scene into commands of the history."""

    def __init__(self, history: History, session: Session, load: LoadHandle) -> None:
        self._history, self._session = history, session
        self._gesture, self._grabbed_end = -1, False
        self._held: GrabbedStimulus | None = None
        self._grabbed_load: Load | None = None
        self._place = (0.0, 0.0)
        self._grabbed_in: Written | None = None
        self._late: list[Callable[[], None]] = []
        self._late_in: Written | None = None
        for signal, act in (
            (load.grabbed, self.grab),
            (load.dragged, self.drag),
            (load.pressed, self.press),
            (load.released, self.release),
            (load.cancelled, self.cancel),
        ):
            signal.connect(guarded(partial(self._in_turn, act)))
        session.playing.connect(guarded(lambda _: self._catch_up()))
        load.replaced.connect(guarded(self.replace_object))

    # Scene texts

    def play(self, written: Written) -> None:
        """Simulate the scene of a text, from its beginning."""
        self._session.begin(written)

    def write(self, text: str) -> None:
        """Simulate the edited text; consecutive keys are one undo step."""
        if (written := self._edited(text)) is not None:
            self._history.request("written", written=written)

    def _edited(self, text: str, *trusted: Path) -> Written | None:
        """The scene with another text, which may name the `trusted` files; None if it is the same.

        These were selected in the window.
        """
        now = self._history.settings.written
        if now is not None and text == now.text:
            return None
        now = now or Written("", OWN)
        if trusted and now.trust is not True:
            now = replace(now, trust=frozenset(trusted).union(now.trust or ()))
        return replace(now, text=text)

    def save(self, file: Path) -> None:
        """Write the scene to a file, which becomes its file; a `Refusal` where that fails.

        Files that it names are copied to the same folder.
        """
        settings = self._history.settings
        if settings.written is None:
            write_whole(file, text_of(settings))
            return
        text = _with_files_in(file.parent, settings.written)
        write_whole(file, text)
        self._history.change(
            "Save the scene", -1, written=replace(settings.written, text=text, file=file)
        )

    def force(self, effect: str, how: str) -> None:
        """Force an effect on or off, or by plan; raises `Refusal` for a text that is no TOML."""
        written = self._edited(forced(text_of(self._history.settings), effect, how))
        if written is not None:
            self._history.change(f"Selection of {effect_name(effect).lower()}", -1, written=written)

    def replace_object(
        self, table: Mapping[str, Any], x: float, y: float, force: float, *trusted: Path
    ) -> None:
        """Replace the object by that of the TOML `table`, at (x, y) in m with `force` in N.

        The table may name the `trusted` files.
        """
        written = self._edited(
            replaced(
                text_of(self._history.settings),
                0,
                {**table, "x": round(x, 6), "y": round(y, 6), "force": float(f"{force:.4g}")},
            ),
            *trusted,
        )
        if written is not None:
            self._history.change("Select the object", -1, written=written)

    # Dragged loads

    def _in_turn(self, act: Callable[..., None], *values: float) -> None:
        """Act now, or once the scene that is being computed is simulated."""
        if not self._session.making:
            act(*values)
            return
        if not self._late:
            self._late_in = self._history.settings.written
        self._late.append(partial(act, *values))

    def _catch_up(self) -> None:
        late, self._late = self._late, []
        for act in late if self._late_in == self._history.settings.written else ():
            act()

    def grab(self, x: float, y: float) -> None:
        """Grab the load at (x, y) in m; the changes until its release are one undo step."""
        settings, session = self._history.settings, self._session
        second = math.dist((x, y), (settings.x_end, settings.y_end))
        self._grabbed_end = second < math.dist((x, y), (settings.x, settings.y))
        self._gesture, self._grabbed_in = self._history.new_gesture(), settings.written
        # Only where the displayed scene is that of the text.
        writes = settings.written is not None and not session.refusal
        self._held = GrabbedStimulus.at_place(session.scene, session.time, x, y) if writes else None
        self._grabbed_load = session.scene.loads[0] if session.scene.loads else None
        self._place = x, y
        if self._held is not None and self._held.moves:
            session.move(self._held.resting)

    @property
    def _exists(self) -> bool:
        """Whether the grabbed load still exists."""
        return self._history.settings.written == self._grabbed_in

    def drag(self, x: float, y: float) -> None:
        settings, scene = self._history.settings, self._session.scene
        if not self._exists:
            return
        if self._held is not None:
            self._session.move(self._held.moved_to(x, y))
        elif settings.written is None:
            self._place = x, y
            moved = dragged(settings, scene, x, y, self._grabbed_end)
            self._history.change("Drag the load", self._gesture, **moved)

    def press(self, times: float) -> None:
        """Set the grabbed load to `times` its force at the start."""
        settings, scene = self._history.settings, self._session.scene
        if not self._exists:
            return
        if self._held is not None:
            self._session.move(self._held.pressed(times))
        elif settings.written is None and self._grabbed_load is not None:
            times = min(times, max(largest_factor(scene, self._grabbed_load), 1.0))
            moved = dragged(settings, scene, *self._place, self._grabbed_end)
            # Two point loads share the force.
            whole = self._grabbed_load.force * max(len(scene.loads), 1)
            self._history.change(
                "Change the force", self._gesture, **moved | {"force": whole * times}
            )

    def release(self) -> None:
        held, written = self._held, self._history.settings.written
        self._gesture, self._held = -1, None
        if held is None or written is None or not self._exists:
            return
        if not held.moved:
            self._session.move(held.scene)  # its motion goes on
        else:
            text = shifted(written.text, held.number, *held.by)
            text = scaled(text, held.number, held.times) if held.times != 1 else text
            self._history.change("Drag the load", -1, written=replace(written, text=text))

    def cancel(self) -> None:
        """Return the load to where it was grabbed."""
        if self._held is not None and self._exists:
            self._session.move(self._held.scene)
        elif self._held is None:
            self._history.cancel(self._gesture)
        self._gesture, self._held = -1, None


_LARGEST = 2**30  # bytes of a file that is copied


def _with_files_in(folder: Path, written: Written) -> str:
    """The text, with the files that it names in `folder` or below: those elsewhere are copied.

    What cannot be read stays as it is. A `Refusal` where another file has the name of a copy.
    """
    text = written.text
    try:
        files = named(text)
    except Refusal:  # no TOML
        return text
    for place, name in files:
        try:
            file = named_file(name, written.file.parent, written.trust)
            inside = file.is_relative_to(folder.resolve())
            content = b"" if inside else read_file(file, _LARGEST)
        except (Refusal, OSError):
            continue
        if not inside:
            _copy(content, folder / file.name)
        relative = file.relative_to(folder.resolve()) if inside else Path(file.name)
        text = put(text, place, relative.as_posix())
    return text


def _copy(content: bytes, to: Path) -> None:
    try:
        there = read_file(to, _LARGEST)
    except FileNotFoundError:
        write_whole(to, content)
        return
    except OSError as error:
        raise Refusal(f"{to}: cannot be read ({error}); save the scene elsewhere") from error
    if there != content:
        raise Refusal(
            f"{to}: expected no other file of the name of one that the scene needs; save the scene "
            "in another folder, or rename one of them"
        )
