"""Parsing of a scene's text with its layout."""

from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError

from kappaskin.errors import Refusal


def parsed(text: str) -> Any:
    """The TOML document that can be changed and written again; raises `Refusal` for no TOML."""
    try:
        return tomlkit.parse(text)
    except TOMLKitError as error:
        raise Refusal(
            f"expected a scene in TOML to change, got a mistake in it: {error}; mend its text first"
        ) from error
