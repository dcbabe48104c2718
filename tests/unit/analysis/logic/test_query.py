"""Queries name only constants that an answer can have."""

from __future__ import annotations

import re

import pytest

from overtaking.analysis.logic.fact_files import PROGRAM_FOLDER
from overtaking.analysis.logic.programs import PREDICATES, possible_constants
from overtaking.analysis.logic.query import parse_query
from overtaking.analysis.logic.vocabulary import RULE_CODES
from overtaking.core.errors import ConfigError
from overtaking.labels.law.germany import GERMANY
from overtaking.labels.law.portugal import PORTUGAL

NAMES = {code.lower() for code in RULE_CODES}


@pytest.mark.parametrize("code", [*PORTUGAL.codes, *GERMANY.codes])
@pytest.mark.parametrize("predicate", ["legal", "illegal", "applies", "not_applicable"])
def test_a_query_may_name_the_rules_that_a_loaded_program_concludes(predicate, code):
    query = f"{predicate}(S,{code.lower()})"
    if code in RULE_CODES:
        parse_query(query)
    else:
        with pytest.raises(ConfigError, match=f"one of .*got {code.lower()};"):
            parse_query(query)


def test_a_query_for_an_unknown_rule_lists_the_rules_with_the_nearest_name_first():
    with pytest.raises(ConfigError) as error:
        parse_query("illegal(S,l4)")
    (listed,) = re.findall(r"one of (.*), got", str(error.value))
    names = listed.split(", ")
    assert set(names) == NAMES
    assert names[0] == "l24"


@pytest.mark.parametrize(
    "query",
    [
        "illegal(S,R), R = l4",
        "illegal(S,R), l4 != R",
        "illegal(S,(l3;l4))",
        "illegal(S,l4())",
        "not illegal(S,l4), night(S)",
        "simulation(S), 1 < #count{ R : illegal(S,R), R = o10 }",
        "doubt(S,l3)",
        "undecidable(S,l1)",
        "neighbour(S,target,V,F,G)",
        "forced_braking(S,leader,F,B)",
        "verdict(S,l3,broken)",
        "class(S,serious,success_l)",
        "event(S,E,F), E = starts",
        "speed(S,40,F,V)",
        "rain(S,101)",
        "rain(S,-1)",
        "rain(S,P), P = 100 + 1",
    ],
)
def test_a_query_that_can_have_no_answer_is_refused(query):
    with pytest.raises(ConfigError, match=" to be "):
        parse_query(query)


@pytest.mark.parametrize(
    "query",
    [
        "illegal(S,R), R != l3",
        "illegal(S,(l3;l5))",
        "doubt(S,l12)",
        "undecidable(S,l13)",
        "forced_braking(S,left_follower,F,B)",
        "spacing(S,target,F,G,C,L)",
        "lane(S,V,-1,F,G)",
        "vehicle(S,1+1,K,_,_), K = t",
    ],
)
def test_a_query_that_can_have_an_answer_is_accepted(query):
    parse_query(query)


def test_a_query_may_name_each_rule_of_the_head_of_the_program():
    text = (PROGRAM_FOLDER / "law.lp").read_text(encoding="utf-8")
    (rules,) = re.findall(r"^rule\((.*)\)\.$", text, re.MULTILINE)
    assert set(rules.split(";")) == NAMES == possible_constants()["rule", 1, 0]


def test_every_argument_for_constants_has_a_possible_constant():
    for (name, arity), predicate in PREDICATES.items():
        for position, argument_type in enumerate(predicate.types):
            if argument_type.constants:
                assert possible_constants()[name, arity, position], (name, position)
