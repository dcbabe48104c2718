//! Signals, events and margins of recorded traffic: the numbers on which rules of traffic law decide.
//!
//! The modules `readable_signals`, `readable_events` and `readable_scans` of `tests/reference/labels` compute the same
//! numbers in Python, one frame after the other. Both give the same bits: the same operations on `f32` in the same
//! order.
//!
//! Here sixteen consecutive frames of one simulation lie side by side in the lanes of a SIMD register. The engine in
//! `overtaking-core` puts sixteen simulations there instead.
//!
//! | step | modules |
//! |---|---|
//! | a recording as slices | [`PackedRecording`], `frame_block` |
//! | signals of each frame | `ego_signals`, `neighbour_signals` |
//! | access to the states and signals of one simulation | `track` |
//! | movements across the road, and the events that they make | `lateral_movements`, `events` |
//! | margins and measures over spans of frames | `span_scans`, `gap_duties`, `safety_measures`, `limit_margins` |

mod ego_signals;
mod events;
mod frame_block;
mod gap_duties;
mod lateral_movements;
mod limit_margins;
mod neighbour_signals;
mod recording;
mod safety_measures;
mod span_scans;
mod track;

pub use ego_signals::ego_signals;
pub use events::{EVENT_NAMES, events};
pub use lateral_movements::EventThresholds;
pub use limit_margins::{LimitQuery, flag_bits, limit_margins};
pub use neighbour_signals::{
    FramesAlongside, NeighbourSignals, TargetSignals, frames_alongside, neighbour_signals,
    target_signals,
};
pub use recording::{
    EgoSignals, MAX_LANES, NO_VEHICLE, NUM_ROLES, PackedRecording, SignalViews, VisibilityInputs,
};
pub use safety_measures::{
    ENCOUNTER_NAMES, EncounterPair, LawNumbers, VehicleInstant, encounter_measures,
};
pub use span_scans::{
    FRAME_NAMES, MOMENT_NAMES, SPAN_NAMES, SUM_NAMES, SpanOutputs, SpanQuery, measure_names,
    scan_spans,
};

/// The engine's vectors; each lane holds one frame here.
mod vectors {
    pub use overtaking_core::math::vectors::{
        F32, Mask, SIMD_LANES, assign_where, at_least, at_most, max, min, select, splat,
    };
}
