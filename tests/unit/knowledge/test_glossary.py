"""Every name in a data set has words, declared once."""

from __future__ import annotations

from overtaking.analysis.stats.columns import FEATURES
from overtaking.data.tables.names import READINGS
from overtaking.data.tables.schemas import SCHEMAS
from overtaking.knowledge.glossary import TERM_GROUPS, terms
from overtaking.labels.law.judging import policies_of_law
from overtaking.model.vehicles import VehicleKind
from overtaking.model.verdicts import OvertakeClass


def test_every_class_policy_reading_feature_and_vehicle_class_has_words():
    assert tuple(terms("classes")) == tuple(one.title for one in OvertakeClass)
    assert tuple(terms("policies")) == tuple(one.name for one in policies_of_law("pt"))
    assert tuple(terms("readings")) == READINGS
    assert tuple(terms("vehicles")) == tuple(kind.code for kind in VehicleKind)
    assert [(one.name, one.unit, one.title) for one in FEATURES] == [
        (name, term.display_unit, term.title) for name, term in terms("features").items()
    ]


def test_the_columns_of_features_say_what_the_terms_say():
    found = {
        field.name.partition("_")[0]: field.metadata[b"description"].decode()
        for field in SCHEMAS["features"]
    }
    assert {name: found[name] for name in terms("features")} == {
        name: term.meaning for name, term in terms("features").items()
    }


def test_every_term_has_a_meaning_of_one_line():
    for group in TERM_GROUPS:
        for name, term in terms(group).items():
            assert len(term.meaning.split()) > 1, name
            assert "\n" not in term.meaning, name
