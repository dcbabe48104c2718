//! What weather and night do to a whole part of a frame.
//!
//! That is many samples, so it is done with the widest vectors that there are (`dispatch`): what is called
//! there is always inlined, as else it would be compiled for the narrowest. Integers are the same in all.

use fearless_simd::{Level, dispatch};

use crate::frame::{Frame, Plane, Rows};
use crate::sprite::{OPAQUE, common};

const GREY: u16 = 128; // Chroma of what has no colour.

/// Brightness between the eye and the road that hides what lies behind it, column by column.
#[derive(Debug, Clone)]
pub struct Veil {
    /// What shines through: for luma, and for chroma.
    keep: [Vec<u16>; 2],
    /// What is added to luma, U and V, times `OPAQUE`.
    added: [Vec<u16>; 3],
}

impl Veil {
    /// A veil of one colour.
    ///
    /// # Errors
    /// More than everything shines through.
    pub fn new(keep: &[u16], colour: [u8; 3]) -> Result<Self, String> {
        if keep.iter().any(|&one| one > OPAQUE) {
            return Err("veil: expected shares to 256".to_owned());
        }
        let half: Vec<u16> = keep.iter().step_by(2).copied().collect();
        let hidden = |shares: &[u16], part: u8| {
            let part = u16::from(part);
            shares.iter().map(|one| (OPAQUE - one) * part).collect()
        };
        Ok(Self {
            added: [
                hidden(keep, colour[0]),
                hidden(&half, colour[1]),
                hidden(&half, colour[2]),
            ],
            keep: [keep.to_vec(), half],
        })
    }

    /// Number of columns.
    #[must_use]
    pub fn width(&self) -> usize {
        self.keep[0].len()
    }

    /// What shines through in some columns of a plane, and what is added.
    fn columns(&self, place: usize, first: usize, count: usize) -> (&[u16], &[u16]) {
        let first = if place == 0 { first } else { first / 2 };
        let part = first..first + count;
        (
            &self.keep[usize::from(place > 0)][part.clone()],
            &self.added[place][part],
        )
    }

    /// Lays its columns from an even one on over a frame.
    pub fn lay(&self, frame: &mut Frame<'_>, first: usize, rows: Rows) {
        dispatch!(Level::new(), _simd => self.cover(frame, first, rows));
    }

    #[inline(always)]
    fn cover(&self, frame: &mut Frame<'_>, first: usize, rows: Rows) {
        for (place, plane) in frame.planes.iter_mut().enumerate() {
            let (keep, added) = self.columns(place, first, plane.width);
            for line in lines(plane, place, rows) {
                for ((sample, keep), added) in line.iter_mut().zip(keep).zip(added) {
                    *sample = ((u16::from(*sample).wrapping_mul(*keep) + added) >> 8) as u8;
                }
            }
        }
    }
}

/// The rows of a plane that may be drawn on.
#[inline(always)]
fn lines<'a>(
    plane: &'a mut Plane<'_>,
    place: usize,
    rows: Rows,
) -> std::slice::ChunksExactMut<'a, u8> {
    let rows = rows.of_plane(if place == 0 { 1 } else { 2 });
    let part = rows.top as usize * plane.width..rows.bottom as usize * plane.width;
    plane.samples[part].chunks_exact_mut(plane.width)
}

/// A patch of light, at the resolution of chroma.
#[derive(Debug, Clone)]
pub struct Light {
    width: usize,
    power: Vec<u16>,
}

impl Light {
    /// A patch of so many columns.
    ///
    /// # Errors
    /// The rows are not whole, or it is brighter than day.
    pub fn new(width: usize, power: Vec<u16>) -> Result<Self, String> {
        if width == 0 || !power.len().is_multiple_of(width) || power.iter().any(|&one| one > OPAQUE)
        {
            return Err("light: expected whole rows of numbers to 256".to_owned());
        }
        Ok(Self { width, power })
    }
}

/// Darkness, and what lamps make of it, at the resolution of chroma.
#[derive(Debug)]
pub struct Night {
    width: usize,
    light: Vec<u16>,
    rows: Rows,
}

impl Night {
    /// Night over some rows of a frame `width` wide, with no light but the moon's.
    #[must_use]
    pub fn new(width: usize, rows: Rows, moonlight: u16) -> Self {
        let (width, height) = (width / 2, (rows.bottom - rows.top) as usize / 2);
        Self {
            width,
            light: vec![moonlight; width * height],
            rows,
        }
    }

    /// Adds a light, its left upper corner at a place of the frame's chroma.
    pub fn shine(&mut self, light: &Light, x: i32, y: i32) {
        let top = self.rows.top / 2;
        let height = light.power.len() / light.width;
        let Some(columns) = common(x, light.width, 0, self.width as i32) else {
            return;
        };
        let Some(lines) = common(y, height, top, self.rows.bottom / 2) else {
            return;
        };
        for line in lines {
            let to = (line - top) as usize * self.width;
            let from = (line - y) as usize * light.width + (columns.start - x) as usize;
            let part = to + columns.start as usize..to + columns.end as usize;
            for (sum, power) in self.light[part].iter_mut().zip(&light.power[from..]) {
                *sum = (*sum + power).min(OPAQUE);
            }
        }
    }

    /// Darkens a frame where no light falls, and lays the columns of a veil over it from one on.
    pub fn lay(&self, frame: &mut Frame<'_>, veil: Option<(&Veil, usize)>) {
        dispatch!(Level::new(), _simd => self.darken(frame, veil));
    }

    #[inline(always)]
    fn darken(&self, frame: &mut Frame<'_>, veil: Option<(&Veil, usize)>) {
        let mut twice = vec![0; 2 * self.width];
        for (place, plane) in frame.planes.iter_mut().enumerate() {
            let through = veil.map(|(veil, first)| veil.columns(place, first, plane.width));
            let (shrink, grey) = if place == 0 { (2, 0) } else { (1, GREY) };
            for (row, line) in lines(plane, place, self.rows).enumerate() {
                let mut light = &self.light[row / shrink * self.width..][..self.width];
                if place == 0 {
                    if row % 2 == 0 {
                        doubled(&mut twice, light);
                    }
                    light = &twice;
                }
                match through {
                    Some((keep, added)) => dim_behind(line, light, grey, keep, added),
                    None => dim(line, light, grey),
                }
            }
        }
    }
}

/// Each number twice: two columns of luma to one of the light.
#[inline(always)]
fn doubled(twice: &mut [u16], once: &[u16]) {
    for (pair, &one) in twice.chunks_exact_mut(2).zip(once) {
        pair[0] = one;
        pair[1] = one;
    }
}

/// Darkens a row towards a grey.
#[inline(always)]
fn dim(line: &mut [u8], light: &[u16], grey: u16) {
    for (sample, &light) in line.iter_mut().zip(light) {
        let sum = u16::from(*sample)
            .wrapping_mul(light)
            .wrapping_add((OPAQUE - light).wrapping_mul(grey));
        *sample = (sum >> 8) as u8;
    }
}

/// The same, and lets what is left shine through a veil.
#[inline(always)]
fn dim_behind(line: &mut [u8], light: &[u16], grey: u16, through: &[u16], added: &[u16]) {
    for (((sample, &light), &through), &added) in line.iter_mut().zip(light).zip(through).zip(added)
    {
        let dark = ((OPAQUE - light).wrapping_mul(grey) >> 8).wrapping_mul(through);
        let sum = u16::from(*sample)
            .wrapping_mul(product(light, through))
            .wrapping_add(dark)
            .wrapping_add(added);
        *sample = (sum >> 8) as u8;
    }
}

/// A share of a share, both of `OPAQUE`.
#[inline(always)]
fn product(one: u16, other: u16) -> u16 {
    // 256 x 256 is one more than sixteen bits hold; so shifted, their upper half is what is wanted.
    ((u32::from(one << 4) * u32::from(other << 4)) >> 16) as u16
}

/// Falling rain: a picture that is black but for its streaks, as wide as the frame.
#[derive(Debug, Clone)]
pub struct Streaks(Vec<u8>);

impl Streaks {
    /// Rain from its luma, row after row.
    #[must_use]
    pub fn new(luma: Vec<u8>) -> Self {
        Self(luma)
    }

    /// Number of its pixels.
    #[must_use]
    pub(crate) fn len(&self) -> usize {
        self.0.len()
    }

    /// Draws it, from the first row on, where it is brighter than what is there.
    pub fn lay(&self, frame: &mut Frame<'_>, rows: Rows) {
        let plane = &mut frame.planes[0];
        let part = rows.top as usize * plane.width..rows.bottom as usize * plane.width;
        for (below, streak) in plane.samples[part].iter_mut().zip(&self.0) {
            *below = (*below).max(*streak);
        }
    }
}
