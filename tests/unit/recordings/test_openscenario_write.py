"""Scenarios in OpenSCENARIO, read back with scenariogeneration."""

from __future__ import annotations

import dataclasses
import xml.etree.ElementTree as ET
from math import pi
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scenariogeneration import xosc

import overtaking as ot
from overtaking.core.units import rad_from_deg
from overtaking.model.trajectories import STATE_RESOLUTION, Lights
from overtaking.recordings.opendrive import read_opendrive
from overtaking.recordings.openscenario_write import write_openscenario

if TYPE_CHECKING:
    from pathlib import Path

    from overtaking.model.trajectories import Trajectories

COUNT = 3


@pytest.fixture(scope="module")
def runs() -> Trajectories:
    return ot.simulate(ot.sample("pinto2023-physical", num_simulations=COUNT, seed=5))


def written(run: Trajectories, folder: Path, number: int = 7, **given: Any) -> ET.Element:
    """The only simulation of a batch as a file has it."""
    write_openscenario(run, np.array([number]), folder, **given)
    return ET.parse(folder / f"simulation-{number:06d}.xosc").getroot()


def element(root: ET.Element, path: str) -> ET.Element:
    found = root.find(path)
    assert found is not None, path
    return found


def one(runs: Trajectories, place: int = 0) -> Trajectories:
    return runs.select(slice(place, place + 1))


def events(root: ET.Element) -> dict[str, list[Any]]:
    """What each vehicle does, as scenariogeneration reads it."""
    storyboard = xosc.StoryBoard.parse(element(root, "Storyboard"))
    groups = storyboard.stories[0].acts[0].maneuvergroup
    return {group.name: group.maneuvers[0].events for group in groups}


def instant(event: Any) -> float:
    return event.trigger.conditiongroups[0].conditions[0].valuecondition.value


@pytest.mark.parametrize("place", range(COUNT))
def test_every_vehicle_is_where_it_was(runs, tmp_path, place):
    run = one(runs, place)
    root = written(run, tmp_path)
    head = element(root, "FileHeader")
    assert (head.get("revMajor"), head.get("revMinor")) == ("1", "3")
    entities = {
        each.name: each.entityobject for each in xosc.Scenario.parse(root).entities.scenario_objects
    }
    did = events(root)
    slots = np.flatnonzero(run.scenario.vehicles.valid[0])
    assert len(entities) == len(did) == len(slots)
    for slot, name in zip(slots, entities, strict=True):
        box = entities[name].boundingbox
        line = did[name][0].action[0].action.trajectory.shapes
        ahead = float(box.center.x)
        x, y, h = (np.array([getattr(each, at) for each in line.positions]) for at in "xyh")
        frames = int(run.num_frames[0])
        np.testing.assert_allclose(line.time, run.time_ms[:frames] / 1000.0, atol=1e-9)
        s, d = (getattr(run.states, at)[0, slot, :frames] * STATE_RESOLUTION[at] for at in "sd")
        centre = x + ahead * np.cos(h), y + ahead * np.sin(h)
        np.testing.assert_allclose(centre, run.road.to_world(s, d), atol=2e-6)  # Of six decimals.
        assert float(box.boundingbox.length) == pytest.approx(
            float(run.scenario.vehicles.length[0, slot]), abs=1e-4
        )


def test_the_road_of_the_file_is_the_road_of_the_simulation(runs, tmp_path):
    root = written(one(runs), tmp_path)
    file = tmp_path / xosc.Scenario.parse(root).roadnetwork.road_file
    back = read_opendrive(file)
    assert back.lanes == runs.road.lanes
    assert back.to_world(10.0, -3.0) == pytest.approx(runs.road.to_world(10.0, -3.0))


def test_the_road_reaches_as_far_as_the_vehicles(runs, tmp_path):
    run = one(runs)
    s = run.states.s.copy()
    s[0, 0, 0], s[0, 0, 1] = -20_300, round(runs.road.length * 1000) + 400_000
    written(run.replace(states=dataclasses.replace(run.states, s=s)), tmp_path)
    back = read_opendrive(tmp_path / "simulation-000007.xodr")
    assert back.length == pytest.approx(71.0 + runs.road.length + 450.0, abs=1.0)
    assert back.to_world(0.0, 0.0) == pytest.approx(runs.road.to_world(-71.0, 0.0))
    assert back.lane_centres == pytest.approx(runs.road.lane_centres)


def test_vehicles_come_and_go_with_the_recording(runs, tmp_path):
    run = one(runs)
    present = run.state_mask.copy()
    present[0, 1] = False
    present[0, 1, 10:20] = present[0, 1, 30] = True
    root = written(run.replace(is_recorded=present), tmp_path)
    placed = {each.get("entityRef") for each in root.iter("Private")}
    assert "ego" in placed
    assert "vehicle1" not in placed
    mine = [each for each in events(root)["vehicle1"] if each.name[-1] in "01"]
    at = {each.name: instant(each) for each in mine if "L" not in each.name}
    frame = run.scenario.frame_interval_ms / 1000.0
    for name, time in {"appear0": 10, "leave0": 20, "appear1": 30, "leave1": 31}.items():
        assert at[name] == pytest.approx(time * frame), name
    lines = {each.name: each.action[0].action for each in mine if each.name.startswith("drive")}
    assert len(lines["drive0"].trajectory.shapes.positions) == 10
    assert len(lines["drive1"].trajectory.shapes.positions) == 2  # A line has two ends.


def test_lamps_change_when_they_did(runs, tmp_path):
    run = one(runs)
    lights = np.zeros_like(run.states.lights)
    lights[0, 0] = int(Lights.LOW_BEAM)
    lights[0, 0, 40:60] = int(Lights.LOW_BEAM | Lights.INDICATOR_LEFT)
    root = written(run.replace(states=dataclasses.replace(run.states, lights=lights)), tmp_path)
    start = element(root, ".//Private[@entityRef='ego']")
    assert [each.get("vehicleLightType") for each in start.iter("VehicleLight")] == ["lowBeam"]
    frame = run.scenario.frame_interval_ms / 1000.0
    found = [(each.name, instant(each)) for each in events(root)["ego"][1:]]
    assert found == [("indicatorLeft40", 40 * frame), ("indicatorLeft60", 60 * frame)]
    modes = [each.get("mode") for each in root.iter("LightState")]
    assert modes == ["on", "flashing", "off"]


def test_weather_is_that_of_the_simulation(runs, tmp_path):
    nothing = np.zeros(1, np.float32)
    weather = one(runs).scenario.weather.replace(
        cloudiness=nothing + 50, rain=nothing + 30, puddles=nothing, wind=nothing + 20,
        wind_direction=nothing, fog=nothing, sun_azimuth=nothing,
        sun_altitude=nothing + np.float32(rad_from_deg(45.0)), night=np.zeros(1, bool),
    )  # fmt: skip
    run = one(runs)
    run = run.replace(scenario=run.scenario.replace(weather=weather))
    root = written(run, tmp_path)
    heading = runs.road.heading
    sun, wind = element(root, ".//Sun"), element(root, ".//Wind")
    # The sun is straight ahead: y is north, and azimuths run clockwise.
    assert float(sun.attrib["azimuth"]) == pytest.approx((pi / 2 - heading) % (2 * pi), abs=1e-4)
    assert float(sun.attrib["elevation"]) == pytest.approx(pi / 4, abs=1e-4)
    assert float(wind.attrib["direction"]) == pytest.approx(heading % (2 * pi), abs=1e-4)
    assert float(wind.attrib["speed"]) > 0
    assert element(root, ".//Weather").get("fractionalCloudCover") == "fourOktas"
    rain = element(root, ".//Precipitation")
    assert rain.get("precipitationType") == "rain"
    assert float(rain.attrib["precipitationIntensity"]) > 0
    road = element(root, ".//RoadCondition")
    assert road.get("wetness") == "moist"
    assert 0.3 < float(road.attrib["frictionScaleFactor"]) < 1.0


def test_what_a_recording_does_not_tell_is_left_out(runs, tmp_path):
    run = one(runs).replace(unknown=frozenset(["weather", "kinds", "indicators", "lamps"]))
    root = written(run, tmp_path)
    assert root.find(".//Environment") is None
    assert {each.get("vehicleCategory") for each in root.iter("Vehicle")} == {"car"}
    assert root.find(".//LightStateAction") is None


def test_the_head_names_simulation_and_events(runs, tmp_path):
    root = written(one(runs, 2), tmp_path, events={7: {"attempt": 3.25}})
    told = {each.get("name"): each.get("value") for each in root.iter("Property")}
    assert told == {
        "simulation": "7",
        "profile": "pinto2023-physical",
        "seed": "5",
        "scenario_index": "2",
        "attempt_s": "3.25",
    }


def test_a_name_may_hold_what_xml_does_not_know(runs, tmp_path):
    run = one(runs)
    named = dataclasses.replace(run, scenario=dataclasses.replace(run.scenario, profile="a\x07<b>"))
    told = {
        each.get("name"): each.get("value") for each in written(named, tmp_path).iter("Property")
    }
    assert told["profile"] == "a\N{REPLACEMENT CHARACTER}<b>"


def test_a_data_set_becomes_the_same_bytes_again(tmp_path):
    data = ot.generate_dataset(
        "pinto2023-physical", num_simulations=3, seed=1, out=tmp_path / "data"
    )
    for name in ("a", "b"):
        rows = ot.export_dataset(data, tmp_path / name, file_format="openscenario")
        assert rows == data.table("states").num_rows
    files = sorted(each.name for each in (tmp_path / "a").iterdir())
    ends = ("xodr", "xosc")
    assert files == sorted(f"simulation-{k:06d}.{end}" for k in range(3) for end in ends)
    for name in files:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    happened = data.events()
    root = ET.parse(tmp_path / "a" / "simulation-000001.xosc").getroot()
    told = {each.get("name") for each in root.iter("Property")}
    assert {f"{name}_s" for name in happened[happened.simulation == 1].event} <= told
