"""Errors of measurement: the standard error of a margin against Monte Carlo."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.support.cases import Track, ramp, with_events
from tests.support.law_fixtures import FIXTURES
from tests.support.overtakes import crossing, overtake, passing

import overtaking as ot
from overtaking.cli import main
from overtaking.core.errors import ConfigError
from overtaking.labels.event_detection import case_from_trajectories
from overtaking.labels.law.judging import judge_pack, judge_rule
from overtaking.labels.law.measurement_errors import MeasurementErrors, propagated_error
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.labels.law.safe_distance import margin_to_leader
from overtaking.model.verdicts import Verdict
from overtaking.recordings.recording import lane_codes

if TYPE_CHECKING:
    from overtaking.model.trajectories import Trajectories
    from overtaking.model.verdicts import Case

RULES = {rule.code: rule for rule in PORTUGAL.rules}
ERRORS = MeasurementErrors(position_std=0.1, speed_std=0.1)
DRAWS = 1500

UPPER_BOUNDS = {
    # The margin comes from a certain crossing; in other frames the line is near.
    ("L2", "over a mixed line that is broken on this side"),
    ("L2", "over a mixed line that is continuous on this side"),
    ("L2", "back over a mixed line that is continuous from there"),
    # The other edge is equally near, so the distance to the nearer edge varies less.
    ("L2", "back before the line is solid"),
    # In the middle of a stretch one end comes nearer as the other end recedes.
    ("L17", "over a crossing for pedestrians on lanes of one direction"),
    ("L29", "a truck behind a sign for trucks"),
}
"""Fixtures for which the formula gives a larger error than Monte Carlo."""

MEASURED: list[tuple[str, str, Any]] = [
    (code, name, make)
    for code, verdict, name, make in FIXTURES
    if verdict in (Verdict.LEGAL, Verdict.ILLEGAL)
    and RULES[code].criterion.ERROR_FORMULA != "0"
    and RULES[code].unit != "lanes"
    and (code, name) not in UPPER_BOUNDS
]
HARD = ("L23", "some braking", lambda: crossing(
    Track(s=-40.0, speed=36.0, lane=1), events={"attempt": 60, "line_crossed": 100},
    ego={"lane": ramp((4, 0), (6, 1), frames=200)}))  # fmt: skip


def drawn(run: Trajectories, errors: MeasurementErrors, num_draws: int) -> Trajectories:
    """The same simulation measured many times, each time with other random errors."""
    repeated, generator = run.select(np.zeros(num_draws, np.int64)), np.random.default_rng(5)
    states, shape = repeated.states, (*repeated.states.s.shape[:2], 1)

    def noise(size: float) -> np.ndarray:
        return np.rint(generator.normal(0.0, size * 1000.0, shape)).astype(np.int32)

    d = states.d + noise(errors.position_std)
    return repeated.replace(
        states=states.replace(
            s=states.s + noise(errors.position_std),
            d=d,
            lane=lane_codes(run.road, d * 1e-3),
            speed=np.maximum(states.speed + noise(errors.speed_std), 0),
        )
    )


def measured(case: Case, errors: MeasurementErrors, num_draws: int = DRAWS) -> Case:
    """The case measured many times, always with the events of the exact case."""
    events = case.events.select(np.zeros(num_draws, np.int64))
    events = events.replace(original_lane=events.original_lane.astype(np.uint8))
    return with_events(case_from_trajectories(drawn(case.trajectories, errors, num_draws)), events)


@pytest.mark.parametrize(("code", "name", "make"), [*MEASURED, HARD])
def test_the_error_of_a_margin_is_the_standard_deviation_of_many_measurements(code, name, make):
    del name
    rule, case = RULES[code], make()
    error = rule.criterion.standard_error(case, rule.criterion.check(case), ERRORS)
    assert error is not None
    standard_error = float(error[0])
    margins = rule.criterion.check(measured(case, ERRORS)).margin
    # 1500 draws give a standard deviation within 4 %. Two formulas are coarser: the one of sight
    # ignores the change of friction (8 %), and a due time is in frames of 0.05 s (18 %).
    assert standard_error == pytest.approx(float(margins.std()), rel=0.2, abs=1e-3)


@pytest.mark.parametrize("distance", [0.05, 0.15, 0.3])
def test_the_error_in_lanes_gives_the_share_of_measurements_in_the_third_lane(distance):
    """A truck whose centre is near the border of the third lane."""
    width, errors = 3.75, MeasurementErrors(position_std=0.1)
    case = passing(2 - 0.5 - distance / width, ego={"kind": "T"})
    rule = RULES["L20"]
    error = rule.criterion.standard_error(case, rule.criterion.check(case), errors)
    assert error is not None
    standard_error = error[0]
    share = (rule.criterion.check(measured(case, errors)).margin < 0).mean()
    # The margin of half a lane counts as many standard errors as the distance to the border.
    expected = 0.5 * math.erfc(0.5 / standard_error / math.sqrt(2.0))
    assert share == pytest.approx(expected, abs=0.03)
    assert (judge_rule(rule, case, errors).verdict[0] == Verdict.UNDECIDABLE) == (distance < 0.2)


def test_the_error_of_a_gap_follows_the_formula():
    """sqrt(2 sp^2 + sv^2 ((t + v/b)^2 + (u/b)^2)), worked out by hand."""
    gap, v, u, b, sp, sv = 40.0, 30.0, 25.0, 8.0, 0.4, 0.3
    unit = np.array([1.0], np.float32)

    def margin(ego_shift, leader_shift, ego_speed_error, leader_speed_error):
        closing = (v - u + ego_speed_error - leader_speed_error) * unit
        return margin_to_leader(
            (gap + leader_shift - ego_shift) * unit, (v + ego_speed_error) * unit, closing, b * unit
        )

    standard_error = propagated_error(margin, sp, sp, sv, sv)
    assert standard_error[0] == pytest.approx(
        math.sqrt(2 * sp**2 + sv**2 * ((1.0 + v / b) ** 2 + (u / b) ** 2)), rel=1e-3
    )


def test_a_margin_is_undecidable_only_within_two_standard_errors():
    case = passing(1, target={"lane": 0}, ego={"lane": 1 - 1.0 / 3.75})
    rule = RULES["L10"]
    exact = rule.criterion.check(case)
    margin = float(exact.margin[0])
    assert 0 < margin < 1
    limit = margin / (2.0 * math.sqrt(2.0))
    for size, verdict in ((limit * 0.99, Verdict.LEGAL), (limit * 1.01, Verdict.UNDECIDABLE)):
        finding = judge_rule(rule, case, MeasurementErrors(position_std=size))
        assert finding.verdict[0] == verdict
        assert (finding.margin[0] == exact.margin[0]) == (verdict == Verdict.LEGAL)


def test_larger_errors_never_decide_more_rules():
    case = overtake(target={"s": 100.0})
    before = judge_pack(PORTUGAL, case, MeasurementErrors())
    exact = judge_pack(PORTUGAL, case)
    assert np.array_equal(before.verdict, exact.verdict)
    for size in (0.1, 0.3, 1.0, 3.0, 10.0):
        now = judge_pack(PORTUGAL, case, MeasurementErrors(position_std=size, speed_std=size))
        is_decided = now.verdict != Verdict.UNDECIDABLE
        assert np.array_equal(now.verdict[is_decided], exact.verdict[is_decided])
        assert not (is_decided & (before.verdict == Verdict.UNDECIDABLE)).any()
        assert (now.severity[~is_decided] == 0).all()
        before = now
    assert (before.verdict == Verdict.UNDECIDABLE).sum() > 5


@pytest.mark.ci
def test_the_public_functions_take_errors_and_the_version_names_them(tmp_path, capsys):
    run = ot.simulate(ot.sample("pinto2023", num_simulations=20, seed=3))
    errors = ot.MeasurementErrors(position_std=0.5, speed_std=0.2)
    exact, doubtful = ot.label(run), ot.label(run, errors=errors)
    assert doubtful.findings.version == f"{exact.findings.version}+-0.5m+-0.2mps"
    num_undecidable = [
        (labelled.findings.verdict == Verdict.UNDECIDABLE).sum() for labelled in (exact, doubtful)
    ]
    assert num_undecidable[1] > num_undecidable[0]
    without_errors = ot.label(run, errors=ot.MeasurementErrors()).findings
    assert without_errors.version == exact.findings.version
    assert np.array_equal(without_errors.verdict, exact.findings.verdict)
    data = ot.generate_dataset("pinto2023", num_simulations=20, seed=3, out=tmp_path / "data")
    relabelled = ot.relabel_dataset(data.path, errors=errors)
    assert set(relabelled.labels()["rule_set"].astype(str)) == {doubtful.findings.version}
    undecidable_rows = relabelled.findings().query("verdict == 'undecidable'")
    assert len(undecidable_rows) == num_undecidable[1]
    number = int(undecidable_rows["simulation"].iloc[0])
    assert main(["show", str(data.path), str(number), "--position-std", "0.5"]) == 0
    assert "(its margin is within its error)" in " ".join(capsys.readouterr().out.split())
    assert (
        len(ot.relabel_dataset(data.path).findings().query("verdict == 'undecidable'"))
        == num_undecidable[0]
    )


@pytest.mark.parametrize(
    ("name", "value"),
    [("position_std", -1.0), ("position_std", math.nan), ("speed_std", 100.1), ("speed_std", "1")],
)
def test_a_standard_deviation_out_of_its_range_is_refused(name: str, value: Any):
    with pytest.raises(ConfigError, match=f"MeasurementErrors: {name}: expected"):
        ot.MeasurementErrors(**{name: value})
