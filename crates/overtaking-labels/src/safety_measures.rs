//! Surrogate measures of safety between the ego and its neighbours: TTC, MTTC, DRAC, PICUD, RSS and the lawful gap.
//!
//! `overtaking.world.surrogate_safety` has the same formulas and names their sources. The operations here have the same
//! order as in Python, so that both give the same bits. Differences of recorded integers wrap around, as NumPy's do.
//!
//! A block is sixteen frames (recorded instants) of one simulation in the lanes of a SIMD vector. A slot is the number
//! of a vehicle in its simulation; the ego has slot 0.

use std::ops::Range;

use fearless_simd::prelude::*;
use fearless_simd::{Level, Simd};
use overtaking_core::dispatch;
use overtaking_core::neighbour_role::{FOLLOWER, LEADER};

use crate::frame_block::{SpanBlock, max_of_lanes, min_of_lanes};
use crate::recording::{METRES_PER_MM, gap_between};
use crate::span_scans::TrackScan;
use crate::track::SlotsPerFrame;
use crate::vectors::{
    F32, Mask, SIMD_LANES, assign_where, at_least, at_most, max, min, select, splat,
};

/// Divisors up to this count as 0, such as speeds [m/s]. Quotients then stay far below 3e38, where `f32` ends. Chosen:
/// far below any speed that matters.
const MIN_DIVISOR: f32 = 1e-20;

/// Hand the fields of `LawNumbers` to a macro: meaning, name and type. The binding to Python reads the same fields.
#[macro_export]
macro_rules! with_law_numbers {
    ($then:ident!) => {
        $then! {
            /// Smallest friction that is thought possible.
            friction_floor: f32,
            /// Deceleration per unit of friction: usable share of friction times gravity [m/s^2].
            decel_per_friction: f32,
            /// Largest deceleration of both vehicles in the lawful gap [m/s^2].
            decel_limit: f32,
            /// Time before the following vehicle brakes [s].
            reaction_time: f32,
            /// Time before the ego brakes for an obstacle in sight [s].
            stop_reaction_time: f32,
            /// Frames after a cut-in ahead of the ego within which it may restore its gap.
            regain_frames: usize,
            /// Time gap of the target behind the ego at which any vehicle has space to return [s].
            time_gap: f32,
            /// Time within which the ego must not reach the leader in the lane of its return [s].
            free_time: f32,
            /// Distance up to which gaps for a return are considered [m].
            return_range: f32,
            /// Frames after a lane change in which forced braking counts.
            obstruction_frames: usize,
            /// Braking that a lane change may force on others [m/s^2].
            allowed_braking: f32,
            /// Cap of braking demands, which grow without limit as a gap closes [m/s^2].
            max_braking: f32,
            /// PICUD: time before the following vehicle brakes [s].
            picud_reaction_time: f32,
            /// PICUD: deceleration of both vehicles [m/s^2].
            picud_decel: f32,
            /// RSS: reaction time [s].
            rss_reaction_time: f32,
            /// RSS: acceleration during the reaction time [m/s^2].
            rss_accel: f32,
            /// RSS: deceleration of the following vehicle [m/s^2].
            rss_rear_decel: f32,
            /// RSS: deceleration of the leader [m/s^2].
            rss_leader_decel: f32,
            /// TTC below which an encounter is critical [s].
            critical_ttc: f32,
        }
    };
}

macro_rules! declare_law_numbers {
    ($($(#[$doc:meta])* $field:ident: $kind:ty,)*) => {
        /// Numbers of traffic law and of the measures.
        #[derive(Clone, Copy)]
        pub struct LawNumbers {
            $($(#[$doc])* pub $field: $kind,)*
        }
    };
}
with_law_numbers! { declare_law_numbers! }

impl LawNumbers {
    /// Deceleration that the law assumes of both vehicles [m/s^2].
    #[inline(always)]
    pub(crate) fn assumed_decel<S: Simd>(&self, friction: F32<S>) -> F32<S> {
        at_most(
            self.decel_per_friction * at_least(friction, self.friction_floor),
            self.decel_limit,
        )
    }

    /// Gap that the law asks of the following vehicle [m].
    #[inline(always)]
    pub(crate) fn lawful_gap<S: Simd>(
        &self,
        rear_speed: F32<S>,
        closing_speed: F32<S>,
        decel: F32<S>,
    ) -> F32<S> {
        let leader_speed = rear_speed - closing_speed;
        let twice_decel = 2.0 * decel;
        let rear_stop = rear_speed * (self.reaction_time + rear_speed / twice_decel);
        // PICUD with a gap of 0 and the reversed sign; `picud` has the same order of operations.
        let remaining = 0.0 - rear_stop + leader_speed * leader_speed / twice_decel;
        at_least(-remaining, 0.0)
    }

    /// PICUD: gap that remains when both vehicles have stopped after sudden braking [m].
    #[inline(always)]
    fn picud<S: Simd>(&self, gap: F32<S>, speed: F32<S>, leader_speed: F32<S>) -> F32<S> {
        let twice_decel = 2.0 * self.picud_decel;
        let rear_stop = speed * (self.picud_reaction_time + speed / twice_decel);
        gap - rear_stop + leader_speed * leader_speed / twice_decel
    }

    /// Safe gap of responsibility-sensitive safety (RSS) [m].
    #[inline(always)]
    fn rss_gap<S: Simd>(&self, speed: F32<S>, leader_speed: F32<S>) -> F32<S> {
        let speed_after_reaction = speed + self.rss_reaction_time * self.rss_accel;
        let mean_speed_gain = 0.5 * self.rss_accel * self.rss_reaction_time;
        let reaction = (speed + mean_speed_gain) * self.rss_reaction_time;
        let stop = speed_after_reaction * speed_after_reaction / (2.0 * self.rss_rear_decel);
        let leader_stop = leader_speed * leader_speed / (2.0 * self.rss_leader_decel);
        at_least(reaction + stop - leader_stop, 0.0)
    }

    /// Whether a TTC counts as exposure. A TTC of 0 does not: the collision has happened.
    #[inline(always)]
    fn is_critical<S: Simd>(&self, ttc: F32<S>) -> Mask<S> {
        ttc.simd_gt(0.0) & ttc.simd_le(self.critical_ttc)
    }
}

/// Time to cover a gap at a speed [s]: infinite unless the speed is positive, 0 without a gap. At the closing speed it
/// is the TTC.
#[inline(always)]
fn time_gap<S: Simd>(gap: F32<S>, speed: F32<S>) -> F32<S> {
    let is_moving = speed.simd_gt(MIN_DIVISOR);
    let time = at_least(gap, 0.0) / select(is_moving, speed, splat(gap.simd, 1.0));
    select(
        is_moving | gap.simd_le(0.0),
        time,
        splat(gap.simd, f32::INFINITY),
    )
}

/// MTTC: time to collision at constant accelerations, infinite without one [s].
#[inline(always)]
fn mttc<S: Simd>(gap: F32<S>, closing_speed: F32<S>, closing_accel: F32<S>) -> F32<S> {
    let simd = gap.simd;
    let distance = at_least(gap, 0.0);
    let discriminant = closing_speed * closing_speed + 2.0 * closing_accel * distance;
    let root = at_least(discriminant, 0.0).sqrt();
    // The earlier root of accel t^2 / 2 + speed t = distance is 2 distance / (speed + root) = (root - speed) / accel. The
    // first form subtracts numbers if the speed is negative, the second if it is positive: differences of nearly equal
    // numbers would be inexact.
    let is_opening = closing_speed.simd_lt(0.0);
    let denominator = select(is_opening, closing_accel, closing_speed + root);
    let numerator = select(is_opening, root - closing_speed, 2.0 * distance);
    let collides = discriminant.simd_ge(0.0) & denominator.simd_gt(MIN_DIVISOR);
    let time = numerator / select(collides, denominator, splat(simd, 1.0));
    let time = select(collides, time, splat(simd, f32::INFINITY));
    select(gap.simd_le(0.0), splat(simd, 0.0), time)
}

/// DRAC: deceleration that just avoids a collision with a leader of constant speed [m/s^2].
#[inline(always)]
pub(crate) fn drac<S: Simd>(gap: F32<S>, closing_speed: F32<S>) -> F32<S> {
    let approach = at_least(closing_speed, 0.0);
    let has_gap = gap.simd_gt(0.0);
    let decel = approach * approach / (2.0 * select(has_gap, gap, splat(gap.simd, 1.0)));
    select(
        has_gap | approach.simd_eq(0.0),
        decel,
        splat(gap.simd, f32::INFINITY),
    )
}

/// Names of the worst measures of a simulation, in the order of the rows of the result.
///
/// `valid` is 1 if any frame has the vehicle. `FollowingMargins` defines the measures without a vehicle in their name.
pub(crate) const WORST_MEASURES: [&str; 21] = [
    "leader.valid",
    "leader.gap",
    "leader.time_gap",
    "leader.ttc",
    "leader.mttc",
    "leader.closing_speed",
    "leader.drac",
    "follower.valid",
    "follower.gap",
    "follower.time_gap",
    "follower.ttc",
    "follower.mttc",
    "follower.closing_speed",
    "follower.drac",
    "time_headway",
    "picud",
    "rss_margin",
    "lawful_margin",
    "num_close",
    "num_critical",
    "shortfall",
];

impl TrackScan<'_> {
    /// The worst value of each measure over a span, 0 without a vehicle; margins and counts concern the leader.
    pub(crate) fn worst_measures<S: Simd>(
        &self,
        simd: S,
        span: Range<usize>,
    ) -> [f32; WORST_MEASURES.len()] {
        let mut with_follower = WorstMeasures::new(simd);
        let mut with_leader = WorstMeasures::new(simd);
        let mut margins = FollowingMargins::new(simd);
        simd.vectorize(
            #[inline(always)]
            || {
                for first_frame in span.clone().step_by(SIMD_LANES) {
                    let block = SpanBlock::new(simd, first_frame, span.end);
                    if let Some(encounter) = self.encounter(block, LEADER) {
                        let ttc = with_leader.take(&encounter);
                        margins.take(self, block, &encounter, ttc);
                    }
                    if let Some(encounter) = self.encounter(block, FOLLOWER) {
                        with_follower.take(&encounter);
                    }
                }
            },
        );
        let counts = [
            margins.num_close as f32,
            margins.num_critical as f32,
            margins.shortfall as f32,
        ];
        let smallest_margins = margins
            .smallest
            .map(|values| with_leader.value_or_zero(min_of_lanes(values)));
        // In the order of `WORST_MEASURES`.
        let values = with_leader
            .result()
            .into_iter()
            .chain(with_follower.result())
            .chain(smallest_margins)
            .chain(counts);
        let mut worst = [0.0; WORST_MEASURES.len()];
        for (measure, value) in worst.iter_mut().zip(values) {
            *measure = value;
        }
        worst
    }

    /// The ego and the neighbour in `role`, `LEADER` or `FOLLOWER`; `None` if no frame of the block has one.
    #[inline(always)]
    fn encounter<S: Simd>(&self, block: SpanBlock<S>, role: usize) -> Option<Encounter<S>> {
        let track = &self.track;
        let neighbour = track.neighbour(block, role)?;
        let ego_speed = block.load(track.signals.speed);
        let ego_accel: F32<S> = block.load_ints(track.accel[0]).to_float();
        let accel: F32<S> = neighbour.slots.gather(block, track.accel).to_float();
        let (ego_accel, accel) = (ego_accel * METRES_PER_MM, accel * METRES_PER_MM);
        // The speed of a follower is the ego's plus the closing speed.
        let (rear_speed, closing_accel) = if role == LEADER {
            (ego_speed, ego_accel - accel)
        } else {
            (ego_speed + neighbour.closing_speed, accel - ego_accel)
        };
        Some(Encounter {
            exists: neighbour.exists,
            slots: neighbour.slots,
            gap: neighbour.gap,
            closing_speed: neighbour.closing_speed,
            rear_speed,
            closing_accel,
        })
    }
}

/// The ego and a neighbour in a block of frames, as a vehicle that follows another.
struct Encounter<S: Simd> {
    /// Whether a frame has the neighbour.
    exists: Mask<S>,
    /// Slots of the neighbour.
    slots: SlotsPerFrame,
    /// Gap between the bumpers [m].
    gap: F32<S>,
    /// Speed at which the gap shrinks [m/s].
    closing_speed: F32<S>,
    /// Speed of the following vehicle [m/s].
    rear_speed: F32<S>,
    /// Acceleration of the following vehicle minus the other vehicle's [m/s^2].
    closing_accel: F32<S>,
}

/// The worst values of an encounter so far.
struct WorstMeasures<S: Simd> {
    /// Smallest gap, time gap, TTC and MTTC.
    smallest: [F32<S>; 4],
    /// Largest closing speed and DRAC.
    largest: [F32<S>; 2],
    /// Whether any block so far has had the neighbour.
    exists: bool,
}

impl<S: Simd> WorstMeasures<S> {
    /// Before the first frame.
    fn new(simd: S) -> Self {
        Self {
            smallest: [splat(simd, f32::INFINITY); 4],
            largest: [splat(simd, f32::NEG_INFINITY); 2],
            exists: false,
        }
    }

    /// Take a block of frames; returns the TTC in each of them.
    #[inline(always)]
    fn take(&mut self, encounter: &Encounter<S>) -> F32<S> {
        let (gap, closing_speed) = (encounter.gap, encounter.closing_speed);
        let ttc = time_gap(gap, closing_speed);
        let mttc = mttc(gap, closing_speed, encounter.closing_accel);
        let values = [gap, time_gap(gap, encounter.rear_speed), ttc, mttc];
        for (smallest, value) in self.smallest.iter_mut().zip(values) {
            let smaller = min(value, *smallest);
            assign_where(smallest, encounter.exists, smaller);
        }
        let values = [closing_speed, drac(gap, closing_speed)];
        for (largest, value) in self.largest.iter_mut().zip(values) {
            let larger = max(value, *largest);
            assign_where(largest, encounter.exists, larger);
        }
        self.exists = true;
        ttc
    }

    /// `value`, or 0 if no frame has had the neighbour.
    fn value_or_zero(&self, value: f32) -> f32 {
        if self.exists { value } else { 0.0 }
    }

    /// The measures with one neighbour, in the order of `WORST_MEASURES`.
    fn result(&self) -> [f32; 7] {
        let [gap, time_gap, ttc, mttc] = self
            .smallest
            .map(|values| self.value_or_zero(min_of_lanes(values)));
        let [closing_speed, drac] = self
            .largest
            .map(|values| self.value_or_zero(max_of_lanes(values)));
        [
            f32::from(u8::from(self.exists)),
            gap,
            time_gap,
            ttc,
            mttc,
            closing_speed,
            drac,
        ]
    }
}

/// Measures between the ego and its leader only.
struct FollowingMargins<S: Simd> {
    /// Smallest time headway, PICUD, and margins to the gaps of RSS and of the law.
    smallest: [F32<S>; 4],
    /// Number of frames with less than the lawful gap.
    num_close: usize,
    /// Number of frames with a critical TTC.
    num_critical: usize,
    /// Sum over these frames of the critical TTC minus the TTC [s].
    shortfall: f64,
}

impl<S: Simd> FollowingMargins<S> {
    /// Before the first frame.
    fn new(simd: S) -> Self {
        Self {
            smallest: [splat(simd, f32::INFINITY); 4],
            num_close: 0,
            num_critical: 0,
            shortfall: 0.0,
        }
    }

    /// Take a block of frames; `ttc` is the TTC in each of them.
    #[inline(always)]
    fn take(
        &mut self,
        scan: &TrackScan<'_>,
        block: SpanBlock<S>,
        encounter: &Encounter<S>,
        ttc: F32<S>,
    ) {
        let (law, exists) = (scan.law, encounter.exists);
        let (gap, speed) = (encounter.gap, encounter.rear_speed);
        let leader_speed = speed - encounter.closing_speed;
        let decel = law.assumed_decel(block.load(scan.track.signals.friction));
        let lawful_margin = gap - law.lawful_gap(speed, encounter.closing_speed, decel);
        let leader_length = encounter.slots.values(block.simd, scan.track.length);
        let values = [
            time_gap(gap + leader_length, speed),
            law.picud(gap, speed, leader_speed),
            gap - law.rss_gap(speed, leader_speed),
            lawful_margin,
        ];
        for (smallest, value) in self.smallest.iter_mut().zip(values) {
            let smaller = min(value, *smallest);
            assign_where(smallest, exists, smaller);
        }
        let zero = splat(block.simd, 0.0);
        // Lanes beyond the span repeat its last frame, so counts visit the frames of the span only.
        if (exists & lawful_margin.simd_lt(0.0)).any_true() {
            let margin = select(exists, lawful_margin, zero);
            block.for_each_frame(margin, |margin, _| {
                self.num_close += usize::from(margin < 0.0);
            });
        }
        let is_critical = exists & law.is_critical(ttc);
        if is_critical.any_true() {
            let shortfall = select(is_critical, law.critical_ttc - ttc, zero);
            block.for_each_frame(shortfall, |shortfall, _| {
                self.shortfall += f64::from(shortfall);
            });
            // The count reads a flag, because the shortfall is 0 for a TTC equal to the limit.
            let flag = select(is_critical, splat(block.simd, 1.0), zero);
            block.for_each_frame(flag, |flag, _| {
                self.num_critical += usize::from(flag > 0.0);
            });
        }
    }
}

/// A vehicle in one frame, as recorded.
#[derive(Clone, Copy)]
pub struct VehicleInstant {
    /// Position along the road [mm].
    pub s: i32,
    /// Speed [mm/s].
    pub speed: i32,
    /// Acceleration [mm/s^2].
    pub accel: i16,
    /// Half of the length [m].
    pub half_length: f32,
}

/// The ego and a neighbour in one frame.
pub struct EncounterPair {
    /// The ego.
    pub ego: VehicleInstant,
    /// The neighbour, if there is one.
    pub neighbour: Option<VehicleInstant>,
    /// Whether the neighbour is ahead of the ego.
    pub is_ahead: bool,
}

/// Names of the measures of an encounter, in the order of the rows of the result.
pub const ENCOUNTER_NAMES: [&str; 6] = ["gap", "closing_speed", "time_gap", "ttc", "mttc", "drac"];

/// Sixteen encounters side by side.
#[derive(Default)]
struct EncounterBlock {
    gap: [f32; SIMD_LANES],
    closing_speed: [f32; SIMD_LANES],
    rear_speed: [f32; SIMD_LANES],
    closing_accel: [f32; SIMD_LANES],
}

/// Compute the measures of encounters: `out` has a row for each of `ENCOUNTER_NAMES`.
pub fn encounter_measures(pairs: &[EncounterPair], level: Level, out: &mut [f32]) {
    for (chunk, pairs_of_chunk) in pairs.chunks(SIMD_LANES).enumerate() {
        let mut block = EncounterBlock::default();
        for (lane, pair) in pairs_of_chunk.iter().enumerate() {
            block.set_lane(lane, pair);
        }
        let measures = dispatch!(level, |simd| block.measures(simd));
        for (values, row) in measures.iter().zip(out.chunks_mut(pairs.len())) {
            let row = &mut row[chunk * SIMD_LANES..][..pairs_of_chunk.len()];
            row.copy_from_slice(&values[..row.len()]);
        }
    }
}

impl EncounterBlock {
    /// Write one encounter. Without a neighbour the ego takes its place, with a gap of 0: all measures are then 0.
    fn set_lane(&mut self, lane: usize, pair: &EncounterPair) {
        let (ego, neighbour) = (pair.ego, pair.neighbour.unwrap_or(pair.ego));
        let half_length_sum = ego.half_length + neighbour.half_length;
        let ego_excess = ego.speed.wrapping_sub(neighbour.speed);
        let closing_speed = if pair.is_ahead {
            ego_excess
        } else {
            ego_excess.wrapping_neg()
        };
        let closing_speed = closing_speed as f32 * METRES_PER_MM;
        let accel = |vehicle: VehicleInstant| f32::from(vehicle.accel) * METRES_PER_MM;
        let ego_speed = ego.speed as f32 * METRES_PER_MM;
        if pair.neighbour.is_some() {
            self.gap[lane] = gap_between(ego.s, neighbour.s, half_length_sum);
        }
        self.closing_speed[lane] = closing_speed;
        (self.rear_speed[lane], self.closing_accel[lane]) = if pair.is_ahead {
            (ego_speed, accel(ego) - accel(neighbour))
        } else {
            (ego_speed + closing_speed, accel(neighbour) - accel(ego))
        };
    }

    /// The measures of all encounters, in the order of `ENCOUNTER_NAMES`.
    fn measures<S: Simd>(&self, simd: S) -> [[f32; SIMD_LANES]; ENCOUNTER_NAMES.len()] {
        simd.vectorize(
            #[inline(always)]
            || {
                let load = |values: &[f32; SIMD_LANES]| F32::simd_from(simd, *values);
                let (gap, closing_speed) = (load(&self.gap), load(&self.closing_speed));
                [
                    gap,
                    closing_speed,
                    time_gap(gap, load(&self.rear_speed)),
                    time_gap(gap, closing_speed),
                    mttc(gap, closing_speed, load(&self.closing_accel)),
                    drac(gap, closing_speed),
                ]
                .map(|values| values.to_array())
            },
        )
    }
}
