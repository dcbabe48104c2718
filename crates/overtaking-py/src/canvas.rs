//! The frames of films: tiny-skia's pictures, and what is done to whole rows of them.
//!
//! Rows are copied, veiled, darkened and converted by plain loops over integers, compiled for the widest
//! vectors (`dispatch`): tiny-skia takes ten times as long, as it is compiled for the narrowest.

use std::ops::Range;

use fearless_simd::{Level, dispatch};
use numpy::{
    PyArray1, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArrayDyn,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use tiny_skia::{Color, Pixmap, Transform};

use crate::arrays::expect_length;
use crate::drawing::{Drawing, parsed};
use crate::spread::{expect_room, reserved};

/// Red, green, blue and opacity.
const BYTES: usize = 4;
/// Scale of shares, so that a division is a shift.
const WHOLE: u16 = 256;

/// An opaque picture.
#[pyclass]
pub struct Canvas(Pixmap);

impl Canvas {
    fn width(&self) -> usize {
        self.0.width() as usize
    }

    /// Some rows, each as bytes.
    fn rows(&mut self, rows: Range<usize>) -> PyResult<std::slice::ChunksExactMut<'_, u8>> {
        let size = self.width() * BYTES;
        let part = self
            .0
            .data_mut()
            .get_mut(rows.start * size..rows.end * size);
        let part =
            part.ok_or_else(|| PyValueError::new_err("rows: expected some of the canvas"))?;
        Ok(part.chunks_exact_mut(size))
    }
}

#[pymethods]
impl Canvas {
    /// A picture of one colour.
    #[new]
    fn new(width: u32, height: u32, colour: &str) -> PyResult<Self> {
        let [red, green, blue] = parsed(colour)?;
        expect_room(
            (width as usize)
                .saturating_mul(height as usize)
                .saturating_mul(BYTES),
        )?;
        let mut pixmap = Pixmap::new(width, height)
            .ok_or_else(|| PyValueError::new_err("canvas: expected a width and a height"))?;
        pixmap.fill(Color::from_rgba8(red, green, blue, 255));
        Ok(Self(pixmap))
    }

    /// Draws shapes with their origin at a place.
    #[pyo3(signature = (drawing, x = 0.0, y = 0.0))]
    fn draw(&mut self, drawing: &Drawing, x: f32, y: f32) {
        drawing.on(&mut self.0.as_mut(), Transform::from_translate(x, y));
    }

    /// Draws shapes one after the other, each with its origin at a place, turned anticlockwise; all scaled.
    fn draw_all(
        &mut self,
        py: Python<'_>,
        placed: Vec<(PyRef<'_, Drawing>, f32, f32, f32)>,
        scale: f32,
    ) {
        let each = |(_, x, y, angle): &(PyRef<'_, Drawing>, f32, f32, f32)| {
            // Rounded from double precision, so that libraries of mathematics agree.
            let (sine, cosine) = f64::from(*angle).sin_cos();
            let (along, across) = (scale * cosine as f32, scale * sine as f32);
            Transform::from_row(along, -across, across, along, *x, *y)
        };
        let transforms: Vec<Transform> = placed.iter().map(each).collect();
        let drawings: Vec<&Drawing> = placed.iter().map(|one| &*one.0).collect();
        py.detach(|| {
            for (drawing, transform) in drawings.into_iter().zip(transforms) {
                drawing.on(&mut self.0.as_mut(), transform);
            }
        });
    }

    /// Copies some columns of another picture, the first of them to column `x` and row `y`.
    fn paste(&mut self, other: &Self, x: usize, y: usize, columns: Range2) -> PyResult<()> {
        let (first, last) = columns;
        let height = other.0.height() as usize;
        if first > last || last > other.width() || x + last - first > self.width() {
            return Err(PyValueError::new_err(
                "columns: expected some of both pictures",
            ));
        }
        let lines = other.0.data().chunks_exact(other.width() * BYTES);
        for (line, from) in self.rows(y..y + height)?.zip(lines) {
            line[x * BYTES..(x + last - first) * BYTES]
                .copy_from_slice(&from[first * BYTES..last * BYTES]);
        }
        Ok(())
    }

    /// Hides some rows behind a colour, each column by its share of 256.
    fn veil(
        &mut self,
        py: Python<'_>,
        rows: Range2,
        hidden: PyReadonlyArray1<'_, u16>,
        colour: &str,
    ) -> PyResult<()> {
        let [red, green, blue] = parsed(colour)?;
        expect_length("veil", hidden.len(), self.width())?;
        let hidden = hidden.as_slice()?;
        let all = |of: fn(u16, u16) -> u16| -> Vec<u16> {
            let each = |&share: &u16| {
                let share = share.min(WHOLE);
                [red, green, blue, 255].map(|part| of(share, u16::from(part)))
            };
            hidden.iter().flat_map(each).collect()
        };
        let (kept, added) = (
            all(|share, _| WHOLE - share),
            all(|share, part| share * part),
        );
        let lines = self.rows(rows.0..rows.1)?;
        py.detach(
            || dispatch!(Level::new(), _simd => lines.for_each(|line| blend(line, &kept, &added))),
        );
        Ok(())
    }

    /// Darkens some rows where no light falls.
    ///
    /// Lights are pictures at half the resolution with their place on the rows; they add up.
    fn night(
        &mut self,
        py: Python<'_>,
        rows: Range2,
        moonlight: u8,
        lights: Vec<(PyReadonlyArray2<'_, u8>, i32, i32)>,
    ) -> PyResult<()> {
        let width = self.width() / 2;
        let mut lit = vec![moonlight; width * (rows.1.saturating_sub(rows.0)).div_ceil(2)];
        for (light, x, y) in &lights {
            shine(
                &mut lit,
                width,
                (light.as_slice()?, light.shape()[1]),
                (i64::from(*x), i64::from(*y)),
            );
        }
        let lines = self.rows(rows.0..rows.1)?;
        py.detach(|| dispatch!(Level::new(), _simd => darken(lines, &lit, width)));
        Ok(())
    }

    /// Red, green and blue, shape (height, width, 3).
    fn rgb<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<u8>>> {
        let pixels = self.0.data().chunks_exact(BYTES);
        let mut parts = reserved(3 * pixels.len())?;
        parts.extend(pixels.flat_map(|pixel| &pixel[..3]));
        PyArray1::from_vec(py, parts).reshape([self.0.height() as usize, self.width(), 3])
    }

    /// Writes the picture as the encoder takes it, YUV 4:2:0 (ITU-R BT.601-7, section 2.5).
    fn yuv(&self, py: Python<'_>, mut out: PyReadwriteArrayDyn<'_, u8>) -> PyResult<()> {
        expect_length("a frame", out.len(), self.0.data().len() / BYTES * 3 / 2)?;
        let (out, size) = (out.as_slice_mut()?, self.0.data().len() / BYTES);
        let (luma, chroma) = out.split_at_mut(size);
        py.detach(
            || dispatch!(Level::new(), _simd => convert(self.0.data(), self.width(), luma, chroma)),
        );
        Ok(())
    }
}

/// First number and the one after the last.
type Range2 = (usize, usize);

/// Keeps a share of a row and adds something.
#[inline(always)]
fn blend(line: &mut [u8], kept: &[u16], added: &[u16]) {
    for ((sample, kept), added) in line.iter_mut().zip(kept).zip(added) {
        *sample = ((u16::from(*sample).wrapping_mul(*kept).wrapping_add(*added)) >> 8) as u8;
    }
}

/// Adds a light to what falls on some rows; what lies outside is cut off.
fn shine(lit: &mut [u8], width: usize, (light, columns): (&[u8], usize), (x, y): (i64, i64)) {
    let columns = columns.max(1);
    let first = x.clamp(0, width as i64);
    let last = (x + columns as i64).clamp(first, width as i64);
    for (row, line) in (y..).zip(light.chunks_exact(columns)) {
        let start = row * width as i64;
        let end = (start + last) as usize;
        if row >= 0 && first < last && end <= lit.len() {
            let from = &line[(first - x) as usize..];
            for (sum, one) in lit[(start + first) as usize..end].iter_mut().zip(from) {
                *sum = sum.saturating_add(*one);
            }
        }
    }
}

/// Lets the light of a pixel fall on two times two.
#[inline(always)]
fn darken(lines: std::slice::ChunksExactMut<'_, u8>, lit: &[u8], width: usize) {
    let mut kept = vec![WHOLE; 2 * width * BYTES];
    for (row, line) in lines.enumerate() {
        if row % 2 == 0 {
            let pairs = kept.chunks_exact_mut(2 * BYTES);
            for (pair, &light) in pairs.zip(&lit[row / 2 * width..]) {
                let light = u16::from(light) + u16::from(light >> 7);
                pair.copy_from_slice(&[light, light, light, WHOLE, light, light, light, WHOLE]);
            }
        }
        for (sample, kept) in line.iter_mut().zip(&kept) {
            *sample = (u16::from(*sample).wrapping_mul(*kept) >> 8) as u8;
        }
    }
}

/// Luma of each pixel, and chroma of two times two.
#[inline(always)]
fn convert(data: &[u8], width: usize, luma: &mut [u8], chroma: &mut [u8]) {
    for (pixel, y) in data.chunks_exact(BYTES).zip(luma) {
        let [red, green, blue] = [0, 1, 2].map(|part| u16::from(pixel[part]));
        *y = ((66 * red + 129 * green + 25 * blue + 128) >> 8) as u8 + 16;
    }
    let (u, v) = chroma.split_at_mut(chroma.len() / 2);
    let pairs = data.chunks_exact(2 * width * BYTES);
    let planes = u
        .chunks_exact_mut(width / 2)
        .zip(v.chunks_exact_mut(width / 2));
    for (two, (u, v)) in pairs.zip(planes) {
        let (upper, lower) = two.split_at(width * BYTES);
        let squares = upper
            .chunks_exact(2 * BYTES)
            .zip(lower.chunks_exact(2 * BYTES));
        for ((up, down), (u, v)) in squares.zip(u.iter_mut().zip(v)) {
            let [red, green, blue] = [0, 1, 2].map(|part| {
                let sum = [up[part], up[part + BYTES], down[part], down[part + BYTES]];
                (sum.into_iter().map(i16::from).sum::<i16>() + 2) >> 2
            });
            *u = (((112 * blue - 74 * green - 38 * red + 128) >> 8) + 128) as u8;
            *v = (((112 * red - 94 * green - 18 * blue + 128) >> 8) + 128) as u8;
        }
    }
}
