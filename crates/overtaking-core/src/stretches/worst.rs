//! The worst of each measure of safety over a stretch.

use fearless_simd::Simd;
use fearless_simd::prelude::*;
use rayon::prelude::*;

use super::around::{Around, Slots};
use super::formulas::{Law, Measures, drac, time_gap, ttc_accel};
use super::row::{Piece, greatest, least};
use super::{SHARE, Spans};
use crate::lanes::{LANES, M, V, choose, dispatch, max, min, splat};

const METRES: f32 = 1e-3;
const LEADER: usize = 0;
const FOLLOWER: usize = 1;

/// Arrays (simulation, frame), and numbers.
pub struct Worst<'a> {
    /// Speed [m/s].
    pub speed: &'a [f32],
    /// Friction.
    pub friction: &'a [f32],
    /// The neighbours of the ego.
    pub around: Around<'a>,
    /// Acceleration of every slot [mm/s^2].
    pub accels: Vec<&'a [i16]>,
    /// The distances of the law.
    pub law: Law,
    /// Numbers of the measures.
    pub measures: Measures,
}

/// Measures of a simulation, in the order of the rows of the result.
pub const WORST: [&str; 21] = [
    "front.valid",
    "front.gap",
    "front.time_gap",
    "front.ttc",
    "front.mttc",
    "front.closing_speed",
    "front.drac",
    "rear.valid",
    "rear.gap",
    "rear.time_gap",
    "rear.ttc",
    "rear.mttc",
    "rear.closing_speed",
    "rear.drac",
    "headway",
    "picud",
    "rss_margin",
    "lawful_margin",
    "num_close",
    "num_critical",
    "shortfall",
];

/// Measure each stretch: a row of `out` for each of `WORST`, nothing where nobody was there.
pub fn worst(given: &Worst<'_>, spans: &Spans<'_>, out: &mut [f32]) {
    let level = spans.level;
    let count = spans.start.len();
    let found: Vec<_> = (0..count)
        .into_par_iter()
        .with_min_len(SHARE)
        .map(|simulation| dispatch!(level, |simd| one(simd, given, spans, simulation)))
        .collect();
    for (name, row) in out.chunks_mut(count.max(1)).enumerate() {
        for (value, one) in row.iter_mut().zip(&found) {
            *value = one[name];
        }
    }
}

fn one<S: Simd>(
    simd: S,
    given: &Worst<'_>,
    spans: &Spans<'_>,
    simulation: usize,
) -> [f32; WORST.len()] {
    let span = spans.of(simulation);
    let mut rear = Extremes::new(simd);
    let mut front = Extremes::new(simd);
    let mut margins = Margins::new(simd);
    simd.vectorize(
        #[inline(always)]
        || {
            for at in span.clone().step_by(LANES) {
                let view = View {
                    piece: Piece::new(simd, at, span.end),
                    given,
                    spans,
                    simulation,
                };
                if let Some(ahead) = view.neighbour(LEADER) {
                    let time = front.take(&ahead);
                    margins.take(&view, &ahead, time);
                }
                if let Some(behind) = view.neighbour(FOLLOWER) {
                    rear.take(&behind);
                }
            }
        },
    );
    let [a, b, c, d, e, f, g] = front.result();
    let [h, i, j, k, l, m, n] = rear.result();
    let [o, p, q, r] = margins.lowest.map(|values| front.known(least(values)));
    [
        a,
        b,
        c,
        d,
        e,
        f,
        g,
        h,
        i,
        j,
        k,
        l,
        m,
        n,
        o,
        p,
        q,
        r,
        margins.num_close as f32,
        margins.num_critical as f32,
        margins.shortfall as f32,
    ]
}

/// A few frames of a simulation.
struct View<'a, S: Simd> {
    piece: Piece<S>,
    given: &'a Worst<'a>,
    spans: &'a Spans<'a>,
    simulation: usize,
}

/// The ego and a neighbour, as one vehicle behind another.
struct Neighbour<S: Simd> {
    there: M<S>,
    slots: Slots,
    gap: V<S>,
    closing: V<S>,
    /// Of whoever is behind.
    speed: V<S>,
    closing_accel: V<S>,
}

impl<S: Simd> View<'_, S> {
    #[inline(always)]
    fn own(&self, values: &[f32]) -> V<S> {
        self.piece.load(&values[self.spans.own(self.simulation)])
    }

    /// A neighbour, if it is there in any of these frames.
    #[inline(always)]
    fn neighbour(&self, place: usize) -> Option<Neighbour<S>> {
        let (around, piece) = (&self.given.around, self.piece);
        let near = around.neighbour(piece, self.spans, self.simulation, place)?;
        let accels = &self.given.accels[around.vehicles(self.simulation)];
        let own_speed = self.own(self.given.speed);
        let own_accel: V<S> = piece.integers(accels[0]).to_float();
        let accel: V<S> = near.slots.recorded(piece, accels).to_float();
        let (own_accel, accel) = (own_accel * METRES, accel * METRES);
        let (speed, closing_accel) = if place == LEADER {
            (own_speed, own_accel - accel)
        } else {
            (own_speed + near.closing, accel - own_accel)
        };
        Some(Neighbour {
            there: near.there,
            slots: near.slots,
            gap: near.gap,
            closing: near.closing,
            speed,
            closing_accel,
        })
    }

    /// Length of the vehicle in each frame.
    #[inline(always)]
    fn length(&self, slots: Slots) -> V<S> {
        let around = &self.given.around;
        let lengths = &around.length[around.vehicles(self.simulation)];
        slots.of(self.piece.simd, lengths)
    }
}

/// The worst of an encounter so far.
struct Extremes<S: Simd> {
    /// Gap, time gap, and times to collision.
    lowest: [V<S>; 4],
    /// Closing speed and braking.
    highest: [V<S>; 2],
    exists: bool,
}

impl<S: Simd> Extremes<S> {
    fn new(simd: S) -> Self {
        Self {
            lowest: [splat(simd, f32::INFINITY); 4],
            highest: [splat(simd, f32::NEG_INFINITY); 2],
            exists: false,
        }
    }

    /// Take some frames; gives the times to collision in them.
    #[inline(always)]
    fn take(&mut self, one: &Neighbour<S>) -> V<S> {
        let (gap, closing) = (one.gap, one.closing);
        let ttc = time_gap(gap, closing);
        let mttc = ttc_accel(gap, closing, one.closing_accel);
        let low = [gap, time_gap(gap, one.speed), ttc, mttc];
        for (lowest, value) in self.lowest.iter_mut().zip(low) {
            *lowest = choose(one.there, min(value, *lowest), *lowest);
        }
        for (highest, value) in self.highest.iter_mut().zip([closing, drac(gap, closing)]) {
            *highest = choose(one.there, max(value, *highest), *highest);
        }
        self.exists = true;
        ttc
    }

    /// A number, 0 where nobody was there.
    fn known(&self, value: f32) -> f32 {
        if self.exists { value } else { 0.0 }
    }

    fn result(&self) -> [f32; 7] {
        let [gap, time_gap, ttc, mttc] = self.lowest.map(|values| self.known(least(values)));
        let [closing, drac] = self.highest.map(|values| self.known(greatest(values)));
        [
            f32::from(u8::from(self.exists)),
            gap,
            time_gap,
            ttc,
            mttc,
            closing,
            drac,
        ]
    }
}

/// What else there is to say of the vehicle ahead.
struct Margins<S: Simd> {
    /// Headway, PICUD, margins of RSS and of the law.
    lowest: [V<S>; 4],
    num_close: usize,
    num_critical: usize,
    shortfall: f64,
}

impl<S: Simd> Margins<S> {
    fn new(simd: S) -> Self {
        Self {
            lowest: [splat(simd, f32::INFINITY); 4],
            num_close: 0,
            num_critical: 0,
            shortfall: 0.0,
        }
    }

    #[inline(always)]
    fn take(&mut self, view: &View<'_, S>, one: &Neighbour<S>, ttc: V<S>) {
        let (given, lead_speed) = (view.given, one.speed - one.closing);
        let decel = given.law.sure_decel(view.own(given.friction));
        let lawful = one.gap - given.law.lawful_gap(one.speed, one.closing, decel);
        let values = [
            time_gap(one.gap + view.length(one.slots), one.speed),
            given.measures.picud(one.gap, one.speed, lead_speed),
            one.gap - given.measures.rss(one.speed, lead_speed),
            lawful,
        ];
        for (lowest, value) in self.lowest.iter_mut().zip(values) {
            *lowest = choose(one.there, min(value, *lowest), *lowest);
        }
        let nothing = splat(view.piece.simd, 0.0);
        if (one.there & lawful.simd_lt(0.0)).any_true() {
            let counted = choose(one.there, lawful, nothing);
            view.piece.each(counted, |margin, _| {
                self.num_close += usize::from(margin < 0.0)
            });
        }
        let critical = one.there & given.measures.is_critical(ttc);
        if critical.any_true() {
            let lacking = given.measures.critical_ttc - ttc;
            view.piece
                .each(choose(critical, lacking, nothing), |each, _| {
                    self.shortfall += f64::from(each)
                });
            let ones = choose(critical, splat(view.piece.simd, 1.0), nothing);
            view.piece
                .each(ones, |each, _| self.num_critical += usize::from(each > 0.0));
        }
    }
}
