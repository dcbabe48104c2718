//! Pictures of several texels to the pixel, put on a frame at any place and angle.
//!
//! Each texel holds what a pixel centred there would show. What is drawn is the texel below the middle
//! of each pixel: places within a pixel cost no filter. All is reckoned in integers, so that every
//! machine takes the same texels.

use std::ops::Range;

use crate::frame::{Frame, PLANES, Plane, Rows};
use crate::sprite::{OPAQUE, Raster, Sprite, mix, mixed};

/// One in the fixed point of cosines, sines and texels.
pub const ONE: i64 = 1 << 16;

/// A painted sheet.
#[derive(Debug, Clone)]
pub struct Texture {
    width: usize,
    fine: i64,
    /// Luma, and chroma at half the resolution.
    patches: [Patch; 2],
}

/// Where a texture is put and how it is turned.
#[derive(Debug, Clone, Copy)]
pub struct Place {
    /// Column of its origin [texels of luma].
    pub x: i32,
    /// Row of its origin [texels of luma].
    pub y: i32,
    /// Cosine of its angle, anticlockwise, times `ONE`.
    pub cosine: i32,
    /// Sine times `ONE`.
    pub sine: i32,
}

impl Texture {
    /// A texture of `fine` texels to the pixel, its origin so many half texels from its corner.
    ///
    /// # Errors
    /// The texels to the pixel are no power of two, or its origin is far away.
    pub fn new(sheet: &Sprite, origin: (i64, i64), fine: i64) -> Result<Self, String> {
        let is_near = origin.0.abs().max(origin.1.abs()) < ONE;
        if !matches!(fine, 1 | 2 | 4 | 8) || !is_near {
            return Err("texture: expected 1, 2, 4 or 8 texels to a pixel, its origin near".into());
        }
        let [luma, chroma] = sheet.rasters();
        Ok(Self {
            width: sheet.size().0,
            fine,
            patches: [
                Patch::new(luma, origin, fine),
                Patch::new(chroma, (origin.0 / 2, origin.1 / 2), fine),
            ],
        })
    }

    /// Width [texels of luma].
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Texels to a pixel.
    #[must_use]
    pub fn fine(&self) -> i64 {
        self.fine
    }

    /// Puts the texels below the middles of pixels on a frame.
    pub fn blend(&self, frame: &mut Frame<'_>, place: Place, rows: Rows) {
        for (patch, (pixels, planes)) in self.patches.iter().zip(PLANES) {
            let sampler = Sampler::new(patch, self.fine, place, i64::from(pixels));
            let planes = &mut frame.planes[planes];
            sampler.draw(planes, rows.of_plane(pixels));
        }
    }
}

/// The part of a raster that is not wholly transparent, as pictures of one texel to the pixel: `fine` times
/// `fine` of them, one after another, each of what is seen if it lies so many texels farther left and up. A
/// sheet that is not turned is drawn from one of them alone, row after row.
#[derive(Debug, Clone)]
struct Patch {
    colours: Vec<Vec<u16>>,
    keep: Vec<u16>,
    /// Texels in x and in y.
    width: usize,
    height: usize,
    /// Columns and rows of each picture.
    columns: usize,
    rows: usize,
    /// Place of the origin, from the left upper corner [half texels].
    origin: (i64, i64),
}

impl Patch {
    fn new(raster: &Raster, origin: (i64, i64), fine: i64) -> Self {
        let (columns, rows) = covered(raster);
        let fine = fine as usize;
        let (across, down) = (columns.len().div_ceil(fine), rows.len().div_ceil(fine));
        let ordered = |plane: &[u16], empty: u16| {
            let mut all = vec![empty; fine * fine * across * down];
            for (row, line) in rows.clone().enumerate() {
                let from = &plane[line * raster.width..][columns.clone()];
                for phase in 0..fine.min(from.len()) {
                    let picture = row % fine * fine + phase;
                    let to = &mut all[(picture * down + row / fine) * across..][..across];
                    for (to, pixel) in to.iter_mut().zip(from[phase..].chunks(fine)) {
                        *to = pixel[0];
                    }
                }
            }
            all
        };
        let corner = (2 * columns.start as i64, 2 * rows.start as i64);
        Self {
            colours: raster.colours.iter().map(|one| ordered(one, 0)).collect(),
            keep: ordered(&raster.keep, OPAQUE),
            width: columns.len(),
            height: rows.len(),
            columns: across,
            rows: down,
            origin: (origin.0 - corner.0, origin.1 - corner.1),
        }
    }

    /// Number of a texel by its column and row, of two to the power of `shift` to the pixel.
    #[inline]
    fn texel(&self, column: usize, row: usize, shift: u32) -> usize {
        let among = (1 << shift) - 1;
        let picture = ((row & among) << shift) + (column & among);
        (picture * self.rows + (row >> shift)) * self.columns + (column >> shift)
    }
}

/// The smallest columns and rows of a raster outside of which nothing can be seen.
fn covered(raster: &Raster) -> (Range<usize>, Range<usize>) {
    let is_seen = |keep: &u16| *keep != OPAQUE;
    let (mut left, mut right) = (raster.width, 0);
    let (mut top, mut bottom) = (raster.height, 0);
    for (row, line) in raster.keep.chunks_exact(raster.width).enumerate() {
        let Some(first) = line.iter().position(is_seen) else {
            continue;
        };
        let last = line.iter().rposition(is_seen).unwrap_or(first);
        (left, right) = (left.min(first), right.max(last + 1));
        (top, bottom) = (top.min(row), row + 1);
    }
    (left.min(right)..right, top.min(bottom)..bottom)
}

/// From the pixels of a plane to the texels of a patch.
struct Sampler<'a> {
    patch: &'a Patch,
    /// Half texels to a pixel.
    step: i64,
    /// Place of the origin in the plane [half texels].
    centre: (i64, i64),
    cosine: i64,
    sine: i64,
}

impl<'a> Sampler<'a> {
    fn new(patch: &'a Patch, fine: i64, place: Place, pixels: i64) -> Self {
        let half = |texels: i32| 2 * i64::from(texels) / pixels;
        Self {
            patch,
            step: 2 * fine,
            centre: (half(place.x), half(place.y)),
            cosine: i64::from(place.cosine),
            sine: i64::from(place.sine),
        }
    }

    /// First row of pixels and the one after the last that the patch may touch.
    fn reach(&self) -> (i64, i64) {
        let origin = self.patch.origin;
        let right = 2 * self.patch.width as i64 - origin.0;
        let down = 2 * self.patch.height as i64 - origin.1;
        let (mut low, mut high) = (i64::MAX, i64::MIN);
        for x in [-origin.0, right] {
            for y in [-origin.1, down] {
                let across = (y * self.cosine - x * self.sine) / ONE + self.centre.1;
                (low, high) = (low.min(across), high.max(across));
            }
        }
        (
            low.div_euclid(self.step) - 1,
            high.div_euclid(self.step) + 2,
        )
    }

    fn draw(&self, planes: &mut [Plane<'_>], rows: Rows) {
        if self.patch.width == 0 {
            return;
        }
        let (top, bottom) = self.reach();
        let bottom = bottom.min(i64::from(rows.bottom));
        for line in top.max(i64::from(rows.top))..bottom {
            self.draw_row(planes, line);
        }
    }

    fn draw_row(&self, planes: &mut [Plane<'_>], line: i64) {
        // From the origin to the middle of the first pixel of the row, in half texels.
        let right = self.step / 2 - self.centre.0;
        let down = line * self.step + self.step / 2 - self.centre.1;
        // Texels times `ONE`; the sums are half texels times `ONE`, so twice as many.
        let origin = self.patch.origin;
        let column = (right * self.cosine - down * self.sine + origin.0 * ONE) >> 1;
        let row = (right * self.sine + down * self.cosine + origin.1 * ONE) >> 1;
        let walk = Walk {
            at: (column, row),
            step: (self.step * self.cosine / 2, self.step * self.sine / 2),
            fine: self.step / 2,
        };
        let pixels = walk.pixels(self.patch, planes[0].width);
        if pixels.is_empty() {
            return;
        }
        for (colour, plane) in self.patch.colours.iter().zip(planes) {
            let below = plane.row(line as usize, pixels.start, pixels.end);
            if self.cosine == ONE && self.sine == 0 {
                let start = walk.texel(pixels.start as i64, self.patch);
                let part = start..start + below.len();
                mix(below, &colour[part.clone()], &self.patch.keep[part]);
            } else {
                walk.draw(below, pixels.start as i64, self.patch, colour);
            }
        }
    }
}

/// The places of the pixels of a row in a patch, from the first pixel of the row on.
struct Walk {
    /// Column and row of texels, times `ONE`.
    at: (i64, i64),
    /// From one pixel to the next.
    step: (i64, i64),
    fine: i64,
}

impl Walk {
    /// The pixels, of so many in the row, that lie on the patch.
    fn pixels(&self, patch: &Patch, width: usize) -> Range<usize> {
        let across = within(self.at.0, self.step.0, patch.width as i64 * ONE);
        let down = within(self.at.1, self.step.1, patch.height as i64 * ONE);
        let first = across.start.max(down.start).max(0);
        let last = across.end.min(down.end).min(width as i64);
        first as usize..last.max(first) as usize
    }

    /// Number of the texel below a pixel that lies on the patch.
    fn texel(&self, pixel: i64, patch: &Patch) -> usize {
        let column = (self.at.0 + pixel * self.step.0) >> 16;
        let row = (self.at.1 + pixel * self.step.1) >> 16;
        patch.texel(column as usize, row as usize, self.fine.trailing_zeros())
    }

    /// Draws what lies below some pixels from one on.
    fn draw(&self, below: &mut [u8], first: i64, patch: &Patch, colour: &[u16]) {
        let (mut column, mut row) = (
            self.at.0 + first * self.step.0,
            self.at.1 + first * self.step.1,
        );
        let shift = self.fine.trailing_zeros();
        for sample in below {
            // Neither is negative here.
            let at = patch.texel((column >> 16) as usize, (row >> 16) as usize, shift);
            let keep = patch.keep[at];
            if keep != OPAQUE {
                *sample = mixed(*sample, colour[at], keep);
            }
            column += self.step.0;
            row += self.step.1;
        }
    }
}

/// The numbers of steps after which something that began at a place lies from 0 to below an end.
fn within(start: i64, step: i64, end: i64) -> Range<i64> {
    match step {
        0 if (0..end).contains(&start) => i64::MIN..i64::MAX,
        0 => 0..0,
        // The first number for which `start + number * step` has come to a value: a quotient, rounded up.
        1.. => {
            let reached = |value: i64| -(start - value).div_euclid(step);
            reached(0)..reached(end)
        }
        _ => {
            let back = within(end - 1 - start, -step, end);
            back.start..back.end
        }
    }
}
