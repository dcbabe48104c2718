//! The formulas of `overtaking.world.surrogate_safety` and `overtaking.labels.law.distances`, same operations.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::lanes::{M, V, at_least, at_most, choose, splat};

/// Nothing moves so slowly [m/s].
const LEAST: f32 = 1e-20;

/// Numbers of the law and of the measures.
#[derive(Clone, Copy)]
pub struct Numbers {
    /// Least friction that is thought possible.
    pub floor: f32,
    /// Usable share of friction times gravity [m/s^2].
    pub usable: f32,
    /// Most deceleration that anybody is thought capable of [m/s^2].
    pub decel_limit: f32,
    /// Before the vehicle behind brakes [s].
    pub reaction_time: f32,
    /// Before the ego brakes for what it sees [s].
    pub stop_reaction_time: f32,
    /// Frames in which a distance that was taken may be regained.
    pub regain: usize,
    /// Of the return: time gap to the target that is enough [s].
    pub time_gap: f32,
    /// Of the return: time in which the vehicle ahead must not be reached [s].
    pub free_time: f32,
    /// Of the return: farthest that room is looked for [m].
    pub reach: f32,
    /// Frames after a change of lane in which forced braking counts.
    pub lasting: usize,
    /// Braking that may be forced on others [m/s^2].
    pub allowed_braking: f32,
    /// Braking beyond which none is told from another [m/s^2].
    pub most_braking: f32,
    /// Of PICUD: before the vehicle behind brakes [s].
    pub picud_reaction_time: f32,
    /// Of PICUD: braking of both [m/s^2].
    pub picud_decel: f32,
    /// Of RSS: reaction time [s].
    pub rss_reaction_time: f32,
    /// Of RSS: acceleration during it [m/s^2].
    pub rss_accel: f32,
    /// Of RSS: braking of the vehicle behind [m/s^2].
    pub rss_rear_decel: f32,
    /// Of RSS: braking of the vehicle ahead [m/s^2].
    pub rss_lead_decel: f32,
    /// Time to collision below which it is critical [s].
    pub critical_ttc: f32,
}

impl Numbers {
    /// Deceleration that both are thought capable of.
    #[inline(always)]
    pub(super) fn sure_decel<S: Simd>(&self, friction: V<S>) -> V<S> {
        at_most(
            self.usable * at_least(friction, self.floor),
            self.decel_limit,
        )
    }

    /// Gap that the law asks of the vehicle behind.
    #[inline(always)]
    pub(super) fn lawful_gap<S: Simd>(&self, rear_speed: V<S>, closing: V<S>, decel: V<S>) -> V<S> {
        let lead_speed = rear_speed - closing;
        let twice = 2.0 * decel;
        let rear = rear_speed * (self.reaction_time + rear_speed / twice);
        let left = 0.0 - rear + lead_speed * lead_speed / twice;
        at_least(-left, 0.0)
    }
}

/// Time to a place ahead at one's own speed.
#[inline(always)]
pub(super) fn time_gap<S: Simd>(gap: V<S>, speed: V<S>) -> V<S> {
    let moving = speed.simd_gt(LEAST);
    let time = at_least(gap, 0.0) / choose(moving, speed, splat(gap.simd, 1.0));
    choose(
        moving | gap.simd_le(0.0),
        time,
        splat(gap.simd, f32::INFINITY),
    )
}

/// Time to collision at constant accelerations.
#[inline(always)]
pub(super) fn ttc_accel<S: Simd>(gap: V<S>, closing: V<S>, closing_accel: V<S>) -> V<S> {
    let simd = gap.simd;
    let distance = at_least(gap, 0.0);
    let square = closing * closing + 2.0 * closing_accel * distance;
    let root = at_least(square, 0.0).sqrt();
    let opening = closing.simd_lt(0.0);
    let below = choose(opening, closing_accel, closing + root);
    let above = choose(opening, root - closing, 2.0 * distance);
    let meets = square.simd_ge(0.0) & below.simd_gt(LEAST);
    let time = above / choose(meets, below, splat(simd, 1.0));
    let found = choose(meets, time, splat(simd, f32::INFINITY));
    choose(gap.simd_le(0.0), splat(simd, 0.0), found)
}

/// Deceleration that just avoids a collision with a steady leader.
#[inline(always)]
pub(super) fn drac<S: Simd>(gap: V<S>, closing: V<S>) -> V<S> {
    let approach = at_least(closing, 0.0);
    let room = gap.simd_gt(0.0);
    let needed = approach * approach / (2.0 * choose(room, gap, splat(gap.simd, 1.0)));
    choose(
        room | approach.simd_eq(0.0),
        needed,
        splat(gap.simd, f32::INFINITY),
    )
}

impl Numbers {
    /// Gap that is left when both have stopped after sudden braking.
    #[inline(always)]
    pub(super) fn picud<S: Simd>(&self, gap: V<S>, speed: V<S>, lead_speed: V<S>) -> V<S> {
        let twice = 2.0 * self.picud_decel;
        let rear = speed * (self.picud_reaction_time + speed / twice);
        gap - rear + lead_speed * lead_speed / twice
    }

    /// Safe gap of responsibility-sensitive safety.
    #[inline(always)]
    pub(super) fn rss<S: Simd>(&self, speed: V<S>, lead_speed: V<S>) -> V<S> {
        let reached = speed + self.rss_reaction_time * self.rss_accel;
        let gained = 0.5 * self.rss_accel * self.rss_reaction_time;
        let reaction = (speed + gained) * self.rss_reaction_time;
        let stop = reached * reached / (2.0 * self.rss_rear_decel);
        let lead = lead_speed * lead_speed / (2.0 * self.rss_lead_decel);
        at_least(reaction + stop - lead, 0.0)
    }

    /// Whether a time to collision counts as exposure.
    #[inline(always)]
    pub(super) fn is_critical<S: Simd>(&self, time: V<S>) -> M<S> {
        time.simd_gt(0.0) & time.simd_le(self.critical_ttc)
    }
}
