"""Loads specifications of scenarios from profiles, files and overrides.

A *specification* states the distributions of traffic, weather and drivers, and all other values
from which scenarios are drawn. A *profile* is a TOML file with a specification; some are part of
the package and have a name, such as `motorway`. An *override* replaces one value, as
`--set traffic.vehicles=2..6` does on the command line. `load_specification` combines them into a
checked `Specification`. In this module a *table* is the unchecked content of a TOML file or of a
part of it, and `where` names its source in errors.
"""

from __future__ import annotations

import shlex
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

from pydantic import ValidationError

from overtaking.core.errors import ConfigError
from overtaking.core.files import read_toml
from overtaking.scenarios.specification import Specification, known_keys
from overtaking.scenarios.specification_values import config_error, suggestion

PROFILE_FOLDER = Path(__file__).with_name("profiles")
"""The folder of the profiles that are part of the package."""

_MAX_BYTES = 1 << 20
"""Size above which a file is refused unread [bytes], a choice far above the 3 kB of the longest
profile."""

_MAX_SUBKEYS = 8
"""Largest number of parts of a key after its section. Keys of a specification have up to two; the
check of the specification refuses more. The limit is a choice: `_with_override` calls itself once
for each part, and a key of a thousand parts would exceed Python's limit of recursion."""

_SPAWN_KEYS = ("spawn_x_m", "spawn_s_m")
"""The two ways to state where vehicles start: by the world coordinate x, or by distance along the
road. Section `[traffic]` states one of them."""


def profile_names() -> tuple[str, ...]:
    """Names of the profiles that are part of the package, in alphabetical order."""
    return tuple(sorted(path.stem for path in PROFILE_FOLDER.glob("*.toml")))


def load_specification(
    source: str | Path | Mapping[str, Any] | Specification,
    overrides: Mapping[str, Any] | None = None,
) -> Specification:
    """Load and check a specification.

    Args:
        source: Name of a profile, path of a TOML file, a `Specification`, or the mapping that
            `Specification.to_dict` returns. Only a file may have the key `base`, the name of a
            profile from which it takes all values that it does not state; in a mapping it is an
            unknown key, an error.
        overrides: Value by dotted key, applied in their order. A text with `..` between two values
            is a range; any other text is read as TOML, and as a name if it is not TOML, so that
            `{"traffic.vehicles": "2..6"}` is the same as `{"traffic.vehicles": [2, 6]}`. A key of
            one part, such as "weather", replaces the whole section. An override of `weather.mode`
            with another mode drops all other keys of `[weather]`, which the new mode does not have.
            So it must precede the overrides of these keys.

    Returns:
        The specification, with defaults for all keys that are not stated.

    Raises:
        ConfigError: A name, file, key or value is invalid; the message describes the first error.
    """
    where, table = _unchecked_table(source)
    for key, value in (overrides or {}).items():
        parsed = _parse_override(value) if isinstance(value, str) else value
        table = _with_override(table, key, parsed, where)
    try:
        return Specification.model_validate(_lists_to_tuples(table))
    except ValidationError as error:
        # `from None` hides Pydantic's message, which says the same on several lines.
        raise config_error(error, where, known_keys) from None


def _unchecked_table(
    source: str | Path | Mapping[str, Any] | Specification,
) -> tuple[str, dict[str, Any]]:
    """The source's name for error messages, and its unchecked content."""
    if isinstance(source, Specification):
        return f"specification {source.name}", source.to_dict()
    if isinstance(source, Mapping):
        return "specification", dict(source)
    if source in profile_names():
        path = _profile_path(str(source))
    elif isinstance(source, Path) or source.endswith(".toml") or path_exists(source):
        path = Path(source)  # Reading it reports a missing file.
    else:
        raise ConfigError(
            what=repr(source),
            where="profile",
            expected="a known profile or the path of a TOML file",
            got="neither",
            next_step=suggestion(source, profile_names()),
        )
    return path.name, _with_base(_read(path), path.name)


def path_exists(name: str) -> bool:
    """Whether a text is the path of a file or folder, for texts that may be names as well.

    Args:
        name: Any text.
    """
    try:
        return Path(name).exists()
    except OSError:  # The text is too long for the name of a file.
        return False


def _profile_path(name: str) -> Path:
    return PROFILE_FOLDER / f"{name}.toml"


def _with_base(table: dict[str, Any], where: str) -> dict[str, Any]:
    """The table merged into the table of its base profile, if it names one.

    A base may itself have a base; profiles of the package have no circle of bases. A file must fit
    its base: unlike an override, it drops no keys, so the check of the specification refuses a file
    with another weather mode or another of `_SPAWN_KEYS` than its base.
    """
    if "base" not in table:
        return table
    base = table["base"]
    if base not in profile_names():
        raise ConfigError(
            what="base",
            where=where,
            expected="a known profile",
            got=repr(base),
            next_step=suggestion(str(base), profile_names()),
        )
    changes = {key: value for key, value in table.items() if key != "base"}
    return _merge_tables(_with_base(_read(_profile_path(base)), f"{base}.toml"), changes)


def _merge_tables(base: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """A copy of `base` with the values of `changes`; tables inside it are merged key by key."""
    merged = dict(base)
    for key, value in changes.items():
        # A list, such as `[[proposal]]`, replaces the list of the base.
        are_tables = isinstance(value, dict) and isinstance(merged.get(key), dict)
        merged[key] = (
            _merge_tables(merged[key], cast("dict[str, Any]", value)) if are_tables else value
        )
    return merged


def _read(path: Path) -> dict[str, Any]:
    """The unchecked content of a profile or another TOML file."""
    if path.is_dir():
        raise _folder_error(path)
    try:
        return read_toml(path, _MAX_BYTES)
    # OSError: the file cannot be read or is too large; ValueError: the content is not TOML;
    # RecursionError: its brackets are nested too deeply.
    except (OSError, ValueError, RecursionError) as error:
        is_unreadable = isinstance(error, OSError)
        raise ConfigError(
            what="file",
            where=str(path),
            expected="a TOML file",
            got=error.strerror if is_unreadable else str(error),
            next_step="check the path" if is_unreadable else "correct the file",
        ) from None


def _folder_error(path: Path) -> ConfigError:
    """The error for a folder in place of a profile, with a hint if the folder is a data set."""
    # An empty name resembles no profile, so the suggestion lists them all.
    content, next_step = "a folder", suggestion("", profile_names())
    if (path / "dataset.json").is_file():
        command = shlex.join(["overtaking", "info", str(path)])
        content, next_step = (
            "a data set",
            f"name a profile; this command prints the profile of the data set: {command}",
        )
    return ConfigError(
        what="profile",
        where=str(path),
        expected="the name of a profile or a TOML file",
        got=content,
        next_step=next_step,
    )


def _parse_override(text: str) -> Any:
    """The value that a text on the command line stands for.

    The range is tried first, because `2..6` is not TOML. Wrong texts need no error here: `1..2..3`
    becomes `[1, [2, 3]]`, which the check of the specification refuses.
    """
    low, dots, high = text.partition("..")
    if dots and low.strip() and high.strip():
        return [_parse_override(low), _parse_override(high)]
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):
        return text.strip()


def _with_override(table: dict[str, Any], key: str, value: Any, where: str) -> dict[str, Any]:
    """A copy of `table` with the value at a dotted key replaced.

    Keys that exclude the new one are dropped: the other of `_SPAWN_KEYS`, and all keys of the
    weather if its mode changes.

    Args:
        table: The whole specification; in a recursive call, a table inside it.
        key: Key in `table`, with dots between its parts; in a recursive call without its first
            parts.
        value: The new value, of any type; checked later with the specification.
        where: Name of the source of the table in errors.
    """
    first, *subkeys = key.split(".")
    if not all([first, *subkeys]) or len(subkeys) > _MAX_SUBKEYS:
        raise ConfigError(
            what=repr(key),
            where=where,
            expected="a key such as traffic.vehicles",
            got=repr(key),
            next_step="name section and key, with a dot between them",
        )
    if not subkeys:
        return table | {first: value}
    section = table.get(first, {})
    if not isinstance(section, Mapping):
        raise ConfigError(
            what=first, where=where, expected="a table", got=section, next_step="set the key itself"
        )
    remaining = dict(cast("Mapping[str, Any]", section))
    # Only the first call has the key "weather.mode": no section contains a table `weather`.
    if key == "weather.mode" and remaining.get("mode", value) != value:
        remaining = {}
    if subkeys[0] in _SPAWN_KEYS:
        remaining = {name: item for name, item in remaining.items() if name not in _SPAWN_KEYS}
    return table | {first: _with_override(remaining, ".".join(subkeys), value, where)}


def _lists_to_tuples(value: Any) -> Any:
    """The same content with tuples in place of lists, also inside tables and lists.

    The models of a specification are strict: they take a tuple for a tuple, not TOML's list.
    """
    if isinstance(value, Mapping):
        return {
            key: _lists_to_tuples(item) for key, item in cast("Mapping[str, Any]", value).items()
        }
    if isinstance(value, list | tuple):
        return tuple(_lists_to_tuples(item) for item in cast("list[Any]", value))
    return value
