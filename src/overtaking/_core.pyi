"""The compiled engine; its source is `crates/overtaking-py`. Use it through `sim.engine`."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

MAX_VEHICLES: Final[int]
MAX_PERCEPTS: Final[int]
LANES: Final[int]
VERSION: Final[str]

def simulate(
    *,
    vehicle: NDArray[np.floating[Any]],
    simulation: NDArray[np.floating[Any]],
    index: NDArray[np.uint64],
    slots: int,
    frames: int,
    seed: int,
    record_every: int,
    road: Mapping[str, Any],
    constants: Mapping[str, Any],
    outputs: dict[str, NDArray[Any]],
    later: tuple[NDArray[np.floating[Any]], NDArray[np.floating[Any]], int] | None = None,
    level: str | None = None,
) -> None:
    """Simulate a batch and fill the flat arrays of `outputs`.

    Args:
        vehicle: Flat (field, vehicle, simulation), fields as `vehicle_fields`.
        simulation: Flat (field, simulation), fields as `simulation_fields`.
        index: Number of each simulation.
        slots: Vehicle slots, at most `MAX_VEHICLES`.
        frames: Frames that the outputs have room for, a multiple of `LANES`.
        seed: Key of the random numbers.
        record_every: Steps between recorded frames.
        road: num_lanes, boundaries (9), film_path (8), side, and pose: x0, y0, heading, cosine,
            sine.
        constants: values as `constant_fields`, friction_new and friction_worn (3 x 4),
            friction_speeds (3), friction_films (4).
        outputs: Flat arrays by name.
        later: vehicle and simulation parameters from a step on, and that step.
        level: SIMD level; None for the best of this CPU.

    Raises:
        ValueError: An array has another length, or the SIMD level is unknown or not available.
    """

def signals(
    *,
    states: Mapping[str, NDArray[Any] | None],
    vehicles: Mapping[str, Any],
    around: Mapping[str, Any],
    constants: Mapping[str, Any],
    outputs: dict[str, NDArray[Any]],
    level: str | None = None,
) -> None:
    """Work out the signals of a recording and fill the arrays of `outputs`.

    Args:
        states: s, d, speed, heading, accel, lane and present (or None), shape (simulation, vehicle,
            time), the frames of a vehicle adjacent.
        vehicles: num_frames, valid, length, width, all flat; and the numbers side, heading,
            interval_ms, half_window.
        around: film (simulation, 8), wear, truck, fog, rain, contrast_depth, lamp_depth,
            lamp_clear, unlit_limit, all flat; and the numbers attention and num_lanes.
        constants: As in `simulate`.
        outputs: Arrays of shape (simulation, time) or (simulation, 6, time) by name.
        level: SIMD level; None for the best of this CPU.

    Raises:
        ValueError: An array has another shape, or the SIMD level is unknown or not available.
    """

def weather_driven(
    driven: Mapping[str, Any],
    table: NDArray[np.float32],
    decision: int,
    level: str | None = None,
) -> None:
    """Write gusts, friction and wind of a decision into a table of what moves.

    Args:
        driven: vehicle, simulation, index, slots, seed, road and constants as in `simulate`, of one
            simulation.
        table: Shape (field, vehicle), fields as `moving_fields`.
        decision: Its number.
        level: SIMD level; None for the best of this CPU.

    Raises:
        ValueError: An array has another length, or the SIMD level is unknown or not available.
    """

def drive(
    driven: Mapping[str, Any],
    table: NDArray[np.float32],
    controls: NDArray[np.float32],
    wheel_rate: float,
    steps: int,
    level: str | None = None,
) -> None:
    """Move the vehicles of a table by some steps.

    Args:
        driven: As in `weather_driven`.
        table: Shape (field, vehicle), fields as `moving_fields`.
        controls: Throttle, brake and wanted angle of the front wheels [rad], shape (3, vehicle).
        wheel_rate: How fast the wheels turn [rad/s].
        steps: How many.
        level: SIMD level; None for the best of this CPU.

    Raises:
        ValueError: An array has another length, or the SIMD level is unknown or not available.
    """

def moving_fields() -> list[str]:
    """Names of the rows of the table of what moves, in order."""

def target(
    *,
    states: Mapping[str, NDArray[Any] | None],
    vehicles: Mapping[str, Any],
    own: Mapping[str, NDArray[Any]],
    outputs: dict[str, NDArray[Any]],
    level: str | None = None,
) -> None:
    """Work out the signals of the vehicles that are overtaken and fill the arrays of `outputs`.

    Args:
        states: As in `signals`.
        vehicles: As in `signals`.
        own: target, the slot of that vehicle, 255 for none; lateral, right_reach and left_reach of
            the ego, flat (simulation, time).
        outputs: Arrays of shape (simulation, time) by name.
        level: SIMD level; None for the best of this CPU.

    Raises:
        ValueError: An array has another shape, a slot does not exist, or the SIMD level is unknown
            or not available.
    """

def neighbours(
    *,
    states: Mapping[str, NDArray[Any] | None],
    vehicles: Mapping[str, Any],
    vehicle: NDArray[np.uint8],
    outputs: dict[str, NDArray[Any]],
    level: str | None = None,
) -> None:
    """Work out the gaps to the neighbours of the ego and fill the arrays of `outputs`.

    Args:
        states: As in `signals`.
        vehicles: As in `signals`.
        vehicle: Who they are, flat (simulation, 6, time).
        outputs: gap, closing_speed and lateral_gap, shape (simulation, 6, time).
        level: SIMD level; None for the best of this CPU.

    Raises:
        ValueError: As in `signals`.
    """

def neighbours_at(
    *,
    near: Mapping[str, NDArray[Any]],
    rows: NDArray[np.int64],
    places: NDArray[np.int64],
    frames: NDArray[np.int64],
    out: Mapping[str, NDArray[Any]],
) -> None:
    """Neighbours of the ego at single frames, in a place each.

    Args:
        near: s and speed, shape (simulation, vehicle, time); length (simulation, vehicle); vehicle,
            who they are, (simulation, 6, time).
        rows: Simulations.
        places: Places around the ego.
        frames: Frames.
        out: vehicle, gap and closing_speed at these, flat.

    Raises:
        ValueError: An array has another length, or an instant or a slot does not exist.
    """

def left_lane(
    *,
    states: Mapping[str, NDArray[Any] | None],
    vehicles: Mapping[str, Any],
    num_lanes: int,
    outputs: dict[str, NDArray[Any]],
    level: str | None = None,
) -> None:
    """Work out who is in the lane to the left of the ego and fill the arrays of `outputs`.

    Args:
        states: As in `signals`.
        vehicles: As in `signals`.
        num_lanes: Driving lanes.
        outputs: left_occupancy and left_count, shape (simulation, time).
        level: SIMD level; None for the best of this CPU.

    Raises:
        ValueError: As in `signals`.
    """

def alongside(
    *,
    states: Mapping[str, NDArray[Any] | None],
    vehicles: Mapping[str, Any],
    own: Mapping[str, NDArray[Any]],
    start: NDArray[np.int32],
    stop: NDArray[np.int32],
    out: Mapping[str, NDArray[Any]],
    level: str | None = None,
) -> None:
    """Work out some of what `target` does, in some frames of each simulation.

    Args:
        states: As in `signals`.
        vehicles: As in `signals`.
        own: As in `target`.
        start: First of these frames.
        stop: Last of them; none where it is before the first.
        out: overlaps, lane, lateral_gap and accel of all of them, one simulation after the other.
        level: SIMD level; None for the best of this CPU.

    Raises:
        ValueError: As in `target`, or a frame was not recorded.
    """

def events(
    *,
    recorded: Mapping[str, NDArray[Any] | None],
    seen: Mapping[str, NDArray[Any]],
    limits: Mapping[str, Any],
    out: NDArray[np.int32],
) -> None:
    """Find the events of a recording: a row of `out` for each of `event_fields`.

    Args:
        recorded: num_frames, valid, length, flat; s and present (or None), shape (simulation,
            vehicle, time), and hit, shape (simulation, time), the frames adjacent.
        seen: Signals of the ego, flat: lane, lateral, lateral_speed, right_reach, left_reach,
            speed, vehicle.
        limits: borders, least_frames, window, least_speed, least_shift, settled_shift,
            follow_time_gap.
        out: Shape (event, simulation).

    Raises:
        ValueError: An array has another shape, or a slot does not exist.
    """

def event_fields() -> list[str]:
    """Names of the rows of events, in order."""

def extreme_float(
    *,
    span: Mapping[str, Any],
    values: NDArray[np.floating[Any]],
    greatest: bool,
    out: NDArray[np.floating[Any]],
) -> None:
    """The smallest or largest of an array in a stretch of each simulation.

    Args:
        span: start and stop, the first and last frame of each simulation; frames, how many there is
            room for; and level, the SIMD level or None.
        values: Flat (simulation, time).
        greatest: Whether the largest is asked for.
        out: Flat (simulation).

    Raises:
        ValueError: An array has another length, or the SIMD level is unknown or not available.
    """

def beyond(
    *,
    span: Mapping[str, Any],
    values: NDArray[np.floating[Any]],
    limits: NDArray[np.floating[Any]],
    greatest: bool,
    out: Mapping[str, NDArray[Any]],
) -> None:
    """The same, and the first and last frame with a number beyond the limit of its simulation.

    Args:
        span: As in `extreme_float`.
        values: Flat (simulation, time).
        limits: Flat (simulation).
        greatest: Whether the largest is asked for, and numbers above the limit.
        out: As in `stops`; low is that extreme, means nothing where the stretch is empty.

    Raises:
        ValueError: As in `extreme_float`.
    """

def encounters(
    *,
    around: Mapping[str, NDArray[Any]],
    accels: NDArray[np.int16],
    instants: Mapping[str, NDArray[np.int64]],
    is_ahead: bool,
    vehicle: NDArray[np.uint8],
    out: NDArray[np.floating[Any]],
    level: str | None = None,
) -> None:
    """Encounters with neighbours at single frames: a row of `out` for each `encounter_fields`.

    Args:
        around: As in `follow`.
        accels: Shape (simulation, vehicle, time).
        instants: rows, places and frames.
        is_ahead: Whether the neighbours are ahead of the ego.
        vehicle: Their slots, 255 where nobody is there.
        out: Shape (measure, instant).
        level: SIMD level; None for the best of this CPU.

    Raises:
        ValueError: An array has another shape, an instant or a slot does not exist, or the SIMD
            level is unknown or not available.
    """

def encounter_fields() -> list[str]:
    """Names of the rows of `encounters`, in order."""

def dark(
    *,
    lights: NDArray[np.uint8],
    crossed: NDArray[np.int32],
    first: NDArray[np.int32],
    last: NDArray[np.int32],
    before: int,
    after: int,
    bit: int,
    out: NDArray[np.int32],
) -> None:
    """Frames around a crossing without a lamp: rows for their number, the first and the last.

    Args:
        lights: Lamps of the ego, shape (simulation, time).
        crossed: Frame of the crossing, -1 without one.
        first: First frame that counts.
        last: Last frame that counts.
        before: Frames before the crossing that count.
        after: Frames after it.
        bit: The lamp.
        out: Shape (3, simulation).

    Raises:
        ValueError: An array has another length, or a frame does not exist.
    """

def arrivals(
    *,
    s: NDArray[np.int32],
    present: NDArray[np.bool_] | None,
    num_frames: NDArray[np.int32],
    coming: Mapping[str, NDArray[Any]],
    out: NDArray[np.int32],
) -> None:
    """First frame in which each of some vehicles has come to a place, -1 without one.

    Args:
        s: Shape (simulation, vehicle, time).
        present: The same shape, or None.
        num_frames: Recorded frames of each simulation.
        coming: row, slot, begin, the first frame that counts, place [mm], and halves, how far the
            front is ahead of the centre [m].
        out: A frame for each.

    Raises:
        ValueError: An array has another length, or a vehicle does not exist.
    """

def stops(
    *,
    span: Mapping[str, Any],
    speed: NDArray[np.floating[Any]],
    friction: NDArray[np.floating[Any]],
    sight: NDArray[np.floating[Any]],
    floor: float,
    usable: float,
    reaction_time: float,
    out: Mapping[str, NDArray[Any]],
) -> None:
    """Sight minus stopping distance over a stretch.

    Args:
        span: As in `extreme_float`.
        speed: Flat (simulation, time).
        friction: The same.
        sight: The same.
        floor: Least friction.
        usable: Usable share of friction times gravity.
        reaction_time: In seconds.
        out: low, first and last of each simulation.

    Raises:
        ValueError: As in `extreme_float`.
    """

def follow(
    *,
    span: Mapping[str, Any],
    seen: Mapping[str, Any],
    law: Mapping[str, float],
    out: Mapping[str, NDArray[Any]],
) -> None:
    """Gap to the leader minus lawful gap over a stretch, but for the time after a cut-in.

    Args:
        span: As in `extreme_float`.
        seen: speed, friction, lane, flat; around, who is there: vehicle and length, flat, s and
            speed, shape (simulation, vehicle, time); lanes and present (or None), the same shape;
            regain, a number of frames.
        law: floor, usable, decel_limit, reaction_time.
        out: As in `stops`.

    Raises:
        ValueError: As in `extreme_float`, or a slot does not exist.
    """

def duty(
    *,
    span: Mapping[str, Any],
    seen: Mapping[str, Any],
    law: Mapping[str, float],
    first: NDArray[np.int32],
    length: NDArray[np.int32],
) -> None:
    """The longest run of frames of a stretch in which the ego could have returned.

    Args:
        span: As in `extreme_float`.
        seen: lane, original_lane, target, speed, friction, flat; around as in `follow`; and the
            numbers num_lanes, time_gap, free_time, reach.
        law: As in `follow`.
        first: First frame of the run, -1 without one.
        length: Its number of frames.

    Raises:
        ValueError: As in `follow`.
    """

def obstruction(
    *,
    span: Mapping[str, Any],
    seen: Mapping[str, Any],
    out: Mapping[str, NDArray[Any]],
) -> None:
    """Allowed braking minus what is forced on the follower after each change of lane.

    Args:
        span: As in `extreme_float`.
        seen: lane, flat; around as in `follow`; and the numbers lasting, allowed, most.
        out: As in `stops`.

    Raises:
        ValueError: As in `follow`.
    """

def worst(
    *,
    span: Mapping[str, Any],
    seen: Mapping[str, Any],
    law: Mapping[str, float],
    measures: Mapping[str, float],
    out: NDArray[np.floating[Any]],
) -> None:
    """The worst of each measure of safety over a stretch: a row of `out` for each `worst_fields`.

    Args:
        span: As in `extreme_float`.
        seen: speed, friction, flat; around as in `follow`; accels, shape (simulation, vehicle,
            time).
        law: As in `follow`.
        measures: picud_reaction_time, picud_decel, rss_reaction_time, rss_accel, rss_rear_decel,
            rss_lead_decel, critical_ttc.
        out: Shape (measure, simulation).

    Raises:
        ValueError: As in `follow`.
    """

def worst_fields() -> list[str]:
    """Names of the rows of `worst`, in order."""

def means(*, span: Mapping[str, Any], seen: Mapping[str, Any], out: NDArray[np.int64]) -> None:
    """Sums over the frames up to the last of a stretch: a row of `out` for each of `mean_fields`.

    Args:
        span: As in `extreme_float`.
        seen: around as in `follow`; num_lanes; valid, flat; lane and present (or None), shape
            (simulation, vehicle, time).
        out: Shape (sum, simulation).

    Raises:
        ValueError: As in `follow`.
    """

def mean_fields() -> list[str]:
    """Names of the rows of `means`, in order."""

def words(
    *,
    seed: int,
    index: NDArray[np.uint64],
    stream: NDArray[np.uint32],
    draw: int,
    level: str | None = None,
) -> list[NDArray[np.uint32]]:
    """The four words of a block of draws, `core.philox.words` of flat arrays.

    Raises:
        ValueError: The arrays differ in length, or the SIMD level is unknown or not available.
    """

def exponentials(values: NDArray[np.floating[Any]], *, level: str | None = None) -> None:
    """Put `core.elementary.exp` of each number of a flat array in its place.

    Raises:
        ValueError: The SIMD level is unknown or not available.
    """

def logarithms(values: NDArray[np.floating[Any]], *, level: str | None = None) -> None:
    """Put `core.elementary.log` of each number of a flat array in its place.

    Raises:
        ValueError: The SIMD level is unknown or not available.
    """

def uniforms(words: NDArray[np.uint32]) -> NDArray[np.float32]:
    """The numbers in (0, 1) that words stand for, `core.philox.uniform` of a flat array."""

def larger(values: NDArray[np.floating[Any]], others: Any) -> None:
    """Put `core.elementary.maximum` of each number and another in its place.

    Args:
        values: Flat array.
        others: An array of the same length, or one number.

    Raises:
        ValueError: The arrays differ in length.
    """

def smaller(values: NDArray[np.floating[Any]], others: Any) -> None:
    """Put `core.elementary.minimum` of each number and another in its place, as `larger`."""

def normal_pairs(
    u: NDArray[np.floating[Any]], v: NDArray[np.floating[Any]], *, level: str | None = None
) -> None:
    """Put `core.philox.normal_pair` of two flat arrays in their places.

    Raises:
        ValueError: As for `words`.
    """

def vehicle_fields() -> list[str]:
    """Names of the vehicle parameters, in order."""

def simulation_fields() -> list[str]:
    """Names of the simulation parameters, in order."""

def constant_fields() -> list[str]:
    """Names of the constants, in order."""

def simd_levels() -> list[tuple[str, bool]]:
    """Every SIMD level that the engine has, and whether this CPU can run it."""

def simd_level() -> str:
    """The SIMD level that is used when none is asked for."""

def num_threads() -> int:
    """Threads of the pool that simulations are spread over."""

class Hash:
    """BLAKE3, 256 bits."""

    def __init__(self) -> None: ...
    def update(self, data: bytes | memoryview) -> None:
        """Add bytes."""

    def hexdigest(self) -> str:
        """The hash so far, 64 hexadecimal digits."""

class Drawing:
    """Shapes, the first below the others; x grows to the right, y downwards.

    Colours are `#rrggbb`, opacity is 0 to 1. Every method raises `ValueError` for another colour.
    """

    def __init__(self) -> None:
        """No shapes."""

    def rect(
        self,
        x: tuple[float, float],
        y: tuple[float, float],
        colour: str,
        *,
        opacity: float = 1.0,
        radius: float = 0.0,
    ) -> None:
        """Add a rectangle, with round corners if it has a radius."""

    def frame(
        self,
        x: tuple[float, float],
        y: tuple[float, float],
        colour: str,
        *,
        line: float,
        radius: float,
    ) -> None:
        """Add the outline of a rectangle with round corners, `line` wide, inside its edges."""

    def polygon(
        self, points: Sequence[tuple[float, float]], colour: str, *, opacity: float = 1.0
    ) -> None:
        """Add a polygon."""

    def lines(
        self,
        lines: Sequence[Sequence[tuple[float, float]]],
        colour: str,
        *,
        width: float,
        opacity: float = 1.0,
    ) -> None:
        """Add lines, each through points."""

    def glow(self, x: float, y: float, reach: float, colour: str, strength: float) -> None:
        """Add light around a point that fades towards `reach`."""

    def mask(self, covered: NDArray[np.uint8], place: tuple[int, int], colour: str) -> None:
        """Add a mask of one colour.

        Args:
            covered: How much of each pixel it covers, 0 to 255; shape (height, width), contiguous.
            place: Column and row of its left upper corner.
            colour: Its colour.

        Raises:
            ValueError: It has no rows or no columns, or this is no colour.
        """

class Canvas:
    """An opaque picture.

    `rows` are the first row and the one after the last; rows or columns that a picture does not
    have raise `ValueError`.
    """

    def __init__(self, width: int, height: int, colour: str) -> None:
        """A picture of one colour.

        Raises:
            ValueError: It has no size, or this is no colour.
        """

    def draw(self, drawing: Drawing, x: float = 0.0, y: float = 0.0) -> None:
        """Draw shapes with their origin at a column and a row; what lies outside is cut off."""

    def draw_all(self, placed: Sequence[tuple[Drawing, float, float, float]], scale: float) -> None:
        """Draw shapes one after the other, without Python's lock; what lies outside is cut off.

        Args:
            placed: Each with column and row of its origin, and the angle by which it is turned
                anticlockwise [rad].
            scale: Pixels to a unit of theirs.
        """

    def paste(self, other: Canvas, x: int, y: int, columns: tuple[int, int]) -> None:
        """Copy all rows of another picture.

        Args:
            other: The other picture.
            x: Where its first copied column goes.
            y: Where its first row goes.
            columns: First column to copy, and the one after the last.
        """

    def veil(self, rows: tuple[int, int], hidden: NDArray[np.uint16], colour: str) -> None:
        """Hide some rows behind a colour.

        Args:
            rows: Which rows.
            hidden: Share of each column that is hidden, 0 to 256; contiguous.
            colour: What is seen instead.
        """

    def night(
        self,
        rows: tuple[int, int],
        moonlight: int,
        lights: Sequence[tuple[NDArray[np.uint8], int, int]],
    ) -> None:
        """Darken some rows where no light falls.

        Args:
            rows: Which rows.
            moonlight: What is left without a lamp, 0 to 255.
            lights: What each adds, at half the resolution, with column and row of its left upper
                corner from that of the rows; what lies outside is cut off.
        """

    def rgb(self) -> NDArray[np.uint8]:
        """Red, green and blue, shape (height, width, 3)."""

    def yuv(self, out: NDArray[np.uint8]) -> None:
        """Write the picture as encoders take it, YUV 4:2:0 with BT.601's colours.

        Args:
            out: Luma, then both chroma planes at half the resolution; contiguous.

        Raises:
            ValueError: The array has another size.
        """
