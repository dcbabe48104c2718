"""The compiled engine; its source is `crates/overtaking-py`. Use it through `sim.engine`."""

from collections.abc import Mapping, Sequence
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

MAX_PERCEPTS: Final[int]
MAX_VEHICLES: Final[int]
SIMD_LANES: Final[int]
VERSION: Final[str]
FIELD_NAMES: Final[dict[str, tuple[str, ...]]]

@final
class Canvas:
    """An opaque picture.

    `rows` are a pair: the first row and the row after the last. Rows or columns beyond the edges
    of the picture raise `ValueError`, and so does an odd width in `darken`, or an odd width or
    height in `write_yuv`.
    """

    def __new__(cls, /, width: int, height: int, colour: str) -> Canvas:
        """Make a picture of one colour.

        Raises:
            SystemLimitError: The system grants too little memory.
            ValueError: Width or height is 0, or the colour is invalid.
        """

    def blend_colour(
        self, /, rows: tuple[int, int], hidden: NDArray[np.uint16], colour: str
    ) -> None:
        """Blend some rows with a colour.

        Args:
            rows: First row, and the row after the last.
            hidden: Share of the colour in each column, 0 (none) to 256 (only the colour), shape
                (width,); contiguous.
            colour: The colour, `#rrggbb`.
        """

    def copy_columns(self, /, other: Canvas, x: int, y: int, columns: tuple[int, int]) -> None:
        """Copy some columns of another picture, over all of its rows.

        Args:
            other: The other picture.
            x: Column of this picture for the first copied column.
            y: Row of this picture for the first row of the other.
            columns: First column of the other to copy, and the column after the last.
        """

    def darken(
        self,
        /,
        rows: tuple[int, int],
        moonlight: int,
        lights: Sequence[tuple[NDArray[np.uint8], int, int]],
    ) -> None:
        """Multiply the brightness of some rows by the light that falls on each pixel.

        Args:
            rows: First row, and the row after the last.
            moonlight: Brightness without lamps, 0 (black) to 255 (unchanged).
            lights: For each lamp the brightness that it adds, shape (height, width), and the column
                and the row of the upper left corner of this array, counted from the upper left
                corner of the rows. All in pixels of half the resolution; parts outside the rows
                are ignored.
        """

    def draw(self, /, drawing: Drawing, x: float = 0.0, y: float = 0.0) -> None:
        """Draw shapes with their origin at a column and a row, clipped to the picture."""

    def draw_placed(
        self, /, placed: Sequence[tuple[Drawing, float, float, float]], scale: float
    ) -> None:
        """Draw shapes one after the other, clipped to the picture, without Python's lock.

        Args:
            placed: Drawings, each with the column and the row of its origin and the angle by
                which it is turned anticlockwise [rad].
            scale: Number of pixels per unit of the shapes.
        """

    def to_rgb(self, /) -> NDArray[np.uint8]:
        """The picture as red, green and blue, shape (height, width, 3).

        Raises:
            SystemLimitError: The system grants too little memory.
        """

    def write_yuv(self, /, out: NDArray[np.uint8]) -> None:
        """Write the picture for a video encoder, as YUV 4:2:0 (ITU-R BT.601-7, section 2.5).

        Args:
            out: Memory for luma, then both chroma planes at half the resolution; contiguous.

        Raises:
            ValueError: The array does not have 3 / 2 elements per pixel, or the width or height is
                odd.
        """

@final
class ColumnHash:
    """BLAKE3 hashes of an Arrow column: over its values, and over its nulls."""

    def __new__(cls, /, layout: str, width: int, *, nullable: bool) -> ColumnHash:
        """Make the hash of a column without rows.

        Args:
            layout: How the rows lie in their buffer: "numbers"; "bits" of Booleans; "codes",
                indices of names as 32-bit integers; "texts" of any length; "fixed", texts of
                `width` bytes.
            width: Bytes of a number or of a fixed text; the other layouts ignore it.
            nullable: Whether the column may hold nulls.

        Raises:
            ValueError: The layout is unknown.
        """

    def hexdigests(self, /) -> tuple[str, str]:
        """The hashes over all values and over all nulls so far, 64 hexadecimal digits each."""

    def update(self, /, rows: Mapping[str, Any], meaning: Sequence[int] | None = None) -> bool:
        """Add rows; returns whether any of these rows has a value.

        Args:
            rows: `count`, the number of rows; `offset`, the index of the first row in the buffers;
                and the buffers of Arrow: `validity` (None if all rows have a value), `data`, and
                `ends` of texts.
            meaning: For layout "codes", the code to hash for each index of a name.

        Raises:
            ValueError: The buffers are too short, or the index of a name is beyond `meaning`.
        """

@final
class Drawing:
    """Shapes in the order in which they are drawn; x grows to the right, y downwards.

    Colours are `#rrggbb`; any other text raises `ValueError`. Opacity is 0 (invisible) to 1.
    """

    def __new__(cls, /) -> Drawing:
        """Make a drawing without shapes."""

    def glow(self, /, x: float, y: float, reach: float, colour: str, strength: float) -> None:
        """Add a light around a point, of opacity `strength` there and 0 at the distance `reach`."""

    def lines(
        self,
        /,
        lines: Sequence[Sequence[tuple[float, float]]],
        colour: str,
        *,
        width: float,
        opacity: float = 1.0,
    ) -> None:
        """Add lines, each through a sequence of points (x, y)."""

    def mask(self, /, covered: NDArray[np.uint8], place: tuple[int, int], colour: str) -> None:
        """Add an image of one colour, such as a letter.

        Args:
            covered: Coverage of each pixel, 0 to 255; shape (height, width), contiguous.
            place: Column and row of the upper left corner.
            colour: Colour of the image.

        Raises:
            ValueError: The array has no rows or no columns, or the colour is invalid.
        """

    def outline(
        self,
        /,
        x: tuple[float, float],
        y: tuple[float, float],
        colour: str,
        *,
        line: float,
        radius: float,
    ) -> None:
        """Add the outline of a rectangle with round corners, `line` wide, inside its edges."""

    def polygon(
        self, /, points: Sequence[tuple[float, float]], colour: str, *, opacity: float = 1.0
    ) -> None:
        """Add a filled polygon through points (x, y)."""

    def rect(
        self,
        /,
        x: tuple[float, float],
        y: tuple[float, float],
        colour: str,
        *,
        opacity: float = 1.0,
        radius: float = 0.0,
    ) -> None:
        """Add a filled rectangle; its corners are round if `radius` is above 0."""

@final
class ExternallyMovedSimulation:
    """Drivers of the model in one simulation whose vehicles another simulator moves."""

    def __new__(
        cls,
        /,
        inputs: Inputs,
        *,
        tick: float,
        frames: int,
        outputs: dict[str, NDArray[Any]],
        level: str | None = None,
    ) -> ExternallyMovedSimulation:
        """Begin before the first decision.

        Args:
            inputs: Inputs of one simulation.
            tick: Time between two decisions [s], in which one call of `steer` turns the wheels.
            frames: Number of frames that fit into the outputs, a multiple of `SIMD_LANES`: the
                recorder writes `SIMD_LANES` frames at once, also for a single simulation.
            outputs: Flat arrays by name, as in `simulate`. Each call writes a part of them.
            level: SIMD level; None for the best of this CPU.

        Raises:
            ValueError: `inputs` has no simulation or several, an array has another length, or the
                SIMD level is unknown or not available.
        """

    def decide(
        self, /, motion: NDArray[np.float32], step: int
    ) -> tuple[NDArray[np.float32], NDArray[np.uint8], int]:
        """Let all drivers decide, and record a frame if one is due.

        Args:
            motion: Motion after the last tick, (field, slot), fields as `FIELD_NAMES["motion"]`.
            step: Number of the step; steps last 10 ms.

        Returns:
            Requests of the drivers, (field, slot), fields as `FIELD_NAMES["driver_output"]`; lamps
            in the last recorded frame, (slot,), as bits of `Lights`; the last step of the
            simulation.

        Raises:
            ValueError: The motion has another length.
        """

    def end_at(self, /, step: int) -> None:
        """Set the last step of the simulation."""

    def end_step(self, /) -> int:
        """The last step of the simulation."""

    def finish(self, /) -> None:
        """Write the last frames, the contacts and the hash of the recording to the outputs."""

    def is_ego_wrecked(self, /) -> bool:
        """Whether the ego has collided or left the road."""

    def record(
        self, /, motion: NDArray[np.float32], ego_stage: float, ego_indicator: float, step: int
    ) -> None:
        """Record a frame, if one is due, in which the other simulator drives all vehicles.

        Args:
            motion: As in `decide`.
            ego_stage: Code of the ego's `Stage`.
            ego_indicator: 1 towards the overtaking side, -1 towards the kerb side, 0 off.
            step: Number of the step; steps last 10 ms.

        Raises:
            ValueError: The motion has another length.
        """

    def record_contacts(
        self, /, contacts: Sequence[tuple[int, int, float, float, float]], step: int
    ) -> None:
        """Record the first contact of each vehicle, which becomes a wreck.

        Args:
            contacts: Slot, slot of the other vehicle, time [s], size of the impulse [N s], and
                closing speed [m/s]. A contact is recorded for its first slot only; the other
                vehicle needs an entry of its own.
            step: Step of the contacts; may be negative, before the first decision. A contact of
                the ego ends the simulation soon after this step.

        Raises:
            ValueError: A slot does not exist.
        """

    def steer(self, /, wind_trim: NDArray[np.float32]) -> NDArray[np.float32]:
        """Turn the front wheels for one tick.

        Args:
            wind_trim: Part of the wheel angle [rad], or of the lateral acceleration of a
                two-wheeler [m/s^2], that compensates crosswind, (slot,).

        Returns:
            Wheel angle [rad], or lateral acceleration of a two-wheeler [m/s^2], (slot,).

        Raises:
            ValueError: The array has another length.
        """

@final
class Inputs:
    """All inputs of a batch. Each call reads the arrays in place."""

    def __new__(
        cls,
        /,
        *,
        vehicle: NDArray[np.float32],
        simulation: NDArray[np.float32],
        scenario_index: NDArray[np.uint64],
        num_slots: int,
        seed: int,
        steps_per_frame: int,
        road: Mapping[str, Any],
        constants: Mapping[str, Any],
    ) -> Inputs:
        """Check the inputs of a batch.

        Args:
            vehicle: Parameters of vehicles and drivers, flat (field, slot, simulation), fields as
                `FIELD_NAMES["vehicle"]`.
            simulation: Parameters of simulations, flat (field, simulation), fields as
                `FIELD_NAMES["simulation"]`.
            scenario_index: Index of each scenario, shape (simulation,).
            num_slots: Vehicle slots, 1 to `MAX_VEHICLES`.
            seed: Seed of the data set, the key of the random numbers.
            steps_per_frame: Steps of 10 ms between recorded frames, at least 1.
            road: Fields of the road by name, as `sim.engine.road_inputs` returns them.
            constants: Constants of the model by name, as `world.constants.engine_constants` returns
                them.

        Raises:
            TypeError: An array has another type or is not contiguous.
            ValueError: An array has another length, or a number is out of range.
        """

@final
class PedalDriving:
    """Moves vehicles of one simulation by their pedals and wheel angles."""

    def __new__(cls, /, inputs: Inputs, level: str | None = None) -> PedalDriving:
        """Keep the parameters of the vehicles and of the road under them.

        Args:
            inputs: Inputs of one simulation; `steps_per_frame` is ignored.
            level: SIMD level; None for the best of this CPU.

        Raises:
            ValueError: `inputs` has no simulation or several, or the SIMD level is unknown or not
                available.
        """

    def drive(
        self,
        /,
        table: NDArray[np.float32],
        controls: NDArray[np.float32],
        wheel_rate: float,
        num_steps: int,
    ) -> None:
        """Move the vehicles of a table by some steps.

        Args:
            table: Shape (field, vehicle), fields as `FIELD_NAMES["pedal_table"]`.
            controls: Throttle and brake, 0 to 1, and requested angle of the front wheels [rad],
                (3, vehicle).
            wheel_rate: Rate at which the front wheels turn [rad/s].
            num_steps: Number of steps, each as long as the constant `step`.

        Raises:
            ValueError: An array has another length.
        """

    def resolve_contacts(
        self,
        /,
        bodies: NDArray[np.float32],
        old_positions: NDArray[np.float32],
        pairs: NDArray[np.uint32],
    ) -> NDArray[np.int32]:
        """Exchange momentum between the bodies of each pair that touched during the last step.

        Args:
            bodies: Shape (field, body), fields as `FIELD_NAMES["bodies"]`. Motion after the step,
                which lasts the constant `step`; changed in place.
            old_positions: `s` and `d` before the step [m], (2, body).
            pairs: Two bodies each, (pair, 2), in the order of resolution.

        Returns:
            First other body that each body touched, -1 without a contact.

        Raises:
            ValueError: An array has another length, or a pair names a body that does not exist.
        """

    def update_weather(self, /, table: NDArray[np.float32], decision_index: int) -> None:
        """Write gusts, friction and wind of a decision into a table of vehicles.

        Args:
            table: Shape (field, vehicle), fields as `FIELD_NAMES["pedal_table"]`.
            decision_index: Index of the decision, 20 a second, which the random numbers depend on.

        Raises:
            ValueError: An array has another length.
        """

@final
class Stepper:
    """A batch that waits at every decision for the actions of an external driver.

    Calls change the batch, so Python raises `RuntimeError` if two threads call it at the same time.
    """

    def __new__(
        cls,
        /,
        inputs: Inputs,
        action_kind: str | None,
        observes_truth: bool,
        level: str | None = None,
    ) -> Stepper:
        """Begin all simulations of a batch, which wait before their first decision.

        Args:
            inputs: Inputs of the batch, with at least one simulation.
            action_kind: Kind of the actions; None if the simulator's own driver drives the ego and
                `step` ignores the actions.
            observes_truth: Whether the driver observes the true state, and not its beliefs about
                it, which are late and have errors.
            level: SIMD level; None for the best of this CPU.

        Raises:
            ValueError: There is no simulation, or the kind or SIMD level is unknown.
        """

    def observe_start(self, /) -> tuple[NDArray[np.float32], NDArray[np.bool_], NDArray[np.uint32]]:
        """Observations at the start, in the format of `step`, with 0 decisions carried out."""

    def restart(
        self, /, rows: NDArray[np.int64], inputs: Inputs
    ) -> tuple[NDArray[np.float32], NDArray[np.bool_], NDArray[np.uint32]]:
        """Begin new simulations in rows of the batch, and observe their start.

        Args:
            rows: The rows, each once.
            inputs: Inputs of the new simulations, one for each row, with the slots of the batch.
                Their seed, road and constants are ignored: the batch keeps its own.

        Raises:
            ValueError: A row occurs twice or does not exist, or `inputs` has another number of
                simulations or slots.
        """

    def step(
        self, /, values: NDArray[np.int32], decisions: int
    ) -> tuple[NDArray[np.float32], NDArray[np.bool_], NDArray[np.uint32]]:
        """Carry out one action of each simulation for some decisions.

        Args:
            values: Each part of the actions as a multiple of its `ActionPart.resolution`
                (`model.driver_interface`), shape (simulation, part).
            decisions: Number of decisions, at least 1.

        Returns:
            Observations after the decisions, or at the end of a simulation that ended earlier,
            (simulation, field); whether each simulation runs; the number of decisions that each
            has carried out.

        Raises:
            ValueError: The actions have another length.
        """

def default_simd_level() -> str:
    """The SIMD level of calls that name no level."""

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
        recording: As `labels.signals.pack_recording` makes it: s, d, speed, heading, accel, lane
            and is_recorded (or None), shape (simulation, vehicle, time), and collided_with, shape
            (simulation, time), the frames adjacent; num_frames, valid, length and width, flat; and
            the numbers num_lanes, overtaking_sign, direction, interval_ms, half_window.
        visibility: As `labels.signals.visibility_inputs` makes it.
        thresholds: As `labels.event_detection.event_thresholds` makes them.
        constants: As in `Inputs`.
        signals: Arrays of shape (simulation, time) or (simulation, 6, time) by name; filled. The 6
            are the `NeighbourRole`s.
        zero_from: Frame from which on each row of these arrays holds zeros, shape (simulation,);
            only earlier frames are cleared. Updated.
        events: A row for each of `FIELD_NAMES["events"]`; filled.
        level: SIMD level; None for the best of this CPU.

    Raises:
        ValueError: An array has another shape, or the SIMD level is unknown or not available.
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
        slot: Slot of each neighbour, 255 without one; filled.
        out: A row for each of `FIELD_NAMES["encounters"]`; filled.
        level: As in `ego_signals_and_events`.

    Raises:
        ValueError: As in `ego_signals_and_events`, or an instant or a slot does not exist.
    """

def exp_in_place(values: NDArray[np.floating[Any]], *, level: str | None = None) -> None:
    """Replace each number of a flat float32 array by `core.float32_math.exp` of it.

    Raises:
        ValueError: The SIMD level is unknown or not available.
    """

def flag_bits(
    *, values: NDArray[np.uint8], span: NDArray[np.int32], out: NDArray[np.uint8]
) -> None:
    """Find the bits that are set in any frame of a span of each simulation, and in all of them.

    Args:
        values: Shape (simulation, time), the frames adjacent.
        span: As in `limit_margins`.
        out: The bits of any frame, then the bits of all frames, shape (2, simulation); filled. A
            span without frames gives 0 and 255.

    Raises:
        ValueError: An array has another shape.
    """

def frames_alongside(
    *,
    recording: Mapping[str, Any],
    signals: Mapping[str, NDArray[Any]],
    target_slot: NDArray[np.uint8],
    span: NDArray[np.int32],
    level: str | None = None,
) -> tuple[
    NDArray[np.intp], NDArray[np.intp], NDArray[np.uint8], NDArray[np.float32], NDArray[np.float32]
]:
    """The frames within a span in which ego and target overlap along the road, in order.

    Args:
        recording: As in `ego_signals_and_events`.
        signals: As in `target_signals`.
        target_slot: As in `target_signals`.
        span: First and last frame of the span, flat (end, simulation).
        level: As in `ego_signals_and_events`.

    Returns:
        Five arrays with an entry for each such frame: simulation, frame, lane of the target, gap
        between the sides of both [m], and acceleration of the target [m/s^2].

    Raises:
        ValueError: As in `target_signals`.
    """

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

def log_in_place(values: NDArray[np.floating[Any]], *, level: str | None = None) -> None:
    """Replace each number of a flat float32 array by `core.float32_math.log` of it.

    Raises:
        ValueError: The SIMD level is unknown or not available.
    """

def maximum_in_place(values: NDArray[np.floating[Any]], others: Any) -> None:
    """Replace each number by the larger of itself and another one, as `core.float32_math.maximum`.

    Args:
        values: Flat float32 array.
        others: A float32 array of the same length, or one number.

    Raises:
        ValueError: The arrays differ in length.
    """

def minimum_in_place(values: NDArray[np.floating[Any]], others: Any) -> None:
    """Replace each number by the smaller of itself and another one, as `core.float32_math.minimum`.

    Arguments and errors as in `maximum_in_place`.
    """

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

def normal_pairs_in_place(
    u: NDArray[np.floating[Any]], v: NDArray[np.floating[Any]], *, level: str | None = None
) -> None:
    """Replace two flat float32 arrays of uniform numbers by `core.random_numbers.box_muller`.

    Raises:
        ValueError: The arrays differ in length, or the SIMD level is unknown or not available.
    """

def num_threads() -> int:
    """Number of threads that simulate."""

def random_words(
    *,
    seed: int,
    index: NDArray[np.uint64],
    stream: NDArray[np.uint32],
    draw: int,
    level: str | None = None,
) -> list[NDArray[np.uint32]]:
    """Draw four random words for each simulation and stream, as `core.random_numbers.philox_words`.

    Args:
        seed: Seed of the data set.
        index: Scenario index of each simulation.
        stream: Purpose of the draws for each simulation: the number of a
            `core.random_numbers.Stream`, plus the vehicle's slot or role if the purpose concerns a
            single vehicle.
        draw: Number of the block of four words within the stream, from 0.
        level: SIMD level, None for the fastest of this CPU; the results are the same.

    Raises:
        SystemLimitError: The system grants too little memory.
        ValueError: The arrays differ in length, or the SIMD level is unknown or not available.
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
        spans: First and last frame, flat (span, end, simulation); cut to the recorded frames.
        moments: The frames in which the line is crossed and the return ends (-1: no event), the
            slot of the target (255: no vehicle) and its original lane, flat (moment, simulation).
        law: Numbers of the law, as `labels.law.margins` makes them.
        outputs: measures, frames and sums, each with a row for each of its names; filled.
        level: As in `ego_signals_and_events`.

    Raises:
        ValueError: As in `ego_signals_and_events`, or a frame or a slot of `moments` does not
            exist.
    """

def simd_levels() -> list[tuple[str, bool]]:
    """Every SIMD level, and whether it is compiled and this CPU can run it."""

def simulate(
    inputs: Inputs,
    *,
    frames: int,
    outputs: dict[str, NDArray[Any]],
    switches: Sequence[
        tuple[
            NDArray[np.floating[Any]],
            NDArray[np.floating[Any]],
            NDArray[np.uint64],
            NDArray[np.floating[Any]] | None,
            int,
        ]
    ] = ...,
    action_log: tuple[str, NDArray[np.int32]] | None = None,
    level: str | None = None,
) -> None:
    """Simulate a batch and fill the flat arrays of `outputs`.

    Args:
        inputs: Inputs of the batch.
        frames: Frames that the outputs have room for, a multiple of `SIMD_LANES`: the recorder
            writes `SIMD_LANES` frames at once.
        outputs: Flat arrays by name.
        switches: For each step at which parameters change: vehicle and simulation parameters,
            indices of the scenarios, errors of the egos in judging distance and speed
            (2, simulation) or None, and the step.
        action_log: Kind and numbers of the actions of an external driver of the ego, (simulation,
            decision, part).
        level: SIMD level; None for the best of this CPU.

    Raises:
        ValueError: An array has another length, or the SIMD level is unknown or not available.
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
        signals: Signals of the ego, as `labels.signals.pack_signals` makes them.
        target_slot: Slot of the overtaken vehicle, 255 without one, shape (simulation,).
        outputs: Arrays of shape (simulation, time) by name; filled.
        level: As in `ego_signals_and_events`.

    Raises:
        ValueError: As in `ego_signals_and_events`, or a slot does not exist.
    """

def uniform_numbers(words: NDArray[np.uint32]) -> NDArray[np.float32]:
    """Convert random words to uniform numbers, as `core.random_numbers.uniform_from_word`."""
