//! Anti-aliased shapes, painted one over another.
//!
//! Places are in units of a sheet's own, y grows downwards; each texel holds what a pixel centred there
//! would show. Nothing but sums, products, quotients and roots is taken, each rounded once, so that every
//! machine paints the same.

use std::ops::Range;

use crate::grid::{Ends, Grid, between, rounded};
use crate::sprite::{Sprite, Tile};
use crate::texture::Texture;

/// Luma, U and V.
pub type Colour = [f32; 3];

const STEPS_PER_UNIT: f64 = 3.0; // Of what is swept; the steps of a slanting edge are then not seen.
const LARGEST: f64 = 8192.0; // Pixels in a direction.

/// Something to paint on.
#[derive(Debug, Clone)]
pub struct Sheet {
    /// Luma, and U and V at half the resolution.
    grids: [Grid; 2],
    /// Of the corner, times pixels to a unit.
    corner: (f64, f64),
    fine: usize,
}

/// A colour as the planes of each grid have it, and 0 for what is hidden.
fn planes([y, u, v]: Colour) -> [Vec<f32>; 2] {
    [vec![y, 0.0], vec![u, v, 0.0]]
}

impl Sheet {
    /// A transparent sheet of `scale` pixels to a unit and `fine` texels to a pixel.
    ///
    /// # Errors
    /// It has no size, or is too large.
    pub fn new(x: Ends, y: Ends, scale: f64, fine: usize) -> Result<Self, String> {
        let half = [x, y].map(|(low, high)| ((high - low) * scale / 2.0).ceil());
        let fits = half.iter().all(|one| (1.0..=LARGEST / 2.0).contains(one));
        if !fits || !matches!(fine, 1 | 2 | 4 | 8) {
            return Err(
                "sheet: expected 2 to 8192 pixels each way, 1, 2, 4 or 8 texels each".to_owned(),
            );
        }
        let [width, height] = half.map(|one| one as usize * fine);
        let corner = (x.0, y.0);
        Ok(Self {
            grids: [
                Grid::new(corner, scale, fine, (2 * width, 2 * height), 1),
                Grid::new(corner, scale / 2.0, fine, (width, height), 2),
            ],
            corner: (x.0 * scale, y.0 * scale),
            fine,
        })
    }

    /// One colour everywhere.
    pub fn fill(&mut self, colour: Colour) {
        for (grid, colour) in self.grids.iter_mut().zip(planes(colour)) {
            grid.fill(&colour);
        }
    }

    /// A rectangle, with round corners if it has a radius.
    pub fn rect(&mut self, x: Ends, y: Ends, colour: Colour, opacity: f64, radius: f64) {
        let opacity = opacity as f32;
        for (grid, colour) in self.grids.iter_mut().zip(planes(colour)) {
            let (columns, rows) = grid.near(x, y);
            if radius > 0.0 {
                let shape = Round::new(grid, &columns, x, y, radius);
                grid.cover(rows, columns, &colour, |y, shares| {
                    shape.fill(y, shares, |share, inside| *share = opacity * inside);
                });
                continue;
            }
            let across = grid.between_columns(&columns, x);
            let pixels = grid.pixels as f32;
            grid.cover(rows, columns, &colour, |place, shares| {
                let down = between(place, y, pixels);
                for (share, across) in shares.iter_mut().zip(&across) {
                    *share = opacity * (across * down);
                }
            });
        }
    }

    /// The outline of a rectangle with round corners, `line` wide, inside its edges.
    pub fn frame(&mut self, x: Ends, y: Ends, colour: Colour, line: f64, radius: f64) {
        let inner = [x, y].map(|(low, high)| (low + line, high - line));
        for (grid, colour) in self.grids.iter_mut().zip(planes(colour)) {
            let (columns, rows) = grid.near(x, y);
            let outside = Round::new(grid, &columns, x, y, radius);
            let inner_radius = (radius - line).max(0.0);
            let inside = Round::new(grid, &columns, inner[0], inner[1], inner_radius);
            grid.cover(rows, columns, &colour, |y, shares| {
                outside.fill(y, shares, |share, covered| *share = covered);
                inside.fill(y, shares, |share, covered| *share -= covered);
            });
        }
    }

    /// Light around a point that fades towards `reach`.
    pub fn glow(&mut self, (x, y): (f64, f64), reach: f64, colour: Colour, strength: f64) {
        let strength = strength as f32;
        for (grid, colour) in self.grids.iter_mut().zip(planes(colour)) {
            let (columns, rows) = grid.near((x - reach, x + reach), (y - reach, y + reach));
            let away = |place: f32, from: f64| (place - from as f32) / reach as f32;
            let across: Vec<f32> = grid.x[columns.clone()]
                .iter()
                .map(|&place| away(place, x))
                .collect();
            grid.cover(rows, columns, &colour, |place, shares| {
                let down = away(place, y);
                for (share, across) in shares.iter_mut().zip(&across) {
                    let left = larger(1.0 - across * across - down * down, 0.0);
                    *share = strength * left * left;
                }
            });
        }
    }

    /// All that a rectangle passes over when it is moved by `reach`.
    pub fn swept(&mut self, x: Ends, y: Ends, reach: (f64, f64), colour: Colour, opacity: f64) {
        let longest = reach.0.abs().max(reach.1.abs());
        let steps = 1.0 + (longest * STEPS_PER_UNIT).ceil();
        let moved = |(low, high): Ends, by: f64| (low + by, high + by);
        let moves: Vec<(Ends, Ends)> = (0..=steps as usize)
            .map(|step| {
                let part = |reach: f64| reach * step as f64 / steps;
                (moved(x, part(reach.0)), moved(y, part(reach.1)))
            })
            .collect();
        for (grid, colour) in self.grids.iter_mut().zip(planes(colour)) {
            let whole = 0..grid.x.len();
            let all: Vec<Vec<f32>> = moves
                .iter()
                .map(|(x, _)| grid.between_columns(&whole, *x))
                .collect();
            let pixels = grid.pixels as f32;
            grid.cover(0..grid.y.len(), whole, &colour, |place, shares| {
                shares.fill(0.0);
                for (across, (_, y)) in all.iter().zip(&moves) {
                    let along = between(place, *y, pixels);
                    if along > 0.0 {
                        raise(shares, across, along);
                    }
                }
                shares.iter_mut().for_each(|share| *share *= opacity as f32);
            });
        }
    }

    /// A line through points with growing x, `line` wide.
    ///
    /// # Errors
    /// There are no points, or of x others than of y.
    pub fn curve(
        &mut self,
        (x, y): (&[f32], &[f32]),
        colour: Colour,
        line: f64,
        opacity: f64,
    ) -> Result<(), String> {
        let (Some(&first), Some(&last)) = (x.first(), x.last()) else {
            return Err("curve: expected points".to_owned());
        };
        if x.len() != y.len() {
            return Err(format!("curve: expected {} rows, got {}", x.len(), y.len()));
        }
        let ends = (f64::from(first), f64::from(last));
        let low = f64::from(y.iter().copied().fold(f32::INFINITY, f32::min));
        let high = f64::from(y.iter().copied().fold(f32::NEG_INFINITY, f32::max));
        for (grid, colour) in self.grids.iter_mut().zip(planes(colour)) {
            let (columns, rows) = grid.near(ends, (low - line, high + line));
            let inside = grid.between_columns(&columns, ends);
            let height = interpolated(&grid.x[columns.clone()], x, y);
            let root = slants(&height, grid.step);
            let (half, pixels) = ((0.5 * line) as f32, grid.pixels as f32);
            grid.cover(rows, columns, &colour, |place, shares| {
                let each = shares.iter_mut().zip(&height).zip(&root).zip(&inside);
                for (((share, height), root), inside) in each {
                    let away = (place - height).abs() / root;
                    let covered = ((half - away) * pixels + 0.5).clamp(0.0, 1.0);
                    *share = opacity as f32 * inside * covered;
                }
            });
        }
        Ok(())
    }

    /// A picture of one colour, given as the share of each texel that it covers, for luma and for chroma;
    /// its left upper corner at texels of chroma. What lies outside is cut off.
    ///
    /// # Errors
    /// The shares are no whole rows.
    pub fn stamp(
        &mut self,
        shares: [(&[f32], usize); 2],
        (column, row): (i64, i64),
        colour: Colour,
    ) -> Result<(), String> {
        let grids = self.grids.iter_mut().zip(planes(colour));
        for ((place, (grid, colour)), (share, width)) in grids.enumerate().zip(shares) {
            if width == 0 || !share.len().is_multiple_of(width) {
                return Err("stamp: expected whole rows".to_owned());
            }
            let pixels = 2 - place as i64;
            grid.stamp(share, width, (column * pixels, row * pixels), &colour);
        }
        Ok(())
    }

    /// The sheet of one texel to the pixel, as a sprite.
    #[must_use]
    pub fn sprite(&self) -> Sprite {
        Sprite::of(self.grids.each_ref().map(Grid::raster))
    }

    /// The sheet of one texel to the pixel, as a picture without opacity.
    #[must_use]
    pub fn tile(&self) -> Tile {
        Tile::of(&self.sprite())
    }

    /// The sheet, to be put at any place and angle; its origin is what it is placed by.
    ///
    /// # Errors
    /// Its origin is too far away.
    pub fn texture(&self) -> Result<Texture, String> {
        let halves = |corner: f64| (2.0 * self.fine as f64 * -corner).round_ties_even() as i64;
        let origin = (halves(self.corner.0), halves(self.corner.1));
        Texture::new(&self.sprite(), origin, self.fine as i64)
    }
}

/// A rectangle with round corners, as far as its columns go.
struct Round {
    /// Distance of each column from where the corners begin.
    across: Vec<f32>,
    middle: f32,
    half: f32,
    radius: f32,
    pixels: f32,
}

impl Round {
    fn new(grid: &Grid, columns: &Range<usize>, x: Ends, y: Ends, radius: f64) -> Self {
        let middle = |(low, high): Ends| (0.5 * (low + high)) as f32;
        let half = |(low, high): Ends| (0.5 * (high - low) - radius) as f32;
        let away = |place: &f32| (place - middle(x)).abs() - half(x);
        Self {
            across: grid.x[columns.clone()].iter().map(away).collect(),
            middle: middle(y),
            half: half(y),
            radius: radius as f32,
            pixels: grid.pixels as f32,
        }
    }

    /// Does something with each share of a row and the share of it that lies inside.
    fn fill(&self, y: f32, shares: &mut [f32], put: impl Fn(&mut f32, f32)) {
        let down = (y - self.middle).abs() - self.half;
        for (share, &across) in shares.iter_mut().zip(&self.across) {
            put(share, rounded(across, down, self.radius, self.pixels));
        }
    }
}

/// The larger of two numbers, neither of which is none.
fn larger(one: f32, other: f32) -> f32 {
    if one > other { one } else { other }
}

/// Raises shares to those of a rectangle where they are lower.
fn raise(shares: &mut [f32], across: &[f32], along: f32) {
    for (share, across) in shares.iter_mut().zip(across) {
        *share = larger(*share, across * along);
    }
}

/// Heights of a line through points, at growing places.
fn interpolated(places: &[f32], x: &[f32], y: &[f32]) -> Vec<f32> {
    let value = |at: usize| (f64::from(x[at]), f64::from(y[at]));
    let mut next = 0;
    let height = |&place: &f32| {
        while next < x.len() && x[next] <= place {
            next += 1;
        }
        if next == 0 || next == x.len() || x[next - 1] == place {
            return y[next.max(1) - 1];
        }
        let ((left, low), (right, high)) = (value(next - 1), value(next));
        let slope = (high - low) / (right - left);
        (slope * (f64::from(place) - left) + low) as f32
    };
    places.iter().map(height).collect()
}

/// How much longer than its columns a line is, by its slope between the neighbours of each column.
fn slants(height: &[f32], step: f64) -> Vec<f32> {
    let last = height.len().saturating_sub(1);
    let slope = |at: usize| match at {
        _ if last == 0 => 0.0,
        0 => (height[1] - height[0]) / step as f32,
        _ if at == last => (height[last] - height[last - 1]) / step as f32,
        _ => (height[at + 1] - height[at - 1]) / (2.0 * step) as f32,
    };
    let root = |slope: f32| (1.0 + slope * slope).sqrt();
    (0..height.len()).map(|at| root(slope(at))).collect()
}
