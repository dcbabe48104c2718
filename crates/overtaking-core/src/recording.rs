//! Frames to their place in memory, percepts and contacts; see `overtaking.sim.reference.recording`.

use fearless_simd::prelude::*;
use fearless_simd::{Simd, i32x16, u32x16};

use crate::lanes::{LANES, M, Seats, choose, splat};
use crate::neighbours::Neighbours;
use crate::oncoming::Oncoming;
use crate::output::{MAX_PERCEPTS, Output};
use crate::perception::Beliefs;
use crate::state::{EGO, FAST_LEAD, State};
use crate::tile::{self, PACKED, Row, TILE, Tile, packed, put_tile, transposed};
use crate::trace::{self, digest, mix, mix_word};
use crate::words::{INT32_LIMIT, NO_VEHICLE, THOUSAND, rounded, vehicle_words};
use crate::world::World;

/// Which decision a percept was written down for.
#[derive(Clone, Copy)]
pub enum Kind {
    PullOut = 0,
    Return = 1,
    Abort = 2,
}

/// Collects the recorded integers of a block and hashes them.
pub struct Recorder<'a, const N: usize> {
    /// Where the simulation of each lane goes; `None` in lanes that are free.
    out: [Option<Output<'a>>; LANES],
    hash: [[u32; LANES]; 4],
    frames: [usize; LANES],
    flushed: usize,
}

impl<'a, const N: usize> Recorder<'a, N> {
    /// A recorder of the simulations of some lanes.
    pub fn new(mut out: [Option<Output<'a>>; LANES]) -> Self {
        for out in out.iter_mut().flatten() {
            clear(out);
        }
        Self {
            out,
            hash: trace::start(),
            frames: [0; LANES],
            flushed: 0,
        }
    }

    /// Whether a lane holds a simulation that is not finished.
    pub fn is_busy(&self, lane: usize) -> bool {
        self.out[lane].is_some()
    }

    /// Free a lane of which nothing is recorded; where its results would have gone.
    pub fn release(&mut self, lane: usize) -> Option<Output<'a>> {
        self.out[lane].take()
    }

    /// Take over the simulation in lane `other` of a recorder that has written down as many frames.
    pub fn seat(&mut self, lane: usize, from: &mut Self, other: usize) {
        debug_assert_eq!(self.flushed, from.flushed);
        self.out[lane] = from.out[other].take();
        self.hash.seat(lane, &from.hash, other);
        self.frames[lane] = from.frames[other];
    }

    /// Write down one frame of the simulations that still run.
    #[inline(always)]
    pub fn frame<S: Simd>(
        &mut self,
        state: &State<'_, S, N>,
        w: &World<'_, S, N>,
        active: M<S>,
        number: usize,
        tile: &mut Tile<N>,
    ) {
        let simd = w.simd;
        let [h0, h1, h2, h3] = self.hash;
        let mut hash = [
            u32x16::simd_from(simd, h0),
            u32x16::simd_from(simd, h1),
            u32x16::simd_from(simd, h2),
            u32x16::simd_from(simd, h3),
        ];
        let at = number - self.flushed;
        for i in 0..w.count {
            let valid = w.p[i].valid.simd_gt(0.0);
            let words = vehicle_words(state, w, i);
            for (k, word) in words.into_iter().enumerate() {
                hash[k % 4] = mix(hash[k % 4], word, active & valid);
            }
            for (k, word) in packed(simd, &words).into_iter().enumerate() {
                tile.0[(i * PACKED + k) * TILE + at] = Row(word.to_array());
            }
            if valid.test(at) {
                self.fetch(i, at);
            }
        }
        let stage: i32x16<S> = state.stage[EGO].to_int();
        let nobody = state.contact_partner[EGO].simd_lt(0.0);
        let partner: i32x16<S> = state.contact_partner[EGO].to_int();
        let partner = nobody.select(i32x16::splat(simd, NO_VEHICLE), partner);
        let frame = i32x16::splat(simd, number as i32);
        let zero = i32x16::splat(simd, 0);
        for (k, word) in [stage, partner, frame, zero].into_iter().enumerate() {
            hash[k] = mix(hash[k], word, active);
        }
        for (kept, word) in self.hash.iter_mut().zip(hash) {
            *kept = word.to_array();
        }
        for (lane, out) in self.out.iter_mut().enumerate() {
            if let Some(out) = out.as_mut().filter(|_| active.test(lane)) {
                out.stage[number] = stage[lane] as u8;
                out.collided_with[number] = partner[lane] as u8;
                self.frames[lane] = number + 1;
            }
        }
        if at + 1 == TILE {
            simd.vectorize(
                #[inline(always)]
                || self.flush(w, tile),
            );
            self.flushed = number + 1;
        }
    }

    /// Ask for the memory that the frames of vehicle `i` of the simulation in lane `at` will be moved to.
    ///
    /// A tile has as many frames as there are lanes, so all of it is there when the tile is full; else each
    /// line of it would be waited for. A vehicle after the other, as the CPU waits for a few lines at a time.
    #[inline(always)]
    fn fetch(&self, i: usize, at: usize) {
        if let Some(out) = self.out[at].as_ref() {
            tile::fetch(out, i * out.frames + self.flushed);
        }
    }

    /// Move the collected frames to their place: the frames of one vehicle are adjacent.
    ///
    /// Sixteen frames are turned at once; what is written beyond the end of a simulation is cleared when
    /// it is finished.
    #[inline(always)]
    pub fn flush<S: Simd>(&mut self, w: &World<'_, S, N>, tile: &Tile<N>) {
        let start = self.flushed;
        if self.frames.iter().all(|frames| *frames <= start) {
            return;
        }
        for i in 0..w.count {
            let there = w.p[i].valid.simd_gt(0.0);
            for k in 0..PACKED {
                let from = (i * PACKED + k) * TILE;
                let turned = transposed(w.simd, &tile.0[from..from + LANES]);
                for (lane, (out, Row(row))) in self.out.iter_mut().zip(&turned).enumerate() {
                    if let Some(out) = out.as_mut().filter(|_| there.test(lane)) {
                        put_tile(out, i, k, start, row);
                    }
                }
            }
        }
    }

    /// Write down what the ego believed at a decision, as long as there is room.
    #[allow(clippy::too_many_arguments)]
    #[inline(always)]
    pub fn percepts<S: Simd>(
        &mut self,
        state: &mut State<'_, S, N>,
        w: &World<'_, S, N>,
        near: &Neighbours<S>,
        believed: &Beliefs<S>,
        mask: M<S>,
        kind: Kind,
        roles: [usize; 3],
        step: u32,
        oncoming: Option<&Oncoming<S>>,
    ) {
        let now = splat(w.simd, step as f32);
        let mask =
            mask & state.num_percepts.simd_lt(MAX_PERCEPTS as f32) & now.simd_le(state.end_step);
        if !mask.any_true() {
            return;
        }
        let (own, _) = state.road_velocity(EGO);
        for (column, role) in roles.into_iter().enumerate() {
            // Who comes stands for the front of the lane that is pulled out to.
            let comes = oncoming.filter(|_| role == FAST_LEAD);
            let slot = comes.map_or(near.slot[role], |one| one.slot);
            let mut speed = state.road_velocity(0).0;
            for j in 1..w.count {
                speed = choose(slot.simd_eq(j as f32), state.road_velocity(j).0, speed);
            }
            let closing = if comes.is_some() {
                own + speed
            } else if role.is_multiple_of(2) {
                own - speed
            } else {
                speed - own
            };
            let gap = comes.map_or(believed.gap[role], |one| one.believed_gap);
            let gap = rounded(gap, THOUSAND, INT32_LIMIT);
            let believed_closing = comes.map_or(believed.closing[role], |one| one.closing);
            let believed_closing = rounded(believed_closing, THOUSAND, INT32_LIMIT);
            let true_gap = comes.map_or(near.gap[role], |one| one.gap);
            let true_gap = rounded(true_gap, THOUSAND, INT32_LIMIT);
            let detected = comes.map_or(believed.detected[role], |one| one.detected);
            let true_closing = rounded(closing, THOUSAND, INT32_LIMIT);
            for (lane, out) in self.out.iter_mut().enumerate() {
                let Some(out) = out.as_mut().filter(|_| mask.test(lane)) else {
                    continue;
                };
                let at = state.num_percepts[lane] as usize * 3 + column;
                let nobody = slot[lane] < 0.0;
                out.percept_slot[at] = if nobody { 255 } else { slot[lane] as u8 };
                out.percept_is_detected[at] = u8::from(detected.test(lane));
                out.percept_gap[at] = gap[lane];
                out.percept_closing_speed[at] = believed_closing[lane];
                out.percept_true_gap[at] = if nobody { 0 } else { true_gap[lane] };
                out.percept_true_closing_speed[at] = if nobody { 0 } else { true_closing[lane] };
            }
        }
        for (lane, out) in self.out.iter_mut().enumerate() {
            if let Some(out) = out.as_mut().filter(|_| mask.test(lane)) {
                let at = state.num_percepts[lane] as usize;
                out.percept_valid[at] = 1;
                out.percept_kind[at] = kind as u8;
                out.percept_time[at] = step as i32 * 10;
            }
        }
        state.num_percepts = choose(mask, state.num_percepts + 1.0, state.num_percepts);
    }

    /// Write what is left of a simulation that has ended: zeros behind its frames, contacts and hash.
    ///
    /// The lane is free afterwards.
    pub fn finish<S: Simd>(&mut self, lane: usize, state: &State<'_, S, N>, w: &World<'_, S, N>) {
        let Some(mut out) = self.out[lane].take() else {
            return;
        };
        let mut hash = self.hash.map(|word| word[lane]);
        clear_behind(&mut out, self.frames[lane], lane, w);
        put_contacts(&mut out, &mut hash, lane, state, w);
        mix_percepts(&mut hash, &out);
        out.num_frames[0] = self.frames[lane] as i32;
        out.trace_hash.copy_from_slice(&digest(hash));
    }
}

/// Set what is only written where something happens.
fn clear(out: &mut Output<'_>) {
    out.percept_valid.fill(0);
    out.percept_slot.fill(255);
    out.collided_with.fill(255);
    for slice in [
        &mut *out.percept_kind,
        &mut *out.percept_is_detected,
        &mut *out.stage,
    ] {
        slice.fill(0);
    }
    for slice in [
        &mut *out.percept_time,
        &mut *out.percept_gap,
        &mut *out.percept_closing_speed,
        &mut *out.percept_true_gap,
        &mut *out.percept_true_closing_speed,
    ] {
        slice.fill(0);
    }
}

/// Zero what lies behind the last frame, and the slots that are empty, as far as something was ever written there.
fn clear_behind<S: Simd, const N: usize>(
    out: &mut Output<'_>,
    frames: usize,
    lane: usize,
    w: &World<'_, S, N>,
) {
    let room = out.frames;
    for i in 0..out.slots {
        let used = if w.p[i].valid[lane] > 0.0 { frames } else { 0 };
        let written = (out.written[i].max(0) as usize).clamp(used, room);
        out.written[i] = used as i32;
        let rest = i * room + used..i * room + written;
        tile::clear(out, rest);
    }
}

/// Write down the first contact of each vehicle.
fn put_contacts<S: Simd, const N: usize>(
    out: &mut Output<'_>,
    hash: &mut [u32; 4],
    lane: usize,
    state: &State<'_, S, N>,
    w: &World<'_, S, N>,
) {
    for i in 0..out.slots {
        let partner = state.contact_partner[i][lane];
        let slot = if partner < 0.0 { 255 } else { partner as u8 };
        let time = rounded(state.contact_time[i], THOUSAND, INT32_LIMIT)[lane];
        let impulse = rounded(state.contact_impulse[i], 1.0, INT32_LIMIT)[lane];
        let speed = rounded(state.contact_speed[i], THOUSAND, INT32_LIMIT)[lane];
        out.contact_partner[i] = slot;
        out.contact_time[i] = time;
        out.contact_impulse[i] = impulse;
        out.contact_speed[i] = speed;
        // Empty slots are no part of the hash, which is the same for any number of slots.
        if w.p[i].valid[lane] == 0.0 {
            continue;
        }
        let words = [u32::from(slot), time as u32, impulse as u32, speed as u32];
        for (hash, word) in hash.iter_mut().zip(words) {
            *hash = mix_word(*hash, word);
        }
    }
}

fn mix_percepts(hash: &mut [u32; 4], out: &Output<'_>) {
    for at in 0..MAX_PERCEPTS {
        if out.percept_valid[at] == 0 {
            continue;
        }
        let mut words = vec![u32::from(out.percept_kind[at]), out.percept_time[at] as u32];
        for k in at * 3..at * 3 + 3 {
            words.extend([
                u32::from(out.percept_slot[k]),
                u32::from(out.percept_is_detected[k]),
                out.percept_gap[k] as u32,
                out.percept_closing_speed[k] as u32,
                out.percept_true_gap[k] as u32,
                out.percept_true_closing_speed[k] as u32,
            ]);
        }
        for (k, word) in words.into_iter().enumerate() {
            hash[k % 4] = mix_word(hash[k % 4], word);
        }
    }
}
