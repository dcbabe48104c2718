//! Binding of `overtaking-pictures`.

use numpy::{
    PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyReadwriteArrayDyn,
    PyUntypedArrayMethods,
};
use overtaking_pictures::{
    ITEM_LENGTH, KINDS, Light, Raster, Show, Sprite, Streaks, Texture, Tile, Veil,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::expect_length;

/// The frames of a film, as a list of what is on them.
#[pyclass]
pub struct Frames(Show);

fn bad(error: String) -> PyErr {
    PyValueError::new_err(error)
}

/// Keeps a picture and gives its number.
fn kept<T>(pictures: &mut Vec<T>, one: T) -> usize {
    pictures.push(one);
    pictures.len() - 1
}

fn raster(planes: &PyReadonlyArray3<'_, u16>) -> PyResult<Raster> {
    let (height, width) = (planes.shape()[1], planes.shape()[2]);
    Raster::new(width, height, planes.as_slice()?).map_err(bad)
}

fn made(luma: &PyReadonlyArray3<'_, u16>, chroma: &PyReadonlyArray3<'_, u16>) -> PyResult<Sprite> {
    Sprite::new(raster(luma)?, raster(chroma)?).map_err(bad)
}

#[pymethods]
impl Frames {
    #[new]
    fn new(width: usize, height: usize, moonlight: u16) -> PyResult<Self> {
        Show::new(width, height, moonlight).map(Self).map_err(bad)
    }

    fn add_tile(
        &mut self,
        luma: PyReadonlyArray2<'_, u8>,
        chroma: PyReadonlyArray3<'_, u8>,
    ) -> PyResult<usize> {
        let (height, width) = (luma.shape()[0], luma.shape()[1]);
        let tile = Tile::new(width, height, luma.as_slice()?, chroma.as_slice()?);
        Ok(kept(&mut self.0.pictures.tiles, tile.map_err(bad)?))
    }

    fn add_sprite(
        &mut self,
        luma: PyReadonlyArray3<'_, u16>,
        chroma: PyReadonlyArray3<'_, u16>,
    ) -> PyResult<usize> {
        Ok(kept(&mut self.0.pictures.sprites, made(&luma, &chroma)?))
    }

    fn add_texture(
        &mut self,
        luma: PyReadonlyArray3<'_, u16>,
        chroma: PyReadonlyArray3<'_, u16>,
        origin: (i64, i64),
        fine: i64,
    ) -> PyResult<usize> {
        let texture = Texture::new(made(&luma, &chroma)?, origin, fine);
        Ok(kept(&mut self.0.pictures.textures, texture.map_err(bad)?))
    }

    fn add_veil(&mut self, keep: PyReadonlyArray1<'_, u16>, colour: [u8; 3]) -> PyResult<usize> {
        let veil = Veil::new(keep.as_slice()?, colour);
        Ok(kept(&mut self.0.pictures.veils, veil.map_err(bad)?))
    }

    fn add_light(&mut self, power: PyReadonlyArray2<'_, u16>) -> PyResult<usize> {
        let light = Light::new(power.shape()[1], power.as_slice()?.to_vec());
        Ok(kept(&mut self.0.pictures.lights, light.map_err(bad)?))
    }

    fn add_streaks(&mut self, luma: PyReadonlyArray2<'_, u8>) -> PyResult<usize> {
        let streaks = Streaks::new(luma.as_slice()?.to_vec());
        Ok(kept(&mut self.0.pictures.streaks, streaks))
    }

    /// Say what is on all frames.
    fn play(
        &mut self,
        py: Python<'_>,
        items: PyReadonlyArray2<'_, i32>,
        ends: PyReadonlyArray1<'_, i64>,
    ) -> PyResult<()> {
        expect_length("an item", items.shape()[1], ITEM_LENGTH)?;
        let (items, ends) = (items.as_slice()?, ends.as_slice()?);
        py.detach(|| self.0.play(items, ends)).map_err(bad)
    }

    /// Draw a frame.
    fn draw(
        &self,
        py: Python<'_>,
        frame: usize,
        mut out: PyReadwriteArrayDyn<'_, u8>,
    ) -> PyResult<()> {
        if frame >= self.0.num_frames() {
            return Err(bad(format!("frame: there is no {frame}")));
        }
        expect_length("a frame", out.len(), self.0.num_samples())?;
        let samples = out.as_slice_mut()?;
        py.detach(|| self.0.draw(frame, samples));
        Ok(())
    }
}

/// What items may be, in the order of their numbers.
#[pyfunction]
pub fn item_kinds() -> Vec<&'static str> {
    KINDS.to_vec()
}
