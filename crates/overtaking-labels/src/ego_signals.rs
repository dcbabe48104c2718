//! Signals of the ego: its lateral motion, friction, sight distances, and the nearest vehicle in each role.
//!
//! A role is one of six: leader or follower in the ego's lane, in the lane to the left (the overtaking side) or in the
//! lane to the right. The attention range is the distance beyond which drivers perceive no vehicle. Blocks have sixteen
//! frames. A slot is the number of a vehicle in its simulation; the ego has slot 0.

use fearless_simd::prelude::*;
use fearless_simd::{Level, Simd, i32x16};
use overtaking_core::math::elementary::log;
use overtaking_core::{dispatch, friction_at_film, friction_at_speed};

use crate::frame_block::{Footprint, FrameBlock, for_each_frame_block};
use crate::recording::{
    BEYOND_KERB_EDGE, EgoSignals, MAX_LANES, METRES_PER_MM, NO_VEHICLE, NUM_ROLES, PackedRecording,
    VisibilityInputs,
};
use crate::vectors::{F32, at_least, at_most, max, min, select, splat};

/// Steps of Newton's method for the range of a lamp: five give a relative error below 1e-6, and three more are a reserve
/// (`overtaking.world.visibility`).
const MAX_NEWTON_STEPS: usize = 8;
/// Keeps ranges finite in clear air [1/m].
const MIN_EXTINCTION: f32 = 1e-7;
/// If a lamp is visible at the attention range with more than this reserve, its own range is not computed.
///
/// The reserve is a logarithm of intensity over the threshold of the eye. The errors of Newton's method and of the
/// logarithm are far smaller, so the range would exceed the attention range for certain.
const LAMP_DEPTH_MARGIN: f32 = 0.01;

/// Compute the signals of a batch.
///
/// Callers reuse `out`, so at the call it still holds the signals of an earlier batch. `zero_from` is, for each
/// simulation, the frame from which on they are zero: only frames before it need clearing. The call updates it.
pub fn ego_signals(
    recording: &PackedRecording<'_>,
    visibility: &VisibilityInputs<'_>,
    level: Level,
    out: &mut EgoSignals<'_>,
    zero_from: &mut [i32],
) {
    // `num_computed` is the number of recorded frames, rounded up to whole blocks.
    out.fill(recording, zero_from, |simulation, num_computed, out| {
        let ego = recording.row(simulation, 0);
        lateral_speed(recording, ego, &mut out.lateral_speed[..num_computed]);
        dispatch!(level, |simd| {
            let mut lamp_range = LampRange::UNKNOWN;
            for_each_frame_block!(
                FrameBlock::new(simd, recording, simulation),
                num_computed,
                |block| {
                    let frames = EgoFrames { block, visibility };
                    frames.ego_alone(block.footprint(ego), &mut lamp_range, out);
                    frames.nearest_vehicles(out);
                }
            );
        });
    });
}

/// Lateral speed of a vehicle that is recorded in every frame, positive to the left, the overtaking side [m/s].
///
/// A central difference over `half_window` frames on either side, one-sided at both ends of the recording. `out` may
/// reach beyond the recording, up to the end of a block; nothing reads these frames.
pub(crate) fn lateral_speed(recording: &PackedRecording<'_>, row: usize, out: &mut [f32]) {
    let (d, half) = (recording.d[row], recording.half_window);
    let num_recorded = recording.num_recorded(row / recording.num_slots);
    let last = num_recorded.saturating_sub(1);
    let near_an_end = |frame: usize| {
        let later = (frame + half).min(last);
        let earlier = frame.saturating_sub(half).min(last);
        // Wraps as NumPy does in the twin in Python, so that any recording gives the same bits in both. Millimetres in
        // milliseconds are metres in seconds.
        let d_change = d[later].wrapping_sub(d[earlier]) as f32;
        let elapsed = ((later - earlier) as i32 * recording.interval_ms).max(1) as f32;
        recording.overtaking_sign * (d_change / elapsed)
    };
    let inner_begin = half.min(out.len());
    let inner_end = num_recorded
        .saturating_sub(half)
        .clamp(inner_begin, out.len());
    for (frame, speed) in out[..inner_begin].iter_mut().enumerate() {
        *speed = near_an_end(frame);
    }
    // The inner frames have one elapsed time and no bounds to check, so the compiler vectorizes this loop.
    let elapsed = (2 * half as i32 * recording.interval_ms).max(1) as f32;
    let pairs = d.iter().zip(d.iter().skip(2 * half));
    for (speed, (earlier, later)) in out[inner_begin..inner_end].iter_mut().zip(pairs) {
        *speed = recording.overtaking_sign * (later.wrapping_sub(*earlier) as f32 / elapsed);
    }
    for (frame, speed) in out[inner_end..].iter_mut().enumerate() {
        *speed = near_an_end(inner_end + frame);
    }
}

/// Intermediate results that later blocks of a simulation reuse.
struct LampRange<S: Simd> {
    /// Distance at which a lamp reaches the threshold of the eye [m].
    range: Option<F32<S>>,
    /// Twice the logarithm of the attention range [m], which Allard's law compares with `lamp_depth`.
    attention_depth: Option<F32<S>>,
}

impl<S: Simd> LampRange<S> {
    /// Before the first block of a simulation.
    const UNKNOWN: Self = Self {
        range: None,
        attention_depth: None,
    };
}

/// Distances at which the driver sees other vehicles [m].
struct SightDistances<S: Simd> {
    /// A vehicle with its lamps on.
    lit: F32<S>,
    /// A vehicle without lamps.
    unlit: F32<S>,
}

/// The nearest vehicle in one role.
#[derive(Clone, Copy)]
struct Nearest<S: Simd> {
    /// Distance of the centres along the road [mm].
    distance: i32x16<S>,
    /// Slot of the vehicle, `NO_VEHICLE` without one.
    slot: i32x16<S>,
}

/// A block of frames with the weather around the ego.
struct EgoFrames<'a, S: Simd> {
    block: FrameBlock<'a, S>,
    visibility: &'a VisibilityInputs<'a>,
}

impl<S: Simd> EgoFrames<'_, S> {
    /// Write the signals that need no other vehicle.
    #[inline(always)]
    fn ego_alone(
        &self,
        footprint: Footprint<S>,
        lamp_range: &mut LampRange<S>,
        out: &mut EgoSignals<'_>,
    ) {
        let (block, recording) = (&self.block, self.block.recording);
        let ego = block.row(0);
        let speed: F32<S> = block.load(recording.speed[ego]).to_float();
        let accel: F32<S> = block.load(recording.accel[ego]).to_float();
        let speed = speed * METRES_PER_MM;
        let Footprint {
            lateral_position,
            half_width,
        } = footprint;
        block.store(out.accel, accel * METRES_PER_MM);
        block.store_bytes(out.lane, block.load(recording.lane[ego]));
        block.store(out.lateral_position, lateral_position);
        block.store(out.speed, speed);
        block.store(out.right_edge, lateral_position - half_width);
        block.store(out.left_edge, lateral_position + half_width);
        block.store(out.friction, self.friction(ego, speed));
        let sight_distances = self.sight_distances(speed, lamp_range);
        block.store(out.sight_lit, sight_distances.lit);
        block.store(out.sight_unlit, sight_distances.unlit);
    }

    /// Peak friction of the ego's tyres in its lane; `ego` is the row of the ego [1].
    #[inline(always)]
    fn friction(&self, ego: usize, speed: F32<S>) -> F32<S> {
        let (block, visibility) = (&self.block, self.visibility);
        let lane = block.load(block.recording.lane[ego]);
        let films = &visibility.film[block.simulation * MAX_LANES..][..block.recording.num_lanes];
        let mut film = splat(block.simd, films[0]);
        for (index, value) in films.iter().enumerate().skip(1) {
            // A vehicle beyond the overtaking-side edge has the film of the outer lane there, a vehicle beyond the
            // kerb-side edge the film of lane 0.
            let is_in_lane_or_beyond =
                lane.simd_ge(index as i32) & lane.simd_lt(i32::from(BEYOND_KERB_EDGE));
            film = select(is_in_lane_or_beyond, splat(block.simd, *value), film);
        }
        let wear = splat(block.simd, visibility.tyre_wear[block.simulation]);
        let truck = splat(block.simd, visibility.has_truck_tyres[block.simulation]);
        let constants = visibility.constants;
        friction_at_film(
            constants,
            &friction_at_speed(constants, speed, wear, truck),
            film,
        )
    }

    /// Distances at which the driver sees a lit and an unlit vehicle, by contrast or by lamps.
    #[inline(always)]
    fn sight_distances(&self, speed: F32<S>, lamp_range: &mut LampRange<S>) -> SightDistances<S> {
        let (simd, visibility) = (self.block.simd, self.visibility);
        let simulation = self.block.simulation;
        let attention_range = visibility.attention_range;
        // A driver that moves meets more drops than an observer at rest; `rain_speed` is the speed of the drops.
        let rain = visibility.rain[simulation] * (1.0 + speed / visibility.constants.rain_speed);
        let extinction = visibility.fog[simulation] + rain;
        let contrast_range =
            visibility.contrast_depth[simulation] / at_least(extinction, MIN_EXTINCTION);
        // The limit is the attention range, or by night the range of the headlamps if that is shorter.
        let unlit = at_most(contrast_range, visibility.unlit_limit[simulation]);
        if unlit.simd_ge(attention_range).all_true() {
            return SightDistances {
                lit: splat(simd, attention_range),
                unlit,
            };
        }
        // Extinction depends on the speed only in rain; without rain one range holds for all frames.
        let earlier_range = lamp_range
            .range
            .filter(|_| visibility.rain[simulation] == 0.0);
        let lamp = if let Some(range) = earlier_range {
            range
        } else if self.exceeds_attention_range(extinction, lamp_range) {
            splat(simd, attention_range)
        } else {
            self.lamp_range(extinction)
        };
        lamp_range.range = Some(lamp);
        SightDistances {
            lit: at_most(max(lamp, unlit), attention_range),
            unlit,
        }
    }

    /// Whether a lamp is certainly visible at the attention range, in each of these frames.
    #[inline(always)]
    fn exceeds_attention_range(&self, extinction: F32<S>, lamp_range: &mut LampRange<S>) -> bool {
        let visibility = self.visibility;
        let attention_depth = match lamp_range.attention_depth {
            Some(depth) => depth,
            None => 2.0 * log(splat(self.block.simd, visibility.attention_range)),
        };
        lamp_range.attention_depth = Some(attention_depth);
        let lacking_depth = attention_depth + extinction * visibility.attention_range
            - visibility.lamp_depth[self.block.simulation];
        lacking_depth.simd_lt(-LAMP_DEPTH_MARGIN).all_true()
    }

    /// Distance at which a lamp reaches the threshold of the eye, by Allard's law [m].
    ///
    /// It solves 2 log(range) + extinction * range = depth by Newton's method.
    #[inline(always)]
    fn lamp_range(&self, extinction: F32<S>) -> F32<S> {
        let depth = self.visibility.lamp_depth[self.block.simulation];
        let clear_range = self.visibility.lamp_clear[self.block.simulation];
        // The iteration starts at the range in clear air, or at an optical depth of 4 if that is nearer: in the
        // thickest fog, lamps of 1 to 500 cd have ranges at optical depths of 2 to 10. The bound of 1e-6 avoids a
        // division by 0. It gives 4000 km, so the range in clear air is then the smaller one.
        let mut range = min(
            splat(self.block.simd, clear_range),
            4.0 / at_least(extinction, 1e-6),
        );
        for _ in 0..MAX_NEWTON_STEPS {
            let excess = 2.0 * log(range) + extinction * range - depth;
            // The bound of 0.5 m keeps the logarithm defined.
            let next = at_least(range - range * excess / (2.0 + extinction * range), 0.5);
            // Once a step changes nothing, no later step does: leaving early keeps the result.
            if next.simd_eq(range).all_true() {
                break;
            }
            range = next;
        }
        range
    }

    /// Write the slot of the nearest vehicle in each role; of vehicles at equal distances the first slot counts.
    #[inline(always)]
    fn nearest_vehicles(&self, out: &mut EgoSignals<'_>) {
        let (block, recording) = (&self.block, self.block.recording);
        let ego = block.row(0);
        let ego_s = block.load(recording.s[ego]);
        let ego_lane = block.load(recording.lane[ego]);
        let num_lanes = recording.num_lanes as i32;
        let ego_is_on_road = ego_lane.simd_lt(num_lanes);
        let mut nearest = [Nearest {
            distance: block.int(i32::MAX),
            slot: block.int(i32::from(NO_VEHICLE)),
        }; NUM_ROLES];
        for slot in 1..recording.num_slots {
            let row = block.row(slot);
            if !recording.valid[row] {
                continue;
            }
            let other_lead = block.load(recording.s[row]) - ego_s;
            let lane = block.load(recording.lane[row]);
            // A valid vehicle may have no state in some frames.
            let counts = block.has_state(row) & ego_is_on_road & lane.simd_lt(num_lanes);
            let (lane_shift, is_ahead) = (lane - ego_lane, other_lead.simd_ge(0));
            let distance = is_ahead.select(other_lead, -other_lead);
            let slot = block.int(slot as i32);
            let lane_pairs = nearest.as_chunks_mut::<2>().0.iter_mut();
            // The order of `NeighbourRole`: own lane, left, right; in each the leader, then the follower. Lanes count
            // towards the overtaking side, which is called left.
            for (pair, shift) in lane_pairs.zip([0, 1, -1]) {
                let is_in_lane = counts & lane_shift.simd_eq(shift);
                if !is_in_lane.any_true() {
                    continue;
                }
                for (nearest, is_on_side) in pair.iter_mut().zip([is_ahead, !is_ahead]) {
                    let is_closer = is_in_lane & is_on_side & distance.simd_lt(nearest.distance);
                    nearest.distance = is_closer.select(distance, nearest.distance);
                    nearest.slot = is_closer.select(slot, nearest.slot);
                }
            }
        }
        for (row, nearest) in out
            .neighbour_slot
            .chunks_mut(recording.max_frames)
            .zip(nearest)
        {
            block.store_bytes(row, nearest.slot);
        }
    }
}
