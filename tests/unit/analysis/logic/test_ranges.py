"""No sum and no product of a program can leave 32 bits, where clingo wraps without a message."""

from __future__ import annotations

import pytest
from tests.support.logic import solve
from tests.support.logic_law import GERMAN_PROGRAM

from overtaking.analysis.logic.fact_files import FACTS, PROGRAM_FOLDER
from overtaking.analysis.logic.programs import (
    PROGRAM_FILES,
    argument_types,
    declared_predicates,
    import_clingo,
    overflows,
    parse_rules,
    rules_of_program,
    term_range,
    variable_ranges,
    walk,
)
from overtaking.analysis.logic.query import parse_query
from overtaking.analysis.logic.vocabulary import MAX_INT
from overtaking.core.errors import ConfigError

PROGRAMS = {file: (PROGRAM_FOLDER / file).read_text(encoding="utf-8") for file in PROGRAM_FILES}
# The German program uses numbers and conclusions of the Portuguese one.
PROGRAMS["germany.lp"] = PROGRAMS["law.lp"] + GERMAN_PROGRAM.read_text(encoding="utf-8")
GERMAN_TYPES = {
    predicate.signature: predicate.types
    for predicate in declared_predicates(GERMAN_PROGRAM.read_text(encoding="utf-8"))
}
TYPES = {**argument_types(), **GERMAN_TYPES}


def rules_of(file: str):
    return parse_rules(PROGRAMS[file])


def overflows_of(text: str) -> list[str]:
    (rule,) = parse_rules(text)
    return [term.text for term in overflows([rule.tree.head, *rule.tree.body], TYPES)]


@pytest.mark.ci
@pytest.mark.parametrize("file", PROGRAMS)
def test_no_term_of_a_program_leaves_32_bits_for_facts_within_their_ranges(file: str):
    for rule in rules_of(file):
        assert overflows([rule.tree.head, *rule.tree.body], TYPES) == [], rule.text


@pytest.mark.parametrize("file", PROGRAMS)
def test_every_predicate_of_a_program_is_declared(file: str):
    used = {atom.signature for rule in rules_of(file) for atom in (*rule.heads, *rule.body)}
    assert used <= set(TYPES)


@pytest.mark.ci
def test_the_largest_term_is_within_32_bits_and_needs_more_than_31():
    highest = 0
    for file in PROGRAMS:
        for rule in rules_of(file):
            trees = [rule.tree.head, *rule.tree.body]
            ranges = variable_ranges(trees, TYPES)
            highest = max(highest, *(term_range(tree, ranges).high for tree in walk(trees)))
    assert MAX_INT // 2 < highest <= MAX_INT


def test_the_largest_declared_values_are_compared_correctly():
    far, near = 500_000_000, -500_000_000
    facts = f"""
        frame(0,0). vehicle(0,0,t,100000,2500). vehicle(0,1,t,100000,2500).
        position(0,0,0,{far}). position(0,1,0,{near}). lane(0,0,0,0,0). lane(0,1,0,0,0).
        speed(0,0,0,200000). speed(0,1,0,200000).
    """
    theory = "".join(rule.text + "\n" for rule in rules_of_program("theory.lp"))
    atoms = solve(facts + theory)
    assert atoms["clear_ahead"] == {(0, 0, 1, 0)}
    assert "beside" not in atoms
    assert "follows" not in atoms


def test_clingo_wraps_larger_values_without_a_message():
    assert solve("p(1000000000). q(3*X) :- p(X).")["q"] == {(3_000_000_000 - 2**32,)}


def test_a_term_that_could_leave_32_bits_is_reported():
    assert overflows_of("p(X*Y) :- speed(S,A,F,X), speed(S,B,F,Y).") == ["(X*Y)"]
    assert overflows_of("p(X) :- position(S,A,F,X), X+X+X+X+X < 3.") != []
    assert overflows_of("p(Z) :- position(S,A,F,X), Z = 3*X, Z+Z > 0.") != []
    assert overflows_of("p(Y) :- position(S,A,F,X), Y = X**2.") != []
    assert overflows_of("p(X) :- unheard_of(X), X+1 > 0.") == ["(X+1)"]
    assert overflows_of("p(X+Y) :- speed(S,A,F,X), speed(S,B,F,Y).") == []


def test_a_variable_has_the_range_of_its_assignment_wherever_the_assignment_stands():
    assert overflows_of("p(Z) :- position(S,A,F,X), Z = 2*Y, Y = X+1.") == []
    chain = ", ".join(f"X{index} = X{index + 1}+1" for index in range(20))
    assert overflows_of(f"p(X0) :- {chain}, position(S,A,F,X20).") == []
    assert overflows_of(f"p(5*X0) :- {chain}, position(S,A,F,X20).") == ["(5*X0)"]
    assert overflows_of("p(Z) :- Z = 2*Y, Y = 2*Z.") != []
    squares = ", ".join(f"X{index + 1} = X{index}*X{index}" for index in range(100))
    assert "(X99*X99)" in overflows_of(f"p(X100) :- position(S,A,F,X0), {squares}.")


def test_a_condition_that_need_not_hold_does_not_bound_a_variable():
    assert overflows_of("p(5*Z) :- Z = Y, Y = X, not Z = 5, position(S,A,F,X).") == ["(5*Z)"]
    rule = "p(5*Z) :- 0 < #count{ Z : Z = 5 }, Z = X, position(S,A,F,X)."
    assert overflows_of(rule) == ["(5*Z)"]
    assert overflows_of("p :- position(S,A,F,X), #count{ Z : Y = X+1, Z = 2*Y } > 1.") == []


def test_a_query_that_could_leave_32_bits_is_refused():
    with pytest.raises(ConfigError, match=r"clingo's integers hold, got \(X\*X\)"):
        parse_query("position(S,A,F,X), X*X > 4")
    with pytest.raises(ConfigError, match="got 4294967297"):
        parse_query("simulation(S), S < 4294967297")
    with pytest.raises(ConfigError, match="sums of numbers up to 2000"):
        parse_query("simulation(S), #sum{ X,F : speed(S,0,F,X) } > 4")


def test_every_type_leaves_a_reserve_for_a_sum():
    for fact in FACTS.values():
        for argument_type in fact.types:
            ends = (argument_type.low, argument_type.high)
            assert all(abs(2 * end) <= MAX_INT for end in ends), argument_type.name


def test_the_reasoner_is_clingo_with_its_32_bit_integers():
    assert import_clingo().__name__ == "clingo"
