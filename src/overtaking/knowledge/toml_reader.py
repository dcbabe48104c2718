"""Reads the TOML files of the knowledge base into typed, frozen values.

The knowledge base is the folder `data`: all numbers about vehicles, drivers, roads, weather and
law. Each number is an entry: an inline table with a unit, a source, and a value or a distribution.

    eye_height = { value = 1.08, unit = "m", source = "aashto-green-book-2018" }
    headway = { distribution = "constant", value = 1.5, unit = "s", source = "..." }

`quantities` parses entries and lists the kinds of distributions with their keys. Values are
converted to SI, unless the name of the entry ends in one of a few units (`core.units`): the value
of `max_rate_mmph` stays in mm/h. An unknown or missing key, unit or source raises an error here, so
callers need not check.

Callers get one number (`number`, `constant`), a quantity with unit and source (`load_quantity`), a
section as a dataclass (`read_record`), or all sections of a file (`read_records`). Dotted names
address nested tables: `fog.clear_range` is the entry `clear_range` of the table `[fog]`.

Three forms of a document state unit and source once for many numbers; `load_toml` expands them to
one entry for each number:

- `[columns]` and `[rows]`: one row for each item, such as a vehicle, with values in the order of
  the columns. A column has a unit and a source; a column `{}` holds texts or flags.
- `[labels]` and `[quantities]`: one line for each quantity, with a value for each item, and with
  unit, source and rationale of all values. An item can replace them: `S = { value = 1.2, source =
  "..." }`. The rationale of the line explains the source of the line, so it does not hold for an
  item with another source. The lines of labels hold texts or flags.
- `base = "name"` in a table: the table takes each entry that it does not state itself from the
  table `name`. A table `name` that has a base itself must stand above the table that names it.
"""

import copy
import dataclasses
import tomllib
from collections.abc import Iterator, Mapping
from enum import Enum, EnumType
from functools import cache
from pathlib import Path
from types import MappingProxyType, UnionType
from typing import Any, TypeVar, cast, get_args, get_type_hints

import numpy as np

from overtaking.core.errors import KnowledgeError
from overtaking.knowledge.quantities import (
    SOURCE_KINDS,
    Distribution,
    Quantity,
    Source,
    is_entry,
    parse_distribution,
    parse_quantity,
)

Record = TypeVar("Record")
"""A dataclass whose fields are the keys of a table."""

DATA_FOLDER = Path(__file__).with_name("data")
"""Folder of the knowledge files of this package."""

_SOURCES_FILE = "sources.toml"
_KEYS_OF_ROW_FORM = {"columns", "rows"}
_KEYS_OF_LINE_FORM = {"labels", "quantities"}
_KEYS_OF_WHOLE_LINE = ("unit", "source", "rationale")


@cache
def load_toml(file: str | Path) -> dict[str, Any]:
    """The content of one knowledge file.

    Args:
        file: A name in `DATA_FOLDER`, or an absolute path.

    Returns:
        The TOML document, in which each number has an entry of its own (the three short forms are
        expanded). It is cached and shared by all callers, which must not change it.

    Raises:
        KnowledgeError: The file is missing or invalid, or a table in it is incomplete.
    """
    path = DATA_FOLDER / file
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, tomllib.TOMLDecodeError) as error:
        raise KnowledgeError(
            what="file",
            where=path.name,
            expected="a readable TOML file",
            got=str(error),
            next_step="restore or correct the file",
        ) from error
    if document.keys() == _KEYS_OF_ROW_FORM:
        return _expand_rows(document["columns"], document["rows"], path.name)
    if document.keys() == _KEYS_OF_LINE_FORM:
        return _expand_lines(document["labels"], document["quantities"], path.name)
    _expand_bases(document, document, path.name)
    return document


@cache
def sources() -> Mapping[str, Source]:
    """Every source that entries may refer to, by id."""
    return MappingProxyType(
        {name: _parse_source(name, item) for name, item in load_toml(_SOURCES_FILE).items()}
    )


def read_record(cls: type[Record], file: str | Path, section: str = "") -> Record:
    """One table of a knowledge file as a frozen dataclass.

    The type of a field decides how its item is read:
        Quantity, Distribution: an entry, with unit and source
        float, int, tuple: the value of an entry without unit and source
        str, bool: a text or a flag without unit
        an enumeration: the value of one of its members
        another dataclass: a nested table, read by the same rules
    A field with a default may be absent from the file.

    Args:
        cls: The dataclass to fill; its field names are the keys of the table.
        file: A name in `DATA_FOLDER`, or an absolute path.
        section: Dotted name of the table; empty for the whole file.

    Returns:
        An instance of `cls`.

    Raises:
        KnowledgeError: A key is unknown or missing, or an entry has no unit or no source.
    """
    table: Any = load_toml(file)
    for part in section.split(".") if section else []:
        table = table.get(part) if isinstance(table, dict) else None
    if not isinstance(table, dict) or is_entry(table):
        raise KnowledgeError(
            what=f"section [{section}]",
            where=Path(file).name,
            expected="a table",
            got="none" if table is None else table,
            next_step="add the section",
        )
    where = _describe_place(file, section)
    return _record_from_table(cls, cast("dict[str, Any]", table), where=where)


def read_records(cls: type[Record], file: str | Path, section: str = "") -> Mapping[str, Record]:
    """All tables of a file, or of one section, as dataclasses by name in the order of the file.

    Args:
        cls: The dataclass to fill for each table, as in `read_record`.
        file: A name in `DATA_FOLDER`, or an absolute path.
        section: Name of the top table that holds the tables; empty for the whole file.

    Returns:
        A read-only mapping from the name of each table.

    Raises:
        KeyError: There is no such section: a mistake of the caller, because the files of the
            package have their sections.
        KnowledgeError: A key is unknown or missing, or an entry has no unit or no source.
    """
    names = load_toml(file)[section] if section else load_toml(file)
    prefix = f"{section}." if section else ""
    return MappingProxyType({name: read_record(cls, file, f"{prefix}{name}") for name in names})


@cache
def all_quantities(file: str | Path) -> Mapping[str, Quantity | Distribution]:
    """Every number of a knowledge file, by dotted name, in the file's order.

    Args:
        file: A name in `DATA_FOLDER`, or an absolute path.

    Returns:
        Dotted name, such as `T.length`, to quantity or distribution.

    Raises:
        KnowledgeError: A number stands alone, or an entry has no unit or no source.
    """
    return MappingProxyType(dict(_parse_entries(load_toml(file), "", Path(file).name)))


def numbers_below(file: str | Path, section: str) -> dict[str, dict[str, Any]]:
    """The numbers of a section as JSON types, without sources and rationales.

    Args:
        file: A name in `DATA_FOLDER`, or an absolute path.
        section: Dotted name of a table.

    Returns:
        Dotted name of each entry within the section, to its numbers and unit by key, such as
        `{"value": 1.2, "sigma": None, "low": 1.0, "high": 1.4, "unit": "m"}`; empty if there is no
        such section. `analysis.reproduction` hashes it: a new rationale leaves the hash as it is.

    Raises:
        KnowledgeError: A number stands alone, or an entry has no unit or no source.
    """
    prefix = f"{section}."
    return {
        name.removeprefix(prefix): entry.numbers()
        for name, entry in all_quantities(file).items()
        if name.startswith(prefix)
    }


def number(path: str) -> float:
    """The value of one quantity of the package's knowledge files.

    Args:
        path: File without suffix and dotted name of the entry, such as "weather.fog.clear_range".

    Returns:
        The value in SI, or in the unit in which the name ends.

    Raises:
        KnowledgeError: There is no such entry, or it is a distribution or a table of numbers.
    """
    return load_quantity(path).number


@cache
def constant(path: str) -> np.float32:
    """The value of one quantity, as `number`, rounded to float32.

    The simulation step and the labels (events and results of overtakes) are computed in float32, in
    Python and in Rust. A product of two Python floats would be rounded to float64 and so differ.

    Args:
        path: File without suffix and dotted name of the entry, such as "weather.fog.clear_range".

    Returns:
        The value in SI, or in the unit in which the name ends.

    Raises:
        KnowledgeError: There is no such entry, or it is a distribution or a table of numbers.
    """
    return np.float32(number(path))


def load_quantity(path: str) -> Quantity:
    """One quantity of the package's knowledge files.

    Args:
        path: File without suffix and dotted name of the entry: "weather.fog.clear_range" is the
            entry `fog.clear_range` of `weather.toml`.

    Returns:
        The quantity, with its unit and source.

    Raises:
        KnowledgeError: There is no such entry, or it is a distribution.
    """
    stem, _, name = path.partition(".")
    entry = all_quantities(f"{stem}.toml").get(name)
    if isinstance(entry, Quantity):
        return entry
    raise KnowledgeError(
        what="entry",
        where=_describe_place(f"{stem}.toml", name),
        expected="a quantity",
        got="none" if entry is None else f"a {entry.kind} distribution",
        next_step="correct the name, or draw from the distribution",
    )


def _expand_rows(
    columns: Mapping[str, dict[str, Any]], rows: Mapping[str, list[Any]], file: str
) -> dict[str, Any]:
    """Expand the form of `[columns]` and `[rows]` to one table of entries for each row.

    Args:
        columns: Name of each column, to its unit and source; to an empty table for texts or flags.
        rows: Name of each item, to its values in the order of the columns.
        file: Name of the file, for messages.
    """
    for name, row in rows.items():
        if len(row) != len(columns):
            raise _error(f"{file} [{name}]", f"{len(columns)} values", f"{len(row)} values")
    return {
        name: {
            key: {"value": value, **column} if column else value
            for (key, column), value in zip(columns.items(), row, strict=True)
        }
        for name, row in rows.items()
    }


def _expand_lines(
    labels: Mapping[str, dict[str, Any]], quantities: Mapping[str, dict[str, Any]], file: str
) -> dict[str, Any]:
    """Expand the form of `[labels]` and `[quantities]` to one table of entries for each item.

    Args:
        labels: Name of each label, to a text or flag for each item.
        quantities: Name of each quantity, to a value for each item, and to `_KEYS_OF_WHOLE_LINE`.
        file: Name of the file, for messages.

    Returns:
        The tables by item, in the order of the first line.
    """
    items = list(next(iter(labels.values()), {}))  # All lines must have the items of the first.
    document: dict[str, Any] = {item: {} for item in items}
    for name, line in (*labels.items(), *quantities.items()):
        shared = {key: line[key] for key in _KEYS_OF_WHOLE_LINE if key in line}
        values = {key: value for key, value in line.items() if key not in shared}
        if values.keys() != document.keys():
            raise _error(f"{file} [{name}]", f"a value for {', '.join(items)}", list(values))
        for item, value in values.items():
            document[item][name] = value if name in labels else _entry_from_line(value, shared)
    return document


def _entry_from_line(value: Any, shared: Mapping[str, str]) -> dict[str, Any]:
    """The entry of one item of a line; keys that the item states replace the keys of the line.

    Args:
        value: The value of the item, or a table with its value and some of the other keys.
        shared: Unit, source and rationale of the line.
    """
    if not isinstance(value, dict):
        return {"value": value, **shared}
    entry = cast("dict[str, Any]", value)
    if "source" in entry:
        # The rationale of a line explains the source of the line only.
        shared = {key: text for key, text in shared.items() if key != "rationale"}
    return {**shared, **entry}


def _expand_bases(table: dict[str, Any], document: Mapping[str, Any], file: str) -> None:
    """Replace each `base` in nested tables by the entries of the table that it names.

    Args:
        table: The table, which is changed; at first the whole document, then the tables in it.
        document: The whole document, in which bases are looked up.
        file: Name of the file, for messages.
    """
    for name, item in table.items():  # The loop replaces values and adds no keys.
        if not isinstance(item, dict) or is_entry(item):
            continue
        child = cast("dict[str, Any]", item)
        if isinstance(path := child.get("base"), str):
            base = _base_table(document, path, f"{file} [{name}]")
            del child["base"]
            table[name] = child = _merge_tables(base, child)
        _expand_bases(child, document, file)


def _base_table(document: Mapping[str, Any], path: str, where: str) -> Mapping[str, Any]:
    """The table with a dotted name.

    Raises:
        KnowledgeError: There is no such table, or its own `base` is not expanded yet, because it
            stands below the table that names it. A table below without a base is accepted.
    """
    table: Any = document
    for part in path.split("."):
        table = table.get(part) if isinstance(table, dict) else None
    if not isinstance(table, dict) or "base" in table or is_entry(table):
        raise _error(where, "as base a table above this one", path)
    return cast("dict[str, Any]", table)


def _merge_tables(base: Mapping[str, Any], table: Mapping[str, Any]) -> dict[str, Any]:
    """The entries of a base in their order, replaced where the table states them, then new entries.

    Drivers' traits are drawn in this order, so a change of it would change every scenario.
    """
    merged = copy.deepcopy(dict(base))
    for key, item in table.items():
        base_item = merged.get(key)
        if isinstance(base_item, dict) and isinstance(item, dict) and not is_entry(item):
            item = _merge_tables(cast("dict[str, Any]", base_item), cast("dict[str, Any]", item))
        merged[key] = item
    return merged


def _parse_source(name: str, item: Any) -> Source:
    """One source from its table in the file of sources; the name of the table is its id."""
    where = f"{_SOURCES_FILE} [{name}]"
    if not isinstance(item, dict):
        raise _error(where, "a table", item)
    table = {"id": name, **cast("dict[str, Any]", item)}
    source = _record_from_table(Source, table, where=where)
    if source.kind not in SOURCE_KINDS:
        raise _error(where, f"a kind out of {', '.join(SOURCE_KINDS)}", source.kind)
    return source


def _describe_place(file: str | Path, name: str) -> str:
    """Name of the file, and of the entry or section in it, for messages."""
    return f"{Path(file).name} [{name}]" if name else Path(file).name


def _parse_entries(
    table: Mapping[str, Any], prefix: str, file: str
) -> Iterator[tuple[str, Quantity | Distribution]]:
    """Parse all entries of a table and of the tables in it, in the order of the file.

    Args:
        table: The table.
        prefix: Dotted name of the table with a dot at its end; empty for a whole file.
        file: Name of the file, for messages.

    Yields:
        Dotted name and number of each entry. Texts and flags are left out.
    """
    for key, item in table.items():
        name = f"{prefix}{key}"
        if is_entry(item):
            parse = parse_distribution if "distribution" in item else parse_quantity
            yield name, parse(item, name=key, where=f"{file} [{name}]", sources=sources())
        elif isinstance(item, dict):
            yield from _parse_entries(cast("dict[str, Any]", item), f"{name}.", file)
        elif not isinstance(item, str | bool):
            raise _error(f"{file} [{name}]", "a table with value, unit and source", item)


def _record_from_table(cls: type[Record], table: Mapping[str, Any], *, where: str) -> Record:
    """An instance of a dataclass from a table whose keys are its fields, as `read_record`."""
    fields = {field.name: field for field in dataclasses.fields(cast("Any", cls)) if field.init}
    required = {
        name
        for name, field in fields.items()
        if field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
    }
    _check_keys(set(table), allowed=set(fields), required=required, where=where)
    # `localns` is for modules that import these types for type checkers only.
    hints = get_type_hints(cls, localns={"Quantity": Quantity, "Distribution": Distribution})
    values = {
        key: _field_value(item, hints[key], key, f"{where} {key}") for key, item in table.items()
    }
    return cls(**values)


def _check_keys(keys: set[str], *, allowed: set[str], required: set[str], where: str) -> None:
    """Raise KnowledgeError for the first key, by alphabet, that is unknown, or else missing."""
    for fault, names in (("unknown key", keys - allowed), ("missing key", required - keys)):
        if names:
            raise KnowledgeError(
                what=f"{fault} {min(names)}",
                where=where,
                expected=f"the keys {', '.join(sorted(allowed))}",
                got=", ".join(sorted(keys)) or "none",
                next_step="correct the file",
            )


def _field_value(item: Any, hint: Any, name: str, where: str) -> Any:
    """One item of a table, converted to the type of its field by the rules of `read_record`.

    Args:
        item: The item, as TOML states it.
        hint: Type of the field.
        name: Name of the field, whose suffix may be a unit.
        where: File, table and field, for messages.
    """
    if isinstance(hint, UnionType):
        hint = get_args(hint)[0]  # `X | None`: TOML has no null, so an item is always an X.
    if hint in (str, bool) or isinstance(hint, EnumType):
        return _text_or_flag(item, hint, where)
    if dataclasses.is_dataclass(hint) and hint not in (Quantity, Distribution):
        if isinstance(item, dict) and not is_entry(item):
            return _record_from_table(
                cast("type[Any]", hint), cast("dict[str, Any]", item), where=where
            )
        raise _error(where, "a table", item)
    if not is_entry(item):
        raise _error(where, "a table with value, unit and source", item)
    if hint is Distribution:
        return parse_distribution(item, name=name, where=where, sources=sources())
    quantity = parse_quantity(item, name=name, where=where, sources=sources())
    return quantity if hint is Quantity else _bare_value(quantity, hint, where)


def _text_or_flag(item: Any, hint: Any, where: str) -> Any:
    """Check a text or flag; for an enumeration, the member with this value."""
    if isinstance(hint, EnumType):
        members = [str(cast("Enum", member).value) for member in hint]
        if item in members:
            return hint(item)
        raise _error(where, f"one of {', '.join(members)}", item)
    if isinstance(item, hint):
        return item
    raise _error(where, f"a {hint.__name__}", item)


def _bare_value(quantity: Quantity, hint: Any, where: str) -> Any:
    """The value of a quantity without unit and source, for a field of type float, int or tuple."""
    value = quantity.value
    expects_number = hint in (float, int)
    if isinstance(value, tuple):
        if expects_number:
            raise _error(where, "one number", value)
        return value
    if not expects_number:
        raise _error(where, "a list", value)
    if hint is float:
        return value
    if value == int(value):
        return int(value)
    raise _error(where, "a whole number", value)


def _error(where: str, expected: str, got: object) -> KnowledgeError:
    return KnowledgeError(
        what="entry", where=where, expected=expected, got=got, next_step="correct the file"
    )
