//! Binding of the sheets that pictures are painted on.

use std::sync::Arc;

use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use overtaking_pictures::{Colour, Ends, Sheet};
use pyo3::prelude::*;

use crate::pictures::{Sprite, Texture, Tile, bad};

/// Something to paint on.
#[pyclass]
pub struct Painting(Sheet);

#[pymethods]
impl Painting {
    #[new]
    fn new(x: Ends, y: Ends, scale: f64, fine: usize) -> PyResult<Self> {
        Sheet::new(x, y, scale, fine).map(Self).map_err(bad)
    }

    /// One colour everywhere.
    fn fill(&mut self, colour: Colour) {
        self.0.fill(colour);
    }

    /// A rectangle, with round corners if it has a radius.
    fn rect(
        &mut self,
        py: Python<'_>,
        x: Ends,
        y: Ends,
        colour: Colour,
        opacity: f64,
        radius: f64,
    ) {
        py.detach(|| self.0.rect(x, y, colour, opacity, radius));
    }

    /// The outline of a rectangle with round corners.
    fn frame(&mut self, py: Python<'_>, x: Ends, y: Ends, colour: Colour, line: f64, radius: f64) {
        py.detach(|| self.0.frame(x, y, colour, line, radius));
    }

    /// Light around a point.
    fn glow(
        &mut self,
        py: Python<'_>,
        place: (f64, f64),
        reach: f64,
        colour: Colour,
        strength: f64,
    ) {
        py.detach(|| self.0.glow(place, reach, colour, strength));
    }

    /// All that a rectangle passes over when it is moved.
    fn swept(
        &mut self,
        py: Python<'_>,
        x: Ends,
        y: Ends,
        reach: (f64, f64),
        colour: Colour,
        opacity: f64,
    ) {
        py.detach(|| self.0.swept(x, y, reach, colour, opacity));
    }

    /// A line through points.
    fn curve(
        &mut self,
        x: PyReadonlyArray1<'_, f32>,
        y: PyReadonlyArray1<'_, f32>,
        colour: Colour,
        line: f64,
        opacity: f64,
    ) -> PyResult<()> {
        let points = (x.as_slice()?, y.as_slice()?);
        self.0.curve(points, colour, line, opacity).map_err(bad)
    }

    /// A picture of one colour by the share of each texel that it covers.
    fn stamp(
        &mut self,
        luma: PyReadonlyArray2<'_, f32>,
        chroma: PyReadonlyArray2<'_, f32>,
        place: (i64, i64),
        colour: Colour,
    ) -> PyResult<()> {
        let (wide, half) = (luma.shape()[1], chroma.shape()[1]);
        let shares = [(luma.as_slice()?, wide), (chroma.as_slice()?, half)];
        self.0.stamp(shares, place, colour).map_err(bad)
    }

    /// The sheet as a sprite.
    fn sprite(&self) -> Sprite {
        Sprite(Arc::new(self.0.sprite()))
    }

    /// The sheet as a picture without opacity.
    fn tile(&self) -> Tile {
        Tile(Arc::new(self.0.tile()))
    }

    /// The sheet, to be put at any place and angle.
    fn texture(&self) -> PyResult<Texture> {
        Ok(Texture(Arc::new(self.0.texture().map_err(bad)?)))
    }
}
