"""Finds sums and products that may leave 32 bits, where clingo would wrap silently.

Every argument has a type with a range. The ranges of variables and of all computed terms follow.
"""

# clingo's syntax trees are typed as nodes of any kind.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from itertools import permutations
from operator import add, mul, sub
from typing import TYPE_CHECKING, Any, NamedTuple

from overtaking.analysis.logic.clauses import declared, kind, reasoner, within
from overtaking.analysis.logic.vocabulary import COUNT, LARGEST

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

Range = tuple[int, int]

_ANY: Range = (-LARGEST - 1, LARGEST)
_EQUAL = 5  # clingo.ast.ComparisonOperator.Equal
_MONOTONE = {3: add, 4: sub, 5: mul}  # clingo.ast.BinaryOperator
_DIVIDED, _MODULO = 6, 7
_NEGATED, _ABSOLUTE = 0, 2  # clingo.ast.UnaryOperator
_ASSIGNMENTS = 8
"""Most assignments in a chain from which the range of a variable follows."""


class Overflow(NamedTuple):
    """A term that may leave 32 bits.

    Attributes:
        text: The term.
        low: The smallest value that it may have.
        high: The largest.
    """

    text: str
    low: int
    high: int


def overflows(trees: Iterable[Any]) -> list[Overflow]:
    """The terms of a rule that may leave 32 bits.

    Args:
        trees: Its head and its body.
    """
    parts = list(trees)
    ranges = ranges_of(parts)
    found = [Overflow(str(tree), *range_of(tree, ranges)) for tree in within(parts)]
    return [one for one in found if one.low < _ANY[0] or one.high > _ANY[1]]


def ranges_of(parts: list[Any]) -> dict[str, Range]:
    """The ranges of the variables of a rule: within the range of every argument that they are."""
    ranges: dict[str, Range] = {}
    for tree in within(parts):
        if kind(tree) == "Function":
            types = declared().get((tree.name, len(tree.arguments)), ())
            for argument, of in zip(tree.arguments, types, strict=False):
                if kind(argument) == "Variable" and not of.names:
                    old = ranges.get(argument.name, _ANY)
                    ranges[argument.name] = (max(old[0], of.low), min(old[1], of.high))
    for _ in range(_ASSIGNMENTS):
        for tree in within(parts):
            for name, found in _assigned(tree, ranges):
                ranges.setdefault(name, found)
    return ranges


def _assigned(tree: Any, ranges: dict[str, Range]) -> Iterator[tuple[str, Range]]:
    """The variables that a comparison or an aggregate assigns, with their ranges."""
    if kind(tree) == "Comparison":
        sides = [tree.term, *(guard.term for guard in tree.guards)]
        is_equation = all(guard.comparison == _EQUAL for guard in tree.guards)
        for one, other in permutations(sides if is_equation else [], 2):
            if kind(one) == "Variable":
                yield one.name, range_of(other, ranges)
    if kind(tree) == "BodyAggregate":
        for guard in (tree.left_guard, tree.right_guard):
            if guard is not None and kind(guard.term) == "Variable":
                yield guard.term.name, (COUNT.low, COUNT.high) if tree.function == 0 else _ANY


def range_of(tree: Any, ranges: dict[str, Range]) -> Range:
    """The smallest and the largest value of a term; (0, 0) for a term that is no number."""
    of = kind(tree)
    if of == "Variable":
        return ranges.get(tree.name, _ANY)
    if of == "SymbolicTerm":
        symbol = tree.symbol
        number = symbol.number if symbol.type == reasoner().SymbolType.Number else 0
        return number, number
    if of == "UnaryOperation":
        return _unary(tree, range_of(tree.argument, ranges))
    if of == "BinaryOperation":
        return _binary(tree, range_of(tree.left, ranges), range_of(tree.right, ranges))
    if of == "Interval":
        left, right = range_of(tree.left, ranges), range_of(tree.right, ranges)
        return min(left[0], right[0]), max(left[1], right[1])
    return 0, 0


def _unary(tree: Any, of: Range) -> Range:
    if tree.operator_type == _ABSOLUTE:
        low = 0 if of[0] <= 0 <= of[1] else min(abs(of[0]), abs(of[1]))
        return low, max(abs(of[0]), abs(of[1]))
    return (-of[1], -of[0]) if tree.operator_type == _NEGATED else _ANY


def _binary(tree: Any, left: Range, right: Range) -> Range:
    operator = tree.operator_type
    if operator in _MONOTONE:  # In each argument: the extremes lie at the ends of the ranges.
        found = [_MONOTONE[operator](a, b) for a in left for b in right]
        return min(found), max(found)
    size = max(abs(left[0]), abs(left[1]))
    if operator == _DIVIDED:
        return -size, size
    if operator == _MODULO:
        most = max(abs(right[0]), abs(right[1]))
        return -most, most
    return _ANY[0] * 2, _ANY[1] * 2  # Powers and bits count as overflows: no query needs them.
