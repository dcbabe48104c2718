//! The inputs and outputs of the signals: recorded states, weather, and the arrays that are filled.
//!
//! Signals are time series of the ego, the vehicle under study, in slot 0. A frame is a recorded instant; a slot is the
//! number of a vehicle in its simulation. In signals, left is the overtaking side, also in left-hand traffic.

use std::ops::Range;

use overtaking_core::ModelConstants;

use crate::vectors::SIMD_LANES;

/// Slot of a neighbour or target that does not exist.
pub const NO_VEHICLE: u8 = 255;
/// Lane of a vehicle beyond the kerb-side edge of the road: -1 as a `u8`.
pub(crate) const BEYOND_KERB_EDGE: u8 = 255;
/// Frame of an event that did not happen.
pub(crate) const NEVER: i32 = -1;
/// Metres in a recorded unit of length, and likewise of speed and acceleration.
pub(crate) const METRES_PER_MM: f32 = 1e-3;
/// Most driving lanes of a road.
pub const MAX_LANES: usize = 8;

/// Number of neighbours of the ego, one for each of `overtaking_core::neighbour_role`.
pub const NUM_ROLES: usize = 6;

/// Whether a role is ahead of the ego: leaders have even numbers.
#[inline(always)]
pub(crate) fn is_ahead(role: usize) -> bool {
    role.is_multiple_of(2)
}

/// A batch of recordings. Rows hold the frames of one vehicle and are ordered by simulation, then by slot.
pub struct PackedRecording<'a> {
    /// Number of recorded frames of each simulation.
    pub num_frames: &'a [i32],
    /// Vehicle slots of a simulation.
    pub num_slots: usize,
    /// Frames for which each row has memory.
    pub max_frames: usize,
    /// Position of the centre along the road, in the ego's direction [mm].
    pub s: Vec<&'a [i32]>,
    /// Lateral position, positive to the geometric left [mm].
    pub d: Vec<&'a [i32]>,
    /// Speed [mm/s].
    pub speed: Vec<&'a [i32]>,
    /// World heading [0.1 mrad].
    pub heading: Vec<&'a [i16]>,
    /// Longitudinal acceleration [mm/s^2].
    pub accel: Vec<&'a [i16]>,
    /// Lane index, from 0 at the kerb side; `num_lanes` beyond the overtaking-side edge of the road, `BEYOND_KERB_EDGE`
    /// beyond the kerb-side edge.
    pub lane: Vec<&'a [u8]>,
    /// Slot with which the ego has collided so far, one row for each simulation.
    pub collided_with: Vec<&'a [u8]>,
    /// Whether a vehicle has a state in a frame; `None` if every vehicle has one in every frame. Oncoming vehicles
    /// count as without a state, because leaders, followers and targets drive in the direction of the ego.
    pub is_recorded: Option<Vec<&'a [bool]>>,
    /// Whether a slot holds a vehicle, (simulation, slot).
    pub valid: &'a [bool],
    /// Length, (simulation, slot) [m].
    pub length: &'a [f32],
    /// Width, (simulation, slot) [m].
    pub width: &'a [f32],
    /// Number of driving lanes, with the opposing lane on a two-way road.
    pub num_lanes: usize,
    /// 1 if the overtaking side is the left one, -1 if it is the right one.
    pub overtaking_sign: f32,
    /// Direction of the road, subtracted from headings; 0 if they already are angles to a road that bends [rad].
    pub direction: f32,
    /// Time between frames [ms].
    pub interval_ms: i32,
    /// Number of frames on either side of a frame over which its lateral speed is a central difference: about 0.1 s.
    pub half_window: usize,
}

impl PackedRecording<'_> {
    /// Number of recorded frames of a simulation.
    pub(crate) fn num_recorded(&self, simulation: usize) -> usize {
        (self.num_frames[simulation].max(0) as usize).min(self.max_frames)
    }

    /// Number of frames to compute: the recorded ones, rounded up to whole blocks of sixteen where rows have memory for
    /// them.
    pub(crate) fn num_computed(&self, simulation: usize) -> usize {
        let recorded = self.num_recorded(simulation);
        recorded.next_multiple_of(SIMD_LANES).min(self.max_frames)
    }

    /// Rows of the vehicles of a simulation.
    pub(crate) fn rows_of(&self, simulation: usize) -> Range<usize> {
        simulation * self.num_slots..(simulation + 1) * self.num_slots
    }

    /// Row of a vehicle.
    pub(crate) fn row(&self, simulation: usize, slot: usize) -> usize {
        simulation * self.num_slots + slot
    }

    /// Whether the vehicle of a row has a state in a frame.
    pub(crate) fn has_state(&self, row: usize, frame: usize) -> bool {
        self.is_recorded
            .as_ref()
            .is_none_or(|rows| rows[row][frame])
    }
}

/// Call a macro with the signals from which events and margins are computed: name, type and number of rows for each
/// simulation.
#[macro_export]
macro_rules! with_signal_views {
    ($then:ident!) => {
        $then! {
            lane: u8, 1;
            lateral_position: f32, 1;
            lateral_speed: f32, 1;
            speed: f32, 1;
            right_edge: f32, 1;
            left_edge: f32, 1;
            neighbour_slot: u8, $crate::NUM_ROLES;
            friction: f32, 1;
            sight_lit: f32, 1;
            sight_unlit: f32, 1;
        }
    };
}

macro_rules! declare_signal_views {
    ($($field:ident: $kind:ty, $rows:expr;)*) => {
        /// The signals that events and scans read, of a batch or of one simulation.
        ///
        /// Arrays have shape (simulation, frame), `neighbour_slot` has shape (simulation, role, frame).
        /// `overtaking.model.ego_signals.EgoSignals` defines each of them.
        #[derive(Clone, Copy)]
        #[allow(missing_docs)]
        pub struct SignalViews<'a> {
            $(pub $field: &'a [$kind],)*
        }

        impl SignalViews<'_> {
            /// The signals of one simulation of a batch.
            pub(crate) fn of_simulation(&self, simulation: usize, max_frames: usize) -> Self {
                let (begin, end) = (simulation * max_frames, (simulation + 1) * max_frames);
                Self { $($field: &self.$field[begin * $rows..end * $rows],)* }
            }
        }

        impl EgoSignals<'_> {
            /// The same arrays for reading, without the acceleration, which no scan reads.
            #[must_use]
            pub fn views(&self) -> SignalViews<'_> {
                SignalViews { $($field: self.$field,)* }
            }
        }
    };
}
with_signal_views! { declare_signal_views! }

impl<'a> SignalViews<'a> {
    /// Slots of a neighbour, frame by frame, in the signals of one simulation.
    pub(crate) fn neighbour(&self, role: usize) -> &'a [u8] {
        let frames = self.lane.len();
        &self.neighbour_slot[role * frames..(role + 1) * frames]
    }
}

/// Call a macro with the arrays of `VisibilityInputs`: meaning, name, and how many numbers a simulation has.
#[macro_export]
macro_rules! with_visibility_arrays {
    ($then:ident!) => {
        $then! {
            /// Mean water film of each lane, (simulation, `MAX_LANES`) [mm].
            film, $crate::MAX_LANES;
            /// Tread wear of the ego's tyres, 0 to 1.
            tyre_wear, 1;
            /// 1 for truck tyres, else 0.
            has_truck_tyres, 1;
            /// Extinction by fog [1/m].
            fog, 1;
            /// Extinction by rain for an observer at rest [1/m].
            rain, 1;
            /// Optical depth at which an unlit vehicle loses its contrast, never negative.
            contrast_depth, 1;
            /// Logarithm of the intensity of a rear lamp over the threshold of the eye.
            lamp_depth, 1;
            /// Distance at which that lamp reaches the threshold in clear air [m].
            lamp_clear, 1;
            /// Largest sight distance to an unlit vehicle: `attention_range`, by night at most the range of the ego's
            /// headlamps [m].
            unlit_limit, 1;
        }
    };
}

macro_rules! declare_visibility_inputs {
    ($($(#[$doc:meta])* $field:ident, $count:expr;)*) => {
        /// Road surface and visibility of each simulation, as `overtaking.labels.signals` computes them.
        pub struct VisibilityInputs<'a> {
            $($(#[$doc])* pub $field: &'a [f32],)*
            /// Farthest distance that drivers pay attention to [m].
            pub attention_range: f32,
            /// Constants of the model.
            pub constants: &'a ModelConstants,
        }
    };
}
with_visibility_arrays! { declare_visibility_inputs! }

/// Declare a struct of output slices, one for each signal, that can be cut into simulations.
///
/// Each line has the name of a signal, its type and the number of rows that a simulation has in its slice. The macro
/// also declares the macro `$export`, which hands these lines to another macro. `$d` is the dollar sign, which a macro
/// that declares a macro cannot write itself.
macro_rules! signal_outputs {
    (
        ($d:tt) $export:ident
        $(#[$about:meta])* $name:ident: $($(#[$doc:meta])* $field:ident: $kind:ty, $rows:expr;)*
    ) => {
        /// Hand the slices of the struct to a macro: name, type and number of rows for each simulation.
        #[macro_export]
        macro_rules! $export {
            ($d then:ident! { $d($d arguments:tt)* }) => {
                $d then! { { $d($d arguments)* } $($field: $kind, $rows;)* }
            };
        }

        $(#[$about])*
        pub struct $name<'a> {
            $($(#[$doc])* pub $field: &'a mut [$kind],)*
        }

        impl $name<'_> {
            /// Set some frames of every row of one simulation to zero.
            fn clear(&mut self, frames: std::ops::Range<usize>, max_frames: usize) {
                $(for row in self.$field.chunks_mut(max_frames.max(1)) {
                    row[frames.clone()].fill(Default::default());
                })*
            }

            /// Call `compute(simulation, num_computed, outputs)` for each simulation, on all threads.
            ///
            /// `compute` fills the first `num_computed` frames; the frames after them are set to zero. `zero_from`
            /// holds the frame from which on the rows of each simulation are zero; the call reads and updates it. Most
            /// simulations end early, so clearing only what an earlier batch wrote saves most of the writes.
            pub(crate) fn fill(
                &mut self,
                recording: &PackedRecording<'_>,
                zero_from: &mut [i32],
                compute: impl Fn(usize, usize, &mut $name<'_>) + Sync,
            ) {
                use rayon::prelude::*;
                self.split(recording.num_frames.len(), recording.max_frames)
                    .into_par_iter()
                    .zip(zero_from)
                    .enumerate()
                    .for_each(|(simulation, (mut outputs, zero_from))| {
                        let num_computed = recording.num_computed(simulation);
                        let written = (*zero_from).clamp(num_computed as i32, recording.max_frames as i32);
                        outputs.clear(num_computed..written as usize, recording.max_frames);
                        *zero_from = num_computed as i32;
                        compute(simulation, num_computed, &mut outputs);
                    });
            }

            /// The outputs of each simulation.
            fn split(&mut self, num_simulations: usize, max_frames: usize) -> Vec<$name<'_>> {
                $(let mut $field = self.$field.chunks_mut(($rows * max_frames).max(1));)*
                let next = |_| Some($name { $($field: $field.next()?,)* });
                (0..num_simulations).map(next).collect::<Option<Vec<_>>>().unwrap_or_default()
            }
        }
    };
}

signal_outputs! {
    ($) with_ego_signals
    /// Arrays for the signals of the ego: one row, or `NUM_ROLES` rows, for each simulation.
    EgoSignals:
    /// Lane index.
    lane: u8, 1;
    /// Lateral position of the centre, positive to the left, the overtaking side [m].
    lateral_position: f32, 1;
    /// Lateral speed, positive to the left [m/s].
    lateral_speed: f32, 1;
    /// Speed [m/s].
    speed: f32, 1;
    /// Acceleration [m/s^2].
    accel: f32, 1;
    /// Lateral position of the right-most corner [m].
    right_edge: f32, 1;
    /// Lateral position of the left-most corner [m].
    left_edge: f32, 1;
    /// Slot of the nearest vehicle in each role, `NO_VEHICLE` without one.
    neighbour_slot: u8, NUM_ROLES;
    /// Peak friction of the ego's tyres.
    friction: f32, 1;
    /// Sight distance to a lit vehicle [m].
    sight_lit: f32, 1;
    /// Sight distance to an unlit vehicle [m].
    sight_unlit: f32, 1;
}
pub(crate) use signal_outputs;

/// Gap between the bumpers of two vehicles, from their positions along the road [m].
pub(crate) fn gap_between(s: i32, other_s: i32, half_length_sum: f32) -> f32 {
    s.wrapping_sub(other_s).wrapping_abs() as f32 * METRES_PER_MM - half_length_sum
}

/// The frames of a span that exist.
///
/// `ends` holds the first frames of all simulations, then their last frames; both belong to the span. A span is empty
/// if its last frame is before its first one.
pub(crate) fn span_frames(
    ends: &[i32],
    simulation: usize,
    num_simulations: usize,
    num_frames: usize,
) -> Range<usize> {
    let (first, last) = (ends[simulation], ends[num_simulations + simulation]);
    let end = (last.max(-1).saturating_add(1) as usize).min(num_frames);
    (first.max(0) as usize).min(end)..end
}
