"""Programs taken apart: the rules, what each reads, and which of them a question needs."""

# clingo's syntax trees are typed as nodes of any kind.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import atexit
import re
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any

from overtaking.analysis.logic.export import PROGRAMS
from overtaking.analysis.logic.facts import BY_NAME, Demand, Pattern
from overtaking.analysis.logic.vocabulary import (
    FACTS,
    LAW,
    THEORY,
    TYPES,
    Predicate,
    Signature,
    Type,
)
from overtaking.core.errors import MissingExtraError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

FILES = ("theory.lp", "law.lp")
"""The programs of the package."""

_GLOSS = "%~ "
_DECLARED = re.compile(r"%: (\w+)\(([^)]*)\)")
_PREAMBLE = "#const ego = 0.\n"


@dataclass(frozen=True, slots=True, kw_only=True)
class Term:
    """An argument: a constant, a variable, or something that is worked out.

    Attributes:
        constant: Its text, None if it is none.
        variable: Its name, None if it is none; `_` is one of its own.
    """

    constant: str | None = None
    variable: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Atom:
    """A predicate with arguments, as it stands in a rule."""

    name: str
    arguments: tuple[Term, ...]

    @property
    def signature(self) -> Signature:
        """Name and number of arguments."""
        return self.name, len(self.arguments)

    def pattern(self, binding: dict[str, str]) -> Pattern:
        """The constants that its arguments are, some variables being known."""
        return tuple(
            term.constant if term.variable is None else binding.get(term.variable)
            for term in self.arguments
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Clause:
    """One rule.

    Attributes:
        tree: Its syntax tree.
        text: The rule as clingo prints it.
        gloss: What an instance says, with variables in braces; empty if nothing is said.
        heads: What it concludes; several only for facts.
        body: All that it reads, negated or not, in aggregates too.
    """

    tree: Any
    text: str
    gloss: str
    heads: tuple[Atom, ...]
    body: tuple[Atom, ...]

    def bindings(self, name: str, pattern: Pattern) -> Iterator[dict[str, str]]:
        """What is known of its variables where a pattern is asked for; nothing if it cannot be."""
        for head in self.heads:
            if head.signature != (name, len(pattern)):
                continue
            pairs = list(zip(head.arguments, pattern, strict=True))
            if all(
                None in (term.constant, asked) or term.constant == asked for term, asked in pairs
            ):
                yield {
                    term.variable: asked
                    for term, asked in pairs
                    if term.variable is not None and asked is not None
                }


def reasoner() -> Any:
    """clingo, which not everybody has."""
    try:
        clingo = import_module("clingo")
        import_module("clingo.ast")
    except ImportError:
        raise MissingExtraError.lacking(
            "logic", what="clingo, which reasons", where="logic"
        ) from None
    return clingo


@cache
def program(file: str) -> tuple[Clause, ...]:
    """The rules of one of `FILES`."""
    return clauses((PROGRAMS / file).read_text(encoding="utf-8"))


@cache
def knowledge() -> tuple[Clause, ...]:
    """The rules of all of `FILES`."""
    return tuple(clause for file in FILES for clause in program(file))


# At the end of a process clingo may go before its trees, each of which then says on standard error
# that it could not be released: they are let go of before.
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
    """The comment above a line, if it says what an instance says."""
    above = lines[line - 2] if line > 1 else ""
    return above.removeprefix(_GLOSS) if above.startswith(_GLOSS) else ""


def _atoms_in(trees: Iterable[Any]) -> Iterator[Atom]:
    """All atoms in syntax trees, in order."""
    kind = reasoner().ast.ASTType
    for tree in trees:
        if tree.ast_type == kind.SymbolicAtom:
            for symbol in _alternatives(tree.symbol):
                arguments = tuple(term_of(one) for one in symbol.arguments)
                yield Atom(name=symbol.name, arguments=arguments)
        else:
            yield from _atoms_in(children(tree))


def children(tree: Any) -> Iterator[Any]:
    """The parts of a syntax tree, in order."""
    node = reasoner().ast.AST
    for key in tree.child_keys:
        part = getattr(tree, key)
        if isinstance(part, node):
            yield part
        elif part is not None:
            yield from part


def _alternatives(symbol: Any) -> Iterator[Any]:
    """The atoms of a pool such as rule(l1;l2), or the one that there is."""
    kind = reasoner().ast.ASTType
    if symbol.ast_type == kind.Pool:
        yield from symbol.arguments
    else:
        yield symbol


def term_of(tree: Any) -> Term:
    """An argument as it is written."""
    kind = reasoner().ast.ASTType
    if tree.ast_type == kind.Variable:
        return Term(variable=tree.name)
    if tree.ast_type == kind.SymbolicTerm:
        return Term(constant=str(tree.symbol))
    return Term()


@dataclass(frozen=True, slots=True, kw_only=True)
class Needed:
    """What answers a question.

    Attributes:
        clauses: The rules that may have a part in it.
        demand: The facts that they read.
    """

    clauses: tuple[Clause, ...]
    demand: Demand

    @property
    def text(self) -> str:
        """The rules as a program; predicates without facts are empty in it."""
        defined = "".join(
            f"#defined {name}/{len(BY_NAME[name].arguments)}.\n" for name in self.demand.patterns
        )
        return _PREAMBLE + defined + "\n".join(clause.text for clause in self.clauses) + "\n"


def needed(rules: Iterable[Clause], goals: Iterable[tuple[str, Pattern]]) -> Needed:
    """The rules and facts that goals depend on.

    Constants are followed from the goals into the rules, so that a question about one rule of law
    reads what that rule reads. Whatever follows besides the goals may be incomplete.

    Args:
        rules: All rules that there are.
        goals: Predicates with the constants that their arguments must be.
    """
    known, waiting = set[tuple[str, Pattern]](), list(goals)
    everything = tuple(rules)
    used = set[int]()
    while waiting:
        goal = waiting.pop()
        if goal in known:
            continue
        known.add(goal)
        for place, clause in enumerate(everything):
            for binding in clause.bindings(*goal):
                used.add(place)
                waiting += [(atom.name, atom.pattern(binding)) for atom in clause.body]
    patterns: dict[str, frozenset[Pattern]] = {}
    for name, pattern in known:
        if name in BY_NAME and len(pattern) == len(BY_NAME[name].arguments):
            patterns[name] = patterns.get(name, frozenset()) | {pattern}
    return Needed(
        clauses=tuple(everything[place] for place in sorted(used)),
        demand=Demand(patterns=patterns),
    )


@cache
def predicates() -> dict[Signature, Predicate]:
    """Every predicate that may be asked for, by name and number of arguments."""
    return {one.signature: one for one in (*FACTS, *THEORY, *LAW)}


@cache
def declared() -> dict[Signature, tuple[Type, ...]]:
    """The types of the arguments of every predicate, those of the programs' own too."""
    found = {
        one.signature: tuple(kind for _, kind in one.arguments) for one in predicates().values()
    }
    for file in FILES:
        for name, types in _DECLARED.findall((PROGRAMS / file).read_text(encoding="utf-8")):
            kinds = tuple(TYPES[one.strip()] for one in types.split(",")) if types else ()
            found[name, len(kinds)] = kinds
    return found
