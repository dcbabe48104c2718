"""Entities and relations of the tables, derived from their schemas."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import TYPE_CHECKING

from overtaking.data.tables.columns import names_of, unit_of
from overtaking.data.tables.schemas import KEYS, SCHEMAS

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pyarrow as pa


@dataclass(frozen=True, slots=True, kw_only=True)
class Attribute:
    """A column of a table.

    Attributes:
        name: Its name.
        kind: Its type; `enum` for one of a few names.
        unit: Its unit; 1 for numbers, names and booleans.
        is_key: Whether it is part of the primary key.
        refers_to: The table that it refers to, as all or part of a foreign key; None without one.
    """

    name: str
    kind: str
    unit: str
    is_key: bool
    refers_to: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Relation:
    """A foreign key.

    Attributes:
        one: The table that is referred to.
        many: The table that refers to it.
        columns: The columns of the key.
        is_optional: Whether the key of a row of `many` may be null.
        is_single: Whether a row of `one` has at most one row of `many`.
    """

    one: str
    many: str
    columns: tuple[str, ...]
    is_optional: bool
    is_single: bool


@cache
def entities() -> Mapping[str, tuple[Attribute, ...]]:
    """The columns of every table, in the order of the schemas."""
    return MappingProxyType({name: _attributes(name) for name in SCHEMAS})


@cache
def relations() -> tuple[Relation, ...]:
    """Every relation that two others do not imply."""
    pairs = {
        (one, many): _relation(one, many)
        for many in SCHEMAS
        for one in SCHEMAS
        if one != many and _refers(many, one)
    }
    return tuple(one for one in pairs.values() if not _follows(one, pairs))


def _follows(relation: Relation, pairs: Mapping[tuple[str, str], Relation]) -> bool:
    """Whether two other relations imply a relation and its cardinality."""
    for between in SCHEMAS:
        first = pairs.get((relation.one, between))
        second = pairs.get((between, relation.many))
        if first and second:
            may_be_none = first.is_optional or second.is_optional
            has_one_each = first.is_single and second.is_single
            if may_be_none <= relation.is_optional and relation.is_single <= has_one_each:
                return True
    return False


def _refers(many: str, one: str) -> bool:
    """Whether a table has the primary key of another as a foreign key.

    Of tables with the same primary key, only the first is referred to.
    """
    first = next(name for name in SCHEMAS if KEYS[name] == KEYS[one])
    return one == first and all(
        key in SCHEMAS[many].names and _is_same(SCHEMAS[one].field(key), SCHEMAS[many].field(key))
        for key in KEYS[one]
    )


def _is_same(one: pa.Field, other: pa.Field) -> bool:
    """Whether two columns have the same type and names."""
    return one.type == other.type and names_of(one) == names_of(other)


def _relation(one: str, many: str) -> Relation:
    columns = KEYS[one]
    return Relation(
        one=one,
        many=many,
        columns=columns,
        is_optional=any(SCHEMAS[many].field(column).nullable for column in columns),
        is_single=set(KEYS[many]) == set(columns),
    )


def _attributes(name: str) -> tuple[Attribute, ...]:
    referred = {
        column: relation.one
        for relation in relations()
        if relation.many == name
        for column in relation.columns
    }
    return tuple(
        Attribute(
            name=field.name,
            kind="enum" if names_of(field) else str(field.type).split("[")[0],
            unit=unit_of(field),
            is_key=field.name in KEYS[name],
            refers_to=referred.get(field.name),
        )
        for field in SCHEMAS[name]
    )
