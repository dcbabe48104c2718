"""Parses a query, and refuses invalid ones."""

# clingo's syntax trees are typed as nodes of any kind.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import difflib
import re
from dataclasses import dataclass
from itertools import permutations
from typing import TYPE_CHECKING, Any

from overtaking.analysis.logic import clauses as programs
from overtaking.analysis.logic.bounds import overflows, range_of, ranges_of
from overtaking.analysis.logic.clauses import kind, reasoner, within
from overtaking.analysis.logic.vocabulary import LARGEST, PREDICATES, Predicate, Type
from overtaking.core.errors import ConfigError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from overtaking.analysis.logic.facts import Demand

ANSWER = "answer__"
"""The predicate of the answers."""

MAX_CHARACTERS = 2000
MAX_DEPTH = 40
"""Of a question, in characters and in brackets within each other."""

_AGGREGATES = ("count", "sum", "min", "max", "true", "false")
_TEXT = re.compile(r'"(?:[^"\\\n]|\\.)*"')
_DIRECTIVE = re.compile(r"#\s*(\w*)")
_NUMBER = re.compile(r"\d+")
_PLACE = re.compile(r":(\d+):(\d+)(?:-[\d:]+)?: error: (.*)", re.DOTALL)
_NOT_EQUAL, _EQUAL = 4, 5  # clingo.ast.ComparisonOperator
_SUMS = (1, 2)  # clingo.ast.AggregateFunction.Sum and SumPlus
_MOST_SUMMED = 2000
"""A sum over every frame of this much stays within 32 bits."""


@dataclass(frozen=True, slots=True)
class Column:
    """A variable of a question.

    Attributes:
        name: Its name.
        kind: Its type; None: computed.
    """

    name: str
    kind: Type | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """A question that can be answered.

    Attributes:
        columns: Its variables, in the order in which they occur.
        demand: The facts that the answer may depend on.
        program: The rules that it may depend on, and the question as one that concludes `ANSWER`.
    """

    columns: tuple[Column, ...]
    demand: Demand
    program: str


def question(text: str) -> Question:
    """Read a question: the body of a rule, in clingo's language.

    Args:
        text: Such as `overtakes(S,ego,P,F), collides(S,ego,_,_)`.

    Raises:
        ConfigError: It is no question, or cannot be true.
        MissingExtraError: clingo is not installed.
    """
    asked = text.strip().removesuffix(".").strip()
    _check_text(asked)
    tree = _parsed(asked)
    types = _checked_types(tree)
    for one in overflows([tree.head, *tree.body]):
        raise refused(f"{one.text}, which may be {max(one.high, -one.low):.3g}", _WITHIN)
    _check_sums(tree)
    names = list(variables_of(tree.body))
    columns = tuple(Column(name, types.get(name)) for name in names)
    head = f"{ANSWER}({','.join(names)})" if names else ANSWER
    rule = f"{head} :-\n{asked}\n."
    rules = (*programs.knowledge(), *programs.clauses(rule))
    found = programs.needed(rules, [(ANSWER, (None,) * len(names))])
    return Question(columns=columns, demand=found.demand, program=found.text)


_WITHIN = f"numbers up to {LARGEST}, which is all that clingo's integers hold"


def refused(got: str, expected: str, next_step: str = "correct the query") -> ConfigError:
    """The error of a question that is none."""
    return ConfigError(what="query", where="ask", expected=expected, got=got, next_step=next_step)


def _check_text(text: str) -> None:
    """Refuse any text that could be more than a condition, before clingo reads it."""
    if not text:
        raise refused("nothing", "a condition such as overtakes(S,A,B,F)")
    if len(text) > MAX_CHARACTERS:
        raise refused(f"{len(text)} characters", f"at most {MAX_CHARACTERS} characters")
    bare = _TEXT.sub('""', text)
    _check_depth(bare)
    _check_numbers(bare)
    for found in _DIRECTIVE.finditer(bare):
        if found[1] not in _AGGREGATES:
            raise refused(
                f"#{found[1]} at column {found.start() + 1}", "no directive and no script"
            )
    for sign, what in (("@", "an external function"), ("%", "a comment"), ("&", "a theory atom")):
        if sign in bare:
            raise refused(f"{what} at column {bare.index(sign) + 1}", "a condition")


def _check_numbers(text: str) -> None:
    """Refuse numbers that clingo would wrap."""
    for found in _NUMBER.finditer(text):
        if len(found[0]) > len(str(LARGEST)) or int(found[0]) > LARGEST:
            raise refused(found[0], _WITHIN)


def _check_depth(text: str) -> None:
    """Refuse brackets nested so deeply that a parser could fail."""
    depth = 0
    for character in text:
        depth += (character in "([{|") - (character in ")]}")
        if depth > MAX_DEPTH:
            raise refused("more", f"at most {MAX_DEPTH} brackets within each other")


def _parsed(text: str) -> Any:
    """The question as the body of one rule."""
    ast, said, trees = reasoner().ast, list[str](), list[Any]()
    try:
        ast.parse_string(
            f"{ANSWER} :-\n{text}\n.", trees.append, logger=lambda _, line: said.append(line)
        )
    except RuntimeError:
        raise refused(located(said, text), "a condition in clingo's language") from None
    rules = [tree for tree in trees if kind(tree) != "Program"]
    if len(rules) != 1 or kind(rules[0]) != "Rule":
        raise refused(f"{len(rules)} statements", "one condition")
    return rules[0]


def located(said: list[str], text: str) -> str:
    """A message of clingo, with the column in the question."""
    for line in said:
        found = _PLACE.search(line)
        if found is None:
            continue
        what = " ".join(found[3].split())
        lines = text.splitlines()
        row, column = int(found[1]) - 2, int(found[2])
        if row >= len(lines):
            return f"{what} at its end"
        where = f"column {column}" if len(lines) == 1 else f"line {row + 1}, column {column}"
        return f"{what} at {where}"
    return "an error"


def _checked_types(tree: Any) -> dict[str, Type]:
    """The type of each variable of a question.

    Raises:
        ConfigError: A predicate is unknown, an argument cannot be a constant, or a variable has
            two types.
    """
    types, first_atoms = dict[str, Type](), dict[str, str]()
    constants = dict[str, frozenset[str]]()
    for function in _functions(tree.body):
        signature = function.name, len(function.arguments)
        predicate = _predicate_of(function)
        for place, (label, argument_type) in enumerate(predicate.arguments):
            argument = function.arguments[place]
            possible = programs.possible_constants().get((*signature, place), frozenset())
            if kind(argument) != "Variable":
                _check_constants(argument, argument_type, possible, f"{label} in {predicate.head}")
            if kind(argument) != "Variable" or argument.name == "_":
                continue
            name = argument.name
            constants[name] = constants.get(name, possible) & possible
            if types.setdefault(name, argument_type) != argument_type:
                old = types[name].name
                conflict = (
                    f"{name}, a {old} in {first_atoms[name]}, and a {argument_type.name} in "
                    f"{predicate.head}"
                )
                raise refused(conflict, "each variable to be one kind of thing")
            first_atoms.setdefault(name, predicate.head)
    compared = [pair for pair in _compared_terms(tree.body) if pair[0] in types]
    for name, term in compared:
        _check_constants(term, types[name], constants[name], f"{name} in {first_atoms[name]}")
    return types


def _predicate_of(function: Any) -> Predicate:
    """The predicate of an atom in a question.

    Raises:
        ConfigError: The predicate is unknown.
    """
    signature = function.name, len(function.arguments)
    if signature not in PREDICATES:
        raise _unknown(*signature, function.location.begin.column)
    return PREDICATES[signature]


def _alternatives(term: Any) -> Iterator[Any]:
    """The alternatives of a pool such as `(l1;l2)`; the term itself if it is no pool."""
    if kind(term) == "Pool":
        for part in term.arguments:
            yield from _alternatives(part)
    else:
        yield term


def _compared_terms(trees: Any) -> Iterator[tuple[str, Any]]:
    """Each variable that is compared by `=` or `!=`, with the term on the other side."""
    for tree in within(trees):
        if kind(tree) == "Comparison" and len(tree.guards) == 1:
            (guard,) = tree.guards
            sides = (tree.term, guard.term) if guard.comparison in (_NOT_EQUAL, _EQUAL) else ()
            for side, opposite in permutations(sides, 2):
                if kind(side) == "Variable":
                    yield side.name, opposite


def _check_constants(term: Any, argument_type: Type, possible: frozenset[str], place: str) -> None:
    """Call `_check_constant` for each alternative of a pool, or for the term itself."""
    for alternative in _alternatives(term):
        _check_constant(alternative, argument_type, possible, place)


def _check_constant(term: Any, argument_type: Type, possible: frozenset[str], place: str) -> None:
    """Refuse a constant that an argument can never have.

    Args:
        term: The argument, or the term with which its variable is compared.
        argument_type: Type of the argument.
        possible: Constants that the argument can have.
        place: Name of the argument and its atom, for the message.

    Raises:
        ConfigError: The constant is impossible.
    """
    # The value of a term with a variable is not known before the query runs.
    if any(kind(part) == "Variable" for part in within([term])):
        return
    if argument_type.names:
        if str(term) not in possible:
            ordered = _nearest_first(
                str(term), [name for name in argument_type.names if name in possible]
            )
            raise refused(str(term), f"{place} to be one of {', '.join(ordered)}")
        return
    if str(term) == "ego":
        return
    is_symbol = kind(term) == "SymbolicTerm" and term.symbol.type != reasoner().SymbolType.Number
    if is_symbol or kind(term) == "Function":
        raise refused(str(term), f"{place} to be a number, {argument_type.about}")
    low, high = range_of(term, {})
    if high < argument_type.low or low > argument_type.high:
        raise refused(
            str(term),
            f"{place} to be {argument_type.low} to {argument_type.high}, {argument_type.about}",
        )


def _nearest_first(unknown_name: str, names: list[str]) -> list[str]:
    """The names, those that resemble `unknown_name` first."""
    near = difflib.get_close_matches(unknown_name.lower(), names, n=3, cutoff=0.5)
    return [*near, *(name for name in names if name not in near)]


def _unknown(name: str, arity: int, column: int) -> ConfigError:
    known = PREDICATES.values()
    near = difflib.get_close_matches(name, [one.name for one in known], n=3, cutoff=0.5)
    same = [one.head for one in known if one.name == name]
    guesses = same or [one.head for one in known if one.name in near]
    expected = " or ".join(guesses[:3]) or "a predicate of facts, theory or law"
    return refused(
        f"{name} with {arity} argument{'' if arity == 1 else 's'} at column {column}",
        expected,
        "see: overtaking ask --predicates",
    )


def _functions(trees: Any) -> Iterator[Any]:
    """The atoms of a question."""
    for tree in within(trees):
        if kind(tree) == "SymbolicAtom":
            if kind(tree.symbol) != "Function":
                raise refused(str(tree), "plain atoms, without pools and without minus")
            yield tree.symbol


def variables_of(trees: Any) -> Iterator[str]:
    """The variables outside of aggregates and conditions, each once, in order.

    Variables that occur in negated literals only are left out: nothing binds them.
    """
    seen = {"_"}
    for tree in trees:
        is_negated = kind(tree) == "Literal" and tree.sign
        for name in () if is_negated else _variables_in(tree):
            if name not in seen:
                seen.add(name)
                yield name


def _variables_in(tree: Any) -> Iterator[str]:
    """The variables of a literal, without those that are local to an aggregate."""
    if kind(tree) == "Variable":
        yield tree.name
    elif kind(tree) == "BodyAggregate":
        for guard in (tree.left_guard, tree.right_guard):
            if guard is not None:
                yield from _variables_in(guard.term)
    elif kind(tree) not in ("ConditionalLiteral", "Aggregate"):
        for part in programs.children(tree):
            yield from _variables_in(part)


def _check_sums(tree: Any) -> None:
    """Refuse sums of large numbers: over all frames they could wrap."""
    ranges = ranges_of([tree.head, *tree.body])
    for part in within(tree.body):
        if kind(part) == "BodyAggregate" and part.function in _SUMS:
            for element in part.elements:
                low, high = range_of(element.terms[0], ranges) if element.terms else (0, 0)
                if max(-low, high) > _MOST_SUMMED:
                    raise refused(str(part), f"sums of numbers up to {_MOST_SUMMED}, as of #count")
