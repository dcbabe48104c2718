"""Our drivers on CARLA's genuine client, on a road with two directions that bends and rises."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support.bends import on
from tests.support.carla import needs_wheel
from tests.support.two_way import pair, road
from tests.support.worlds import scenario

from overtaking import api
from overtaking.simulators.carla.library import SERVER_VARIABLE

pytestmark = [pytest.mark.ci, needs_wheel]

BENDS = ((900.0, 0.0, 0.0), (300.0, 0.0, 1 / 300), (500.0, 1 / 300, 1 / 300))
HILLS = ((800.0, 0.0), (1100.0, 0.04), (1500.0, -0.03))


@pytest.mark.parametrize("grade", [(), HILLS], ids=["level", "hills"])
def test_vehicles_of_both_directions_drive_as_on_the_engine(
    grade: tuple[tuple[float, float], ...], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv(SERVER_VARIABLE, "headless")
    world = scenario(pair(250.0), road=on(road(), *BENDS, grade=grade), horizon=7.0)
    run, ours = (api.simulate(world, simulator=name) for name in ("carla", "engine"))
    assert run.road.is_two_way
    frames = int(run.num_frames[0])
    assert frames == int(ours.num_frames[0])
    for slot in range(3):
        there, here = (
            {name: getattr(one.states, name)[0, slot, :frames] * 1e-3 for name in "sdxy"}
            for one in (run, ours)
        )
        np.testing.assert_allclose(there["s"], here["s"], atol=2.0)
        np.testing.assert_allclose(there["d"], here["d"], atol=0.5)
        x, y = run.road.world(there["s"], there["d"])
        np.testing.assert_allclose(there["x"], x, atol=2e-3)
        np.testing.assert_allclose(there["y"], y, atol=2e-3)
        turned = run.headings[0][0, slot, :frames] * 1e-4
        way = np.pi if slot == 2 else 0.0
        assert np.abs(np.remainder(turned - way + np.pi, 2 * np.pi) - np.pi).max() < 0.12
    assert run.states.s[0, 2, -1] < run.states.s[0, 2, 0]
    lanes = run.states.lane[0, :, :frames]
    assert (lanes[1] == 0).all()
    assert (lanes[2] == 1).all()
