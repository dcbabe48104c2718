"""Proofs: the facts and the instances of rules from which a breach of the law follows.

For each rule of the program, a second rule records its instances. A proof is thus clingo's own
derivation, independent of the rules in Python.
"""

# clingo's syntax trees are typed as nodes of any kind.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import count
from typing import TYPE_CHECKING, Any

from overtaking.analysis.logic.clauses import kind, needed, program, reasoner
from overtaking.analysis.logic.facts import group_text
from overtaking.analysis.logic.question import variables_of
from overtaking.analysis.logic.reasoning import MEMORY_MIB, TIMEOUT_S, Reasoner
from overtaking.analysis.logic.vocabulary import MAX_FRAME
from overtaking.core.equality import ContentEquality

if TYPE_CHECKING:
    from collections.abc import Iterator

    from overtaking.analysis.logic.clauses import Clause
    from overtaking.analysis.logic.source import Group

_INSTANCE = "because__"
_VARIABLE = re.compile(r"\b[A-Z]\w*\b")

Ground = tuple[Any, ...]
"""An atom: its name and its arguments."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Step(ContentEquality):
    """An instance of a rule.

    Attributes:
        atom: Its conclusion.
        says: The conclusion in words; the atom where the rule has no gloss.
        conditions: The comparisons that hold, with their values.
        facts: The facts that it reads.
        absent: The literals that must not hold.
        because: The instances from which the other atoms that it reads follow.
        num_skipped: Number of instances of the same rule between it and those.
    """

    atom: str
    says: str
    conditions: tuple[str, ...]
    facts: tuple[str, ...]
    absent: tuple[str, ...]
    because: tuple[Step, ...]
    num_skipped: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Proof(ContentEquality):
    """Why one rule is broken.

    Attributes:
        rule: Name of the rule in the program.
        first: First frame of the breach.
        last: Last frame of the breach.
        num_frames: Number of frames in which it is broken.
        step: The proof for the first frame.
    """

    rule: str
    first: int
    last: int
    num_frames: int
    step: Step


@dataclass(frozen=True, slots=True, kw_only=True)
class _Recorded:
    """A rule whose instances are recorded.

    Attributes:
        clause: The rule.
        names: Its variables.
        text: The rule that records its instances.
    """

    clause: Clause
    names: tuple[str, ...]
    text: str


def proofs(
    group: Group, *, timeout_s: float = TIMEOUT_S, memory_mib: int = MEMORY_MIB
) -> tuple[Proof, ...]:
    """A proof for each rule of the program that one simulation breaks.

    Args:
        group: That simulation.
        timeout_s: Time limit of the reasoner [s].
        memory_mib: Memory limit [MiB].

    Raises:
        ConfigError: It exceeds its time or memory.
        MissingExtraError: clingo is not installed.
    """
    asked = needed(program("law.lp"), [("illegal", (None,) * 2)])
    recorded = [_recorded(index, clause) for index, clause in enumerate(asked.clauses)]
    text = asked.text + "\n".join(one.text for one in recorded)
    with Reasoner(text, ((_INSTANCE, 4),), timeout_s=timeout_s, memory_mib=memory_mib) as one:
        rows = one.rows(group_text(group, asked.demand, MAX_FRAME))
    derivation = _Derivation(recorded, rows)
    return tuple(derivation.proofs())


def _recorded(index: int, clause: Clause) -> _Recorded:
    """A rule and its place, as one that records instances."""
    fresh = count()
    body = [
        _named(literal, fresh) if _is_read(literal) else literal for literal in clause.tree.body
    ]
    names, head = tuple(variables_of(body)), clause.tree.head
    is_pool = kind(head.atom) == "SymbolicAtom" and kind(head.atom.symbol) == "Pool"
    if not body or is_pool:
        return _Recorded(clause=clause, names=(), text="")
    # The trailing commas make tuples of the lists, also of those with one member or none.
    read = "".join(f"{literal}," for literal in body if _is_read(literal))
    values = "".join(f"{name}," for name in names)
    condition = "; ".join(str(literal) for literal in body)
    text = f"{_INSTANCE}({index},{head},({read}),({values})) :- {condition}."
    return _Recorded(clause=clause, names=names, text=text)


def _is_read(literal: Any) -> bool:
    """Whether a literal is an atom that must hold."""
    return kind(literal) == "Literal" and kind(literal.atom) == "SymbolicAtom" and not literal.sign


def _named(tree: Any, fresh: Iterator[int]) -> Any:
    """The same with a name for each anonymous variable."""

    class Names(reasoner().ast.Transformer):
        def visit_Variable(self, node: Any) -> Any:
            return node.update(name=f"Any{next(fresh)}") if node.name == "_" else node

    return Names().visit(tree)


class _Derivation:
    """All instances of rules, by their conclusions."""

    def __init__(self, recorded: list[_Recorded], rows: list[list[Any]]) -> None:
        self._recorded = recorded
        self._instances: dict[Ground, list[tuple[int, list[Ground], list[Any]]]] = {}
        for index, head, read, values in rows:
            body = [_ground(one) for one in read]
            self._instances.setdefault(_ground(head), []).append((index, body, values))
        for found in self._instances.values():
            found.sort(key=lambda one: (str(one[0]).zfill(4), [_order(each) for each in one[2]]))

    def proofs(self) -> Iterator[Proof]:
        """A proof for each broken rule, in the order of the rules."""
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
        """The first instance that concludes an atom, with all that it rests on."""
        index, body, values = self._instances[atom][0]
        end, skipped = self._end_of_chain(index, body)
        clause = self._recorded[index].clause
        known = dict(zip(self._recorded[index].names, values, strict=True))
        facts = [_text(one) for one in body if one not in self._instances]
        derived = [one for one in end if one in self._instances]
        return Step(
            atom=_text(atom),
            says=re.sub(r"\{(\w+)\}", lambda at: str(known[at[1]]), clause.gloss) or _text(atom),
            conditions=tuple(
                _put(literal, known)
                for literal in clause.tree.body
                if kind(literal) == "Literal" and kind(literal.atom) != "SymbolicAtom"
            ),
            facts=tuple(dict.fromkeys(facts)),
            absent=tuple(
                _put(literal, known) for literal in clause.tree.body if getattr(literal, "sign", 0)
            ),
            because=tuple(self._step(one) for one in dict.fromkeys(derived)),
            num_skipped=skipped,
        )

    def _end_of_chain(self, index: int, body: list[Ground]) -> tuple[list[Ground], int]:
        """What a recursive rule begins with, and how many of its instances lie between."""
        skipped = 0
        while True:
            again = [self._instances[one][0] for one in body if one in self._instances]
            again = [one for one in again if one[0] == index]
            if not again:
                return body, skipped
            body, skipped = again[0][1], skipped + 1


def _ground(term: Any) -> Ground:
    """An atom as clingo returns it; one without arguments is its name."""
    return tuple(term) if isinstance(term, list) else (term,)


def _order(value: Any) -> tuple[bool, Any]:
    return isinstance(value, str), value


def _text(atom: Ground) -> str:
    name, *arguments = atom
    return f"{name}({','.join(str(one) for one in arguments)})" if arguments else str(name)


def _put(literal: Any, known: dict[str, Any]) -> str:
    """A literal with the values of its variables, without brackets around all of it."""
    found = _VARIABLE.sub(lambda name: str(known.get(name[0], name[0])), str(literal))
    is_bracketed = found.startswith("(") and found.endswith(")") and "(" not in found[1:]
    return found[1:-1] if is_bracketed else found
