//! Sprites taken from a painted sheet at any place and angle.
//!
//! A sheet has several texels to the pixel, each holding what a pixel centred there would show. What is
//! drawn is the texel below the middle of each pixel: places within a pixel cost no filter. All is
//! reckoned in integers, so that every machine takes the same texels.

use crate::frame::{Frame, PLANES, Plane, Rows};
use crate::sprite::{Raster, Sprite, mixed};

/// One in the fixed point of cosines, sines and texels.
pub const ONE: i64 = 1 << 16;

/// A painted sheet.
#[derive(Debug, Clone)]
pub struct Texture {
    sheet: Sprite,
    /// Where the sheet's origin is, from its left upper corner: half texels of luma.
    origin: (i64, i64),
    fine: i64,
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
    /// There are no texels to the pixel.
    pub fn new(sheet: Sprite, origin: (i64, i64), fine: i64) -> Result<Self, String> {
        if !(1..=64).contains(&fine) || origin.0.abs().max(origin.1.abs()) >= ONE {
            return Err("texture: expected 1 to 64 texels to a pixel, its origin near".to_owned());
        }
        Ok(Self {
            sheet,
            origin,
            fine,
        })
    }

    /// Puts the texels below the middles of pixels on a frame.
    pub fn blend(&self, frame: &mut Frame<'_>, place: Place, rows: Rows) {
        for (raster, (pixels, planes)) in self.sheet.rasters().iter().zip(PLANES) {
            let sampler = Sampler::new(self, raster, place, i64::from(pixels));
            let planes = &mut frame.planes[planes];
            sampler.draw(planes, rows.of_plane(pixels));
        }
    }
}

/// From the pixels of a plane to the texels of a raster.
struct Sampler<'a> {
    raster: &'a Raster,
    /// Half texels to a pixel.
    step: i64,
    /// Place of the origin in the plane, and in the raster [half texels].
    centre: (i64, i64),
    origin: (i64, i64),
    cosine: i64,
    sine: i64,
}

impl<'a> Sampler<'a> {
    fn new(texture: &Texture, raster: &'a Raster, place: Place, pixels: i64) -> Self {
        let half = |texels: i32| 2 * i64::from(texels) / pixels;
        Self {
            raster,
            step: 2 * texture.fine,
            centre: (half(place.x), half(place.y)),
            origin: (texture.origin.0 / pixels, texture.origin.1 / pixels),
            cosine: i64::from(place.cosine),
            sine: i64::from(place.sine),
        }
    }

    /// First pixel and the one after the last that the sheet may touch, in columns and in rows.
    fn reach(&self) -> [(i64, i64); 2] {
        let right = 2 * self.raster.width as i64 - self.origin.0;
        let down = 2 * self.raster.height as i64 - self.origin.1;
        let (mut low, mut high) = ([i64::MAX; 2], [i64::MIN; 2]);
        for x in [-self.origin.0, right] {
            for y in [-self.origin.1, down] {
                let along = (x * self.cosine + y * self.sine) / ONE + self.centre.0;
                let across = (y * self.cosine - x * self.sine) / ONE + self.centre.1;
                for (axis, value) in [along, across].into_iter().enumerate() {
                    low[axis] = low[axis].min(value);
                    high[axis] = high[axis].max(value);
                }
            }
        }
        [0, 1].map(|axis| {
            let first = low[axis].div_euclid(self.step);
            (first, high[axis].div_euclid(self.step) + 1)
        })
    }

    fn draw(&self, planes: &mut [Plane<'_>], rows: Rows) {
        let [columns, lines] = self.reach();
        let (first, last) = (columns.0.max(0), columns.1.min(planes[0].width as i64));
        let (top, bottom) = (
            lines.0.max(i64::from(rows.top)),
            lines.1.min(i64::from(rows.bottom)),
        );
        if first >= last {
            return;
        }
        for line in top..bottom {
            self.draw_row(planes, line, (first, last));
        }
    }

    fn draw_row(&self, planes: &mut [Plane<'_>], line: i64, (first, last): (i64, i64)) {
        // From the origin to the middle of the first pixel, in half texels.
        let right = first * self.step + self.step / 2 - self.centre.0;
        let down = line * self.step + self.step / 2 - self.centre.1;
        // Texels times `ONE`; the sums are half texels times `ONE`, so twice as many.
        let mut column = (right * self.cosine - down * self.sine + self.origin.0 * ONE) >> 1;
        let mut row = (right * self.sine + down * self.cosine + self.origin.1 * ONE) >> 1;
        let (forward, aside) = (self.step * self.cosine / 2, self.step * self.sine / 2);
        let (width, height) = (self.raster.width, self.raster.height);
        if self.cosine == ONE {
            self.draw_straight(planes, line, (first, last), (column >> 16, row >> 16));
            return;
        }
        for pixel in first as usize..last as usize {
            let (texel, texel_row) = ((column >> 16) as usize, (row >> 16) as usize);
            // Negative numbers are very large ones here.
            if texel < width && texel_row < height {
                self.draw_texel(planes, line as usize, pixel, texel_row * width + texel);
            }
            column += forward;
            row += aside;
        }
    }

    /// Draws a row of a sheet that is not turned: of one row of texels each so-and-so-many-th.
    fn draw_straight(
        &self,
        planes: &mut [Plane<'_>],
        line: i64,
        (first, last): (i64, i64),
        (texel, row): (i64, i64),
    ) {
        let (width, height) = (self.raster.width as i64, self.raster.height as i64);
        if !(0..height).contains(&row) {
            return;
        }
        let fine = self.step / 2;
        let skipped = ((fine - 1 - texel) / fine).max(0);
        let count = ((width - texel + fine - 1) / fine).min(last - first);
        let start = row * width + texel;
        for number in skipped..count {
            let pixel = (first + number) as usize;
            self.draw_texel(
                planes,
                line as usize,
                pixel,
                (start + number * fine) as usize,
            );
        }
    }

    #[inline]
    fn draw_texel(&self, planes: &mut [Plane<'_>], row: usize, pixel: usize, texel: usize) {
        let keep = self.raster.keep[texel];
        if keep == crate::OPAQUE {
            return;
        }
        for (colour, plane) in self.raster.colours.iter().zip(planes) {
            let below = &mut plane.samples[row * plane.width + pixel];
            *below = mixed(*below, colour[texel], keep);
        }
    }
}
