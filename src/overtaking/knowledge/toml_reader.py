"""Reads the TOML files of the knowledge base into typed, frozen values.

Every number in a file is an inline table with at least a value, a unit and a source. An unknown or
missing key, unit or source raises an error here, so callers need not check.

Three forms of a document state unit and source once for many numbers; `load_toml` expands them:

- `[columns]` and `[rows]`: one row for each item, with values in the order of the columns. A
  column has a unit and a source; a column `{}` holds texts or flags.
- `[labels]` and `[quantities]`: one line for each quantity, with a value for each item and with
  unit, source and rationale at its end. An item may state its own source or rationale as a table;
  with a source of its own, it has no rationale but its own. Labels are texts or flags.
- `base = "name"` in a table: the table takes each entry of the table `name`, which stands above it,
  that it does not state itself.
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

DATA_FOLDER = Path(__file__).with_name("data")
"""The folder of the files that are part of the package."""
_SOURCES = "sources.toml"
_ROW_TABLES = {"columns", "rows"}
_LINE_TABLES = {"labels", "quantities"}
_SHARED_KEYS = ("unit", "source", "rationale")


@cache
def load_toml(file: str | Path) -> dict[str, Any]:
    """The content of one knowledge file.

    Args:
        file: A name inside the package's data folder, or an absolute path.

    Returns:
        The TOML document, with tables expanded to one entry a number (see the head of this
        module); callers must not change it.

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
    if document.keys() == _ROW_TABLES:
        return _entries_of_rows(document["columns"], document["rows"], path.name)
    if document.keys() == _LINE_TABLES:
        return _entries_of_lines(document["labels"], document["quantities"], path.name)
    _inherit(document, document, path.name)
    return document


@cache
def sources() -> Mapping[str, Source]:
    """Every source that entries may refer to, by id."""
    return MappingProxyType({id_: _source(id_, item) for id_, item in load_toml(_SOURCES).items()})


def read_record(cls: type[Record], file: str | Path, section: str = "") -> Record:
    """One section of a knowledge file as a frozen dataclass.

    A field of type `Quantity` or `Distribution` keeps unit and source; a field of type `float`,
    `int` or a tuple takes the value alone, in SI or in the unit that its name ends in; `str`,
    `bool` and enumerated fields are names and flags, which have no unit; a field that is itself a
    dataclass is a subsection. A field with a default may be absent.

    Args:
        cls: The dataclass to fill; its field names are the keys of the section.
        file: A name inside the package's data folder, or an absolute path.
        section: Dotted name of the table; empty for the whole file.

    Returns:
        An instance of `cls`.

    Raises:
        KnowledgeError: A key is unknown or missing, or an entry lacks its unit or source.
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
    return _record_from_table(cls, cast("dict[str, Any]", table), where=_entry_place(file, section))


def read_records(cls: type[Record], file: str | Path, section: str = "") -> Mapping[str, Record]:
    """The tables of a section, or of a whole file, by name in the order of the file.

    Args:
        cls: The dataclass to fill for each table.
        file: A name inside the package's data folder, or an absolute path.
        section: Name of the section; empty for the whole file.

    Raises:
        KeyError: There is no such section.
        KnowledgeError: A key is unknown or missing, or an entry lacks its unit or source.
    """
    names = load_toml(file)[section] if section else load_toml(file)
    prefix = f"{section}." if section else ""
    return MappingProxyType({name: read_record(cls, file, f"{prefix}{name}") for name in names})


@cache
def all_quantities(file: str | Path) -> Mapping[str, Quantity | Distribution]:
    """Every number of a knowledge file, by dotted name, in the file's order.

    Args:
        file: A name inside the package's data folder, or an absolute path.

    Returns:
        Dotted name, such as `T.length`, to quantity or distribution.

    Raises:
        KnowledgeError: A number stands alone, or an entry lacks its unit or source.
    """
    return MappingProxyType(dict(_walk(load_toml(file), "", Path(file).name)))


def numbers_below(file: str | Path, section: str) -> dict[str, dict[str, Any]]:
    """The numbers of a section as JSON types, without sources and reasons.

    Args:
        file: A name inside the package's data folder, or an absolute path.
        section: Dotted name of a table.

    Returns:
        Dotted name of each entry below the section, to the fields of its quantity or distribution
        that decide values.

    Raises:
        KnowledgeError: A number stands alone, or an entry lacks its unit or source.
    """
    prefix = f"{section}."
    return {
        name.removeprefix(prefix): entry.numbers()
        for name, entry in all_quantities(file).items()
        if name.startswith(prefix)
    }


def number(path: str) -> float:
    """The value of one scalar quantity of the package's knowledge files.

    Args:
        path: File without suffix and dotted name of the entry, as for `load_quantity`.

    Returns:
        The value in SI, or in the unit that the name carries as a suffix.

    Raises:
        KnowledgeError: There is no such entry, or it is a distribution or a table of numbers.
    """
    return load_quantity(path).number


@cache
def constant(path: str) -> np.float32:
    """The value of one scalar quantity, rounded once to float32, the type of the step.

    Args:
        path: File without suffix and dotted name of the entry, as for `number`.

    Raises:
        KnowledgeError: There is no such entry, or it is a distribution or a table of numbers.
    """
    return np.float32(number(path))


def load_quantity(path: str) -> Quantity:
    """One quantity of the package's knowledge files.

    Args:
        path: File without suffix and dotted name of the entry: `weather.fog.clear_range` is the
            entry `fog.clear_range` of `weather.toml`.

    Raises:
        KnowledgeError: There is no such entry, or it is a distribution.
    """
    stem, _, name = path.partition(".")
    entry = all_quantities(f"{stem}.toml").get(name)
    if isinstance(entry, Quantity):
        return entry
    raise KnowledgeError(
        what="entry",
        where=_entry_place(f"{stem}.toml", name),
        expected="a quantity",
        got="none" if entry is None else f"a {entry.kind} distribution",
        next_step="correct the name, or draw from the distribution",
    )


def _entries_of_rows(
    columns: Mapping[str, dict[str, Any]], rows: Mapping[str, list[Any]], file: str
) -> dict[str, Any]:
    """One table of entries for each row of values in the order of the columns."""
    for name, row in rows.items():
        if len(row) != len(columns):
            raise _wrong_kind(f"{file} [{name}]", f"{len(columns)} values", f"{len(row)} values")
    return {
        name: {
            key: {"value": value, **column} if column else value
            for (key, column), value in zip(columns.items(), row, strict=True)
        }
        for name, row in rows.items()
    }


def _entries_of_lines(
    labels: Mapping[str, dict[str, Any]], quantities: Mapping[str, dict[str, Any]], file: str
) -> dict[str, Any]:
    """One table of entries for each item that the lines name, in the order of the first line."""
    items = list(next(iter(labels.values()), {}))
    document: dict[str, Any] = {item: {} for item in items}
    for name, line in (*labels.items(), *quantities.items()):
        shared = {key: line[key] for key in _SHARED_KEYS if key in line}
        values = {key: value for key, value in line.items() if key not in shared}
        if values.keys() != document.keys():
            raise _wrong_kind(f"{file} [{name}]", f"a value for {', '.join(items)}", list(values))
        for item, value in values.items():
            document[item][name] = value if name in labels else _entry_with_shared(value, shared)
    return document


def _entry_with_shared(value: Any, shared: Mapping[str, str]) -> dict[str, Any]:
    """The entry of one item; its own source and rationale replace the shared ones."""
    if not isinstance(value, dict):
        return {"value": value, **shared}
    entry = cast("dict[str, Any]", value)
    if "source" in entry:
        # The rationale of a line explains the source of the line only.
        shared = {key: text for key, text in shared.items() if key != "rationale"}
    return {**shared, **entry}


def _inherit(table: dict[str, Any], document: Mapping[str, Any], file: str) -> None:
    """Replace each `base` below a table by the entries of the table that it names, in place."""
    for name, item in table.items():
        if not isinstance(item, dict) or is_entry(item):
            continue
        child = cast("dict[str, Any]", item)
        if isinstance(path := child.get("base"), str):
            base = _table_at(document, path, f"{file} [{name}]")
            del child["base"]
            table[name] = child = _merge_tables(base, child)
        _inherit(child, document, file)


def _table_at(document: Mapping[str, Any], path: str, where: str) -> Mapping[str, Any]:
    """The table with a dotted name, whose own base is expanded already."""
    table: Any = document
    for part in path.split("."):
        table = table.get(part) if isinstance(table, dict) else None
    if not isinstance(table, dict) or "base" in table or is_entry(table):
        raise _wrong_kind(where, "as base a table above this one", path)
    return cast("dict[str, Any]", table)


def _merge_tables(base: Mapping[str, Any], table: Mapping[str, Any]) -> dict[str, Any]:
    """The entries of a base, each replaced if the table states it, then the new entries."""
    merged = copy.deepcopy(dict(base))
    for key, item in table.items():
        below = merged.get(key)
        if isinstance(below, dict) and isinstance(item, dict) and not is_entry(item):
            item = _merge_tables(cast("dict[str, Any]", below), cast("dict[str, Any]", item))
        merged[key] = item
    return merged


def _source(id_: str, item: Any) -> Source:
    """One source from its table in the file of sources."""
    if not isinstance(item, dict):
        raise _wrong_kind(f"{_SOURCES} [{id_}]", "a table", item)
    source = _record_from_table(
        Source, {"id": id_, **cast("dict[str, Any]", item)}, where=f"{_SOURCES} [{id_}]"
    )
    if source.kind not in SOURCE_KINDS:
        expected = f"a kind out of {', '.join(SOURCE_KINDS)}"
        raise _wrong_kind(f"{_SOURCES} [{id_}]", expected, source.kind)
    return source


def _entry_place(file: str | Path, name: str) -> str:
    """File and entry or section, for messages."""
    return f"{Path(file).name} [{name}]" if name else Path(file).name


def _walk(
    table: Mapping[str, Any], prefix: str, file: str
) -> Iterator[tuple[str, Quantity | Distribution]]:
    """The entries below a table, depth first."""
    for key, item in table.items():
        name = f"{prefix}{key}"
        if is_entry(item):
            parse = parse_distribution if "distribution" in item else parse_quantity
            yield name, parse(item, name=key, where=f"{file} [{name}]", sources=sources())
        elif isinstance(item, dict):
            yield from _walk(cast("dict[str, Any]", item), f"{name}.", file)
        elif not isinstance(item, str | bool):
            raise _wrong_kind(f"{file} [{name}]", "a table with value, unit and source", item)


def _record_from_table(cls: type[Record], table: Mapping[str, Any], *, where: str) -> Record:
    """An instance of a dataclass from a table whose keys are its fields."""
    fields = {field.name: field for field in dataclasses.fields(cast("Any", cls)) if field.init}
    required = {
        name
        for name, field in fields.items()
        if field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
    }
    _check_keys(set(table), allowed=set(fields), required=required, where=where)
    hints = get_type_hints(cls, localns={"Quantity": Quantity, "Distribution": Distribution})
    values = {
        key: _field_value(item, hints[key], key, f"{where} {key}") for key, item in table.items()
    }
    return cls(**values)


def _check_keys(keys: set[str], *, allowed: set[str], required: set[str], where: str) -> None:
    """KnowledgeError for the first key that is unknown or missing."""
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
    """One item of a table, as the type that its field declares."""
    if isinstance(hint, UnionType):
        hint = get_args(hint)[0]  # The type beside None.
    if hint in (str, bool) or isinstance(hint, EnumType):
        return _text_or_flag(item, hint, where)
    if dataclasses.is_dataclass(hint) and hint not in (Quantity, Distribution):
        if isinstance(item, dict) and not is_entry(item):
            return _record_from_table(
                cast("type[Any]", hint), cast("dict[str, Any]", item), where=where
            )
        raise _wrong_kind(where, "a table", item)
    if not is_entry(item):
        raise _wrong_kind(where, "a table with value, unit and source", item)
    if hint is Distribution:
        return parse_distribution(item, name=name, where=where, sources=sources())
    quantity = parse_quantity(item, name=name, where=where, sources=sources())
    return quantity if hint is Quantity else _bare_value(quantity, hint, where)


def _text_or_flag(item: Any, hint: Any, where: str) -> Any:
    """A name, a flag or a member of an enumeration."""
    if isinstance(hint, EnumType):
        members = [str(cast("Enum", member).value) for member in hint]
        if item in members:
            return hint(item)
        raise _wrong_kind(where, f"one of {', '.join(members)}", item)
    if isinstance(item, hint):
        return item
    raise _wrong_kind(where, f"a {hint.__name__}", item)


def _bare_value(quantity: Quantity, hint: Any, where: str) -> Any:
    """The value of a quantity alone, for a field of type float, int or tuple."""
    value = quantity.value
    is_table = isinstance(value, tuple)
    if is_table != (hint not in (float, int)):
        raise _wrong_kind(where, "a list" if not is_table else "one number", value)
    if hint is not int:
        return value
    if not is_table and value == int(value):
        return int(value)
    raise _wrong_kind(where, "a whole number", value)


def _wrong_kind(where: str, expected: str, got: object) -> KnowledgeError:
    return KnowledgeError(
        what="entry", where=where, expected=expected, got=got, next_step="correct the file"
    )
