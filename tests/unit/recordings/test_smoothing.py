"""Smoothing: the formula written out, what it keeps, and how much noise it takes away."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from tests.support.recordings import states
from tests.unit.recordings.test_tables import COLUMNS, TRAFFIC

from overtaking.recordings.formats import read_recording
from overtaking.recordings.smoothing import moving_average, smoothed
from overtaking.recordings.tables import read_table


def by_definition(values: list[float], width: float) -> list[float]:
    """Equation 1 of Thiemann et al. (2008), term by term."""
    found: list[float] = []
    for i in range(len(values)):
        reach = min(int(3 * width), i, len(values) - 1 - i)
        pairs = [
            (math.exp(-abs(i - k) / width), values[k]) for k in range(i - reach, i + reach + 1)
        ]
        found.append(sum(w * x for w, x in pairs) / sum(w for w, _ in pairs))
    return found


@pytest.mark.parametrize("width", [0.5, 5.0, 40.0])
def test_averages_are_those_of_the_definition_within_each_track(width):
    draw = np.random.default_rng(1)
    tracks = [draw.normal(size=length) for length in (1, 2, 30, 200)]
    start = np.cumsum([0, *map(len, tracks)])
    found = moving_average(np.concatenate(tracks), start=start, width=width)
    expected = [value for track in tracks for value in by_definition(track.tolist(), width)]
    assert np.allclose(found, expected, atol=1e-12)


def test_steady_motion_stays_and_noise_shrinks(tmp_path):
    table, draw = pd.DataFrame(states(TRAFFIC)), np.random.default_rng(2)
    path, noisy_path = tmp_path / "t.csv", tmp_path / "noisy.csv"
    table.to_csv(path, index=False)
    noisy = table.assign(x=table.x + draw.normal(0, 0.1, len(table)))
    noisy.to_csv(noisy_path, index=False)
    exact, rough = read_table(path, COLUMNS), read_table(noisy_path, COLUMNS)
    smooth = smoothed(rough)
    assert smooth.notes["smoothing_s"] == {"position": 0.5, "speed": 1.0, "accel": 4.0}
    steady = exact.tracks.names[exact.tracks.vehicle] == "3"
    middle = np.flatnonzero(steady)[40:-40]  # Nearer to the ends fewer frames are averaged.
    weights = np.exp(-np.abs(np.arange(-31, 32)) / 10.0) * (np.abs(np.arange(-31, 32)) <= 30)
    weights /= weights.sum()
    # The error of a mean of differences over 0.2 s, each of positions with an error of 0.1 m.
    by_theory = 0.1 / 0.2 * np.sqrt((np.convolve(weights, [1.0, 0.0, -1.0]) ** 2).sum())
    assert np.std(rough.tracks.speed[middle]) > 0.5
    assert np.std(smooth.tracks.speed[middle]) == pytest.approx(by_theory, rel=0.35)
    assert np.abs(smoothed(exact).tracks.speed[steady] - 24.0).max() < 1e-4
    assert np.abs(smoothed(exact).tracks.s - exact.tracks.s).max() < 1e-4


def test_any_format_with_tracks_can_be_smoothed(tmp_path):
    path = tmp_path / "t.csv"
    pd.DataFrame(states(TRAFFIC)).to_csv(path, index=False)
    read = read_recording("table", path, {"columns": COLUMNS, "smooth": True})
    assert read.scenes.notes["smoothing_s"]["accel"] == 4.0
    assert read.options["smooth"] is True
