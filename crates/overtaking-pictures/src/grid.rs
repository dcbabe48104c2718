//! One resolution of a sheet.

use std::ops::Range;

use crate::sprite::{OPAQUE, Raster};

/// Lower and upper end along an axis.
pub type Ends = (f64, f64);

/// Texels of a sheet, component by component, and what shines through.
#[derive(Debug, Clone)]
pub(crate) struct Grid {
    /// Pixels to a unit.
    pub pixels: f64,
    /// Units to a texel.
    pub step: f64,
    /// Middles of columns.
    pub x: Vec<f32>,
    /// Middles of rows.
    pub y: Vec<f32>,
    /// Each component times opacity, and what shines through, 0 to 1.
    planes: Vec<Vec<f32>>,
}

impl Grid {
    /// A transparent grid of so many texels in x and in y.
    pub fn new(
        corner: (f64, f64),
        pixels: f64,
        fine: usize,
        size: (usize, usize),
        components: usize,
    ) -> Self {
        let step = 1.0 / (pixels * fine as f64);
        let axis = |first: f64, count: usize| {
            let middle = |texel: usize| (first + (texel as f64 + 0.5) * step) as f32;
            (0..count).map(middle).collect()
        };
        let mut planes = vec![vec![0.0; size.0 * size.1]; components];
        planes.push(vec![1.0; size.0 * size.1]);
        Self {
            pixels,
            step,
            x: axis(corner.0, size.0),
            y: axis(corner.1, size.1),
            planes,
        }
    }

    /// Columns and rows that something between two places each way can touch.
    pub fn near(&self, x: Ends, y: Ends) -> (Range<usize>, Range<usize>) {
        let touched = |axis: &[f32], (low, high): Ends| {
            let (origin, half) = (f64::from(axis[0]), 0.5 / (self.pixels * self.step));
            let first = ((low - origin) / self.step - half).floor().max(0.0) as usize;
            let last = ((high - origin) / self.step + half).ceil() + 1.0;
            let last = axis.len().min(last.max(0.0) as usize);
            first.min(last)..last
        };
        (touched(&self.x, x), touched(&self.y, y))
    }

    /// Share of a pixel around each of some columns that lies between two ends.
    pub fn between_columns(&self, columns: &Range<usize>, ends: Ends) -> Vec<f32> {
        let pixels = self.pixels as f32;
        let share = |&place: &f32| between(place, ends, pixels);
        self.x[columns.clone()].iter().map(share).collect()
    }

    /// One colour everywhere.
    pub fn fill(&mut self, colour: &[f32]) {
        for (plane, colour) in self.planes.iter_mut().zip(colour) {
            plane.fill(*colour);
        }
    }

    /// Lays a colour over some texels, whose shares are asked for row by row, by the middle of the row.
    pub fn cover(
        &mut self,
        rows: Range<usize>,
        columns: Range<usize>,
        colour: &[f32],
        share: impl Fn(f32, &mut [f32]),
    ) {
        let mut shares = vec![0.0; columns.len()];
        for row in rows {
            share(self.y[row], &mut shares);
            self.cover_row(row, columns.clone(), colour, &shares);
        }
    }

    /// Lays a colour, its shares given row by row, from a column and a row on.
    pub fn stamp(
        &mut self,
        shares: &[f32],
        width: usize,
        (column, row): (i64, i64),
        colour: &[f32],
    ) {
        let first = column.clamp(0, self.x.len() as i64);
        let last = (column + width as i64).clamp(first, self.x.len() as i64);
        let skipped = (first - column) as usize;
        for (line, shares) in (row..).zip(shares.chunks_exact(width)) {
            if (0..self.y.len() as i64).contains(&line) && first < last {
                let columns = first as usize..last as usize;
                let shares = &shares[skipped..skipped + columns.len()];
                self.cover_row(line as usize, columns, colour, shares);
            }
        }
    }

    fn cover_row(&mut self, row: usize, columns: Range<usize>, colour: &[f32], shares: &[f32]) {
        let start = row * self.x.len();
        for (plane, colour) in self.planes.iter_mut().zip(colour) {
            let texels = &mut plane[start + columns.start..start + columns.end];
            for (texel, share) in texels.iter_mut().zip(shares) {
                *texel += share * (colour - *texel);
            }
        }
    }

    /// Everything in fixed point, what shines through on the scale of opacity.
    pub fn raster(&self) -> Raster {
        let (keep, colours) = self.planes.split_last().expect("a plane of opacity");
        let fixed = |texel: f32| whole(texel + 0.5);
        let scale = f32::from(OPAQUE);
        Raster {
            width: self.x.len(),
            height: self.y.len(),
            colours: colours
                .iter()
                .map(|texels| texels.iter().map(|&one| fixed(one)).collect())
                .collect(),
            keep: keep.iter().map(|one| fixed(one * scale)).collect(),
        }
    }
}

/// Share of a pixel around a place that lies between two ends.
pub(crate) fn between(place: f32, (low, high): Ends, pixels: f32) -> f32 {
    let beyond = |end: f64| ((place - end as f32) * pixels + 0.5).clamp(0.0, 1.0);
    beyond(low) - beyond(high)
}

/// Share of a pixel inside a rectangle with round corners, by its distances from where they begin.
#[inline]
pub(crate) fn rounded(across: f32, down: f32, radius: f32, pixels: f32) -> f32 {
    let beyond = |away: f32| if away > 0.0 { away } else { 0.0 };
    let (x, y) = (beyond(across), beyond(down));
    let inner = if across > down { across } else { down };
    let distance = (x * x + y * y).sqrt() + if inner < 0.0 { inner } else { 0.0 };
    ((radius - distance) * pixels + 0.5).clamp(0.0, 1.0)
}

/// A number from 0 to 65535 without what stands behind its point: many at a time, unlike a cast.
fn whole(value: f32) -> u16 {
    const FAR: f32 = 8_388_608.0; // From here on, one number and the next are 1 apart.
    let moved = value + FAR;
    let is_above = moved - FAR > value;
    moved.to_bits().wrapping_sub(u32::from(is_above)) as u16
}
