"""Accidents in recordings with contacts, departures and spins that the test writes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.support.worlds import Vehicle, scenario, wide_road

from overtaking.analysis.validation import accidents as module
from overtaking.analysis.validation.accidents import Severity, accidents, first_of_each
from overtaking.analysis.validation.figures import DEFINITIONS
from overtaking.analysis.validation.tally import Tally
from overtaking.analysis.validation.traffic import Batch, limit
from overtaking.model.trajectories import NO_VEHICLE
from overtaking.sim import engine
from overtaking.world.step_parameters import step_parameters

if TYPE_CHECKING:
    from overtaking.model.trajectories import Trajectories

NUM_VEHICLES = 6
OFF_ROAD = 255
"""Lane of a vehicle that has left the road."""


def uneventful_drive() -> Trajectories:
    """Six vehicles drive 300 m apart in one lane, without an accident."""
    vehicles = [
        Vehicle(s=200.0 + 300.0 * index, lane=0, speed=25.0, driver={"desired_speed": 25.0})
        for index in range(NUM_VEHICLES)
    ]
    world = scenario(vehicles, road=wide_road(), horizon=10.0)
    return engine.run(world, step_parameters(world))


def with_contacts(runs: Trajectories, *hits: tuple[int, int, int, float]) -> Trajectories:
    """The recording with first contacts.

    Args:
        runs: The recording.
        hits: Slot, slot of the partner, time [ms] and change of speed [km/h] of each contact.
    """
    partner = np.full_like(runs.contacts.partner, NO_VEHICLE)
    time, impulse = np.zeros_like(runs.contacts.time), np.zeros_like(runs.contacts.impulse)
    for slot, partner_slot, time_ms, delta_v_kmh in hits:
        partner[0, slot], time[0, slot] = partner_slot, time_ms
        impulse[0, slot] = round(delta_v_kmh / 3.6 * float(runs.scenario.vehicles.mass[0, slot]))
    return runs.replace(contacts=runs.contacts.replace(partner=partner, time=time, impulse=impulse))


def with_states(runs: Trajectories, **changed: np.ndarray) -> Trajectories:
    return runs.replace(states=runs.states.replace(**changed))


def test_a_drive_without_contacts_departures_and_spins_has_no_accident():
    assert accidents(uneventful_drive()) == []


def test_vehicles_connected_by_contacts_are_in_one_accident():
    first_hits = (0, 1, 2000, 9), (1, 0, 2000, 9), (2, 1, 3000, 12)
    second_hits = (4, 5, 2500, 1), (5, 4, 2500, 1)
    chains = accidents(with_contacts(uneventful_drive(), *first_hits, *second_hits))
    assert [accident.vehicles for accident in chains] == [(0, 1, 2), (4, 5)]
    assert [accident.time for accident in chains] == [2.0, 2.5]
    assert all(accident.is_contact for accident in chains)
    assert chains[0].delta_v == pytest.approx(12 / 3.6, rel=1e-3)


def test_a_later_accident_of_a_simulation_adds_its_severity_to_the_first():
    hits = (0, 1, 2000, 1), (1, 0, 2000, 1), (4, 5, 2500, 30), (5, 4, 2500, 30)
    (accident,) = first_of_each(accidents(with_contacts(uneventful_drive(), *hits)))
    assert (accident.vehicles, accident.time) == ((0, 1), 2.0)
    assert accident.severity is Severity.SEVERE


def test_a_chain_of_contacts_is_one_accident_in_any_order_of_its_contacts():
    hits = [(0, 5, 3000, 9), (5, 3, 2000, 9), (3, 5, 2000, 9), (1, 0, 4000, 9)]
    (accident,) = accidents(with_contacts(uneventful_drive(), *hits))
    assert accident.vehicles == (3, 5, 0, 1)


@pytest.mark.parametrize(
    # The limits are 5 and 20 km/h, see the last test.
    ("delta_v_kmh", "severity"),
    [(4.9, Severity.LIGHT), (5.1, Severity.MODERATE), (19.9, Severity.MODERATE),
     (20.1, Severity.SEVERE)],
)  # fmt: skip
def test_the_hardest_contact_decides_the_severity_of_an_accident(delta_v_kmh, severity):
    (accident,) = accidents(
        with_contacts(uneventful_drive(), (0, 1, 2000, 1.0), (1, 0, 2000, delta_v_kmh))
    )
    assert accident.severity is severity


def test_a_departure_and_a_spin_without_contact_are_separate_accidents():
    runs = uneventful_drive()
    lane, heading = runs.states.lane.copy(), runs.states.heading.copy()
    # Frames of 0.05 s: slot 2 leaves the road at 5 s, slot 4 spins at 3 s and leaves it later.
    lane[0, 2, 100:], heading[0, 4, 60:] = OFF_ROAD, 8100
    lane[0, 4, 120:] = OFF_ROAD
    single_accidents = accidents(with_states(runs, lane=lane, heading=heading))
    facts = [(accident.vehicles, accident.time, accident.is_spin) for accident in single_accidents]
    assert facts == [((4,), 3.0, True), ((2,), 5.0, False)]
    assert all(accident.severity is Severity.NO_CONTACT for accident in single_accidents)


def test_a_vehicle_that_leaves_the_road_after_a_contact_has_one_accident():
    runs = with_contacts(uneventful_drive(), (0, 1, 2000, 9), (1, 0, 2000, 9))
    lane = runs.states.lane.copy()
    lane[0, 1, 100:] = OFF_ROAD
    (accident,) = accidents(with_states(runs, lane=lane))
    assert accident.vehicles == (0, 1)


def test_a_departure_after_the_end_of_a_recording_does_not_count():
    runs = uneventful_drive()
    lane = runs.states.lane.copy()
    lane[0, 2, 100:] = OFF_ROAD
    ended = with_states(runs, lane=lane).replace(num_frames=np.array([90], np.int32))
    assert accidents(ended) == []


def test_the_accident_rate_is_per_million_km_with_the_poisson_limits_of_its_count():
    tally = Tally()
    module.count(
        tally, Batch.of(with_contacts(uneventful_drive(), (0, 1, 2000, 9), (1, 0, 2000, 9)))
    )
    tally.add("metres", np.zeros(1, np.int64), np.array([1e9]))
    by_name = {definition.name: definition.measured(tally) for definition in DEFINITIONS}
    rate = by_name["accidents"]
    assert (rate.value, rate.met, rate.needs_km) == (pytest.approx(1.0), True, 0.0)
    # Exact 95 % limits of one event: 0.0253 and 5.572, see test_poisson.py.
    assert rate.low <= 0.0254
    assert rate.high >= 5.57
    assert by_name["accidents_moderate"].value == pytest.approx(1.0)
    assert by_name["accidents_severe"].value == 0.0
    assert by_name["accidents_severe"].met is False


def test_zero_accidents_in_a_million_km_miss_the_target_and_in_fewer_km_decide_nothing():
    definition = next(figure for figure in DEFINITIONS if figure.name == "accidents")
    for metres, expected_met, expected_needs_km in ((1e9, False, 0.0), (9e8, None, 1e6)):
        tally = Tally()
        tally.add("metres", np.zeros(1, np.int64), np.array([metres]))
        rate = definition.measured(tally)
        assert (rate.value, rate.met, rate.needs_km) == (0.0, expected_met, expected_needs_km)
        # 3.689 is the upper limit of no event, see test_poisson.py.
        assert rate.high == pytest.approx(3.689e9 / metres, rel=1e-3)


def test_light_impacts_end_at_5_and_severe_ones_begin_at_20_kilometres_per_hour():
    assert 3.6 * limit("light_impact") == pytest.approx(5.0)
    assert 3.6 * limit("severe_impact") == pytest.approx(20.0)
