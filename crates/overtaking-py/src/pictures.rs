//! Binding of `overtaking-pictures`: pictures, and the frames that show them.

use std::sync::Arc;

use numpy::{
    PyArray1, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3,
    PyReadwriteArrayDyn, PyUntypedArrayMethods,
};
use overtaking_pictures as pictures;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::expect_length;

/// A refusal as Python knows it.
pub fn bad(error: String) -> PyErr {
    PyValueError::new_err(error)
}

/// A picture without opacity.
#[pyclass(frozen)]
pub struct Tile(pub Arc<pictures::Tile>);

#[pymethods]
impl Tile {
    #[new]
    fn new(luma: PyReadonlyArray2<'_, u8>, chroma: PyReadonlyArray3<'_, u8>) -> PyResult<Self> {
        let (height, width) = (luma.shape()[0], luma.shape()[1]);
        let tile = pictures::Tile::new(width, height, luma.as_slice()?, chroma.as_slice()?);
        Ok(Self(Arc::new(tile.map_err(bad)?)))
    }

    /// Width and height.
    #[getter]
    fn size(&self) -> (usize, usize) {
        self.0.size()
    }
}

/// A picture with opacity.
#[pyclass(frozen)]
pub struct Sprite(pub Arc<pictures::Sprite>);

fn raster(planes: &PyReadonlyArray3<'_, u16>) -> PyResult<pictures::Raster> {
    let (height, width) = (planes.shape()[1], planes.shape()[2]);
    pictures::Raster::new(width, height, planes.as_slice()?).map_err(bad)
}

type Planes<'py> = Bound<'py, PyArray3<u16>>;

#[pymethods]
impl Sprite {
    #[new]
    fn new(luma: PyReadonlyArray3<'_, u16>, chroma: PyReadonlyArray3<'_, u16>) -> PyResult<Self> {
        let sprite = pictures::Sprite::new(raster(&luma)?, raster(&chroma)?);
        Ok(Self(Arc::new(sprite.map_err(bad)?)))
    }

    /// Width and height.
    #[getter]
    fn size(&self) -> (usize, usize) {
        self.0.size()
    }

    /// Luma and chroma, as they were given.
    fn planes<'py>(&self, py: Python<'py>) -> PyResult<(Planes<'py>, Planes<'py>)> {
        let array = |raster: &pictures::Raster| {
            let (width, height) = raster.size();
            let planes: Vec<u16> = raster.planes().flatten().copied().collect();
            let count = planes.len() / (width * height);
            PyArray1::from_vec(py, planes).reshape([count, height, width])
        };
        let [luma, chroma] = self.0.rasters();
        Ok((array(luma)?, array(chroma)?))
    }
}

/// A sheet that is drawn at any place and angle.
#[pyclass(frozen)]
pub struct Texture(pub Arc<pictures::Texture>);

#[pymethods]
impl Texture {
    /// Width in texels.
    #[getter]
    fn width(&self) -> usize {
        self.0.width()
    }

    /// Texels to a pixel.
    #[getter]
    fn fine(&self) -> i64 {
        self.0.fine()
    }
}

/// Fog or glare.
#[pyclass(frozen)]
pub struct Veil(Arc<pictures::Veil>);

#[pymethods]
impl Veil {
    #[new]
    fn new(keep: PyReadonlyArray1<'_, u16>, colour: [u8; 3]) -> PyResult<Self> {
        let veil = pictures::Veil::new(keep.as_slice()?, colour);
        Ok(Self(Arc::new(veil.map_err(bad)?)))
    }
}

/// A patch of light.
#[pyclass(frozen)]
pub struct Light(Arc<pictures::Light>);

#[pymethods]
impl Light {
    #[new]
    fn new(power: PyReadonlyArray2<'_, u16>) -> PyResult<Self> {
        let light = pictures::Light::new(power.shape()[1], power.as_slice()?.to_vec());
        Ok(Self(Arc::new(light.map_err(bad)?)))
    }
}

/// Falling rain.
#[pyclass(frozen)]
pub struct Streaks(Arc<pictures::Streaks>);

#[pymethods]
impl Streaks {
    #[new]
    fn new(luma: PyReadonlyArray2<'_, u8>) -> PyResult<Self> {
        let luma = luma.as_slice()?.to_vec();
        Ok(Self(Arc::new(pictures::Streaks::new(luma))))
    }
}

/// Anything that a frame may show.
#[derive(FromPyObject)]
enum Picture<'py> {
    Tile(PyRef<'py, Tile>),
    Sprite(PyRef<'py, Sprite>),
    Texture(PyRef<'py, Texture>),
    Veil(PyRef<'py, Veil>),
    Light(PyRef<'py, Light>),
    Streaks(PyRef<'py, Streaks>),
}

/// Keeps a picture and gives its number.
fn kept<T>(pictures: &mut Vec<Arc<T>>, one: &Arc<T>) -> usize {
    pictures.push(Arc::clone(one));
    pictures.len() - 1
}

/// The frames of a film, as a list of what is on them.
#[pyclass]
pub struct Frames(pictures::Show);

#[pymethods]
impl Frames {
    #[new]
    fn new(width: usize, height: usize, moonlight: u16) -> PyResult<Self> {
        pictures::Show::new(width, height, moonlight)
            .map(Self)
            .map_err(bad)
    }

    /// Keep a picture and give its number among those of its kind.
    fn add(&mut self, picture: Picture<'_>) -> usize {
        let all = &mut self.0.pictures;
        match picture {
            Picture::Tile(one) => kept(&mut all.tiles, &one.0),
            Picture::Sprite(one) => kept(&mut all.sprites, &one.0),
            Picture::Texture(one) => kept(&mut all.textures, &one.0),
            Picture::Veil(one) => kept(&mut all.veils, &one.0),
            Picture::Light(one) => kept(&mut all.lights, &one.0),
            Picture::Streaks(one) => kept(&mut all.streaks, &one.0),
        }
    }

    /// Say what is on all frames.
    fn play(
        &mut self,
        py: Python<'_>,
        items: PyReadonlyArray2<'_, i32>,
        ends: PyReadonlyArray1<'_, i64>,
    ) -> PyResult<()> {
        expect_length("an item", items.shape()[1], pictures::ITEM_LENGTH)?;
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
    pictures::KINDS.to_vec()
}
