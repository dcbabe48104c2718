"""One recorded simulation in metres and seconds, at the instants of a film."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from overtaking.core.arrays import F64
from overtaking.core.errors import ConfigError
from overtaking.model.overtake_events import OvertakeEvents
from overtaking.model.road import Road
from overtaking.model.trajectories import NO_VEHICLE, Trajectories
from overtaking.model.vehicle_tracks import VehicleTracks
from overtaking.model.vehicles import EGO_SLOT, Colour, VehicleKind
from overtaking.show.video.vehicles import Body

RATE = 20
"""Frames of a film a second; films run in real time."""

_MS_PER_S = 1000.0


@dataclass(frozen=True, slots=True, kw_only=True)
class FilmScene:
    """The drawn simulation; arrays have shape (frame,) or (vehicle, frame), counted in the film.

    Attributes:
        road: The road.
        slots: Vehicles that are there, the ego first; the vehicle axis is in this order.
        bodies: What each of them looks like.
        target: Index into `slots` of the vehicle to overtake, None if there is none.
        recorded: Recorded frame of each frame of the film.
        is_there: Whether a vehicle was recorded in a frame.
        time: Since the start of the recording [s].
        s: Position along the road [m].
        d: Position to the left [m].
        angle: Of the body to the road, anticlockwise [rad].
        speed: [m/s].
        lights: `Lights` bits.
        stage: `Stage` of the ego, or None if it is not known.
        contact: First contact of the ego: time [s] and index into `slots`, or None.
    """

    road: Road
    slots: tuple[int, ...]
    bodies: tuple[Body, ...]
    target: int | None
    recorded: NDArray[np.int64]
    is_there: NDArray[np.bool_]
    time: F64
    s: F64
    d: F64
    angle: F64
    speed: F64
    lights: NDArray[np.uint8]
    stage: NDArray[np.uint8] | None
    contact: tuple[float, int | None] | None

    @property
    def num_frames(self) -> int:
        """Frames of the film."""
        return len(self.time)

    @property
    def lead(self) -> F64 | None:
        """Distance of the bumpers of ego and target [m], or None without a target.

        Positive while the target is ahead, 0 alongside, negative once it is behind.
        """
        if self.target is None:
            return None
        apart = self.s[self.target] - self.s[EGO_SLOT]
        reach = 0.5 * (self.bodies[EGO_SLOT].length + self.bodies[self.target].length)
        return np.sign(apart) * np.maximum(np.abs(apart) - reach, 0.0)


def scene(run: Trajectories, events: OvertakeEvents | None = None) -> FilmScene:
    """A scene from a batch of one simulation.

    Args:
        run: The recording.
        events: What happened in it, if it is known; else the target is the vehicle that the ego
            decided to overtake, or the nearest one ahead in its lane at the start.

    Raises:
        ConfigError: The batch holds another number of simulations than one.
    """
    if run.scenario.num_simulations != 1:
        raise ConfigError(
            what="simulations",
            where="video",
            expected="a batch of one",
            got=run.scenario.num_simulations,
            next_step="select one, such as run.select(slice(0, 1))",
        )
    recorded = _film_frames(int(run.num_frames[0]), run.scenario.frame_interval_ms)
    tracks = VehicleTracks.from_trajectories(run, events=events).at_frames(recorded)
    return FilmScene(
        road=run.road,
        slots=tracks.slots,
        bodies=tuple(_body(run, slot) for slot in tracks.slots),
        target=tracks.target,
        recorded=recorded,
        is_there=tracks.is_recorded,
        time=recorded.astype(np.float64) * (run.scenario.frame_interval_ms / _MS_PER_S),
        s=tracks.s,
        d=tracks.d,
        angle=tracks.road_angle,
        speed=tracks.speed,
        lights=_lights(run, tracks),
        stage=None if "stage" in run.unknown else run.stage[0, recorded],
        contact=_contact(run, tracks.slots),
    )


def _film_frames(num_frames: int, interval_ms: int) -> NDArray[np.int64]:
    """The recorded frame nearest to each frame of the film."""
    last_ms = (num_frames - 1) * interval_ms
    count = round(last_ms * RATE / _MS_PER_S) + 1
    instants = np.arange(count) * (_MS_PER_S / RATE)
    return np.minimum(np.rint(instants / interval_ms), num_frames - 1).astype(np.int64)


def _lights(run: Trajectories, tracks: VehicleTracks) -> NDArray[np.uint8]:
    """Lights of all vehicles; all are off in a recording that leaves out some kind of lamp."""
    is_known = {"indicators", "lamps"}.isdisjoint(run.unknown)
    return tracks.lights if is_known else np.zeros_like(tracks.lights)


def _body(run: Trajectories, slot: int) -> Body:
    specs = run.scenario.vehicles
    return Body(
        kind=VehicleKind(int(specs.kind[0, slot])),
        colour=Colour(int(specs.colour[0, slot])),
        **{name: float(getattr(specs, name)[0, slot]) for name in ("length", "width", "height")},
    )


def _contact(run: Trajectories, slots: tuple[int, ...]) -> tuple[float, int | None] | None:
    """First contact of the ego: time [s], and row of its partner, None for an undrawn one."""
    collided = np.flatnonzero(run.collided_with[0, : run.num_frames[0]] != NO_VEHICLE)
    if not len(collided):
        return None
    partner = int(run.collided_with[0, collided[0]])
    is_timed = run.contacts.partner[0, EGO_SLOT] == partner
    first_ms = int(collided[0]) * run.scenario.frame_interval_ms
    time_ms = int(run.contacts.time[0, EGO_SLOT]) if is_timed else first_ms
    return time_ms / _MS_PER_S, slots.index(partner) if partner in slots else None
