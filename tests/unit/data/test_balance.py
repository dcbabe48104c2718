"""Quotas are filled in the order of the candidates, and weights undo what the quotas have done."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from overtaking.core.errors import ConfigError
from overtaking.data.balance import CLASSES, OUTSIDE, ClassBalance, selection_weights
from overtaking.data.balance_scan import Selection
from overtaking.data.manifest import Identity
from overtaking.model.verdicts import OvertakeClass

BY_LIGHT = ClassBalance(by=("class", "day-night"))

cells_of_candidates = st.lists(st.integers(OUTSIDE, 3), max_size=60)


def one_by_one(quotas: list[int], cells: list[int]) -> tuple[list[int], list[int], int]:
    """The definition: kept candidates, candidates seen of each cell, candidates seen."""
    room, seen, kept = list(quotas), [0] * len(quotas), []
    for candidate, cell in enumerate(cells):
        if cell != OUTSIDE:
            seen[cell] += 1
            if room[cell]:
                room[cell] -= 1
                kept.append(candidate)
        if not any(room):
            return kept, seen, candidate + 1
    return kept, seen, len(cells)


@given(
    quotas=st.lists(st.integers(1, 5), min_size=4, max_size=4),
    cells=cells_of_candidates,
    size=st.integers(1, 20),
)
@example(quotas=[1, 1, 1, 1], cells=[0, 1, 2, 3, 3, 3], size=6)
@example(quotas=[1, 1, 1, 1], cells=[0, 1, 2, OUTSIDE], size=2)
def test_candidates_are_kept_as_if_they_came_one_by_one(quotas, cells, size):
    selection = Selection(np.array(quotas))
    for first in range(0, len(cells), size):
        if not selection.is_full:
            selection.offer(np.array(cells[first : first + size]))
    kept, seen, candidates = one_by_one(quotas, cells)
    assert selection.index.tolist() == kept
    assert selection.cell.tolist() == [cells[candidate] for candidate in kept]
    assert selection.seen.tolist() == seen
    assert selection.candidates == candidates


@given(
    counts=st.lists(
        st.integers(0, 10**9).flatmap(
            lambda seen: st.tuples(st.just(seen), st.integers(min(seen, 1), min(seen, 10**6)))
        ),
        min_size=1,
        max_size=10,
    )
)
def test_weighted_shares_are_those_of_the_candidates(counts):
    seen, kept = (np.array(column) for column in zip(*counts, strict=True))
    weights = [Fraction(weight) for weight in selection_weights(seen, kept).tolist()]
    total = int(seen.sum())
    for (s, k), weight in zip(counts, weights, strict=True):
        share = Fraction(s, total) if total else Fraction(0)
        assert float(k * weight) == pytest.approx(float(share * int(kept.sum())), rel=1e-14)


def test_weights_are_one_where_everything_is_kept():
    assert selection_weights(np.array([7, 3]), np.array([7, 3])).tolist() == [1.0, 1.0]


@given(num_simulations=st.integers(10, 10**6))
def test_quotas_are_as_equal_as_can_be(num_simulations):
    for balance in (ClassBalance(), BY_LIGHT):
        quotas = balance.quotas(num_simulations).tolist()
        assert sum(quotas) == num_simulations
        assert max(quotas) - min(quotas) <= 1
        assert quotas == sorted(quotas, reverse=True)


def test_there_is_no_cell_without_a_simulation():
    with pytest.raises(ConfigError, match="expected at least 10, one a cell, got 9"):
        BY_LIGHT.quotas(9)


def test_a_cell_is_named_after_its_class_and_its_light():
    classes = np.array([int(one) for one in OvertakeClass], np.uint8)
    for night, light in ((False, "Day"), (True, "Night")):
        cells = BY_LIGHT.cell_of(classes, np.full(len(classes), night)).tolist()
        assert [BY_LIGHT.cells[cell] for cell in cells if cell != OUTSIDE] == [
            f"{one.title}/{light}" for one in CLASSES
        ]
        assert cells[len(CLASSES) :] == [OUTSIDE] * 3, "Success_U, censored and departed"


def test_the_number_of_candidates_follows_from_how_many_have_been_needed():
    selection = Selection(np.array([2, 2]))
    assert selection.expected(1000) == 1000, "nothing is known yet"
    selection.offer(np.array([0, 0, 0, 1]))
    assert selection.expected(1000) == 8
    selection.offer(np.array([1]))
    assert selection.expected(1000) == selection.candidates == 5


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"by": ("light",)}, "expected class or class,day-night, got light"),
        ({"policy": "lenient"}, "expected paper or default or strict, got lenient"),
        ({"candidates": 0}, "expected 1 to 1000000000000, got 0"),
    ],
)
def test_what_cannot_be_balanced_is_refused(changes, said):
    with pytest.raises(ConfigError, match=said) as caught:
        ClassBalance(**changes)
    assert "\n" not in str(caught.value)


def test_what_is_not_balanced_has_the_fingerprint_that_it_always_had(recipe, simulator):
    identity = Identity.of(recipe, simulator)
    newer = {"unknown", "source", "balance", "policy", "branches"}
    older = identity.model_dump(mode="json", exclude=newer)
    text = json.dumps(older, sort_keys=True, separators=(",", ":"))
    assert identity.fingerprint == hashlib.sha256(text.encode()).hexdigest()


def test_the_balance_is_a_part_of_the_identity(recipe, simulator):
    plain, *balanced = (
        Identity.of(dataclasses.replace(recipe, balance=one), simulator)
        for one in (None, ClassBalance(), BY_LIGHT, ClassBalance(policy="strict"))
    )
    assert len({one.fingerprint for one in (plain, *balanced)}) == 4
    assert all(plain.differences(one) == ["balance"] for one in balanced)


def test_the_usual_number_of_candidates_is_written_down(recipe, simulator):
    large = dataclasses.replace(recipe, num_simulations=5000, balance=ClassBalance())
    for wanted, one in ((10_000, dataclasses.replace(large, num_simulations=5)), (10**6, large)):
        identity = Identity.of(one, simulator)
        assert identity.balance == ClassBalance(policy="paper", candidates=wanted)
