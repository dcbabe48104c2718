"""The compiled engine; its source is `crates/overtaking-py`. Use it through `sim.engine`."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

_F32 = NDArray[np.floating[Any]]

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
    steps_per_frame: int,
    road: Mapping[str, Any],
    constants: Mapping[str, Any],
    outputs: dict[str, NDArray[Any]],
    later: Sequence[tuple[_F32, _F32, NDArray[np.uint64], _F32 | None, int]] = (),
    actions: tuple[str, NDArray[np.int32]] | None = None,
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
        steps_per_frame: Steps between recorded frames.
        road: num_lanes, boundaries (9), film_path (8), side, and pose: x0, y0, heading, cosine,
            sine.
        constants: values as `constant_fields`, friction_new and friction_worn (3 x 4),
            friction_speeds (3), friction_films (4).
        outputs: Flat arrays by name.
        later: For each step at which others take over: vehicle and simulation parameters, numbers
            of the simulations, errors of the egos (2, simulation), and the step.
        actions: Kind and numbers of what another driver did with the ego, (simulation, action,
            part).
        level: SIMD level; None for the best of this CPU.

    Raises:
        ValueError: An array has another length, or the SIMD level is unknown or not available.
    """

def ego_signals_and_events(
    *,
    recording: Mapping[str, Any],
    visibility: Mapping[str, Any],
    thresholds: Mapping[str, Any],
    constants: Mapping[str, Any],
    signals: dict[str, NDArray[Any]],
    zero_from: NDArray[np.int32],
    events: NDArray[np.int32],
    level: str | None = None,
) -> None:
    """Compute the signals and the events of recordings.

    Args:
        recording: As `labels.signals.pack` makes it: s, d, speed, heading, accel, lane and
            is_recorded (or None), shape (simulation, vehicle, time), and collided_with, shape
            (simulation, time), the frames adjacent; num_frames, valid, length and width, flat; and
            the numbers num_lanes, overtaking_sign, direction, interval_ms, half_window.
        visibility: As `labels.signals.conditions` makes it.
        thresholds: As `labels.events.thresholds` makes them.
        constants: As in `simulate`.
        signals: Arrays of shape (simulation, time) or (simulation, 6, time) by name; filled.
        zero_from: Frame from which on these arrays are zero, before and after the call, shape
            (simulation,).
        events: A row for each of `event_fields`; filled.
        level: SIMD level; None for the best of this CPU.

    Raises:
        ValueError: An array has another shape, or the SIMD level is unknown or not available.
    """

def event_fields() -> list[str]:
    """Names of the rows of events, in order."""

def neighbour_signals(
    *,
    recording: Mapping[str, Any],
    neighbour_slot: NDArray[np.uint8],
    outputs: dict[str, NDArray[Any]],
    level: str | None = None,
) -> None:
    """Compute gaps to the neighbours of the ego and the occupancy of the lane to its left.

    Args:
        recording: As in `ego_signals_and_events`.
        neighbour_slot: Slots of the neighbours, flat (simulation, 6, time).
        outputs: gap, closing_speed and lateral_gap, shape (simulation, 6, time); left_occupancy
            and left_count, shape (simulation, time); filled.
        level: As in `ego_signals_and_events`.

    Raises:
        ValueError: As in `ego_signals_and_events`.
    """

def target_signals(
    *,
    recording: Mapping[str, Any],
    signals: Mapping[str, NDArray[Any]],
    target_slot: NDArray[np.uint8],
    outputs: dict[str, NDArray[Any]],
    level: str | None = None,
) -> None:
    """Compute the signals of the overtaken vehicles.

    Args:
        recording: As in `ego_signals_and_events`.
        signals: Signals of the ego, as `labels.signals.pack_seen` makes them.
        target_slot: Slot of the overtaken vehicle, 255 for none, shape (simulation,).
        outputs: Arrays of shape (simulation, time) by name; filled.
        level: As in `ego_signals_and_events`.

    Raises:
        ValueError: As in `ego_signals_and_events`, or a slot does not exist.
    """

def frames_alongside(
    *,
    recording: Mapping[str, Any],
    signals: Mapping[str, NDArray[Any]],
    target_slot: NDArray[np.uint8],
    span: NDArray[np.int32],
    level: str | None = None,
) -> tuple[
    NDArray[np.intp],
    NDArray[np.intp],
    NDArray[np.uint8],
    NDArray[np.float32],
    NDArray[np.float32],
]:
    """The frames within a span in which ego and target overlap along the road, in order.

    Args:
        recording: As in `ego_signals_and_events`.
        signals: As in `target_signals`.
        target_slot: As in `target_signals`.
        span: First and last frame of the span, flat (end, simulation).
        level: As in `ego_signals_and_events`.

    Returns:
        Simulation and frame of each, and of the target its lane, the gap between the sides of both
        [m], and its acceleration [m/s^2].

    Raises:
        ValueError: As in `target_signals`.
    """

def scan_spans(
    *,
    recording: Mapping[str, Any],
    signals: Mapping[str, NDArray[Any]],
    spans: NDArray[np.int32],
    moments: NDArray[np.int32],
    law: Mapping[str, Any],
    outputs: Mapping[str, NDArray[Any]],
    level: str | None = None,
) -> None:
    """Compute margins, measures and sums over spans of frames of each simulation.

    Args:
        recording: As in `ego_signals_and_events`.
        signals: As in `target_signals`.
        spans: First and last frame, flat (span, end, simulation).
        moments: Frames, -1 for none, and slots, 255 for none, flat (moment, simulation).
        law: Numbers of the law, as `labels.law.frames` makes them.
        outputs: measures, frames and sums, each with a row for each of its names; filled.
        level: As in `ego_signals_and_events`.

    Raises:
        ValueError: As in `ego_signals_and_events`, or a frame or a slot does not exist.
    """

def span_fields() -> list[tuple[str, list[str]]]:
    """Names of spans, moments and the rows of the results of `scan_spans`, in order."""

def limit_margins(
    *,
    signal: NDArray[np.float32],
    span: NDArray[np.int32],
    limit: NDArray[np.float32],
    is_maximum: bool,
    min_margin: NDArray[np.float32],
    frames: NDArray[np.int32],
    level: str | None = None,
) -> None:
    """Compute the smallest margin of a signal to a limit over a span of frames of each simulation.

    Args:
        signal: Shape (simulation, time), the frames adjacent.
        span: First and last frame, flat (end, simulation).
        limit: Shape (simulation,).
        is_maximum: Whether the limit is the largest allowed value, and not the smallest.
        min_margin: The smallest margins, 3e38 without a frame, shape (simulation,); filled.
        frames: First and last frame with a negative margin, -1 without one, and the length of the
            longest run of such frames, shape (3, simulation); filled.
        level: As in `ego_signals_and_events`.

    Raises:
        ValueError: As in `ego_signals_and_events`.
    """

def flag_bits(
    *, values: NDArray[np.uint8], span: NDArray[np.int32], out: NDArray[np.uint8]
) -> None:
    """Find the bits that are set in any frame of a span of each simulation, and in all of them.

    Args:
        values: Shape (simulation, time), the frames adjacent.
        span: As in `limit_margins`.
        out: Both, shape (2, simulation); filled. Without a frame no bit, and all bits.

    Raises:
        ValueError: An array has another shape.
    """

def encounter_measures(
    *,
    recording: Mapping[str, Any],
    neighbour_slot: NDArray[np.uint8],
    instants: NDArray[np.int64],
    slot: NDArray[np.uint8],
    out: NDArray[np.floating[Any]],
    level: str | None = None,
) -> None:
    """Compute the measures between the ego and neighbours in single frames.

    Args:
        recording: As in `ego_signals_and_events`.
        neighbour_slot: Slots of the neighbours, flat (simulation, 6, time).
        instants: Simulations, roles and frames, flat (3, instant).
        slot: Slot of each neighbour, 255 for none; filled.
        out: A row for each of `encounter_fields`; filled.
        level: As in `ego_signals_and_events`.

    Raises:
        ValueError: As in `ego_signals_and_events`, or an instant or a slot does not exist.
    """

def encounter_fields() -> list[str]:
    """Names of the rows of `encounter_measures`, in order."""

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

def words(
    *,
    seed: int,
    index: NDArray[np.uint64],
    stream: NDArray[np.uint32],
    draw: int,
    level: str | None = None,
) -> list[NDArray[np.uint32]]:
    """The four words of a block of draws, `core.random_numbers.philox_words` of flat arrays.

    Raises:
        ValueError: The arrays differ in length, or the SIMD level is unknown or not available.
    """

def exponentials(values: NDArray[np.floating[Any]], *, level: str | None = None) -> None:
    """Put `core.float32_math.exp` of each number of a flat array in its place.

    Raises:
        ValueError: The SIMD level is unknown or not available.
    """

def logarithms(values: NDArray[np.floating[Any]], *, level: str | None = None) -> None:
    """Put `core.float32_math.log` of each number of a flat array in its place.

    Raises:
        ValueError: The SIMD level is unknown or not available.
    """

def uniforms(words: NDArray[np.uint32]) -> NDArray[np.float32]:
    """Numbers in (0, 1) of random words, as `core.random_numbers.uniform_from_word` has them."""

def larger(values: NDArray[np.floating[Any]], others: Any) -> None:
    """Put `core.float32_math.maximum` of each number and another in its place.

    Args:
        values: Flat array.
        others: An array of the same length, or one number.

    Raises:
        ValueError: The arrays differ in length.
    """

def smaller(values: NDArray[np.floating[Any]], others: Any) -> None:
    """Put `core.float32_math.minimum` of each number and another in its place, as `larger`."""

def normal_pairs(
    u: NDArray[np.floating[Any]], v: NDArray[np.floating[Any]], *, level: str | None = None
) -> None:
    """Put `core.random_numbers.box_muller` of two flat arrays in their places.

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

def ego_columns() -> list[str]:
    """Names of the observed columns of the ego, in order."""

def neighbour_columns() -> list[str]:
    """Names of the observed columns of a neighbour, in order."""

def passing_columns() -> list[str]:
    """Names of the observed columns about a pass against oncoming traffic, in order."""

class Stepper:
    """A batch that waits at every decision for what another driver orders."""

    def __init__(
        self, batch: Mapping[str, Any], kind: str | None, is_true: bool, level: str | None = None
    ) -> None:
        """Stand before the first decision.

        Args:
            batch: vehicle, simulation, index, slots, seed, steps_per_frame, road and constants as
                in `simulate`.
            kind: What orders are; None where the model's own driver decides.
            is_true: Whether the truth is observed.
            level: SIMD level; None for the best of this CPU.

        Raises:
            ValueError: An array has another length, or the kind or SIMD level is unknown.
        """

    def begin(self) -> tuple[NDArray[np.float32], NDArray[np.bool_], NDArray[np.uint32]]:
        """Observations at the start, (simulation, field); which simulations run; zeros."""

    def step(
        self, values: NDArray[np.int32], decisions: int
    ) -> tuple[NDArray[np.float32], NDArray[np.bool_], NDArray[np.uint32]]:
        """Carry out the same orders, (simulation, part), for some decisions.

        Returns:
            Observations, those of a simulation that ended within the step at its end; which
            simulations run; how many decisions of the step each carried out.

        Raises:
            ValueError: The orders have another length.
        """

    def renew(
        self, rows: NDArray[np.int64], batch: Mapping[str, Any]
    ) -> tuple[NDArray[np.float32], NDArray[np.bool_], NDArray[np.uint32]]:
        """What is observed at first in new simulations, which begin in rows of others.

        Args:
            rows: The rows, each once.
            batch: The new simulations, one for each row, with as many slots as the others. Their
                seed, road and constants are those of the others.

        Raises:
            ValueError: A row is named twice or is none, or an array has another length.
        """

class ColumnHash:
    """BLAKE3 over the values of a column of Arrow, and over where it is null."""

    def __init__(self, layout: str, width: int, *, nullable: bool) -> None:
        """Start without rows.

        Args:
            layout: "numbers", "bits", "codes" of names, "texts" of any length, or "fixed".
            width: Bytes of a number, or of a text of fixed length.
            nullable: Whether the column may hold nulls.

        Raises:
            ValueError: There is no such layout.
        """

    def update(self, rows: Mapping[str, Any], meaning: Sequence[int] | None = None) -> bool:
        """Add rows; whether any of them has a value.

        Args:
            rows: Their `count`, their `offset` in the buffers, and these: `validity` or None,
                `data`, and `ends` of texts.
            meaning: The code of each place in a list of names.

        Raises:
            ValueError: The buffers are too short, or a name is none of the list.
        """

    def hexdigests(self) -> tuple[str, str]:
        """The hashes over all values and over all nulls so far, 64 hexadecimal digits each."""

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
