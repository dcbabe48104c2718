"""Checks the requests of a page, once, where they come in."""

from __future__ import annotations

from typing import Annotated, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from overtaking.core.errors import ConfigError

MOST_ROWS = 200
"""Rows of a page of the list."""

MOST_CHANGES = 4
"""Changes of a branch."""

MOST_SQL = 4000
"""Characters of a query."""

Asked = TypeVar("Asked", bound=BaseModel)
Name = Annotated[str, Field(max_length=64)]
Names = Annotated[tuple[Name, ...], Field(max_length=64)]
Number = Annotated[float, Field(allow_inf_nan=False)]
Count = Annotated[int, Field(ge=0, le=2**53)]


class _Asked(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Margin(_Asked):
    """Bounds for the margin of a rule, in its unit; None is no bound."""

    rule: Name
    least: Number | None = None
    most: Number | None = None


class Rows(_Asked):
    """Which simulations to list, and which part of the list.

    A simulation matches a field if it has any of its values; for `rules`, it must break all of
    them. Without a policy, the classes are those under the policy of the page.
    """

    policy: Name | None = None
    classes: Names = ()
    rules: Names = ()
    weather: Names = ()
    light: Names = ()
    ego: Names = ()
    overtaken: Names = ()
    margin: Margin | None = None
    sql: Annotated[str, Field(max_length=MOST_SQL)] = ""
    order: Literal["number", "duration", "margin"] = "number"
    descending: bool = False
    first: Count = 0
    count: Annotated[int, Field(ge=1, le=MOST_ROWS)] = 50
    around: Count | None = None


class Otherwise(_Asked):
    """What is to be otherwise from a frame on: a decision, or the weather of a preset."""

    frame: Count
    decision: Name | None = None
    weather: Name | None = None


class Branch(_Asked):
    """A simulation with one change, or several in turn."""

    changes: Annotated[tuple[Otherwise, ...], Field(min_length=1, max_length=MOST_CHANGES)]


class Futures(_Asked):
    """Outcomes of an overtake that begins at each instant; without a policy, the page's policy."""

    condition_on: Literal["truth", "belief"] = "truth"
    policy: Name | None = None


class Query(_Asked):
    """A question in SQL."""

    sql: Annotated[str, Field(min_length=1, max_length=MOST_SQL)]


class Token(_Asked):
    """What the address of the page was printed with."""

    token: Annotated[str, Field(max_length=200)]


def asked(kind: type[Asked], body: bytes) -> Asked:
    """What the body of a request asks for.

    Raises:
        ConfigError: It is something else.
    """
    try:
        return kind.model_validate_json(body)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False, include_input=False)[0]
        place = ".".join(str(part) for part in first["loc"])
        raise ConfigError(
            what=place or "request",
            where="view",
            expected=f"what the page sends: {first['msg']}",
            got="something else",
            next_step="reload the page",
        ) from None
