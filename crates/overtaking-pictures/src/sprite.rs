//! Small pictures that are put on a frame: with opacity (`Sprite`) and without (`Tile`).

use crate::frame::{Frame, PLANES, Plane, Rows};

/// Scale of opacity, so that a division is a shift.
pub const OPAQUE: u16 = 256;

/// One or two components of a picture with one opacity.
#[derive(Debug, Clone)]
pub struct Raster {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Each component times opacity.
    pub(crate) colours: Vec<Vec<u16>>,
    /// What shines through, of `OPAQUE`.
    pub(crate) keep: Vec<u16>,
}

impl Raster {
    /// Width and height.
    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Each component times opacity, and what shines through.
    pub fn planes(&self) -> impl Iterator<Item = &[u16]> {
        let planes = self.colours.iter().chain(std::iter::once(&self.keep));
        planes.map(Vec::as_slice)
    }

    /// A raster from its planes: the components, and what shines through.
    ///
    /// # Errors
    /// There are other numbers than `width * height` for each of some planes, or one is too large.
    pub fn new(width: usize, height: usize, planes: &[u16]) -> Result<Self, String> {
        let size = width * height;
        if size == 0 || !planes.len().is_multiple_of(size) || planes.len() / size < 2 {
            return Err(format!("raster: expected planes of {size} numbers"));
        }
        let (colours, keep) = planes.split_at(planes.len() - size);
        if colours.iter().any(|&one| one > 255) || keep.iter().any(|&one| one > OPAQUE) {
            return Err("raster: expected colours to 255 and opacity to 256".to_owned());
        }
        Ok(Self {
            width,
            height,
            colours: colours.chunks_exact(size).map(<[u16]>::to_vec).collect(),
            keep: keep.to_vec(),
        })
    }
}

/// A picture with opacity: luma, and chroma at half the resolution.
#[derive(Debug, Clone)]
pub struct Sprite([Raster; 2]);

impl Sprite {
    /// A sprite.
    ///
    /// # Errors
    /// Chroma is not half as wide and high as luma, or has not two components.
    pub fn new(luma: Raster, chroma: Raster) -> Result<Self, String> {
        let is_half = luma.width == 2 * chroma.width && luma.height == 2 * chroma.height;
        if !is_half || luma.colours.len() != 1 || chroma.colours.len() != 2 {
            return Err("sprite: expected luma, and two components of half its size".to_owned());
        }
        Ok(Self([luma, chroma]))
    }

    /// A sprite of rasters that fit together.
    pub(crate) fn of(rasters: [Raster; 2]) -> Self {
        Self(rasters)
    }

    /// Width and height.
    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        (self.0[0].width, self.0[0].height)
    }

    /// Luma, and chroma at half the resolution.
    #[must_use]
    pub fn rasters(&self) -> &[Raster; 2] {
        &self.0
    }

    /// Puts it on a frame; what lies outside is cut off. Column and row are even.
    pub fn blend(&self, frame: &mut Frame<'_>, x: i32, y: i32, rows: Rows) {
        for (raster, (pixels, planes)) in self.0.iter().zip(PLANES) {
            for (colour, plane) in raster.colours.iter().zip(&mut frame.planes[planes]) {
                raster.over(
                    colour,
                    plane,
                    (x / pixels, y / pixels),
                    rows.of_plane(pixels),
                );
            }
        }
    }
}

impl Raster {
    fn over(&self, colour: &[u16], plane: &mut Plane<'_>, (x, y): (i32, i32), rows: Rows) {
        let Some(columns) = common(x, self.width, 0, plane.width as i32) else {
            return;
        };
        let Some(lines) = common(y, self.height, rows.top, rows.bottom) else {
            return;
        };
        let from = (columns.start - x) as usize;
        let count = columns.len();
        for line in lines {
            let start = (line - y) as usize * self.width + from;
            let part = start..start + count;
            let below = plane.row(line as usize, columns.start as usize, columns.end as usize);
            mix(below, &colour[part.clone()], &self.keep[part]);
        }
    }
}

/// What two stretches have in common: one of some length from a place on, and one between two ends.
pub(crate) fn common(
    first: i32,
    length: usize,
    low: i32,
    high: i32,
) -> Option<std::ops::Range<i32>> {
    let (start, end) = (first.max(low), (first + length as i32).min(high));
    (start < end).then_some(start..end)
}

/// Lets a share of what is below shine through, and adds a colour.
pub(crate) fn mix(below: &mut [u8], colour: &[u16], keep: &[u16]) {
    for ((below, colour), keep) in below.iter_mut().zip(colour).zip(keep) {
        *below = mixed(*below, *colour, *keep);
    }
}

/// One sample of `mix`.
pub(crate) fn mixed(below: u8, colour: u16, keep: u16) -> u8 {
    ((u16::from(below).wrapping_mul(keep) >> 8) + colour).min(255) as u8
}

/// A picture without opacity.
#[derive(Debug, Clone)]
pub struct Tile {
    width: usize,
    height: usize,
    /// Luma, U and V.
    planes: [Vec<u8>; 3],
}

impl Tile {
    /// A tile of even width and height.
    ///
    /// # Errors
    /// The planes have not this size.
    pub fn new(width: usize, height: usize, luma: &[u8], chroma: &[u8]) -> Result<Self, String> {
        let size = width * height;
        if luma.len() != size || chroma.len() != size / 2 || width % 2 + height % 2 > 0 {
            return Err(format!("tile: expected planes of {width} x {height}"));
        }
        let (u, v) = chroma.split_at(size / 4);
        Ok(Self {
            width,
            height,
            planes: [luma, u, v].map(<[u8]>::to_vec),
        })
    }

    /// A sprite that nothing shines through.
    #[must_use]
    pub fn of(sprite: &Sprite) -> Self {
        let (width, height) = sprite.size();
        let [luma, chroma] = sprite.rasters();
        let bytes = |plane: &Vec<u16>| plane.iter().map(|&one| one as u8).collect();
        Self {
            width,
            height,
            planes: [&luma.colours[0], &chroma.colours[0], &chroma.colours[1]].map(bytes),
        }
    }

    /// Width and height.
    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Copies `count` columns from `first` on to a place that is wholly inside; all numbers even.
    pub fn paste(&self, frame: &mut Frame<'_>, x: usize, y: usize, first: usize, count: usize) {
        for (place, plane) in frame.planes.iter_mut().enumerate() {
            let pixels = if place == 0 { 1 } else { 2 };
            let (x, first, count) = (x / pixels, first / pixels, count / pixels);
            let lines = self.planes[place].chunks_exact(self.width / pixels);
            for (row, line) in lines.enumerate() {
                plane
                    .row(y / pixels + row, x, x + count)
                    .copy_from_slice(&line[first..first + count]);
            }
        }
    }
}
