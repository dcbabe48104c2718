"""Recorded simulations as OpenSCENARIO XML 1.3, each with the OpenDRIVE of its road.

Every vehicle follows a polyline with a vertex for each recorded frame. OpenSCENARIO places a
vehicle by the middle of its rear axle, the recording by the middle of its box; the box says how far
apart they are. On slopes vehicles have a height and a pitch. Vehicles that appear later are added,
and those that leave are deleted. Lamps are actions at the instants of their changes. The head of
the file names the simulation and its events.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from overtaking.core.files import write_new_file
from overtaking.model.trajectories import STATE_RESOLUTION, Lights, Trajectories
from overtaking.model.vehicles import VehicleKind
from overtaking.recordings.opendrive_writer import covering, write_opendrive
from overtaking.recordings.openscenario_weather import environments
from overtaking.recordings.xml import quoted

FORMAT = "openscenario"

DATE = "1970-01-01T00:00:00"
"""What stands where a date is required: a scenario is the same whenever it is written."""

_MARGIN = 50.0  # How far the road goes on beyond the vehicles [m].
_WHEEL_DIAMETER = 0.7  # A required attribute that the model has no use for; a car's [m].
_MAX_STEERING = 0.6  # The same [rad].

_CATEGORIES = {
    VehicleKind.VAN: "van",
    VehicleKind.TRUCK: "truck",
    VehicleKind.MOTORCYCLE: "motorbike",
    VehicleKind.BICYCLE: "bicycle",
}
_LAMPS = {
    Lights.INDICATOR_LEFT: ("indicatorLeft", "flashing"),
    Lights.INDICATOR_RIGHT: ("indicatorRight", "flashing"),
    Lights.BRAKE: ("brakeLights", "on"),
    Lights.LOW_BEAM: ("lowBeam", "on"),
    Lights.HIGH_BEAM: ("highBeam", "on"),
    Lights.REAR_FOG: ("fogLightsRear", "on"),
}
"""Name and mode of each lamp that is on."""

_INDICATORS = Lights.INDICATOR_LEFT | Lights.INDICATOR_RIGHT


class _Track(NamedTuple):
    """A vehicle of a simulation; arrays have shape (frame,), in SI units and world axes."""

    name: str
    slot: int
    there: NDArray[np.bool_]
    time: NDArray[np.float64]
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    z: NDArray[np.float64]
    heading: NDArray[np.float64]
    pitch: NDArray[np.float64]
    lights: NDArray[np.uint8]


def write_openscenario(
    trajectories: Trajectories,
    numbers: NDArray[np.integer],
    folder: Path,
    *,
    events: Mapping[int, Mapping[str, float]] | None = None,
) -> int:
    """Write a scenario and its road for each simulation of a batch.

    Args:
        trajectories: Recorded simulations.
        numbers: Number of each in its data set, shape (simulation,).
        folder: Where the files go; they are called after the numbers.
        events: Instants of what happened by number and name [s]; they become properties.

    Returns:
        Number of states written.

    Raises:
        ConfigError: OpenDRIVE cannot hold the road.
        OSError: A file cannot be written.
    """
    weathers = environments(trajectories)
    for place, number in enumerate(numbers.tolist()):
        name = f"simulation-{number:06d}"
        told = {} if events is None else events.get(number, {})
        begin, end = _extent(trajectories, place)
        road = covering(trajectories.road, begin, end)
        lines = _lines(trajectories, place, number, weathers[place], told, begin)
        write_new_file(folder / f"{name}.xodr", write_opendrive(road))
        write_new_file(folder / f"{name}.xosc", "\n".join(lines) + "\n")
    return int(trajectories.state_mask.sum())


def _extent(trajectories: Trajectories, place: int) -> tuple[float, float]:
    """Where the road has to begin and to end for the vehicles of a simulation [m]."""
    road = trajectories.road
    s = trajectories.states.s[place][trajectories.state_mask[place]] * STATE_RESOLUTION["s"]
    begin = min(0.0, float(np.floor(s.min())) - _MARGIN if s.min() < 0 else 0.0)
    end = max(road.length, float(np.ceil(s.max())) + _MARGIN if s.max() > road.length else 0.0)
    return begin, end


def _lines(
    trajectories: Trajectories,
    place: int,
    number: int,
    environment: str,
    events: Mapping[str, float],
    begin: float,
) -> Iterator[str]:
    """The lines of one scenario, on a road that begins at a station [m]."""
    scenario = trajectories.scenario
    slots = np.flatnonzero(trajectories.state_mask[place].any(axis=1)).tolist()
    tracks = [_track(trajectories, place, slot, begin) for slot in slots]
    facts = {
        "simulation": number,
        "profile": scenario.profile,
        "seed": scenario.seed,
        "scenario_index": scenario.scenario_index[place],
        **{f"{name}_s": f"{time:g}" for name, time in events.items()},
    }
    yield '<?xml version="1.0" encoding="UTF-8"?>'
    yield "<OpenSCENARIO>"
    yield (
        f'<FileHeader author="overtaking" date="{DATE}" revMajor="1" revMinor="3"'
        f' description="Simulation {number} of overtaking"><Properties>'
    )
    for name, value in facts.items():
        yield f'<Property name="{name}" value={quoted(str(value))}/>'
    yield "</Properties></FileHeader>"
    yield "<ParameterDeclarations/><CatalogLocations/>"
    yield f'<RoadNetwork><LogicFile filepath="simulation-{number:06d}.xodr"/></RoadNetwork>'
    yield "<Entities>"
    for one in tracks:
        yield from _vehicle(trajectories, place, one)
    yield "</Entities><Storyboard><Init><Actions>"
    yield environment
    for one in tracks:
        yield from _start(one)
    yield '</Actions></Init><Story name="recording"><Act name="recording">'
    for one in tracks:
        yield from _story(one)
    end = float(tracks[0].time[-1])
    yield f"{_trigger('StartTrigger', 0.0)}</Act></Story>{_trigger('StopTrigger', end)}"
    yield "</Storyboard></OpenSCENARIO>"


def _track(trajectories: Trajectories, place: int, slot: int, begin: float) -> _Track:
    """What a vehicle did; heights count from where the road begins."""
    frames = int(trajectories.num_frames[place])

    def column(name: str) -> NDArray[np.float64]:
        return getattr(trajectories.states, name)[place, slot, :frames] * STATE_RESOLUTION[name]

    heading, road, s = column("heading"), trajectories.road, column("s")
    # Not the recorded world: that of a recording bends with its road, the road here may not.
    x, y = road.to_world(s, column("d"))
    slope = road.grade_at(s) * np.cos(heading - road.heading_at(s))
    behind = _to_rear_axle(trajectories, place, slot)
    lights = trajectories.states.lights[place, slot, :frames]
    return _Track(
        name="ego" if slot == 0 else f"vehicle{slot}",
        slot=slot,
        there=trajectories.state_mask[place, slot, :frames],
        time=trajectories.time_ms[:frames] / 1000.0,
        x=x - behind * np.cos(heading),
        y=y - behind * np.sin(heading),
        z=road.height_at(s) - road.height_at(begin) - behind * slope,
        heading=heading,
        pitch=-np.arctan(slope),  # Positive pitch lowers the front.
        lights=lights & np.uint8(_known_lamps(trajectories)),
    )


def _to_rear_axle(trajectories: Trajectories, place: int, slot: int) -> float:
    """From the middle of the box back to the rear axle [m]."""
    bodies = trajectories.scenario.vehicles
    return float(bodies.wheelbase[place, slot]) - float(bodies.cg_to_front[place, slot])


def _known_lamps(trajectories: Trajectories) -> int:
    """Bits of the lamps that the recording tells of."""
    known = int(sum(_LAMPS))
    if "indicators" in trajectories.unknown:
        known &= ~int(_INDICATORS)
    return known & int(_INDICATORS) if "lamps" in trajectories.unknown else known


def _vehicle(trajectories: Trajectories, place: int, one: _Track) -> Iterator[str]:
    """The entity of a vehicle, with its body in place of a catalogue."""
    bodies = trajectories.scenario.vehicles

    def of(name: str) -> float:
        return float(getattr(bodies, name)[place, one.slot])

    kind = VehicleKind(int(of("kind")))
    is_known = bool(trajectories.known_kinds[place, one.slot])
    category = _CATEGORIES.get(kind, "car") if is_known else "car"
    axle = (
        f'trackWidth="{of("track_width"):.4f}" wheelDiameter="{_WHEEL_DIAMETER}"'
        f' positionZ="{_WHEEL_DIAMETER / 2}"'
    )
    yield (
        f'<ScenarioObject name="{one.name}"><Vehicle name="{kind.code}"'
        f' vehicleCategory="{category}" mass="{of("mass"):.1f}">'
    )
    yield (
        f'<BoundingBox><Center x="{_to_rear_axle(trajectories, place, one.slot):.6f}" y="0"'
        f' z="{of("height") / 2:.4f}"/><Dimensions width="{of("width"):.4f}"'
        f' length="{of("length"):.4f}" height="{of("height"):.4f}"/></BoundingBox>'
    )
    yield (
        f'<Performance maxSpeed="{of("max_speed"):.4f}" maxAcceleration="{of("launch_accel"):.4f}"'
        f' maxDeceleration="{of("peak_decel"):.4f}"/>'
    )
    yield (
        f'<Axles><FrontAxle maxSteering="{_MAX_STEERING}" {axle}'
        f' positionX="{of("wheelbase"):.4f}"/>'
        f'<RearAxle maxSteering="0" positionX="0" {axle}/></Axles></Vehicle></ScenarioObject>'
    )


def _start(one: _Track) -> Iterator[str]:
    """The place and the lamps of a vehicle that is there from the start."""
    if one.there[0]:
        yield f'<Private entityRef="{one.name}">'
        yield f"<PrivateAction><TeleportAction>{_position(one, 0)}</TeleportAction></PrivateAction>"
        for lamp in _lamps(int(one.lights[0])):
            yield f"<PrivateAction>{_lamp_action(lamp, is_on=True)}</PrivateAction>"
        yield "</Private>"


def _story(one: _Track) -> Iterator[str]:
    """What a vehicle does, part after part of the recording in which it is there."""
    yield (
        f'<ManeuverGroup name="{one.name}" maximumExecutionCount="1">'
        f'<Actors selectTriggeringEntities="false"><EntityRef entityRef="{one.name}"/></Actors>'
        f'<Maneuver name="{one.name}">'
    )
    edges = np.flatnonzero(np.diff(np.concatenate([[False], one.there, [False]]).astype(np.int8)))
    for part, (first, stop) in enumerate(edges.reshape(-1, 2).tolist()):
        yield from _part(one, part, first, stop)
    yield "</Maneuver></ManeuverGroup>"


def _part(one: _Track, part: int, first: int, stop: int) -> Iterator[str]:
    """The frames from one to before another, in each of which the vehicle is there."""
    if first:
        entity = f"<AddEntityAction>{_position(one, first)}</AddEntityAction>"
        yield _event(f"appear{part}", one.time[first], _entity_action(one, entity))
    yield _event(f"drive{part}", one.time[first], _follow(one, part, first, stop))
    if first:
        for lamp in _lamps(int(one.lights[first])):
            yield _lamp_event(one, lamp, first, is_on=True)
    changes = np.flatnonzero(np.diff(one.lights[first:stop])) + first + 1
    for frame in changes.tolist():
        now, before = int(one.lights[frame]), int(one.lights[frame - 1])
        for lamp in _lamps(now ^ before):
            yield _lamp_event(one, lamp, frame, is_on=bool(now & lamp))
    if stop < len(one.there):
        gone = _entity_action(one, "<DeleteEntityAction/>")
        yield _event(f"leave{part}", one.time[stop], gone)


def _follow(one: _Track, part: int, first: int, stop: int) -> str:
    """The trajectory of some frames; a single one is held for a frame, as a line has two ends."""
    frames = [*range(first, stop)]
    times = one.time[first:stop].tolist()
    if len(frames) == 1:
        frames, times = frames * 2, [*times, times[0] + 1e-3]
    vertices = "\n".join(
        f'<Vertex time="{time:.3f}">{_position(one, frame)}</Vertex>'
        for time, frame in zip(times, frames, strict=True)
    )
    return (
        "<PrivateAction><RoutingAction><FollowTrajectoryAction>"
        f'<TrajectoryRef><Trajectory name="{one.name}-{part}" closed="false"><Shape><Polyline>\n'
        f"{vertices}\n</Polyline></Shape></Trajectory></TrajectoryRef>"
        '<TimeReference><Timing domainAbsoluteRelative="absolute" scale="1" offset="0"/>'
        '</TimeReference><TrajectoryFollowingMode followingMode="position"/>'
        "</FollowTrajectoryAction></RoutingAction></PrivateAction>"
    )


def _position(one: _Track, frame: int) -> str:
    """Where the rear axle is."""
    z, pitch = one.z[frame], one.pitch[frame]
    height = f"{z:.6f}" if z else "0"
    tilt = f' p="{pitch:.5f}"' if pitch else ""
    return (
        f'<Position><WorldPosition x="{one.x[frame]:.6f}" y="{one.y[frame]:.6f}" z="{height}"'
        f' h="{one.heading[frame]:.4f}"{tilt}/></Position>'
    )


def _lamps(bits: int) -> list[Lights]:
    return [lamp for lamp in _LAMPS if bits & lamp]


def _lamp_event(one: _Track, lamp: Lights, frame: int, *, is_on: bool) -> str:
    """A lamp that is switched."""
    action = f"<PrivateAction>{_lamp_action(lamp, is_on=is_on)}</PrivateAction>"
    return _event(f"{_LAMPS[lamp][0]}{frame}", one.time[frame], action)


def _lamp_action(lamp: Lights, *, is_on: bool) -> str:
    name, mode = _LAMPS[lamp]
    return (
        "<AppearanceAction><LightStateAction><LightType>"
        f'<VehicleLight vehicleLightType="{name}"/></LightType>'
        f'<LightState mode="{mode if is_on else "off"}"/></LightStateAction></AppearanceAction>'
    )


def _entity_action(one: _Track, what: str) -> str:
    entity = f'<EntityAction entityRef="{one.name}">{what}</EntityAction>'
    return f"<GlobalAction>{entity}</GlobalAction>"


def _event(name: str, time: float, action: str) -> str:
    """Something that begins at an instant, beside all else."""
    return (
        f'<Event name="{name}" priority="parallel" maximumExecutionCount="1">'
        f'<Action name="{name}">{action}</Action>{_trigger("StartTrigger", time)}</Event>'
    )


def _trigger(name: str, time: float) -> str:
    """From an instant on."""
    return (
        f'<{name}><ConditionGroup><Condition name="time" delay="0" conditionEdge="none">'
        f'<ByValueCondition><SimulationTimeCondition value="{time:.3f}" rule="greaterOrEqual"/>'
        f"</ByValueCondition></Condition></ConditionGroup></{name}>"
    )
