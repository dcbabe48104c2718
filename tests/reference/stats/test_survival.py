"""Waiting times against statsmodels, and against published remission times."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.support.features import synthetic_features

from overtaking.analysis.stats.sample import prepare
from overtaking.analysis.stats.survival import kaplan_meier, waiting_time

# Remission in weeks under 6-MP, + censored: E. J. Freireich et al., Blood 21 (1963) 699-716, as
# printed in many books since D. R. Cox, J. R. Stat. Soc. B 34 (1972) 187-220.
WEEKS = np.array([6, 6, 6, 7, 10, 13, 16, 22, 23, 6, 9, 10, 11, 17, 19, 20, 25, 32, 32, 34, 35.0])
RELAPSED = np.arange(21) < 9


def test_freireichs_remissions_have_the_published_curve():
    curve = kaplan_meier(WEEKS, RELAPSED)
    assert curve.time.tolist() == [6, 7, 10, 13, 16, 22, 23]
    published = [0.857, 0.807, 0.753, 0.690, 0.627, 0.538, 0.448]
    np.testing.assert_allclose(curve.survival, published, atol=5e-4)
    errors = [0.0764, 0.0869, 0.0963, 0.1068, 0.1141, 0.1282, 0.1346]
    np.testing.assert_allclose(curve.error, errors, atol=5e-5)
    assert curve.median == 23
    assert (curve.num_events, curve.num_censored) == (9, 12)


@pytest.mark.ci
@given(
    st.lists(st.tuples(st.integers(0, 20), st.booleans()), min_size=2, max_size=60).filter(
        lambda rows: any(event for _, event in rows)
    )
)
def test_any_curve_equals_statsmodels(rows: list[tuple[int, bool]]):
    from statsmodels.duration import survfunc

    time = np.array([float(value) for value, _ in rows])
    event = np.array([value for _, value in rows])
    curve = kaplan_meier(time, event)
    expected = survfunc.SurvfuncRight(time, event.astype(int))
    np.testing.assert_array_equal(curve.time, expected.surv_times)
    np.testing.assert_allclose(curve.survival, expected.surv_prob, atol=1e-12)
    np.testing.assert_array_equal(curve.at_risk, expected.n_risk)
    sure = curve.survival > 0
    np.testing.assert_allclose(curve.error[sure], expected.surv_prob_se[sure], atol=1e-12)


def test_equal_weights_change_nothing():
    plain, weighted = kaplan_meier(WEEKS, RELAPSED), kaplan_meier(WEEKS, RELAPSED, np.full(21, 3.0))
    np.testing.assert_allclose(plain.survival, weighted.survival, rtol=1e-12)
    np.testing.assert_allclose(plain.error, weighted.error, rtol=1e-12)


def test_a_weight_of_two_counts_as_two_drivers():
    weight = np.where(np.arange(21) % 2 == 0, 2.0, 1.0)
    twice = np.repeat(np.arange(21), weight.astype(int))
    weighted, repeated = (
        kaplan_meier(WEEKS, RELAPSED, weight),
        kaplan_meier(WEEKS[twice], RELAPSED[twice]),
    )
    np.testing.assert_allclose(weighted.survival, repeated.survival, rtol=1e-12)
    assert (weighted.error[:-1] >= repeated.error[:-1]).all()


def test_confidence_limits_equal_scipy():
    from scipy.stats import CensoredData, ecdf

    data = CensoredData(uncensored=WEEKS[RELAPSED], right=WEEKS[~RELAPSED])
    limits = ecdf(data).sf.confidence_interval(0.95, method="log-log")
    curve = kaplan_meier(WEEKS, RELAPSED)
    np.testing.assert_allclose(curve.low, limits.low.evaluate(curve.time), rtol=1e-9)
    np.testing.assert_allclose(curve.high, limits.high.evaluate(curve.time), rtol=1e-9)
    assert ((curve.low < curve.survival) & (curve.survival < curve.high)).all()


def test_drivers_without_an_attempt_are_censored():
    frame = synthetic_features()
    curve = waiting_time(prepare(frame, policy="paper"))
    assert curve is not None
    assert curve.num_censored == int((frame["CLASS"] == "No_attempt").sum())
    assert curve.survival[-1] > 0.05
    mean_of_all = np.mean([curve.quantile(0.25), curve.quantile(0.75)])
    assert mean_of_all < 8.0


def test_a_collision_before_any_attempt_censors_the_waiting_time():
    frame = synthetic_features()
    crashed = frame.index[frame["CLASS"] == "Unsuccess_col"][:10]
    before = waiting_time(prepare(frame, policy="paper"))
    after = waiting_time(
        prepare(frame.assign(OT=frame["OT"].where(~frame.index.isin(crashed), 0)), policy="paper")
    )
    assert before is not None
    assert after is not None
    assert after.num_censored == before.num_censored + 10


def test_matched_and_missing_waiting_times_have_no_curve():
    assert waiting_time(prepare(synthetic_features(), policy="matched")) is None
    assert waiting_time(prepare(synthetic_features().assign(WT=np.nan), policy="paper")) is None
