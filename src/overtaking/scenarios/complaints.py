"""From pydantic's findings to one line that says what, where, expected, got and what to do."""

import difflib
from collections.abc import Callable, Iterable
from typing import TypeAlias, cast

from pydantic import ValidationError
from pydantic_core import ErrorDetails, PydanticCustomError

from overtaking.core.errors import ConfigError

Keys: TypeAlias = "Callable[[tuple[str, ...], str | None], tuple[str, ...]]"

_OURS = "specification"


def complaint(
    expected: str, next_step: str, *, key: str | None = None, got: object = None
) -> PydanticCustomError:
    """An error of one of our own checks.

    Args:
        expected: What would have been right.
        next_step: What the reader can do, as an imperative.
        key: Key inside the section, where the check is about a whole section.
        got: The value found, if it is not the checked one.
    """
    context = {"expected": expected, "next_step": next_step, "key": key, "got": got}
    return PydanticCustomError(_OURS, "{expected}", context)


def known_name(what: str, names: Callable[[], tuple[str, ...]]) -> Callable[[str], str]:
    """A check that a text is one of `names()`."""

    def check(name: str) -> str:
        if name in names():
            return name
        raise complaint(f"a known {what}", advice(name, names()), got=name)

    return check


def config_error(found: ValidationError, where: str, keys: Keys) -> ConfigError:
    """Make a `ConfigError` from one finding of a validation: an unknown key, else the first one.

    A misspelt key leads to two findings, an unknown and a missing key. The unknown one names the
    mistake.

    Args:
        found: What pydantic raised.
        where: The file or profile that was read.
        keys: Gives the known keys of a section, named by its path, and the weather's mode.
    """
    findings = found.errors(include_url=False)
    unknown = (finding for finding in findings if finding["type"] == "extra_forbidden")
    first = next(unknown, findings[0])
    path, mode = _path(first)
    expected, got, next_step = _explain(first, path, lambda: keys(tuple(path[:-1]), mode))
    key = first.get("ctx", {}).get("key")
    what = ".".join([*path, key] if key else path)
    return ConfigError.of(what=what, where=where, expected=expected, got=got, next_step=next_step)


def _path(found: ErrorDetails) -> tuple[list[str], str | None]:
    """The key path of a finding, and the mode of the weather or traffic if it lies there.

    Pydantic names the mode after the section, and marks the keys of a mapping.
    """
    path = [str(part) for part in found["loc"] if part != "[key]"]
    if path[:1] in (["weather"], ["traffic"]) and len(path) > 1:
        return path[:1] + path[2:], path[1]
    return path, None


_MODE = 'mode = "presets" or mode = "independent"'
_TYPES = {
    "int_type": "a whole number",
    "float_type": "a number",
    "string_type": "a text in quotes",
    "bool_type": "true or false",
    "dict_type": "a table",
    "model_type": "a table",
    "model_attributes_type": "a table",
    "tuple_type": "a list",
    "finite_number": "a finite number",
    "union_tag_not_found": _MODE,
    "union_tag_invalid": _MODE,
}


def _explain(
    found: ErrorDetails, path: list[str], keys: Callable[[], tuple[str, ...]]
) -> tuple[str, object, str]:
    """Expected, got and next step of one finding."""
    kind, context = found["type"], found.get("ctx", {})
    if kind == _OURS:
        got = _shown(found["input"]) if context["got"] is None else context["got"]
        return context["expected"], got, context["next_step"]
    if kind == "extra_forbidden":
        return "a known key", repr(path[-1]), advice(path[-1], keys())
    if kind == "union_tag_not_found":
        similar = difflib.get_close_matches("mode", map(str, found["input"]), n=1)
        if similar:
            return f"the key mode, {_MODE}", f"the key {similar[0]}", "did you mean mode?"
    if kind == "missing":
        return "a value", "nothing", "add the key"
    if kind in ("too_short", "too_long"):
        number = context["min_length" if kind == "too_short" else "max_length"]
        return f"{number} values", _shown(found["input"]), "correct the list"
    expected = _TYPES.get(kind) or found["msg"].removeprefix("Input should be ")
    return expected, _shown(found["input"]), "correct the value"


def advice(name: str, known: Iterable[str]) -> str:
    """What to do about an unknown name: take the one most like it, or choose from all."""
    by_lower = {candidate.lower(): candidate for candidate in known}
    close = difflib.get_close_matches(name.lower(), by_lower, n=1)
    if close:
        return f"did you mean {by_lower[close[0]]}?"
    return f"choose from {', '.join(by_lower.values())}"


def _shown(value: object) -> str:
    return repr(list(cast("tuple[object, ...]", value)) if isinstance(value, tuple) else value)
