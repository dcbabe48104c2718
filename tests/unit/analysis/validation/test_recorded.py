"""Comparison of recordings with simulations of equal traffic density."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import ks_2samp
from tests.support.recordings import OVERTAKE, Mover, commonroad
from tests.unit.analysis.validation.test_changes import steady_traffic

from overtaking.analysis.validation import recorded
from overtaking.analysis.validation.traffic import Batch
from overtaking.cli.validation_page import _recordings
from overtaking.model.import_report import ImportFinding
from overtaking.recordings.scenes import Parts


def test_the_distance_of_two_samples_is_the_kolmogorov_smirnov_statistic():
    rng = np.random.default_rng(3)
    first, second = rng.normal(size=40), rng.normal(0.4, 1.3, size=70)
    expected, _ = ks_2samp(first, second)
    assert recorded.distance(first, second) == pytest.approx(expected)
    assert recorded.distance(first, first) == 0.0
    assert np.isnan(recorded.distance(first, second[:0]))


def test_vehicles_every_40_m_have_a_density_of_25_per_km():
    batch = Batch.of(steady_traffic(*((100.0 + 40.0 * k, 25.0) for k in range(6))))
    lanes = batch.runs.road.num_lanes
    assert recorded._density(batch) == pytest.approx(25.0 / lanes, rel=0.01)


def test_samples_of_a_follower_are_its_time_gap_and_speed():
    batch = Batch.of(steady_traffic((100.0, 25.0), (154.4, 25.0)))
    samples = recorded._samples(batch, recorded._egos(batch))
    assert samples["speed"] == pytest.approx(25.0)
    # 54.4 m between the fronts, minus 4.4 m length, at 25 m/s.
    assert samples["time gap of followers"] == pytest.approx(2.0, abs=0.01)
    assert not len(samples["duration of a lane change"])


def test_findings_of_recordings_are_named_by_file_in_values_and_on_the_page(tmp_path, monkeypatch):
    path = tmp_path / "scene.xml"
    movers = [*OVERTAKE, Mover(number=11, s=-70.0, speed=25.0), Mover(number=12, s=-90.0, lane=1)]
    path.write_text(commonroad(movers), encoding="utf-8")
    finding = ImportFinding(
        recording="DEU_Test-1_1_T-1",
        check="motion",
        vehicle="7",
        first_time_s=3.0,
        rows=2,
        consequence="left out",
        detail="15 m from the line.",
    )
    monkeypatch.setattr(Parts, "import_findings", property(lambda _: (finding,)))
    used, unused, batches, findings = recorded._read([path])
    assert (used, unused, len(batches)) == (["scene.xml"], [], 1)
    comparison = recorded.Comparison(
        files=("scene.xml",),
        unused=(),
        densities=(10.0,),
        likenesses=(),
        import_findings=tuple(findings),
    )
    assert comparison.import_report.recording.tolist() == ["scene.xml"]
    values = comparison.values()
    assert values["import_report"] == [{**finding.to_dict(), "recording": "scene.xml"}]
    head, _ = _recordings(values)
    expected_line = "scene.xml: motion: left out, 2 rows: vehicle 7 at 3 s: 15 m from the line."
    assert f"import report: {expected_line}" in head.plain
