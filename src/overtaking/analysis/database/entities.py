"""Entities and relations, derived from the schemas of the tables and from nothing else."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
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
        kind: Its type; `enum` if it names one of a few things.
        unit: Its unit; 1 for numbers, names and yes or no.
        is_key: Whether it is part of what names a row.
        refers_to: The table whose row it names, alone or with others; None if it names none.
    """

    name: str
    kind: str
    unit: str
    is_key: bool
    refers_to: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Entity:
    """A table.

    Attributes:
        name: Its name.
        attributes: Its columns, in their order.
    """

    name: str
    attributes: tuple[Attribute, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Relation:
    """A row of one table has rows of another.

    Attributes:
        one: The table whose row is named.
        many: The table whose rows name it.
        columns: The columns by which they do.
        is_optional: Whether a row of `many` may name none.
        is_single: Whether a row of `one` has at most one.
    """

    one: str
    many: str
    columns: tuple[str, ...]
    is_optional: bool
    is_single: bool


@cache
def entities() -> tuple[Entity, ...]:
    """Every table, in the order of the schemas."""
    return tuple(_entity(name) for name in SCHEMAS)


@cache
def relations() -> tuple[Relation, ...]:
    """Every relation that does not follow from two others."""
    pairs = {
        (one, many): _relation(one, many)
        for many in SCHEMAS
        for one in SCHEMAS
        if one != many and _refers(many, one)
    }
    return tuple(one for one in pairs.values() if not _follows(one, pairs))


def _follows(relation: Relation, pairs: Mapping[tuple[str, str], Relation]) -> bool:
    """Whether a relation, and how many rows it joins, follows from two others."""
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
    """Whether the columns that name a row of one table are columns of another.

    Of the tables whose rows have the same names, only the first is referred to.
    """
    first = next(name for name in SCHEMAS if KEYS[name] == KEYS[one])
    return one == first and all(
        key in SCHEMAS[many].names and _is_same(SCHEMAS[one].field(key), SCHEMAS[many].field(key))
        for key in KEYS[one]
    )


def _is_same(one: pa.Field, other: pa.Field) -> bool:
    """Whether two columns hold names of the same things."""
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


def _entity(name: str) -> Entity:
    referred = {
        column: relation.one
        for relation in relations()
        if relation.many == name
        for column in relation.columns
    }
    return Entity(
        name=name,
        attributes=tuple(
            Attribute(
                name=field.name,
                kind="enum" if names_of(field) else str(field.type).split("[")[0],
                unit=unit_of(field),
                is_key=field.name in KEYS[name],
                refers_to=referred.get(field.name),
            )
            for field in SCHEMAS[name]
        ),
    )
