"""An OpenSCENARIO file is played on the headless server, to its end, with the genuine client."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from tests.support.carla import (
    PATIENCE,
    Address,
    free_port,
    headless_server,
    needs_wheel,
    stopped_by_signals,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

pytestmark = [pytest.mark.ci, needs_wheel, stopped_by_signals]


# `-P`, as `support.carla` would hide the wheel from a script in its folder.
PLAYER = str(Path(__file__).parents[1] / "support" / "openscenario_player.py")


def vehicle(name: str, blueprint: str) -> str:
    body = f'<Vehicle name="{blueprint}" vehicleCategory="car"/>'
    return f'<ScenarioObject name="{name}">{body}</ScenarioObject>'


def prop(name: str, blueprint: str) -> str:
    body = f'<MiscObject name="{blueprint}" miscObjectCategory="barrier" mass="20"/>'
    return f'<ScenarioObject name="{name}">{body}</ScenarioObject>'


def start(name: str, x: float, y: float, *, heading: float = 0.0, actions: str = "") -> str:
    return (
        f'<Private entityRef="{name}"><PrivateAction><TeleportAction><Position>'
        f'<WorldPosition x="{x}" y="{y}" z="0" h="{heading}"/>'
        f"</Position></TeleportAction></PrivateAction>{actions}</Private>"
    )


def speed(value: float) -> str:
    return (
        "<PrivateAction><LongitudinalAction><SpeedAction>"
        '<SpeedActionDynamics dynamicsShape="step" value="0" dynamicsDimension="time"/>'
        f'<SpeedActionTarget><AbsoluteTargetSpeed value="{value}"/></SpeedActionTarget>'
        "</SpeedAction></LongitudinalAction></PrivateAction>"
    )


CONTROLLER = (
    '<PrivateAction><ActivateControllerAction lateral="true" longitudinal="true"/></PrivateAction>'
)


def condition(seconds: float) -> str:
    return (
        '<ConditionGroup><Condition name="time" delay="0" conditionEdge="none"><ByValueCondition>'
        f'<SimulationTimeCondition value="{seconds}" rule="greaterThan"/>'
        "</ByValueCondition></Condition></ConditionGroup>"
    )


def scenario(friction: float) -> str:
    """The ego brakes after 1 s; others drive in both directions; one hits a barrier."""
    entities = [
        vehicle("ego", "vehicle.audi.a2"),
        vehicle("along", "vehicle.tesla.model3"),
        vehicle("against", "vehicle.lincoln.mkz_2020"),
        vehicle("stray", "vehicle.mini.cooper_s"),
        prop("barrier", "static.prop.streetbarrier"),
        prop("cone", "static.prop.trafficcone01"),
    ]
    starts = [
        start("ego", 1000.0, -1.75, actions=speed(20.0)),
        start("along", 2000.0, -1.75, actions=CONTROLLER),
        start("against", 3000.0, 1.75, heading=3.14159265, actions=CONTROLLER),
        start("stray", 4000.0, -1.75, actions=speed(15.0)),
        start("barrier", 4030.0, -1.75, heading=1.5707963),
        start("cone", 1010.0, -4.5),
    ]
    return f"""<?xml version="1.0"?>
<OpenSCENARIO>
  <FileHeader revMajor="1" revMinor="0" date="2026-01-01T00:00:00" description="" author=""/>
  <RoadNetwork><LogicFile filepath="rural"/></RoadNetwork>
  <Entities>{"".join(entities)}</Entities>
  <Storyboard>
    <Init><Actions>
      <GlobalAction><EnvironmentAction><Environment name="rain">
        <TimeOfDay animation="false" dateTime="2026-01-01T12:00:00"/>
        <Weather cloudState="rainy">
          <Sun intensity="0.5" azimuth="0" elevation="0.8"/>
          <Fog visualRange="10000"/><Precipitation precipitationType="rain" intensity="0.2"/>
        </Weather>
        <RoadCondition frictionScaleFactor="{friction}"/>
      </Environment></EnvironmentAction></GlobalAction>
      {"".join(starts)}
    </Actions></Init>
    <Story name="story"><Act name="act">
      <ManeuverGroup name="group" maximumExecutionCount="1">
        <Actors selectTriggeringEntities="false"><EntityRef entityRef="ego"/></Actors>
        <Maneuver name="brake"><Event name="brake" priority="overwrite"><Action name="brake">
          {speed(0.0)}</Action><StartTrigger>{condition(1.0)}</StartTrigger></Event></Maneuver>
      </ManeuverGroup>
      <StartTrigger>{condition(0.0)}</StartTrigger>
    </Act></Story>
    <StopTrigger>{condition(20.0)}</StopTrigger>
  </Storyboard>
</OpenSCENARIO>
"""


@pytest.fixture(scope="module")
def rural_server() -> Iterator[Address]:
    with headless_server("--map", "rural") as address:
        yield address


def play(server: Address, folder: Path, friction: float) -> dict[str, Any]:
    path = folder / f"{friction}.xosc"
    path.write_text(scenario(friction), encoding="utf-8")
    process = subprocess.run(
        [sys.executable, "-P", PLAYER, str(path), str(server.port), str(free_port())],
        capture_output=True,
        text=True,
        timeout=2.0 * PATIENCE,
        check=False,
    )
    assert process.returncode == 0, process.stderr[-2000:]
    return json.loads(process.stdout.strip().splitlines()[-1])


def test_a_file_with_friction_props_weather_and_two_directions_runs_to_its_end(
    rural_server: Address, tmp_path: Path
):
    usual, icy = (play(rural_server, tmp_path, friction) for friction in (1.0, 0.3))
    assert usual["rain"] == pytest.approx(20.0)
    for report in (usual, icy):
        assert report["lanes"] == {"ego": -1, "along": -1, "against": 1, "stray": -1}
        assert report["collisions"] == [["stray", "static.prop.streetbarrier"]]
        assert report["speeds"]["ego"] == 0.0
        assert report["travelled"]["cone"] == 0.0
        assert report["travelled"]["stray"] < 30.0
    assert min(usual["travelled"][name] for name in ("along", "against")) > 50.0
    assert usual["speeds"]["along"] > 5.0
    assert usual["speeds"]["against"] > 5.0
    assert icy["braking"]["ego"] == pytest.approx(usual["braking"]["ego"] / 0.3, rel=0.2)
