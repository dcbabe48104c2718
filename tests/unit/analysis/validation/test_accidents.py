"""Accidents in recordings whose contacts, departures and spins are written by hand."""

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

NUMBER = 6
BEYOND = 255


def drive() -> Trajectories:
    """Six vehicles far behind each other in one lane: nothing happens."""
    vehicles = [
        Vehicle(s=200.0 + 300.0 * k, lane=0, speed=25.0, driver={"desired_speed": 25.0})
        for k in range(NUMBER)
    ]
    world = scenario(vehicles, road=wide_road(), horizon=10.0)
    return engine.run(world, step_parameters(world))


def touching(runs: Trajectories, *hits: tuple[int, int, int, float]) -> Trajectories:
    """With first contacts: slot, partner, time [ms], change of speed [km/h]."""
    partner = np.full_like(runs.contacts.partner, NO_VEHICLE)
    time, impulse = np.zeros_like(runs.contacts.time), np.zeros_like(runs.contacts.impulse)
    for slot, other, when, change in hits:
        partner[0, slot], time[0, slot] = other, when
        impulse[0, slot] = round(change / 3.6 * float(runs.scenario.vehicles.mass[0, slot]))
    return runs.replace(contacts=runs.contacts.replace(partner=partner, time=time, impulse=impulse))


def with_states(runs: Trajectories, **changed: np.ndarray) -> Trajectories:
    return runs.replace(states=runs.states.replace(**changed))


def test_a_drive_without_any_has_none():
    assert accidents(drive()) == []


def test_who_is_connected_by_contacts_is_in_one_accident():
    found = accidents(
        touching(drive(), (0, 1, 2000, 9), (1, 0, 2000, 9), (2, 1, 3000, 12), (4, 5, 2500, 1),
                 (5, 4, 2500, 1))
    )  # fmt: skip
    assert [one.vehicles for one in found] == [(0, 1, 2), (4, 5)]
    assert [one.time for one in found] == [2.0, 2.5]
    assert all(one.is_contact for one in found)
    assert found[0].delta_v == pytest.approx(12 / 3.6, rel=1e-3)


def test_what_follows_in_a_simulation_belongs_to_the_first_accident_and_may_be_harder():
    hits = (0, 1, 2000, 1), (1, 0, 2000, 1), (4, 5, 2500, 30), (5, 4, 2500, 30)
    (only,) = first_of_each(accidents(touching(drive(), *hits)))
    assert (only.vehicles, only.time) == ((0, 1), 2.0)
    assert only.severity is Severity.SEVERE


def test_a_chain_is_one_accident_in_whatever_order_its_links_are_known():
    hits = [(0, 5, 3000, 9), (5, 3, 2000, 9), (3, 5, 2000, 9), (1, 0, 4000, 9)]
    (only,) = accidents(touching(drive(), *hits))
    assert only.vehicles == (3, 5, 0, 1)


@pytest.mark.parametrize(
    ("change", "severity"),
    [(4.9, Severity.LIGHT), (5.1, Severity.MODERATE), (19.9, Severity.MODERATE),
     (20.1, Severity.SEVERE)],
)  # fmt: skip
def test_the_hardest_hit_decides_how_hard_it_was(change, severity):
    (only,) = accidents(touching(drive(), (0, 1, 2000, 1.0), (1, 0, 2000, change)))
    assert only.severity is severity


def test_who_leaves_the_road_or_spins_without_contact_has_an_accident_of_its_own():
    runs = drive()
    lane, heading = runs.states.lane.copy(), runs.states.heading.copy()
    lane[0, 2, 100:], heading[0, 4, 60:] = BEYOND, 8100
    lane[0, 4, 120:] = BEYOND
    found = accidents(with_states(runs, lane=lane, heading=heading))
    said = [(one.vehicles, one.time, one.is_spin) for one in found]
    assert said == [((4,), 3.0, True), ((2,), 5.0, False)]
    assert all(one.severity is Severity.NO_CONTACT for one in found)


def test_who_touched_and_then_leaves_the_road_has_only_one():
    runs = touching(drive(), (0, 1, 2000, 9), (1, 0, 2000, 9))
    lane = runs.states.lane.copy()
    lane[0, 1, 100:] = BEYOND
    (only,) = accidents(with_states(runs, lane=lane))
    assert only.vehicles == (0, 1)


def test_what_lies_after_the_end_of_a_recording_does_not_count():
    runs = drive()
    lane = runs.states.lane.copy()
    lane[0, 2, 100:] = BEYOND
    assert (
        accidents(with_states(runs, lane=lane).replace(num_frames=np.array([90], np.int32))) == []
    )


def test_the_rate_is_per_million_km_with_the_limits_of_its_count():
    tally = Tally()
    module.count(tally, Batch.of(touching(drive(), (0, 1, 2000, 9), (1, 0, 2000, 9))))
    tally.add("metres", np.zeros(1, np.int64), np.array([1e9]))
    by_name = {one.name: one.measured(tally) for one in DEFINITIONS}
    rate = by_name["accidents"]
    assert (rate.value, rate.met, rate.needs_km) == (pytest.approx(1.0), True, 0.0)
    assert rate.low <= 0.0254
    assert rate.high >= 5.57
    assert by_name["accidents_moderate"].value == pytest.approx(1.0)
    assert by_name["accidents_severe"].value == 0.0
    assert by_name["accidents_severe"].met is False


def test_no_accident_at_all_fails_and_too_few_km_say_nothing():
    for metres, met, needs in ((1e9, False, 0.0), (9e8, None, 1e6)):
        tally = Tally()
        tally.add("metres", np.zeros(1, np.int64), np.array([metres]))
        rate = {one.name: one for one in DEFINITIONS}["accidents"].measured(tally)
        assert (rate.value, rate.met, rate.needs_km) == (0.0, met, needs)
        assert rate.high == pytest.approx(3.689e9 / metres, rel=1e-3)


def test_the_limits_of_severity_are_those_that_are_declared():
    assert 3.6 * limit("light_impact") == pytest.approx(5.0)
    assert 3.6 * limit("severe_impact") == pytest.approx(20.0)
