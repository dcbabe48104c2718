"""Draws from where more happens are undone by their weights."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
import scipy.stats

from overtaking.core.errors import ConfigError
from overtaking.core.random_numbers import Stream
from overtaking.labels.labelling import label
from overtaking.model.overtake_events import Outcome
from overtaking.model.vehicles import EGO_SLOT
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification, profile_names
from overtaking.scenarios.random_draws import ProposalSampler, RandomStream
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.scenarios.specification import Component
from overtaking.scenarios.weather_sampling import draw_weather
from overtaking.sim import engine

if TYPE_CHECKING:
    from overtaking.model.weather import Weather

NUMBERS = np.arange(20_000, dtype=np.uint64)


def bent(share: float, power: float) -> tuple[np.ndarray, np.ndarray]:
    proposal = Component(name="windy", share=share, powers={"wind": power})
    bending = ProposalSampler((proposal,), 3, NUMBERS)
    u = (np.random.default_rng(1).permutation(len(NUMBERS)) + 0.5) / len(NUMBERS)
    return bending.transform("wind", u.astype(np.float32)), bending.weight_so_far


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


def shifted(shift: float) -> tuple[np.ndarray, np.ndarray]:
    far = Component(name="far", share=0.4, shifts={"ego_time_gap": shift})
    near = Component(name="near", share=0.3, shifts={"ego_time_gap": -shift})
    bending = ProposalSampler((far, near), 3, NUMBERS)
    z = scipy.stats.norm.ppf((np.random.default_rng(1).permutation(20_000) + 0.5) / 20_000)
    return bending.transform("ego_time_gap", z.astype(np.float32)), bending.weight_so_far


@pytest.mark.parametrize("shift", [0.5, 1.5, 3.0])
def test_weighted_moments_of_shifted_numbers_are_those_of_the_normal_distribution(shift):
    v, weight = shifted(shift)
    for moment in range(5):
        estimate = weight * v**moment
        spread = estimate.std() / np.sqrt(len(v))
        assert estimate.mean() == pytest.approx(scipy.stats.norm.moment(moment), abs=5.0 * spread)
    assert weight.max() <= 1.0 / 0.3 + 1e-6


def test_what_a_component_draws_from_a_part_is_there_and_weighted_back():
    low = Component(name="low", share=0.6, parts={"sun": (0.5, 0.65)})
    bending = ProposalSampler((low,), 3, NUMBERS)
    u = (np.random.default_rng(1).permutation(len(NUMBERS)) + 0.5) / len(NUMBERS)
    v, weight = bending.transform("sun", u.astype(np.float32)), bending.weight_so_far
    inside = (v >= 0.5) & (v <= 0.65)
    assert inside.mean() == pytest.approx(0.6 + 0.4 * 0.15, abs=0.01)
    assert weight[~inside] == pytest.approx(2.5)
    assert weight[inside] == pytest.approx(1.0 / (0.4 + 0.6 / 0.15))
    assert (weight * inside).mean() == pytest.approx(0.15, abs=0.002)


def test_each_component_draws_its_share():
    v, _ = shifted(3.0)
    # Of those moved there 93 % lie beyond 1.5, of those as they are met 7 %.
    assert (v > 1.5).mean() == pytest.approx(0.4 * 0.933 + 0.3 * 0.0668, abs=0.02)
    assert (v < -1.5).mean() == pytest.approx(0.3 * 0.933 + 0.3 * 0.0668, abs=0.02)


def test_a_tempered_component_is_a_mixture_of_its_copies():
    one = {"powers": {"wind": 0.2}, "shifts": {"ego_time_gap": 2.0}}
    whole = Component(name="both", share=0.6, tempers=(1.0, 0.5, 0.25), **one)
    powers, shifts = (0.2, 0.2**0.5, 0.2**0.25), (2.0, 1.0, 0.5)
    bending = ProposalSampler((whole,), 3, NUMBERS)
    rng = np.random.default_rng(1)
    u = ((rng.permutation(len(NUMBERS)) + 0.5) / len(NUMBERS)).astype(np.float32)
    z = scipy.stats.norm.ppf((rng.permutation(len(NUMBERS)) + 0.5) / len(NUMBERS))
    v, y = bending.transform("wind", u), bending.transform("ego_time_gap", z.astype(np.float32))
    # The densities are SciPy's: u^p has that of a beta distribution with a = 1 / p.
    drawn_from = 0.4 * scipy.stats.norm.pdf(y)
    for power, shift in zip(powers, shifts, strict=True):
        drawn_from += 0.2 * scipy.stats.beta.pdf(v, 1 / power, 1) * scipy.stats.norm.pdf(y - shift)
    np.testing.assert_allclose(
        bending.weight_so_far, scipy.stats.norm.pdf(y) / drawn_from, rtol=1e-3
    )
    assert bending.weight_so_far.mean() == pytest.approx(
        1.0, abs=5.0 * bending.weight_so_far.std() / 141.0
    )


@pytest.mark.ci
def test_few_simulations_of_the_risk_profile_weigh_nothing():
    weight = (
        ScenarioSource(load_specification("motorway-risk"), load_road("motorway"), 1)
        .sample(NUMBERS[:8000])
        .weight
    )
    assert (weight < 1e-6).mean() < 0.1
    assert weight.sum() ** 2 / (weight**2).sum() > 0.4 * len(weight)
    assert weight.mean() == pytest.approx(1.0, abs=4.0 * weight.std() / np.sqrt(len(weight)))


def test_without_a_proposal_every_weight_is_one():
    bending = ProposalSampler((), 1, NUMBERS)
    u = np.full(len(NUMBERS), 0.25, np.float32)
    assert bending.transform("wind", u) is u
    assert (bending.weight_so_far == 1.0).all()


def test_the_risk_profile_has_more_of_everything_and_weighs_it_back():
    stream = RandomStream(1, NUMBERS, Stream.WEATHER)
    natural = draw_weather(load_specification("motorway").weather, stream)
    risk = load_specification("motorway-risk")
    bending = ProposalSampler(risk.proposal, 1, NUMBERS)
    stream = RandomStream(1, NUMBERS, Stream.WEATHER)
    weather = draw_weather(risk.weather, stream, bending.transform)
    weight = bending.weight_so_far
    for often in ((lambda w: w.rain > 0), (lambda w: w.fog > 20), (lambda w: w.wind > 60)):
        plain, enriched = often(natural), often(weather)
        assert enriched.mean() > 1.5 * plain.mean()
        spread = (weight * enriched).std() / np.sqrt(len(weight)) + plain.std() / np.sqrt(
            len(weight)
        )
        assert (weight * enriched).mean() == pytest.approx(plain.mean(), abs=4.0 * spread)


SUN_ALTITUDES = {
    ("motorway-risk", "dense nights"): (-20.0, 0.0),
    ("motorway-risk", "dazzled"): (0.0, 18.0),
    ("rural-risk", "busy nights"): (-20.0, 12.0),
}
"""Altitudes of the sun that each component with a part of `sun` states in its profile [deg]."""


def weather_of_component(profile: str, name: str) -> Weather:
    """Weather of the simulations that are drawn from one component of a profile."""
    specification = load_specification(profile)
    (component,) = (part for part in specification.proposal or () if part.name == name)
    component = component.model_copy(update={"share": 0.999})
    proposal = ProposalSampler((component,), 1, NUMBERS)
    stream = RandomStream(1, NUMBERS, Stream.WEATHER)
    weather = draw_weather(specification.weather, stream, proposal.transform)
    is_drawn = RandomStream(1, NUMBERS, Stream.PROPOSAL).uniform() < 0.999
    return weather.select(is_drawn)


@pytest.mark.parametrize(("profile", "name"), SUN_ALTITUDES)
def test_a_component_draws_the_sun_at_the_altitudes_that_its_profile_states(profile, name):
    low, high = SUN_ALTITUDES[profile, name]
    altitude = np.degrees(weather_of_component(profile, name).sun_altitude.astype(np.float64))
    assert altitude.min() == pytest.approx(low, abs=0.05)
    assert altitude.max() == pytest.approx(high, abs=0.05)


def test_the_table_of_sun_altitudes_has_every_component_that_moves_the_sun():
    moving = {
        (profile, component.name)
        for profile in profile_names()
        for component in load_specification(profile).proposal or ()
        if component.changes("sun")
    }
    assert moving == set(SUN_ALTITUDES)


def test_dense_nights_are_nights_and_the_sun_of_dazzled_dazzles():
    assert weather_of_component("motorway-risk", "dense nights").night.all()
    dazzled = weather_of_component("motorway-risk", "dazzled")
    # The part of `sun_direction` is 0.2 degrees wider than the angle at which the sun dazzles, and
    # rain brings clouds.
    assert dazzled.low_sun[dazzled.rain == 0].mean() > 0.98


def test_the_risk_profile_has_more_nights_and_low_suns_and_weighs_them_back():
    stream = RandomStream(1, NUMBERS, Stream.WEATHER)
    natural = draw_weather(load_specification("motorway").weather, stream)
    risk = load_specification("motorway-risk")
    proposal = ProposalSampler(risk.proposal or (), 1, NUMBERS)
    stream = RandomStream(1, NUMBERS, Stream.WEATHER)
    weather = draw_weather(risk.weather, stream, proposal.transform)
    weight = proposal.weight_so_far
    for plain, enriched, factor in (
        (natural.night, weather.night, 1.5),
        (natural.low_sun, weather.low_sun, 2.0),
    ):
        assert enriched.mean() > factor * plain.mean()
        spread = np.hypot((weight * enriched).std(), plain.std()) / np.sqrt(len(weight))
        assert (weight * enriched).mean() == pytest.approx(plain.mean(), abs=4.0 * spread)


@pytest.mark.ci
def test_the_weighted_share_of_attempts_at_night_agrees_with_that_of_the_natural_profile():
    road, numbers = load_road("motorway"), NUMBERS[:768]

    def sample(profile: str) -> tuple[np.ndarray, np.ndarray]:
        scenario = ScenarioSource(load_specification(profile), road, 5).sample(numbers)
        labels = label(engine.simulate(scenario)).labels
        return scenario.weight, (labels.outcome != Outcome.NO_ATTEMPT) & scenario.weather.night

    (weight, risky), (_, natural) = sample("motorway-risk"), sample("motorway")
    interval = 3.0 * np.hypot((weight * risky).std(), natural.std()) / np.sqrt(len(numbers))
    assert (weight * risky).mean() == pytest.approx(natural.mean(), abs=interval)
    # Without weights the shares disagree, so the comparison can fail.
    assert risky.mean() > natural.mean() + interval


def test_scenarios_carry_their_weights():
    road = load_road("motorway")
    drawn = ScenarioSource(load_specification("motorway-risk"), road, 1).sample(NUMBERS[:400])
    assert drawn.weight.dtype == np.float64
    assert drawn.weight.min() < 0.5 < 2.0 < drawn.weight.max() <= 1.0 / 0.36 + 1e-9
    natural = ScenarioSource(load_specification("motorway"), road, 1).sample(NUMBERS[:400])
    assert (natural.weight == 1.0).all()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"share": 0.5, "powers": {"winds": 2.0}}, "did you mean wind"),
        ({"share": 0.5, "shifts": {"ego_time_gaps": 1.0}}, "did you mean ego_time_gap"),
        ({"share": 1.0}, "less than 1"),
        ({"share": 0.5, "parts": {"sun": [0.7, 0.6]}}, "a lower end below the upper one"),
        ({"share": 0.5, "parts": {"sun": [0.5, 0.5 + 1e-12]}}, "by 0.001 or more"),
        ({"share": 0.5, "powers": {"sun": 1e-320}}, "greater than or equal to 0.01"),
        ({"share": 0.5, "parts": {"sun": [0, 1]}, "powers": {"sun": 2}}, "a power or a part"),
        ({"share": 0.5, "power": {"wind": 2.0}}, "did you mean powers"),
    ],
)
def test_a_wrong_component_is_refused(given, message):
    with pytest.raises(ConfigError, match=message):
        load_specification("motorway-risk", {"proposal": [{"name": "windy"} | given]})


def test_components_that_leave_nothing_as_it_is_met_are_refused():
    half = {"name": "half", "share": 0.5}
    with pytest.raises(ConfigError, match="a sum below 1"):
        load_specification("motorway-risk", {"proposal": [half, half]})


@pytest.mark.ci
def test_the_risk_profile_has_orderly_drivers_and_weighs_them_back():
    road = load_road("motorway")
    natural = ScenarioSource(load_specification("motorway"), road, 1).sample(NUMBERS[:8000]).drivers
    risk = ScenarioSource(load_specification("motorway-risk"), road, 1).sample(NUMBERS[:8000])
    weight, far = risk.weight, 2.2
    for slot, more in ((EGO_SLOT, 1.5), (5, 1.05)):
        enriched, plain = (who.time_gap[:, slot] > far for who in (risk.drivers, natural))
        assert enriched.mean() > more * plain.mean()
        spread = np.hypot((weight * enriched).std(), plain.std()) / np.sqrt(len(weight))
        assert (weight * enriched).mean() == pytest.approx(plain.mean(), abs=4.0 * spread)


@pytest.mark.ci
def test_rural_risk_has_more_who_misjudge_and_heed_no_line_and_weighs_them_back():
    road = load_road("rural")
    natural = ScenarioSource(load_specification("rural"), road, 1).sample(NUMBERS[:8000]).drivers
    risk = ScenarioSource(load_specification("rural-risk"), road, 1).sample(NUMBERS[:8000])
    weight = risk.weight
    assert weight.max() <= 1.0 / 0.36 + 1e-9
    for unusual in (lambda who: ~who.heeds_solid_lines, lambda who: who.passing_time_factor < 0.6):
        enriched, plain = (unusual(who)[:, EGO_SLOT] for who in (risk.drivers, natural))
        assert enriched.mean() > 2.0 * plain.mean()
        spread = np.hypot((weight * enriched).std(), plain.std()) / np.sqrt(len(weight))
        assert (weight * enriched).mean() == pytest.approx(plain.mean(), abs=4.0 * spread)
        others = unusual(risk.drivers)[:, 1:]
        assert others.mean() == pytest.approx(unusual(natural)[:, 1:].mean(), abs=0.005)
