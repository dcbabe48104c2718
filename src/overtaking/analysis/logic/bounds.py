"""That no sum and no product leaves 32 bits, where clingo would wrap it without a word.

Every argument has a type with a range; the ranges of variables follow, and with them those of all
terms that are worked out from them.
"""

# clingo's syntax trees are typed as nodes of any kind.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations
from typing import TYPE_CHECKING, Any

from overtaking.analysis.logic.clauses import children, declared, reasoner
from overtaking.analysis.logic.vocabulary import COUNT, LARGEST

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from overtaking.analysis.logic.vocabulary import Type

Range = tuple[int, int]

_ANY: Range = (-LARGEST - 1, LARGEST)
_EQUAL = 5  # clingo.ast.ComparisonOperator.Equal
_PLUS, _MINUS, _TIMES, _DIVIDED, _MODULO = 3, 4, 5, 6, 7  # clingo.ast.BinaryOperator
_NEGATED, _ABSOLUTE = 0, 2  # clingo.ast.UnaryOperator
_ASSIGNMENTS = 8
"""Rounds in which ranges go from one assignment to the next; no rule has a longer chain."""


@dataclass(frozen=True, slots=True)
class Overflow:
    """A term that may leave 32 bits.

    Attributes:
        text: The term.
        low: Least value that it may have.
        high: Largest value that it may have.
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
    found: list[Overflow] = []
    for tree in within(parts):
        low, high = range_of(tree, ranges)
        if low < _ANY[0] or high > _ANY[1]:
            found.append(Overflow(str(tree), low, high))
    return found


def within(trees: Iterable[Any]) -> Iterator[Any]:
    """Syntax trees and all their parts."""
    for tree in trees:
        yield tree
        yield from within(children(tree))


def ranges_of(parts: list[Any]) -> dict[str, Range]:
    """Where the variables of a rule lie: within every argument that they are."""
    kind, ranges = reasoner().ast.ASTType, dict[str, Range]()
    for tree in within(parts):
        if tree.ast_type == kind.Function:
            for argument, of in zip(tree.arguments, _types(tree), strict=False):
                if argument.ast_type == kind.Variable and not of.names:
                    old = ranges.get(argument.name, _ANY)
                    ranges[argument.name] = (max(old[0], of.low), min(old[1], of.high))
    for _ in range(_ASSIGNMENTS):
        for tree in within(parts):
            for name, found in _assigned(tree, ranges):
                ranges.setdefault(name, found)
    return ranges


def _types(function: Any) -> tuple[Type, ...]:
    return declared().get((function.name, len(function.arguments)), ())


def _assigned(tree: Any, ranges: dict[str, Range]) -> Iterator[tuple[str, Range]]:
    """Variables that a comparison or an aggregate gives a value to."""
    kind = reasoner().ast.ASTType
    if tree.ast_type == kind.Comparison:
        sides = [tree.term, *(guard.term for guard in tree.guards)]
        is_equation = all(guard.comparison == _EQUAL for guard in tree.guards)
        for one, other in permutations(sides if is_equation else [], 2):
            if one.ast_type == kind.Variable:
                yield one.name, range_of(other, ranges)
    if tree.ast_type == kind.BodyAggregate:
        for guard in (tree.left_guard, tree.right_guard):
            if guard is not None and guard.term.ast_type == kind.Variable:
                yield guard.term.name, (COUNT.low, COUNT.high) if tree.function == 0 else _ANY


def range_of(tree: Any, ranges: dict[str, Range]) -> Range:
    """The least and the largest value that a term may have; anything else is zero."""
    ast = reasoner().ast
    kind = ast.ASTType
    if tree.ast_type == kind.Variable:
        return ranges.get(tree.name, _ANY)
    if tree.ast_type == kind.SymbolicTerm:
        symbol = tree.symbol
        number = symbol.number if symbol.type == reasoner().SymbolType.Number else 0
        return number, number
    if tree.ast_type == kind.UnaryOperation:
        return _unary(tree, range_of(tree.argument, ranges))
    if tree.ast_type == kind.BinaryOperation:
        return _binary(tree, range_of(tree.left, ranges), range_of(tree.right, ranges))
    if tree.ast_type == kind.Interval:
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
    if operator == _PLUS:
        return left[0] + right[0], left[1] + right[1]
    if operator == _MINUS:
        return left[0] - right[1], left[1] - right[0]
    if operator == _TIMES:
        products = [a * b for a in left for b in right]
        return min(products), max(products)
    size = max(abs(left[0]), abs(left[1]))
    if operator == _DIVIDED:
        return -size, size
    if operator == _MODULO:
        most = max(abs(right[0]), abs(right[1]))
        return -most, most
    return _ANY[0] * 2, _ANY[1] * 2  # Powers and bits: there is no need of them.
