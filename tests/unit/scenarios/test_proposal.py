"""Draws from where more happens are undone by their weights."""

from __future__ import annotations

import numpy as np
import pytest

from overtaking.core.errors import ConfigError
from overtaking.exchange.roads import load_road
from overtaking.scenarios import sample, spec
from overtaking.scenarios.proposal import Bending
from overtaking.scenarios.schema_flow import Proposal
from overtaking.scenarios.weather import sample_weather

NUMBERS = np.arange(20_000, dtype=np.uint64)


def bent(share: float, power: float) -> tuple[np.ndarray, np.ndarray]:
    proposal = Proposal(share=share, powers={"wind": power})
    bending = Bending(proposal, 3, NUMBERS)
    u = (np.random.default_rng(1).permutation(len(NUMBERS)) + 0.5) / len(NUMBERS)
    return bending("wind", u.astype(np.float32)), bending.weight


@pytest.mark.parametrize(("share", "power"), [(0.8, 0.4), (0.5, 3.0), (0.95, 0.2)])
def test_weighted_moments_are_those_of_the_uniform_distribution(share, power):
    v, weight = bent(share, power)
    spread = (weight * (v - 0.5)).std() / np.sqrt(len(v))
    for moment in (1, 2, 5):
        found = (weight * v**moment).mean()
        assert found == pytest.approx(1.0 / (moment + 1), abs=5.0 * spread)
    assert weight.mean() == pytest.approx(1.0, abs=5.0 * weight.std() / np.sqrt(len(v)))


@pytest.mark.parametrize(("share", "power"), [(0.8, 0.4), (0.5, 3.0), (0.95, 0.2)])
def test_no_weight_exceeds_the_bound_so_the_effective_number_does_not_collapse(share, power):
    _, weight = bent(share, power)
    assert weight.max() <= 1.0 / (1.0 - share) + 1e-9
    effective = weight.sum() ** 2 / (weight**2).sum()
    assert effective >= 0.95 * (1.0 - share) * len(weight)


def test_a_power_below_one_favours_the_upper_end():
    upper, _ = bent(0.8, 0.4)
    lower, _ = bent(0.8, 3.0)
    assert upper.mean() > 0.6 > 0.4 > lower.mean()


def test_without_a_proposal_every_weight_is_one():
    bending = Bending(None, 1, NUMBERS)
    u = np.full(len(NUMBERS), 0.25, np.float32)
    assert bending("wind", u) is u
    assert (bending.weight == 1.0).all()


def test_the_risk_profile_has_more_of_everything_and_weighs_it_back():
    natural = sample_weather(spec("motorway").weather, 1, NUMBERS)
    risk = spec("motorway-risk")
    bending = Bending(risk.proposal, 1, NUMBERS)
    weather = sample_weather(risk.weather, 1, NUMBERS, bending)
    weight = bending.weight
    for often in ((lambda w: w.rain > 0), (lambda w: w.fog > 20), (lambda w: w.wind > 60)):
        plain, enriched = often(natural), often(weather)
        assert enriched.mean() > 1.5 * plain.mean()
        spread = (weight * enriched).std() / np.sqrt(len(weight)) + plain.std() / np.sqrt(
            len(weight)
        )
        assert (weight * enriched).mean() == pytest.approx(plain.mean(), abs=4.0 * spread)


def test_scenarios_carry_their_weights():
    road = load_road("motorway")
    drawn = sample(spec("motorway-risk"), road, 1, NUMBERS[:400])
    assert drawn.weight.dtype == np.float64
    assert drawn.weight.min() < 0.5 < 2.0 < drawn.weight.max() <= 5.0 + 1e-9
    natural = sample(spec("motorway"), road, 1, NUMBERS[:400])
    assert (natural.weight == 1.0).all()


def test_an_unknown_quantity_is_refused():
    with pytest.raises(ConfigError, match="did you mean wind"):
        spec("motorway-risk", {"proposal.powers": {"winds": 2.0}})
