"""The rules of programs: what each reads, and which of them a question needs."""

# clingo's syntax trees are typed as nodes of any kind.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import atexit
import re
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any, TypeGuard

from overtaking.analysis.logic import vocabulary as words
from overtaking.analysis.logic.export import PROGRAMS
from overtaking.analysis.logic.facts import Demand, Pattern
from overtaking.analysis.logic.vocabulary import BY_NAME, Signature, Type
from overtaking.core.errors import MissingExtraError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

FILES = ("theory.lp", "law.lp", "law_de.lp")
"""The programs of the package."""

_ASKED = FILES[:2]
"""Those that questions may use."""

_GLOSS = "%~ "
_DECLARED = re.compile(r"%: (\w+)\(([^)]*)\)")
_PREAMBLE = "#const ego = 0.\n"


@dataclass(frozen=True, slots=True)
class Atom:
    """A predicate in a rule.

    Attributes:
        name: Its name.
        arguments: Each the text of a constant, the name of a variable, or None if it is computed.
    """

    name: str
    arguments: Pattern

    @property
    def signature(self) -> Signature:
        """Name and number of arguments."""
        return self.name, len(self.arguments)

    def pattern(self, binding: dict[str, str]) -> Pattern:
        """The constants among its arguments, given the values of some variables."""
        return tuple(binding.get(one) if _is_variable(one) else one for one in self.arguments)


@dataclass(frozen=True, slots=True, kw_only=True)
class Clause:
    """One rule.

    Attributes:
        tree: Its syntax tree.
        text: The rule as clingo prints it.
        gloss: What an instance says, with variables in braces; may be empty.
        heads: Its conclusions; several only for facts.
        body: All atoms that it reads, negated or not, in aggregates too.
    """

    tree: Any
    text: str
    gloss: str
    heads: tuple[Atom, ...]
    body: tuple[Atom, ...]

    @property
    def positive_atoms(self) -> tuple[Atom, ...]:
        """The atoms of the body that must hold: neither negated nor within an aggregate."""
        plain = [
            literal.atom
            for literal in self.tree.body
            if kind(literal) == "Literal" and not literal.sign
        ]
        return tuple(_atoms_in(atom for atom in plain if kind(atom) == "SymbolicAtom"))

    def bindings(self, name: str, pattern: Pattern) -> Iterator[dict[str, str]]:
        """The variables that a pattern of its head gives a value to, for each head that fits."""
        for head in self.heads:
            if head.signature == (name, len(pattern)):
                asked = [pair for pair in zip(head.arguments, pattern, strict=True) if pair[1]]
                bound = {one: value for one, value in asked if one and value and _is_variable(one)}
                if all(one in (None, value) or one in bound for one, value in asked):
                    yield bound


def reasoner() -> Any:
    """The module clingo.

    Raises:
        MissingExtraError: clingo is not installed.
    """
    try:
        clingo = import_module("clingo")
        import_module("clingo.ast")
    except ImportError:
        raise MissingExtraError.for_extra(
            "logic", what="clingo, which reasons", where="logic"
        ) from None
    return clingo


@cache
def program(file: str) -> tuple[Clause, ...]:
    """The rules of one of `FILES`."""
    return clauses((PROGRAMS / file).read_text(encoding="utf-8"))


@cache
def knowledge() -> tuple[Clause, ...]:
    """The rules that questions may use."""
    return tuple(clause for file in _ASKED for clause in program(file))


# At exit, clingo may be unloaded before its trees, each of which then complains on standard error:
# release the trees first.
atexit.register(program.cache_clear)
atexit.register(knowledge.cache_clear)


def clauses(text: str) -> tuple[Clause, ...]:
    """The rules of a program that is correct."""
    ast, lines = reasoner().ast, text.splitlines()
    trees: list[Any] = []
    ast.parse_string(text, trees.append)
    return tuple(
        Clause(
            tree=tree,
            text=str(tree),
            gloss=_gloss(lines, tree.location.begin.line),
            heads=tuple(_atoms_in([tree.head])),
            body=tuple(_atoms_in(tree.body)),
        )
        for tree in trees
        if tree.ast_type == ast.ASTType.Rule
    )


def _gloss(lines: list[str], line: int) -> str:
    """The gloss above a line, if there is one."""
    above = lines[line - 2] if line > 1 else ""
    return above.removeprefix(_GLOSS) if above.startswith(_GLOSS) else ""


def _atoms_in(trees: Iterable[Any]) -> Iterator[Atom]:
    """All atoms in syntax trees, in order; of a pool such as rule(l1;l2) each."""
    for tree in within(trees):
        if kind(tree) == "SymbolicAtom":
            symbol = tree.symbol
            for one in symbol.arguments if kind(symbol) == "Pool" else (symbol,):
                yield Atom(one.name, tuple(_text(each) for each in one.arguments))


def kind(tree: Any) -> str:
    """The name of the kind of a syntax tree, one of `clingo.ast.ASTType`."""
    return tree.ast_type.name


def within(trees: Iterable[Any]) -> Iterator[Any]:
    """Syntax trees and all their parts, in order."""
    for tree in trees:
        yield tree
        yield from within(children(tree))


def children(tree: Any) -> Iterator[Any]:
    """The parts of a syntax tree, in order."""
    node = reasoner().ast.AST
    for key in tree.child_keys:
        part = getattr(tree, key)
        if isinstance(part, node):
            yield part
        elif part is not None:
            yield from part


def _text(tree: Any) -> str | None:
    """An argument of an atom, as in `Atom`."""
    if kind(tree) == "Variable":
        return tree.name
    return str(tree.symbol) if kind(tree) == "SymbolicTerm" else None


def _is_variable(argument: str | None) -> TypeGuard[str]:
    """Whether an argument of an atom is a variable, which begins with a capital letter."""
    return argument is not None and (argument == "_" or argument.lstrip("_")[:1].isupper())


@dataclass(frozen=True, slots=True, kw_only=True)
class Needed:
    """The rules and facts that a question needs.

    Attributes:
        clauses: The rules that the answer may depend on.
        demand: The facts that they read.
    """

    clauses: tuple[Clause, ...]
    demand: Demand

    @property
    def text(self) -> str:
        """The rules as a program, in which predicates without facts are empty."""
        defined = "".join(
            f"#defined {name}/{len(BY_NAME[name].arguments)}.\n" for name in self.demand.patterns
        )
        return _PREAMBLE + defined + "\n".join(clause.text for clause in self.clauses) + "\n"


@cache
def possible_constants() -> dict[tuple[str, int, int], frozenset[str]]:
    """The constants that each argument of a predicate can have, in facts and in conclusions.

    A conclusion has the constants in the head of its rule. A variable in the head has the
    constants that the positive atoms of the body allow. Conclusions of one rule are atoms of
    others, so the loop repeats until no constant is added.

    Returns:
        The constants by name of the predicate, its number of arguments and the position of the
        argument. Arguments that are numbers are left out.
    """
    constants = _constants_of_facts()
    rules = [(head, clause.positive_atoms) for clause in knowledge() for head in clause.heads]
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


def _constants_of_facts() -> dict[tuple[str, int, int], frozenset[str]]:
    """`possible_constants` of facts; empty sets for predicates that only rules conclude."""
    constants = {
        (*signature, position): frozenset[str]()
        for signature, types in declared().items()
        for position, argument_type in enumerate(types)
        if argument_type.names
    }
    for fact in words.FACTS:
        for position, (label, argument_type) in enumerate(fact.arguments):
            if argument_type.names:
                constants[*fact.signature, position] = fact.constants(label)
    return constants


atexit.register(possible_constants.cache_clear)


def _constants_of(
    argument: str | None,
    body: Iterable[Atom],
    constants: dict[tuple[str, int, int], frozenset[str]],
) -> frozenset[str]:
    """The constants that an argument of a head can have.

    Args:
        argument: A constant, a variable, or None for any other term.
        body: The positive atoms of the rule.
        constants: The constants that are possible in these atoms so far.
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


def needed(rules: Iterable[Clause], goals: Iterable[tuple[str, Pattern]]) -> Needed:
    """The rules and facts that goals depend on.

    Constants are propagated from the goals into the rules, so that a question about one rule of law
    reads only what that rule reads. Other conclusions of the rules may be incomplete.

    Args:
        rules: All rules.
        goals: Predicates with the constants that their arguments must be.
    """
    known, waiting, everything = set[tuple[str, Pattern]](), list(goals), tuple(rules)
    used = set[int]()
    while waiting:
        goal = waiting.pop()
        if goal not in known:
            known.add(goal)
            for index, clause in enumerate(everything):
                for binding in clause.bindings(*goal):
                    used.add(index)
                    waiting += [(atom.name, atom.pattern(binding)) for atom in clause.body]
    patterns: dict[str, frozenset[Pattern]] = {}
    for name, pattern in known:
        if name in BY_NAME and len(pattern) == len(BY_NAME[name].arguments):
            patterns[name] = patterns.get(name, frozenset()) | {pattern}
    return Needed(
        clauses=tuple(everything[index] for index in sorted(used)),
        demand=Demand(patterns=patterns),
    )


@cache
def declared() -> dict[Signature, tuple[Type, ...]]:
    """The types of the arguments of every predicate, those of the programs' own too."""
    found = {
        one.signature: tuple(of for _, of in one.arguments) for one in words.PREDICATES.values()
    }
    for file in FILES:
        for name, types in _DECLARED.findall((PROGRAMS / file).read_text(encoding="utf-8")):
            kinds = tuple(words.TYPES[one.strip()] for one in types.split(",")) if types else ()
            found[name, len(kinds)] = kinds
    return found
