"""Recordings beside simulations in traffic as dense as theirs."""

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


def test_the_distance_is_that_of_smirnov():
    random = np.random.default_rng(3)
    one, other = random.normal(size=40), random.normal(0.4, 1.3, size=70)
    expected, _ = ks_2samp(one, other)
    assert recorded.distance(one, other) == pytest.approx(expected)
    assert recorded.distance(one, one) == 0.0
    assert np.isnan(recorded.distance(one, other[:0]))


def test_the_density_is_that_of_even_spacing():
    batch = Batch.of(steady_traffic(*((100.0 + 40.0 * k, 25.0) for k in range(6))))
    lanes = batch.runs.road.num_lanes
    assert recorded._density(batch) == pytest.approx(25.0 / lanes, rel=0.01)


def test_what_is_sampled_of_a_follower_is_its_time_gap_and_speed():
    batch = Batch.of(steady_traffic((100.0, 25.0), (154.4, 25.0)))
    found = recorded._samples(batch, recorded._egos(batch))
    assert found["speed"] == pytest.approx(25.0)
    assert found["time gap of followers"] == pytest.approx(2.0, abs=0.01)
    assert not len(found["duration of a lane change"])


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
    compared = recorded.Comparison(
        files=("scene.xml",),
        unused=(),
        densities=(10.0,),
        likenesses=(),
        import_findings=tuple(findings),
    )
    assert compared.import_report.recording.tolist() == ["scene.xml"]
    values = compared.values()
    assert values["import_report"] == [{**finding.to_dict(), "recording": "scene.xml"}]
    head, _ = _recordings(values)
    line = "scene.xml: motion: left out, 2 rows: vehicle 7 at 3 s: 15 m from the line."
    assert f"import report: {line}" in head.plain
