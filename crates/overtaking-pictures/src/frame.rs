//! A frame in the encoder's own form, YUV 4:2:0: a plane of luma, and two of half its width and height.

/// One component of a frame.
pub struct Plane<'a> {
    /// Row after row.
    pub samples: &'a mut [u8],
    /// Samples to a row.
    pub width: usize,
}

impl Plane<'_> {
    /// Some columns of a row.
    pub(crate) fn row(&mut self, row: usize, first: usize, last: usize) -> &mut [u8] {
        let start = row * self.width;
        &mut self.samples[start + first..start + last]
    }
}

/// A picture that is drawn on.
pub struct Frame<'a> {
    /// Luma, and both chroma planes.
    pub planes: [Plane<'a>; 3],
}

impl<'a> Frame<'a> {
    /// Looks at the three planes, which lie one after another.
    ///
    /// # Panics
    /// The samples are not those of a frame of this size.
    #[must_use]
    pub fn new(samples: &'a mut [u8], width: usize, height: usize) -> Self {
        assert_eq!(samples.len(), width * height * 3 / 2, "samples of a frame");
        let (luma, chroma) = samples.split_at_mut(width * height);
        let (u, v) = chroma.split_at_mut(chroma.len() / 2);
        let half = width / 2;
        Self {
            planes: [(luma, width), (u, half), (v, half)]
                .map(|(samples, width)| Plane { samples, width }),
        }
    }
}

/// The rows of luma that may be drawn on; both even.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rows {
    /// First row.
    pub top: i32,
    /// Row after the last one.
    pub bottom: i32,
}

impl Rows {
    /// The same rows of a plane with `pixels` rows of luma to one of its own.
    pub(crate) fn of_plane(self, pixels: i32) -> Self {
        Self {
            top: self.top / pixels,
            bottom: self.bottom / pixels,
        }
    }
}

/// Luma, and U and V together: pixels to a sample, and which planes of a frame.
pub(crate) const PLANES: [(i32, std::ops::Range<usize>); 2] = [(1, 0..1), (2, 1..3)];
