"""Contacts against another package's geometry, and impacts against mechanics."""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st
from shapely import affinity
from tests.support.worlds import Vehicle, body_of, scenario, wide_road

from overtaking.sim import engine
from overtaking.sim.reference import collisions
from overtaking.sim.reference.collisions import OrientedBox, RoadVector, swept_overlap
from overtaking.sim.reference.state import State
from overtaking.world.constants import EnabledEffects
from overtaking.world.step_parameters import VEHICLE_FIELDS, VehicleParameters, step_parameters

RESTITUTION = 0.1
STEP = 0.01


@dataclass(frozen=True, kw_only=True)
class Pose:
    """A box around (0, 0)."""

    half_length: float
    half_width: float
    heading: float

    def corners(self) -> np.ndarray:
        """Shape (corner, 2), by another package."""
        box = shapely.box(-self.half_length, -self.half_width, self.half_length, self.half_width)
        turned = affinity.rotate(box, self.heading, use_radians=True, origin=(0, 0))
        return shapely.get_coordinates(turned)

    def ours(self) -> OrientedBox:
        numbers = [
            math.sin(self.heading),
            math.cos(self.heading),
            self.half_length,
            self.half_width,
        ]
        sine, cosine, half_length, half_width = (np.array([x], np.float32) for x in numbers)
        zero = np.zeros(1, np.float32)
        return OrientedBox(
            s=zero, d=zero, sine=sine, cosine=cosine, half_length=half_length, half_width=half_width
        )


def obstacle(a: Pose, b: Pose) -> shapely.Polygon:
    """Positions of the centre of b relative to a that overlap: the Minkowski difference."""
    sums = (a.corners()[:, None, :] - b.corners()[None, :, :]).reshape(-1, 2)
    hull = shapely.MultiPoint(sums).convex_hull
    assert isinstance(hull, shapely.Polygon)
    return hull


poses = st.builds(
    Pose,
    half_length=st.floats(0.5, 6.0),
    half_width=st.floats(0.3, 1.5),
    heading=st.floats(-math.pi, math.pi),
)
places = st.tuples(st.floats(-9.0, 9.0), st.floats(-6.0, 6.0))
moves = st.tuples(st.floats(-8.0, 8.0), st.floats(-8.0, 8.0))


def contact(a: Pose, b: Pose, start: tuple[float, float], end: tuple[float, float]) -> list[float]:
    """`swept_overlap` of two boxes; relative to the first, the second moves from start to end."""
    s0, d0, s1, d1 = (np.array([x], np.float32) for x in (*start, *end))
    overlap = swept_overlap(a.ours(), b.ours(), RoadVector(s0, d0), RoadVector(s1, d1))
    return [float(values[0]) for values in overlap]


@pytest.mark.ci
@given(a=poses, b=poses, start=places, move=moves)
@settings(max_examples=300)
def test_boxes_touch_in_the_span_that_shapely_computes(
    a: Pose, b: Pose, start: tuple[float, float], move: tuple[float, float]
):
    length = math.hypot(*move)
    if length < 1e-3:
        return
    end = (start[0] + move[0], start[1] + move[1])
    enter, leave, _, _ = contact(a, b, start, end)
    touches = enter <= leave and enter <= 1.0 and leave >= 0.0
    forbidden = obstacle(a, b)
    path = shapely.LineString([start, end])
    inside = path.intersection(forbidden)
    graze = shapely.distance(path, forbidden.exterior)
    if not touches or inside.is_empty:
        # Both must agree unless the path ends or passes within 0.1 mm of the border.
        assert touches is (not inside.is_empty) or graze < 1e-4
        return
    if inside.length < 1e-3:
        return
    first = min(shapely.Point(start).distance(shapely.Point(p)) for p in inside.coords)
    last = max(shapely.Point(start).distance(shapely.Point(p)) for p in inside.coords)
    # Float32 over up to 20 m: 0.01 mm, more where the path grazes a side.
    sharpness = 2e-4 * max(1.0, length)
    assert max(enter, 0.0) * length == pytest.approx(first, abs=sharpness)
    assert min(leave, 1.0) * length == pytest.approx(last, abs=sharpness)


@given(a=poses, b=poses, move=moves)
def test_the_contact_normal_is_normal_to_the_side_that_is_hit(
    a: Pose, b: Pose, move: tuple[float, float]
):
    length = math.hypot(*move)
    if length < 0.5:
        return
    # The path begins far away and leads to the middle, so that it enters once.
    start = (-30.0 * move[0] / length, -30.0 * move[1] / length)
    enter, _, along, across = contact(a, b, start, (0.0, 0.0))
    forbidden = obstacle(a, b)
    hit = np.array(start) * (1.0 - enter)
    ring = np.array(forbidden.exterior.coords)
    corner = min(np.hypot(*(ring - hit).T))
    if corner < 1e-3:
        return  # At a corner the normal of either side is right.
    sides = [shapely.LineString(pair) for pair in pairwise(ring)]
    side = min(sides, key=lambda s: s.distance(shapely.Point(*hit)))
    (x0, y0), (x1, y1) = side.coords
    # The normal is a unit vector, at right angles to the side, and points from a to b.
    assert math.hypot(along, across) == pytest.approx(1.0, abs=1e-5)
    cosine = ((x1 - x0) * along + (y1 - y0) * across) / math.hypot(x1 - x0, y1 - y0)
    assert abs(cosine) < 1e-3
    assert along * hit[0] + across * hit[1] > 0.0


@dataclass(slots=True, kw_only=True)
class Crash:
    """Two vehicles before and after a possible impact.

    Attributes:
        before: State at the end of a step, before the exchange of momentum.
        after: State after the exchange of momentum.
        p: Vehicle parameters.
        hit: The contact.
    """

    before: State
    after: State
    p: VehicleParameters
    hit: collisions.Impact


def crash(
    kinds: tuple[str, str],
    *,
    place: tuple[float, float],
    motion: tuple[tuple[float, float, float], tuple[float, float, float]],
    heading: tuple[float, float] = (0.0, 0.0),
) -> Crash:
    """Let the second vehicle be at `place` from the first at the end of a step.

    Args:
        kinds: Classes.
        place: Position of the second centre relative to the first [m].
        motion: Longitudinal speed, speed to the left and yaw rate of each, in vehicle axes.
        heading: Of each [rad].
    """
    world = scenario([Vehicle(kind=kind) for kind in kinds], road=wide_road(), num_slots=2)
    parameters = step_parameters(world)
    state = State.at_start(parameters)
    p = parameters.vehicles
    for i in range(2):
        state.motion.heading[i] = heading[i]
        state.motion.vx[i], state.motion.vy[i], state.motion.yaw_rate[i] = motion[i]
    state.motion.s[0], state.motion.d[0] = 100.0, -5.0
    state.motion.s[1], state.motion.d[1] = 100.0 + place[0], -5.0 + place[1]
    velocity = [road_velocity(state, i) for i in range(2)]
    start = RoadVector(
        s=np.stack([state.motion.s[i] - np.float32(STEP * velocity[i][0]) for i in range(2)]),
        d=np.stack([state.motion.d[i] - np.float32(STEP * velocity[i][1]) for i in range(2)]),
    )
    old = copied(state)
    pair = collisions.VehiclePair(
        first=0,
        second=1,
        frame=collisions.pair_frame(parameters, 0, 1),
        is_near=np.array([True]),
    )
    swept = collisions.SweptStep(index=7, length=np.float32(STEP), start=start)
    hit = collisions._find_impact(copied(state), parameters, pair, swept)
    collisions.resolve_contacts(state, parameters, [pair], swept)
    return Crash(before=old, after=state, p=p, hit=hit)


def copied(state: State) -> State:
    return copy.deepcopy(state)


def road_velocity(state: State, i: int) -> tuple[float, float]:
    cosine, sine = (
        math.cos(float(state.motion.heading[i, 0])),
        math.sin(float(state.motion.heading[i, 0])),
    )
    vx, vy = float(state.motion.vx[i, 0]), float(state.motion.vy[i, 0])
    return vx * cosine - vy * sine, vx * sine + vy * cosine


def momentum(state: State, p: VehicleParameters) -> np.ndarray:
    """Along, across, and about the origin."""
    total = np.zeros(3)
    for i in range(2):
        mass, inertia = 1.0 / float(p.inverse_mass[i, 0]), 1.0 / float(p.inverse_inertia[i, 0])
        along, across = road_velocity(state, i)
        s, d = float(state.motion.s[i, 0]) - 100.0, float(state.motion.d[i, 0]) + 5.0
        spin = mass * (s * across - d * along) + inertia * float(state.motion.yaw_rate[i, 0])
        total += (mass * along, mass * across, spin)
    return total


def energy(state: State, p: VehicleParameters) -> float:
    total = 0.0
    for i in range(2):
        mass, inertia = 1.0 / float(p.inverse_mass[i, 0]), 1.0 / float(p.inverse_inertia[i, 0])
        speed = math.hypot(float(state.motion.vx[i, 0]), float(state.motion.vy[i, 0]))
        total += 0.5 * mass * speed**2 + 0.5 * inertia * float(state.motion.yaw_rate[i, 0]) ** 2
    return total


def approach(impact: Crash, state: State) -> float:
    """Speed at which the touching points of a state approach each other along the normal [m/s]."""
    hit, closing = impact.hit, 0.0
    for i, lever, sign in ((0, hit.lever_first, 1.0), (1, hit.lever_second, -1.0)):
        ahead, aside = road_velocity(state, i)
        normal_speed = ahead * float(hit.normal_s[0]) + aside * float(hit.normal_d[0])
        closing += sign * (normal_speed + float(state.motion.yaw_rate[i, 0]) * float(lever[0]))
    return closing


motions = st.tuples(st.floats(0.0, 40.0), st.floats(-4.0, 4.0), st.floats(-1.0, 1.0))


@pytest.mark.ci
@given(
    kinds=st.tuples(*[st.sampled_from(["S", "M", "L", "V", "T", "MC"])] * 2),
    place=st.tuples(st.floats(-6.0, 6.0), st.floats(-2.2, 2.2)),
    motion=st.tuples(motions, motions),
    heading=st.tuples(st.floats(-0.8, 0.8), st.floats(-0.8, 0.8)),
)
@example(
    kinds=("L", "T"),
    place=(0.0, 2.171875),
    motion=((0.0, 3.0, 1.0), (1.0, 0.0, 0.0)),
    heading=(0.0, 0.0),
)
@example(
    kinds=("T", "S"),
    place=(5.515625, -0.5625),
    motion=((6.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
    heading=(0.5, -0.25),
)
@settings(max_examples=200)
def test_an_impact_keeps_momentum_and_spin_and_never_makes_energy(kinds, place, motion, heading):
    impact = crash(kinds, place=place, motion=motion, heading=heading)
    size = 20_000.0 * 40.0
    # Float32: 1e-6 of the momentum of a lorry at speed; its lever is 6 m.
    lost = momentum(impact.after, impact.p) - momentum(impact.before, impact.p)
    assert np.abs(lost[:2]).max() <= 2e-6 * size
    assert abs(lost[2]) <= 5e-6 * size
    before, after = energy(impact.before, impact.p), energy(impact.after, impact.p)
    assert after <= before * (1.0 + 1e-5) + 1.0
    touched = bool(impact.after.motion.is_wreck[0, 0])
    assert touched == bool(impact.after.motion.is_wreck[1, 0])
    if not touched:
        assert after == before


@pytest.mark.ci
@given(
    kinds=st.tuples(*[st.sampled_from(["S", "M", "V", "T"])] * 2),
    aside=st.floats(-1.5, 1.5),
    speeds=st.tuples(st.floats(5.0, 40.0), st.floats(5.0, 40.0)),
    heading=st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3)),
)
def test_after_an_impact_the_contact_opens_at_a_tenth_of_the_speed(kinds, aside, speeds, heading):
    gap = 0.5 * (body_of(kinds[0])["length"] + body_of(kinds[1])["length"]) - 0.05
    still = (0.0, 0.0)
    motion = ((speeds[0], *still), (speeds[1], *still))
    impact = crash(kinds, place=(gap, aside), motion=motion, heading=heading)
    if not impact.after.motion.is_wreck[0, 0]:
        return
    impulse, closing = (
        float(impact.after.first_contact.impulse[0, 0]),
        float(impact.after.first_contact.closing_speed[0, 0]),
    )
    assert closing > 0.0
    # The work of the impulse is closing (1 - e) / 2 of it, whatever the geometry.
    work = energy(impact.before, impact.p) - energy(impact.after, impact.p)
    scale = energy(impact.before, impact.p)
    expected = 0.5 * (1.0 - RESTITUTION) * closing * impulse
    assert work == pytest.approx(expected, rel=1e-3, abs=2e-6 * scale)
    # Newton's law of impact at the contact point, along the normal.
    assert approach(impact, impact.before) == pytest.approx(closing, rel=1e-4, abs=1e-4)
    assert approach(impact, impact.after) == pytest.approx(
        -RESTITUTION * closing, rel=1e-2, abs=1e-3
    )


@pytest.mark.parametrize(("striker", "struck"), [("M", "M"), ("T", "S"), ("S", "T"), ("V", "MC")])
def test_a_rear_end_at_10_mps_gives_the_closed_form_in_one_dimension(striker: str, struck: str):
    gap = 0.5 * (body_of(striker)["length"] + body_of(struck)["length"]) - 0.02
    impact = crash((striker, struck), place=(gap, 0.0), motion=((30.0, 0.0, 0.0), (20.0, 0.0, 0.0)))
    m1, m2 = body_of(striker)["mass"], body_of(struck)["mass"]
    common = (m1 * 30.0 + m2 * 20.0) / (m1 + m2)
    expected = [
        common - RESTITUTION * 10.0 * m2 / (m1 + m2),
        common + RESTITUTION * 10.0 * m1 / (m1 + m2),
    ]
    np.testing.assert_allclose(impact.after.motion.vx[:, 0], expected, rtol=1e-5)
    assert (impact.after.motion.vy == 0.0).all()
    assert (impact.after.motion.yaw_rate == 0.0).all()
    impulse = (1.0 + RESTITUTION) * 10.0 * m1 * m2 / (m1 + m2)
    assert float(impact.after.first_contact.impulse[0, 0]) == pytest.approx(impulse, rel=1e-5)
    assert float(impact.after.first_contact.closing_speed[1, 0]) == pytest.approx(10.0, rel=1e-5)
    # The cars come 0.1 m closer in the eighth step, and overlap by 0.02 m at its end.
    assert float(impact.after.first_contact.time[0, 0]) == pytest.approx(0.078, abs=1e-4)


def test_an_off_centre_rear_end_turns_both_vehicles_in_the_direction_of_mechanics():
    gap = 0.5 * body_of("M")["length"] * 2.0 - 0.02
    impact = crash(("M", "M"), place=(gap, 1.0), motion=((30.0, 0.0, 0.0), (20.0, 0.0, 0.0)))
    # The impulse pushes the struck car forwards on its right rear, so it turns to the left. The
    # impulse holds the striking car back on its left front, so it turns to the left as well.
    assert float(impact.after.motion.yaw_rate[1, 0]) > 0.1
    assert float(impact.after.motion.yaw_rate[0, 0]) > 0.1
    # Contact in the middle of the overlap, 0.5 m from each axis: softness by the textbook.
    m, inertia = body_of("M")["mass"], body_of("M")["yaw_inertia"]
    impulse = 1.1 * 10.0 / (2.0 / m + 2.0 * 0.5**2 / inertia)
    assert float(impact.after.first_contact.impulse[0, 0]) == pytest.approx(impulse, rel=1e-3)
    np.testing.assert_allclose(
        impact.after.motion.yaw_rate[:, 0], 0.5 * impulse / inertia, rtol=1e-3
    )


def test_vehicles_that_slide_along_each_other_lose_no_speed():
    width = body_of("M")["width"]
    impact = crash(
        ("M", "M"), place=(0.5, width - 0.01), motion=((30.0, 0.3, 0.0), (25.0, -0.3, 0.0))
    )
    assert bool(impact.after.motion.is_wreck[0, 0])
    np.testing.assert_allclose(impact.after.motion.vx[:, 0], [30.0, 25.0], atol=1e-5)


def test_the_time_of_a_collision_follows_from_kinematics():
    # A standing car is 100 m ahead of a car at 25 m/s, whose driver sees nothing.
    blind = {"time_gap": 0.0, "desired_speed": 25.0}
    cars = [
        Vehicle(s=0.0, speed=25.0, driver=blind),
        Vehicle(s=100.0 + body_of("M")["length"], speed=0.0, driver={"desired_speed": 0.01}),
    ]
    world = scenario(cars, road=wide_road(lanes=1), weather={"fog": 100.0}, horizon=10.0)
    parameters = step_parameters(world, EnabledEffects(gusts=False, distance_error=False))
    # No driver sees farther than a millimetre, so no driver brakes.
    parameters.vehicle_table[VEHICLE_FIELDS.index("attention_range")] = 1e-3
    run = engine.run(world, parameters)
    assert run.contacts.partner[0, 0] == 1
    frame = int(run.contacts.time[0, 0]) // 50
    before = run.states.s[0, :2, frame] / 1000.0
    speed = run.states.speed[0, 0, frame] / 1000.0
    room = before[1] - before[0] - body_of("M")["length"]
    # At constant speed from the last frame before the contact; the pedal balances drag. The
    # tolerance is one step.
    expected = frame * 50.0 + room / speed * 1000.0
    assert int(run.contacts.time[0, 0]) == pytest.approx(expected, abs=10.0)
    # The striking speed is the speed of approach, and nothing moved before.
    assert int(run.contacts.closing_speed[0, 0]) == pytest.approx(speed * 1000.0, rel=1e-3)
