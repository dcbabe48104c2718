"""Proofs: the facts and the instances of rules from which a breach of the law follows.

The program is written for the solver clingo. A rule `head :- body.` concludes the atom in its head
where the literals of its body hold: atoms, comparisons, or their negations. An atom is a predicate
with its arguments; without variables it is ground.

For each rule of the program, a second rule records its instances: the values of its variables with
which it holds. A proof is thus clingo's own derivation, independent of the rules in Python.
"""

# clingo's syntax trees are typed as nodes of any kind.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import count
from typing import TYPE_CHECKING, Any, NamedTuple

from overtaking.analysis.logic.fact_files import pooled_facts
from overtaking.analysis.logic.programs import (
    import_clingo,
    node_kind,
    rules_needed_by,
    rules_of_program,
)
from overtaking.analysis.logic.query import answer_variables
from overtaking.analysis.logic.reasoner import MEMORY_MIB, TIMEOUT_S, Reasoner
from overtaking.analysis.logic.vocabulary import MAX_FRAME, RULE, RULE_CODES
from overtaking.core.equality import ContentEquality
from overtaking.labels.law.portugal import PORTUGAL

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from overtaking.analysis.logic.programs import ProgramRule
    from overtaking.analysis.logic.simulation_groups import SimulationGroup

_INSTANCE_PREDICATE = "because__"
"""Predicate of the recorded instances.

Its arguments: index of the rule, conclusion, atoms of the body, values of the variables.
"""

_VARIABLE = re.compile(r"\b[A-Z]\w*\b")

GroundAtom = tuple[Any, ...]
"""An atom without variables: its name and its arguments."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ProofStep(ContentEquality):
    """An instance of a rule.

    Attributes:
        atom: Its conclusion.
        sentence: The conclusion in words; the atom where the rule has no gloss.
        conditions: The comparisons that hold, with their values.
        facts: The facts that it reads.
        absent_literals: Its negated literals, which hold because their atoms do not follow.
        premises: The steps from which its other atoms follow.
        num_skipped: Number of instances of the same rule that the proof leaves out between the step
            and its premises.
    """

    atom: str
    sentence: str
    conditions: tuple[str, ...]
    facts: tuple[str, ...]
    absent_literals: tuple[str, ...]
    premises: tuple[ProofStep, ...]
    num_skipped: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Proof(ContentEquality):
    """Proof that one rule is broken.

    Attributes:
        rule: Name of the rule in the program, such as `l12`.
        first_frame: First frame of the breach.
        last_frame: Last frame of the breach.
        num_frames: Number of frames in which it is broken.
        step: The proof for the first frame.
    """

    rule: str
    first_frame: int
    last_frame: int
    num_frames: int
    step: ProofStep


def title_of(rule: str) -> str:
    """Code, title and article of a rule by its name in the program, such as `l12`."""
    # The constants of `RULE` are the codes in lower case, in the same order.
    rule_of_law = PORTUGAL.rule(RULE_CODES[RULE.constants.index(rule)])
    return f"{rule_of_law.code}, {rule_of_law.title} ({rule_of_law.article})"


def prove_breaches(
    group: SimulationGroup, *, timeout_s: float = TIMEOUT_S, memory_mib: int = MEMORY_MIB
) -> tuple[Proof, ...]:
    """A proof for each rule of the program that one simulation breaks.

    Args:
        group: A group of one simulation.
        timeout_s: Time limit of the reasoner [s].
        memory_mib: Memory limit [MiB].

    Raises:
        ConfigError: The reasoner exceeds its time or memory.
        MissingExtraError: clingo is not installed.
    """
    # None stands for any simulation and any rule of the law.
    needed = rules_needed_by([("illegal", (None,) * 2)], rules_of_program("law.lp"))
    instance_rules = [_instance_rule(index, rule) for index, rule in enumerate(needed.rules)]
    program = needed.program + "\n".join(rule.text for rule in instance_rules)
    predicates = ((_INSTANCE_PREDICATE, 4),)
    # `MAX_FRAME` is the step between frames with facts about positions. The law reads none of these
    # facts, and the largest step makes the fewest.
    facts = pooled_facts(group, needed.requested_facts, MAX_FRAME)
    with Reasoner(program, predicates, timeout_s=timeout_s, memory_mib=memory_mib) as reasoner:
        rows = reasoner.solve(facts)
    return tuple(_Derivation(instance_rules, rows).proofs())


@dataclass(frozen=True, slots=True, kw_only=True)
class _InstanceRule:
    """A rule whose instances are recorded.

    Attributes:
        rule: The rule of the law.
        variables: Its variables.
        text: The rule that records its instances.
    """

    rule: ProgramRule
    variables: tuple[str, ...]
    text: str


def _instance_rule(index: int, rule: ProgramRule) -> _InstanceRule:
    """The rule that records the instances of a rule, under its index."""
    numbers = count()
    body = [
        _with_named_variables(literal, numbers) if _is_positive_atom(literal) else literal
        for literal in rule.tree.body
    ]
    head = rule.tree.head
    is_pool = node_kind(head.atom) == "SymbolicAtom" and node_kind(head.atom.symbol) == "Pool"
    # A fact of the program has no premises. Among heads only facts are pools: `rule(l1;l2).`
    if not body or is_pool:
        return _InstanceRule(rule=rule, variables=(), text="")
    variables = tuple(answer_variables(body))
    # The trailing commas make tuples of the lists, also of an empty list or of a single member.
    premises = "".join(f"{literal}," for literal in body if _is_positive_atom(literal))
    values = "".join(f"{name}," for name in variables)
    condition = "; ".join(str(literal) for literal in body)
    text = f"{_INSTANCE_PREDICATE}({index},{head},({premises}),({values})) :- {condition}."
    return _InstanceRule(rule=rule, variables=variables, text=text)


def _is_positive_atom(literal: Any) -> bool:
    """Whether a literal is an atom that must hold."""
    is_literal = node_kind(literal) == "Literal"
    return is_literal and node_kind(literal.atom) == "SymbolicAtom" and not literal.sign


def _with_named_variables(tree: Any, numbers: Iterator[int]) -> Any:
    """The same tree with a name for each anonymous variable, so that its value is recorded."""

    class Renaming(import_clingo().ast.Transformer):
        def visit_Variable(self, node: Any) -> Any:
            return node.update(name=f"Any{next(numbers)}") if node.name == "_" else node

    return Renaming().visit(tree)


class _Instance(NamedTuple):
    """An instance of a rule: index of the rule, atoms of its body, and values of its variables."""

    rule_index: int
    body: list[GroundAtom]
    values: list[Any]


class _Derivation:
    """All instances of rules, by their conclusions."""

    def __init__(self, instance_rules: list[_InstanceRule], rows: list[list[Any]]) -> None:
        self._rules = instance_rules
        self._instances: dict[GroundAtom, list[_Instance]] = {}
        for index, head, premises, values in rows:
            body = [_ground_atom(premise) for premise in premises]
            instance = _Instance(index, body, values)
            self._instances.setdefault(_ground_atom(head), []).append(instance)
        # The values are in the order of the variables in the body. The rule for `illegal` begins it
        # with `breach(S,R,F)`, in which only the frame F varies: the smallest comes first.
        for instances in self._instances.values():
            instances.sort(
                key=lambda instance: (
                    instance.rule_index,
                    [_sort_key(value) for value in instance.values],
                )
            )

    def proofs(self) -> Iterator[Proof]:
        """A proof for each broken rule, in the order of the rules."""
        # The atoms are `breach(S,Rule,F)` and `illegal(S,Rule)`.
        frames_by_rule: dict[str, set[int]] = {}
        for name, *arguments in self._instances:
            if name == "breach":
                frames_by_rule.setdefault(str(arguments[1]), set()).add(int(arguments[2]))
        illegal = [atom for atom in self._instances if atom[0] == "illegal"]
        for atom in sorted(illegal, key=lambda atom: int(atom[2].removeprefix("l"))):
            frames = frames_by_rule[atom[2]]
            yield Proof(
                rule=atom[2],
                first_frame=min(frames),
                last_frame=max(frames),
                num_frames=len(frames),
                step=self._step(atom),
            )

    def _step(self, atom: GroundAtom) -> ProofStep:
        """The first instance that concludes an atom, with all its premises.

        An instance may follow from an instance of the same rule, as for the frames in which a
        return is due. Of such a chain the step shows only the ends.
        """
        instance = self._instances[atom][0]
        body_at_chain_begin, num_skipped = self._follow_chain(instance)
        instance_rule = self._rules[instance.rule_index]
        literals = instance_rule.rule.tree.body
        values = dict(zip(instance_rule.variables, instance.values, strict=True))
        # Facts and conditions are of this instance, at the end of its chain; premises are of the
        # beginning.
        facts = [_atom_text(premise) for premise in instance.body if premise not in self._instances]
        derived = [premise for premise in body_at_chain_begin if premise in self._instances]
        gloss = instance_rule.rule.gloss
        sentence = re.sub(r"\{(\w+)\}", lambda match: str(values[match[1]]), gloss)
        return ProofStep(
            atom=_atom_text(atom),
            sentence=sentence or _atom_text(atom),
            conditions=tuple(
                _with_values(literal, values)
                for literal in literals
                if node_kind(literal) == "Literal" and node_kind(literal.atom) != "SymbolicAtom"
            ),
            facts=tuple(dict.fromkeys(facts)),
            absent_literals=tuple(
                _with_values(literal, values) for literal in literals if getattr(literal, "sign", 0)
            ),
            premises=tuple(self._step(premise) for premise in dict.fromkeys(derived)),
            num_skipped=num_skipped,
        )

    def _follow_chain(self, instance: _Instance) -> tuple[list[GroundAtom], int]:
        """Follow a recursive rule back to the first instance of its chain.

        Returns:
            The body of that first instance, and the number of instances that precede the argument
            `instance` in the chain.
        """
        num_skipped = 0
        while True:
            previous_instances = [
                self._instances[premise][0]
                for premise in instance.body
                if premise in self._instances
            ]
            instances_of_same_rule = [
                previous
                for previous in previous_instances
                if previous.rule_index == instance.rule_index
            ]
            if not instances_of_same_rule:
                return instance.body, num_skipped
            instance, num_skipped = instances_of_same_rule[0], num_skipped + 1


def _ground_atom(term: Any) -> GroundAtom:
    """The atom from the reasoner's value: a list, or the name of an atom without arguments."""
    return tuple(term) if isinstance(term, list) else (term,)


def _sort_key(value: Any) -> tuple[bool, Any]:
    """Key that sorts numbers before names, which Python cannot compare with each other."""
    return isinstance(value, str), value


def _atom_text(atom: GroundAtom) -> str:
    name, *arguments = atom
    return f"{name}({','.join(map(str, arguments))})" if arguments else str(name)


def _with_values(literal: Any, values: Mapping[str, Any]) -> str:
    """A literal with the values of its variables, without outer brackets."""
    text = _VARIABLE.sub(lambda match: str(values.get(match[0], match[0])), str(literal))
    is_bracketed = text.startswith("(") and text.endswith(")") and "(" not in text[1:]
    return text[1:-1] if is_bracketed else text
