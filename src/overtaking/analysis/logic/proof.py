"""Proofs: the facts and the instances of rules from which a breach of the law follows.

Beside each rule of the program stands one that writes down its instances. What is shown is thus
clingo's own derivation; nothing of it comes from the rules in Python.
"""

# clingo's syntax trees are typed as nodes of any kind.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import count
from typing import TYPE_CHECKING, Any

from overtaking.analysis.logic.ask import group_text
from overtaking.analysis.logic.clauses import needed, program, reasoner
from overtaking.analysis.logic.question import variables_of
from overtaking.analysis.logic.reasoning import MEMORY_MIB, TIMEOUT_S, Reasoner
from overtaking.analysis.logic.vocabulary import MAX_FRAME

if TYPE_CHECKING:
    from collections.abc import Iterator

    from overtaking.analysis.logic.clauses import Clause
    from overtaking.analysis.logic.source import Group

_INSTANCE = "because__"
_VARIABLE = re.compile(r"\b[A-Z]\w*\b")

Ground = tuple[Any, ...]
"""An atom: its name and its arguments."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """An instance of a rule.

    Attributes:
        atom: What it concludes.
        says: The same in words; the atom where there are none.
        conditions: Comparisons that hold, with their values.
        facts: Facts that it reads.
        absent: What does not hold.
        because: The instances from which the rest of what it reads follows.
        num_skipped: How many more instances of the same rule lie between it and those.
    """

    atom: str
    says: str
    conditions: tuple[str, ...]
    facts: tuple[str, ...]
    absent: tuple[str, ...]
    because: tuple[Step, ...]
    num_skipped: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Proof:
    """Why one rule is broken.

    Attributes:
        rule: Name of the rule in the program.
        first: First frame of the breach.
        last: Last frame of the breach.
        num_frames: How many frames it is broken in.
        step: The proof for the first frame.
    """

    rule: str
    first: int
    last: int
    num_frames: int
    step: Step


@dataclass(frozen=True, slots=True, kw_only=True)
class _Recorded:
    """A rule whose instances are written down.

    Attributes:
        clause: The rule.
        names: Its variables.
        text: The rule that writes its instances down.
    """

    clause: Clause
    names: tuple[str, ...]
    text: str


def proofs(
    group: Group, *, timeout_s: float = TIMEOUT_S, memory_mib: int = MEMORY_MIB
) -> tuple[Proof, ...]:
    """Why each rule that one simulation breaks is broken; empty if it breaks none of the program.

    Args:
        group: That simulation.
        timeout_s: How long the reasoner may take [s].
        memory_mib: How much memory it may use [MiB].

    Raises:
        ConfigError: It needs more time or memory than it may.
        MissingExtraError: clingo is not installed.
    """
    asked = needed(program("law.lp"), [("illegal", (None,) * 2)])
    recorded = [_recorded(place, clause) for place, clause in enumerate(asked.clauses)]
    text = asked.text + "\n".join(one.text for one in recorded)
    with Reasoner(text, ((_INSTANCE, 4),), timeout_s=timeout_s, memory_mib=memory_mib) as one:
        rows = one.rows(group_text(group, asked.demand, MAX_FRAME))
    derivation = _Derivation(recorded, rows)
    return tuple(derivation.proofs())


def _recorded(place: int, clause: Clause) -> _Recorded:
    """A rule and its place, as one that writes instances down."""
    kind = reasoner().ast.ASTType
    fresh = count()
    body = [
        _named(literal, fresh) if _is_read(literal) else literal for literal in clause.tree.body
    ]
    read = ",".join(str(literal) for literal in body if _is_read(literal))
    names = tuple(variables_of(body))
    head = clause.tree.head
    is_pool = head.atom.ast_type == kind.SymbolicAtom and head.atom.symbol.ast_type == kind.Pool
    if not body or is_pool:
        return _Recorded(clause=clause, names=(), text="")
    arguments = f"{place},{head},({read + ',' if read else ''}),({','.join([*names, ''])})"
    condition = "; ".join(str(literal) for literal in body)
    return _Recorded(clause=clause, names=names, text=f"{_INSTANCE}({arguments}) :- {condition}.")


def _is_read(literal: Any) -> bool:
    """Whether something is an atom that must hold."""
    kind = reasoner().ast.ASTType
    is_atom = literal.ast_type == kind.Literal and literal.atom.ast_type == kind.SymbolicAtom
    return is_atom and not literal.sign


def _named(tree: Any, fresh: Iterator[int]) -> Any:
    """The same with a name for each variable that has none."""

    class Names(reasoner().ast.Transformer):
        def visit_Variable(self, node: Any) -> Any:
            return node.update(name=f"Any{next(fresh)}") if node.name == "_" else node

    return Names().visit(tree)


class _Derivation:
    """All instances of rules, by what they conclude."""

    def __init__(self, recorded: list[_Recorded], rows: list[list[Any]]) -> None:
        self._recorded = recorded
        self._instances: dict[Ground, list[tuple[int, list[Ground], list[Any]]]] = {}
        for place, head, read, values in rows:
            body = [_ground(one) for one in read]
            self._instances.setdefault(_ground(head), []).append((place, body, values))
        for found in self._instances.values():
            found.sort(key=lambda one: (str(one[0]).zfill(4), [_order(each) for each in one[2]]))

    def proofs(self) -> Iterator[Proof]:
        """One proof for each rule that is broken, in the order of the rules."""
        broken: dict[str, set[int]] = {}
        for name, *arguments in self._instances:
            if name == "breach":
                broken.setdefault(str(arguments[1]), set()).add(int(arguments[2]))
        illegal = [atom for atom in self._instances if atom[0] == "illegal"]
        for atom in sorted(illegal, key=lambda one: int(one[2].removeprefix("l"))):
            frames = broken[atom[2]]
            yield Proof(
                rule=atom[2],
                first=min(frames),
                last=max(frames),
                num_frames=len(frames),
                step=self._step(atom),
            )

    def _step(self, atom: Ground) -> Step:
        """How an atom follows, by the first instance that concludes it."""
        place, body, values = self._instances[atom][0]
        end, skipped = self._end_of_chain(place, body, 0)
        clause, known = (
            self._recorded[place].clause,
            dict(zip(self._recorded[place].names, values, strict=True)),
        )
        derived = [one for one in end if one in self._instances]
        facts = [one for one in body if one not in self._instances]
        return Step(
            atom=_text(atom),
            says=_filled(clause.gloss, known) or _text(atom),
            conditions=tuple(_conditions(clause, known)),
            facts=tuple(dict.fromkeys(_text(one) for one in facts)),
            absent=tuple(_absent(clause, known)),
            because=tuple(self._step(one) for one in dict.fromkeys(derived)),
            num_skipped=skipped,
        )

    def _end_of_chain(
        self, place: int, body: list[Ground], skipped: int
    ) -> tuple[list[Ground], int]:
        """What a rule that leads back to itself begins with, and how many instances lie between."""
        while True:
            again = [
                one
                for one in body
                if one in self._instances and self._instances[one][0][0] == place
            ]
            if not again:
                return body, skipped
            body, skipped = self._instances[again[0]][0][1], skipped + 1


def _ground(term: Any) -> Ground:
    """An atom as clingo gives it back; one without arguments is its name."""
    return tuple(term) if isinstance(term, list) else (term,)


def _order(value: Any) -> tuple[bool, Any]:
    return isinstance(value, str), value


def _text(atom: Ground) -> str:
    name, *arguments = atom
    return f"{name}({','.join(str(one) for one in arguments)})" if arguments else str(name)


def _filled(gloss: str, known: dict[str, Any]) -> str:
    return re.sub(r"\{(\w+)\}", lambda found: str(known[found[1]]), gloss)


def _conditions(clause: Clause, known: dict[str, Any]) -> Iterator[str]:
    """The comparisons and counts of a rule, with the values of its variables."""
    kind = reasoner().ast.ASTType
    for literal in clause.tree.body:
        if literal.ast_type == kind.Literal and literal.atom.ast_type != kind.SymbolicAtom:
            yield _put(str(literal), known)


def _absent(clause: Clause, known: dict[str, Any]) -> Iterator[str]:
    """What the rule asks not to hold."""
    for literal in clause.tree.body:
        if getattr(literal, "sign", 0):
            yield _put(str(literal), known)


def _put(text: str, known: dict[str, Any]) -> str:
    found = _VARIABLE.sub(lambda name: str(known.get(name[0], name[0])), text)
    return (
        found[1:-1]
        if found.startswith("(") and found.endswith(")") and "(" not in found[1:]
        else found
    )
