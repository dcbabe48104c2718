"""Plays a small part of OpenSCENARIO with CARLA's genuine client.

python openscenario_player.py FILE PORT TRAFFIC_MANAGER_PORT

The script needs nothing but the wheel of CARLA. It knows weather, road friction, vehicles and
props at world positions, speeds, a Traffic Manager as the controller, and events at a simulation
time. It prints what happened as JSON.
"""

from __future__ import annotations

import json
import os
import sys
import xml.etree.ElementTree as ET
from typing import Any

import carla

TICK = 0.05
EXTENT_CM = 1e6
"""Half side of the box with the friction of the road [cm]: 10 km."""


class Player:
    """One scenario in one world.

    Args:
        path: The OpenSCENARIO file.
        port: Of the server.
        manager_port: Of the Traffic Manager.
    """

    def __init__(self, path: str, port: int, manager_port: int) -> None:
        self.root = ET.parse(path).getroot()
        self.client = carla.Client("127.0.0.1", port)
        self.client.set_timeout(60.0)
        town = attribute(self.root, ".//LogicFile", "filepath")
        self.world = self.client.load_world(town)
        settings = self.world.get_settings()
        settings.synchronous_mode, settings.fixed_delta_seconds = True, TICK
        self.world.apply_settings(settings)
        self.manager = self.client.get_trafficmanager(manager_port)
        self.manager.set_synchronous_mode(True)
        self.manager.set_random_device_seed(1)
        self.library = self.world.get_blueprint_library()
        self.actors: dict[str, Any] = {}
        self.sensors: list[Any] = []
        self.collisions: list[tuple[str, str]] = []
        self.braking_from: dict[str, Any] = {}

    def play(self) -> dict[str, Any]:
        """Play to the stop trigger, remove all actors, and return the results of `finish`."""
        self.set_environment()
        for entity in self.root.iter("ScenarioObject"):
            self.spawn(entity)
        self.world.tick()
        starts = {name: actor.get_location() for name, actor in self.actors.items()}
        for private in self.root.iter("Private"):
            self.act(private.get("entityRef", ""), private)
        events = list(self.root.iter("Event"))
        stop, now = time_of(self.root.find(".//StopTrigger")), 0.0
        while now < stop:
            now += TICK
            self.world.tick()
            for event in [event for event in events if time_of(event) <= now]:
                events.remove(event)
                group = attribute(self.root, ".//ManeuverGroup//EntityRef", "entityRef")
                self.act(group, event)
        return self.finish(starts)

    def set_environment(self) -> None:
        """Weather, and the friction of the road as a trigger around everything."""
        weather = self.root.find(".//Weather")
        assert weather is not None
        rain = 100.0 * float(attribute(weather, "Precipitation", "intensity"))
        sun = float(attribute(weather, "Sun", "elevation"))
        self.world.set_weather(
            carla.WeatherParameters(precipitation=rain, sun_altitude_angle=57.3 * sun)
        )
        blueprint = self.library.find("static.trigger.friction")
        blueprint.set_attribute(
            "friction", attribute(self.root, ".//RoadCondition", "frictionScaleFactor")
        )
        for axis in "xyz":
            blueprint.set_attribute(f"extent_{axis}", str(EXTENT_CM))
        self.actors["road"] = self.world.spawn_actor(blueprint, carla.Transform())

    def spawn(self, entity: ET.Element) -> None:
        """Spawn a vehicle with a collision sensor, or a prop."""
        name = entity.get("name", "")
        (body,) = entity
        place = self.root.find(f".//Private[@entityRef='{name}']//WorldPosition")
        assert place is not None
        x, y, heading = (float(place.get(key, "0")) for key in "xyh")
        # OpenSCENARIO's y axis points to the left, CARLA's to the right.
        pose = carla.Transform(carla.Location(x, -y, 0.0), carla.Rotation(yaw=-57.29578 * heading))
        actor = self.actors[name] = self.world.spawn_actor(
            self.library.find(body.get("name", "")), pose
        )
        if body.tag == "Vehicle":
            sensor: Any = self.world.spawn_actor(
                self.library.find("sensor.other.collision"), carla.Transform(), attach_to=actor
            )
            sensor.listen(lambda event: self.collisions.append((name, event.other_actor.type_id)))
            self.sensors.append(sensor)

    def act(self, name: str, actions: ET.Element) -> None:
        """Carry out the speed and the controller of some actions."""
        actor = self.actors[name]
        for action in actions.iter("AbsoluteTargetSpeed"):
            speed = float(action.get("value", "0"))
            if speed == 0.0:
                self.braking_from[name] = actor.get_location()
                actor.apply_control(carla.VehicleControl(brake=1.0))
            else:
                actor.set_target_velocity(speed * actor.get_transform().get_forward_vector())
        if actions.find(".//ActivateControllerAction") is not None:
            actor.set_autopilot(True, self.manager.get_port())

    def finish(self, starts: dict[str, Any]) -> dict[str, Any]:
        """Measure the results and remove all actors.

        Returns:
            Distances [m] and speeds [m/s] of actors, lanes of vehicles, collisions, rain [%].
        """
        town = self.world.get_map()
        weather = self.world.get_weather()
        results = {
            "travelled": {
                name: starts[name].distance(actor.get_location())
                for name, actor in self.actors.items()
            },
            "lanes": {
                name: town.get_waypoint(actor.get_location()).lane_id
                for name, actor in self.actors.items()
                if actor.type_id.startswith("vehicle")
            },
            "speeds": {name: actor.get_velocity().length() for name, actor in self.actors.items()},
            "braking": {
                name: place.distance(self.actors[name].get_location())
                for name, place in self.braking_from.items()
            },
            "collisions": sorted(set(self.collisions)),
            "rain": weather.precipitation,
        }
        self.manager.shut_down()  # Else it queries vehicles that are destroyed below.
        for sensor in self.sensors:
            sensor.stop()
        for actor in [*self.sensors, *self.actors.values()]:
            actor.destroy()
        settings = self.world.get_settings()
        settings.synchronous_mode = False
        self.world.apply_settings(settings)
        return results


def attribute(element: ET.Element, path: str, name: str) -> str:
    """An attribute of the first element at a path."""
    descendant = element.find(path)
    assert descendant is not None, path
    return descendant.attrib[name]


def time_of(element: ET.Element | None) -> float:
    """The simulation time at which the condition of an element is met [s]."""
    assert element is not None
    return float(attribute(element, ".//SimulationTimeCondition", "value"))


if __name__ == "__main__":
    print(json.dumps(Player(sys.argv[1], int(sys.argv[2]), int(sys.argv[3])).play()), flush=True)
    os._exit(0)  # CARLA's client may abort while Python ends; see `support.carla.EPILOGUE`.
