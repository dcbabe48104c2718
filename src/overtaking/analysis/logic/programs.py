"""The logic programs: their predicates and rules, dependencies of rules, and ranges of values.

The programs are in the language of clingo, answer set programming (ASP). A rule `head :- body.`
concludes its head where all literals of its body hold. An atom is a predicate with its arguments,
such as `target(S,2)`; capitals begin variables. A literal is an atom, a comparison or an aggregate
such as `N = #count{...}`, or the negation of one. A guard is the side with which a comparison or an
aggregate is compared. A pool `p(1;2)` stands for `p(1)` and `p(2)`.

In a program, a comment that begins with `%:` declares a predicate with the types of its arguments,
and with labels and a meaning if queries may name it. A comment that begins with `%~` is a gloss: a
sentence about an instance of the rule below it.
"""

# clingo's syntax trees are typed as nodes of any kind.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import atexit
import re
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from itertools import permutations
from operator import add, mul, sub
from typing import TYPE_CHECKING, Any, NamedTuple, TypeGuard

from overtaking.analysis.logic.fact_files import (
    FACTS,
    PROGRAM_FOLDER,
    ArgumentPattern,
    RequestedFacts,
)
from overtaking.analysis.logic.vocabulary import ARGUMENT_TYPES, COUNT, MAX_INT, Predicate
from overtaking.core.errors import MissingExtraError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from overtaking.analysis.logic.vocabulary import ArgumentType, Signature

PROGRAM_FILES = ("theory.lp", "law.lp")
"""The programs that queries may use, in `PROGRAM_FOLDER`."""

# Such as `%: in_lane(S: simulation, V: vehicle)  V is in a lane.`, or `%: two_way_road()` without
# labels and meaning. The groups are name, arguments and meaning.
_DECLARATION = re.compile(r"^%: (\w+)\(([^)]*)\)(?:  (.+))?$", re.MULTILINE)
_GLOSS_PREFIX = "%~ "
# The first line of each program for clingo: a query may contain the name `ego`. In the theory and
# the law, `parse_rules` replaces the names of constants by values.
_PREAMBLE = "#const ego = 0.\n"


def import_clingo() -> Any:
    """The module clingo.

    Raises:
        MissingExtraError: clingo is not installed.
    """
    try:
        clingo = import_module("clingo")
        import_module("clingo.ast")
    except ImportError:
        raise MissingExtraError.for_extra(
            "logic", what="clingo, the reasoner", where="logic"
        ) from None
    return clingo


def _read_program(file: str) -> str:
    return (PROGRAM_FOLDER / file).read_text(encoding="utf-8")


def declared_predicates(program: str) -> tuple[Predicate, ...]:
    """The predicates that the comments of a program declare.

    A predicate without a meaning is internal. It has no labels; its arguments are labelled by
    position.
    """
    predicates: list[Predicate] = []
    for name, arguments, meaning in _DECLARATION.findall(program):
        labelled = [part.strip().rpartition(": ") for part in arguments.split(",") if part]
        predicates.append(
            Predicate(
                name=name,
                meaning=meaning,
                arguments={
                    label or str(position): ARGUMENT_TYPES[type_name]
                    for position, (label, _, type_name) in enumerate(labelled)
                },
            )
        )
    return tuple(predicates)


def _queryable(file: str) -> tuple[Predicate, ...]:
    return tuple(
        predicate for predicate in declared_predicates(_read_program(file)) if predicate.meaning
    )


THEORY_PREDICATES, LAW_PREDICATES = (_queryable(file) for file in PROGRAM_FILES)
PREDICATES = {
    predicate.signature: predicate
    for predicate in (*FACTS.values(), *THEORY_PREDICATES, *LAW_PREDICATES)
}
"""Every predicate that a query may name."""


@cache
def argument_types() -> Mapping[Signature, tuple[ArgumentType, ...]]:
    """The types of the arguments of all predicates, also of the internal ones of the programs."""
    declared = (
        predicate
        for file in PROGRAM_FILES
        for predicate in declared_predicates(_read_program(file))
    )
    return {predicate.signature: predicate.types for predicate in (*PREDICATES.values(), *declared)}


@dataclass(frozen=True, slots=True)
class Atom:
    """A predicate in a rule.

    Attributes:
        name: Its name.
        arguments: The text of each constant, the name of each variable; None for a computed term.
    """

    name: str
    arguments: ArgumentPattern

    @property
    def signature(self) -> Signature:
        """Name and number of arguments."""
        return self.name, len(self.arguments)

    def pattern(self, binding: Mapping[str, str]) -> ArgumentPattern:
        """Its arguments as a pattern: constants, values of bound variables, None for any value."""
        return tuple(
            binding.get(argument) if _is_variable(argument) else argument
            for argument in self.arguments
        )


def _is_variable(argument: str | None) -> TypeGuard[str]:
    """Whether an argument of an atom is a variable, which begins with a capital letter."""
    return argument is not None and (argument == "_" or argument.lstrip("_")[:1].isupper())


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramRule:
    """A rule of a program.

    Attributes:
        tree: Its syntax tree.
        text: The rule as clingo prints it.
        gloss: A sentence about an instance, with variables in braces; may be empty.
        heads: Its conclusion; several only for a fact with a pool, such as `rule(l1;l2).`.
        body: All atoms that it reads, also negated ones and those in aggregates.
    """

    tree: Any
    text: str
    gloss: str
    heads: tuple[Atom, ...]
    body: tuple[Atom, ...]

    @property
    def positive_atoms(self) -> tuple[Atom, ...]:
        """The atoms of the body that must hold: neither negated nor within an aggregate."""
        trees = [
            literal.atom
            for literal in self.tree.body
            if node_kind(literal) == "Literal" and not literal.sign
        ]
        return tuple(_atoms_in(tree for tree in trees if node_kind(tree) == "SymbolicAtom"))

    def bindings(self, name: str, pattern: ArgumentPattern) -> Iterator[dict[str, str]]:
        """For each head that can match an atom, the values that the match gives to its variables.

        Args:
            name: Predicate of the atom.
            pattern: Constants of the atom; None for an argument of any value.
        """
        for head in self.heads:
            if head.signature != (name, len(pattern)):
                continue
            pairs = [
                (argument, constant)
                for argument, constant in zip(head.arguments, pattern, strict=True)
                if constant
            ]
            binding = {argument: constant for argument, constant in pairs if _is_variable(argument)}
            # A computed argument, None, may have any value.
            if all(
                argument in (None, constant) or argument in binding for argument, constant in pairs
            ):
                yield binding


@cache
def rules_of_program(file: str) -> tuple[ProgramRule, ...]:
    """The rules of one of `PROGRAM_FILES`."""
    return parse_rules(_read_program(file))


@cache
def rules_for_queries() -> tuple[ProgramRule, ...]:
    """The rules that queries may use."""
    return tuple(rule for file in PROGRAM_FILES for rule in rules_of_program(file))


# At exit, clingo may be unloaded before its syntax trees, each of which then prints an error. So
# the trees are released first.
atexit.register(rules_of_program.cache_clear)
atexit.register(rules_for_queries.cache_clear)


def parse_rules(program: str) -> tuple[ProgramRule, ...]:
    """The rules of a valid program, with values in place of the constants that it defines.

    A rule in which values replace the names of constants needs no `#const` of its program. So a
    few rules can run without the rest of it, and the ranges of their terms follow from their text.
    """
    ast, lines = import_clingo().ast, program.splitlines()
    statements: list[Any] = []
    ast.parse_string(program, statements.append)
    values = {
        statement.name: statement.value
        for statement in statements
        if node_kind(statement) == "Definition"
    }
    trees = [
        _with_constants_replaced(statement, values)
        for statement in statements
        if node_kind(statement) == "Rule"
    ]
    return tuple(
        ProgramRule(
            tree=tree,
            text=str(tree),
            gloss=_gloss_above(lines, tree.location.begin.line),
            heads=tuple(_atoms_in([tree.head])),
            body=tuple(_atoms_in(tree.body)),
        )
        for tree in trees
    )


def _with_constants_replaced(tree: Any, values: Mapping[str, Any]) -> Any:
    """The same tree with the value of each constant that `#const` defines."""

    class Replacement(import_clingo().ast.Transformer):
        def visit_SymbolicTerm(self, node: Any) -> Any:
            return values.get(str(node.symbol), node)

    return Replacement().visit(tree)


def _gloss_above(lines: list[str], line_number: int) -> str:
    """The gloss in the line above a rule; empty if that line is no gloss."""
    line_above = lines[line_number - 2] if line_number > 1 else ""
    return line_above.removeprefix(_GLOSS_PREFIX) if line_above.startswith(_GLOSS_PREFIX) else ""


def _atoms_in(trees: Iterable[Any]) -> Iterator[Atom]:
    """All atoms in syntax trees, in order; a pool such as rule(l1;l2) gives one for each member."""
    for tree in walk(trees):
        if node_kind(tree) == "SymbolicAtom":
            symbol = tree.symbol
            functions = symbol.arguments if node_kind(symbol) == "Pool" else (symbol,)
            for function in functions:
                arguments = (_argument_text(argument) for argument in function.arguments)
                yield Atom(function.name, tuple(arguments))


def _argument_text(tree: Any) -> str | None:
    """An argument of an atom, as in `Atom`."""
    if node_kind(tree) == "Variable":
        return tree.name
    return str(tree.symbol) if node_kind(tree) == "SymbolicTerm" else None


def node_kind(tree: Any) -> str:
    """The kind of a syntax tree, a name of `clingo.ast.ASTType`."""
    return tree.ast_type.name


def walk(trees: Iterable[Any]) -> Iterator[Any]:
    """Syntax trees and all their parts, in order."""
    for tree in trees:
        yield tree
        yield from walk(children(tree))


def children(tree: Any) -> Iterator[Any]:
    """The parts of a syntax tree, in order."""
    node_class = import_clingo().ast.AST
    for key in tree.child_keys:
        part = getattr(tree, key)
        if isinstance(part, node_class):
            yield part
        elif part is not None:
            yield from part


@dataclass(frozen=True, slots=True, kw_only=True)
class NeededRules:
    """The rules and facts that a query or a law needs.

    Attributes:
        rules: The rules that the answer may depend on.
        requested_facts: The facts that they read.
    """

    rules: tuple[ProgramRule, ...]
    requested_facts: RequestedFacts

    @property
    def program(self) -> str:
        """The rules as a program.

        `#defined` declares the predicates of facts. Without it, clingo would report each predicate
        without facts, and `ProgramError` would repeat these messages beside the error.
        """
        defined = "".join(
            f"#defined {name}/{len(FACTS[name].arguments)}.\n"
            for name in self.requested_facts.patterns
        )
        return _PREAMBLE + defined + "\n".join(rule.text for rule in self.rules) + "\n"


def rules_needed_by(
    goals: Iterable[tuple[str, ArgumentPattern]], rules: Iterable[ProgramRule]
) -> NeededRules:
    """The rules and facts that goals depend on.

    Constants are propagated from the goals into the rules, so that a query about one rule of law
    reads only the facts of that rule. The facts may be too few for other conclusions of the same
    rules, such as about another rule of law.

    Args:
        goals: Predicates with the constants that their arguments must be.
        rules: The rules to choose from.
    """
    all_rules, pending = tuple(rules), list(goals)
    visited, needed = set[tuple[str, ArgumentPattern]](), set[int]()
    while pending:
        goal = pending.pop()
        if goal in visited:
            continue
        visited.add(goal)
        for index, rule in enumerate(all_rules):
            for binding in rule.bindings(*goal):
                needed.add(index)
                pending += [(atom.name, atom.pattern(binding)) for atom in rule.body]
    patterns: dict[str, frozenset[ArgumentPattern]] = {}
    for name, pattern in visited:
        if name in FACTS and len(pattern) == len(FACTS[name].arguments):
            patterns[name] = patterns.get(name, frozenset()) | {pattern}
    return NeededRules(
        rules=tuple(all_rules[index] for index in sorted(needed)),
        requested_facts=RequestedFacts(patterns=patterns),
    )


ArgumentPosition = tuple[str, int, int]
"""Name and number of arguments of a predicate, and the position of one argument."""


@cache
def possible_constants() -> dict[ArgumentPosition, frozenset[str]]:
    """The constants that each argument of a predicate can have, in facts and in conclusions.

    A conclusion has the constants in the head of its rule. A variable in the head has the
    constants that the positive atoms of the body allow. Conclusions of one rule are atoms of
    others, so the loop repeats until no constant is added.

    Returns:
        The constants by argument. Arguments that are numbers are left out.
    """
    constants = _constants_of_facts()
    rules = [(head, rule.positive_atoms) for rule in rules_for_queries() for head in rule.heads]
    is_growing = True
    while is_growing:
        is_growing = False
        for head, body in rules:
            for position, argument in enumerate(head.arguments):
                key = (*head.signature, position)
                if key not in constants:
                    continue
                new = _constants_of(argument, body, constants) - constants[key]
                if new:
                    is_growing, constants[key] = True, constants[key] | new
    return constants


def _constants_of_facts() -> dict[ArgumentPosition, frozenset[str]]:
    """`possible_constants` of facts; empty sets for predicates that only rules conclude."""
    constants = {
        (*signature, position): frozenset[str]()
        for signature, types in argument_types().items()
        for position, argument_type in enumerate(types)
        if argument_type.constants
    }
    for fact in FACTS.values():
        for position, (label, argument_type) in enumerate(fact.arguments.items()):
            if argument_type.constants:
                constants[*fact.signature, position] = fact.constants(label)
    return constants


def _constants_of(
    argument: str | None,
    body: Iterable[Atom],
    constants: Mapping[ArgumentPosition, frozenset[str]],
) -> frozenset[str]:
    """The constants that an argument of a head can have.

    Args:
        argument: A constant, a variable, or None for any other term.
        body: The positive atoms of the rule.
        constants: The constants found so far for the arguments of these atoms.
    """
    if not _is_variable(argument):
        return frozenset() if argument is None else frozenset([argument])
    values = [
        constants[key]
        for atom in body
        for position, body_argument in enumerate(atom.arguments)
        if body_argument == argument and (key := (*atom.signature, position)) in constants
    ]
    return frozenset.intersection(*values) if values else frozenset()


# Ranges. clingo wraps integers beyond 32 bits silently, so no term of a program may leave them.


class ValueRange(NamedTuple):
    """The smallest and the largest value of a term."""

    low: int
    high: int


_INT32 = ValueRange(-MAX_INT - 1, MAX_INT)
_NO_NUMBER = ValueRange(0, 0)
_COUNT_RANGE = ValueRange(COUNT.low, COUNT.high)

# Values of enumerations of clingo.ast. They are numbers here, because clingo is an optional package
# that this module must not import before rules are parsed.
_EQUAL = 5  # ComparisonOperator.Equal
_MONOTONE_OPERATORS = {3: add, 4: sub, 5: mul}  # BinaryOperator: Plus, Minus, Multiplication
_DIVISION, _MODULO = 6, 7  # BinaryOperator
_NEGATION, _ABSOLUTE = 0, 2  # UnaryOperator: Minus, Absolute
_COUNT_AGGREGATE = 0  # AggregateFunction.Count


class Overflow(NamedTuple):
    """A term that may leave 32 bits.

    Attributes:
        text: The term.
        low: The smallest value that it may have.
        high: The largest value that it may have.
    """

    text: str
    low: int
    high: int


def overflows(
    trees: Iterable[Any], types: Mapping[Signature, tuple[ArgumentType, ...]]
) -> list[Overflow]:
    """The terms of a rule that may leave 32 bits.

    Args:
        trees: Head and body of the rule.
        types: Types of the arguments of its predicates, such as `argument_types()`.
    """
    parts = list(trees)
    ranges = variable_ranges(parts, types)
    terms = [Overflow(str(tree), *term_range(tree, ranges)) for tree in walk(parts)]
    return [term for term in terms if term.low < _INT32.low or term.high > _INT32.high]


def variable_ranges(
    trees: Iterable[Any], types: Mapping[Signature, tuple[ArgumentType, ...]]
) -> dict[str, ValueRange]:
    """The ranges of the variables of a rule.

    The range of a variable is the intersection of the types of the arguments at which it occurs. A
    variable that is no argument of a predicate has the range of the comparison or count that
    assigns it.

    Args:
        trees: As in `overflows`.
        types: As in `overflows`.
    """
    parts, ranges = list(trees), dict[str, ValueRange]()
    for tree in walk(parts):
        if node_kind(tree) == "Function":
            argument_types_of_tree = types.get((tree.name, len(tree.arguments)), ())
            # An undeclared predicate has no types.
            for argument, argument_type in zip(
                tree.arguments, argument_types_of_tree, strict=False
            ):
                if node_kind(argument) == "Variable" and not argument_type.constants:
                    low, high = ranges.get(argument.name, _INT32)
                    ranges[argument.name] = ValueRange(
                        max(low, argument_type.low), min(high, argument_type.high)
                    )
    required_literals, local_literals = _literals_by_scope(parts)
    _add_assigned_ranges(required_literals, ranges)
    # A condition within an aggregate, such as `Z = 5` in `#count{Z : Z = 5}`, holds only there. It
    # comes second, so that it does not bound a variable that the rule assigns outside.
    _add_assigned_ranges(local_literals, ranges)
    return ranges


def _literals_by_scope(trees: list[Any]) -> tuple[list[Any], list[Any]]:
    """The literals that must hold in each instance of the rule, and the literals within literals.

    Negated literals are left out: `not Z = 5` assigns nothing.
    """
    literals = [tree for tree in walk(trees) if node_kind(tree) == "Literal" and not tree.sign]
    top_level = {id(tree) for tree in trees}
    return (
        [literal for literal in literals if id(literal) in top_level],
        [literal for literal in literals if id(literal) not in top_level],
    )


def _add_assigned_ranges(literals: Iterable[Any], ranges: dict[str, ValueRange]) -> None:
    """Add the ranges of variables that comparisons and aggregates among the literals assign."""
    pending = [pair for literal in literals for pair in _assignments(literal.atom)]
    # A variable may be assigned from a variable that a later literal assigns. So the loop repeats
    # until no further assignment has all its variables bounded. Other variables stay without a
    # range: they can have any value.
    while True:
        bounded = [pair for pair in pending if _variable_names(pair[1]) <= ranges.keys()]
        if not bounded:
            return
        for name, term in bounded:
            low, high = _COUNT_RANGE if term is None else term_range(term, ranges)
            # `overflows` reports the term itself if it may leave 32 bits. Without the cut, a chain
            # of squares would double the digits of the range with each variable.
            ranges.setdefault(name, ValueRange(max(low, _INT32.low), min(high, _INT32.high)))
        pending = [pair for pair in pending if pair[0] not in ranges]


def _variable_names(term: Any) -> set[str]:
    """The names of the variables in a term; empty for a count, which has the term None."""
    trees = [] if term is None else [term]
    return {tree.name for tree in walk(trees) if node_kind(tree) == "Variable"}


def _assignments(atom: Any) -> Iterator[tuple[str, Any]]:
    """The variables that a comparison or an aggregate assigns, with their terms; None for a count.

    The variables of other aggregates are left out: they can have any value.
    """
    if node_kind(atom) == "Comparison":
        sides = [atom.term, *(guard.term for guard in atom.guards)]
        is_equation = all(guard.comparison == _EQUAL for guard in atom.guards)
        for left, right in permutations(sides if is_equation else [], 2):
            if node_kind(left) == "Variable":
                yield left.name, right
    if node_kind(atom) == "BodyAggregate" and atom.function == _COUNT_AGGREGATE:
        for guard in (atom.left_guard, atom.right_guard):
            if guard is not None and node_kind(guard.term) == "Variable":
                yield guard.term.name, None


def term_range(tree: Any, ranges: Mapping[str, ValueRange]) -> ValueRange:
    """The range of a term; (0, 0) for a term that is no number.

    Args:
        tree: The syntax tree of the term.
        ranges: Ranges of the variables in it; others can have any value.
    """
    kind = node_kind(tree)
    if kind == "Variable":
        return ranges.get(tree.name, _INT32)
    if kind == "SymbolicTerm":
        is_number = tree.symbol.type == import_clingo().SymbolType.Number
        return ValueRange(tree.symbol.number, tree.symbol.number) if is_number else _NO_NUMBER
    if kind == "UnaryOperation":
        return _unary_range(tree.operator_type, term_range(tree.argument, ranges))
    if kind in ("BinaryOperation", "Interval"):
        left, right = term_range(tree.left, ranges), term_range(tree.right, ranges)
        if kind == "BinaryOperation":
            return _binary_range(tree.operator_type, left, right)
        return ValueRange(min(left.low, right.low), max(left.high, right.high))
    return _NO_NUMBER


def _unary_range(operator: int, operand: ValueRange) -> ValueRange:
    low, high = operand
    if operator == _ABSOLUTE:
        smallest = 0 if low <= 0 <= high else min(abs(low), abs(high))
        return ValueRange(smallest, max(abs(low), abs(high)))
    return ValueRange(-high, -low) if operator == _NEGATION else _INT32


def _binary_range(operator: int, left: ValueRange, right: ValueRange) -> ValueRange:
    if operator in _MONOTONE_OPERATORS:
        # Monotone in each operand: the extremes lie at the ends of the ranges.
        ends = [_MONOTONE_OPERATORS[operator](a, b) for a in left for b in right]
        return ValueRange(min(ends), max(ends))
    if operator == _DIVISION:
        size = max(abs(left.low), abs(left.high))  # The divisor 1 or -1 gives the largest size.
        return ValueRange(-size, size)
    if operator == _MODULO:
        size = max(abs(right.low), abs(right.high))
        return ValueRange(-size, size)
    # Powers and bit operations count as overflows: no query needs them.
    return ValueRange(_INT32.low * 2, _INT32.high * 2)
