"""The text of a TOML file to the line on which each of its keys stands."""

import re

# A name begins and ends with what is no space: else a line of spaces is tried in every way.
_HEADER = re.compile(r"\s*(\[\[?)\s*([\w.\-\"']+(?: +[\w.\-\"']+)*)\s*\]\]?\s*(#.*)?$")
_KEY = re.compile(r"""\s*("[^"]*"|'[^']*'|[\w\-"'.]+)\s*=""")

Place = tuple[str | int, ...]
"""The way to a value: keys, and numbers from 0 where tables come in arrays."""


def _names(dotted: str) -> list[str]:
    if dotted[0] == dotted[-1] and dotted.count(dotted[0]) == 2 and dotted[0] in "\"'":
        return [dotted[1:-1]]
    return [name.strip().strip("\"'") for name in dotted.split(".")]


class Lines:
    """Where the keys of a file stand; of what is inside a value, where the value begins."""

    def __init__(self, text: str) -> None:
        self._lines: dict[Place, int] = {(): 1}
        within, counts = list[str | int](), dict[str, int]()
        in_text = False  # of several lines
        for number, line in enumerate(text.split("\n"), 1):
            was_in_text, quotes = in_text, line.count('"""') + line.count("'''")
            in_text ^= quotes % 2 == 1
            if was_in_text:
                continue
            if header := _HEADER.match(line):
                if header[1] == "[[":
                    counts[header[2]] = counts.get(header[2], -1) + 1
                    for inner in [name for name in counts if name.startswith(f"{header[2]}.")]:
                        del counts[inner]  # a new table has none yet
                within = self._counted(_names(header[2]), counts)
                self._lines[tuple(within)] = number
            elif key := _KEY.match(line):
                self._lines.setdefault((*within, *_names(key[1])), number)

    @staticmethod
    def _counted(names: list[str], counts: dict[str, int]) -> list[str | int]:
        """The names with the number of the last table after those that are arrays of tables."""
        place, dotted = list[str | int](), list[str]()
        for name in names:
            dotted.append(name)
            place.append(name)
            if ".".join(dotted) in counts:
                place.append(counts[".".join(dotted)])
        return place

    def of(self, place: Place) -> int:
        """The line of what is at `place`, or of the nearest thing around it."""
        while place not in self._lines:
            place = place[:-1]
        return self._lines[place]
