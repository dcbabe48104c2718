//! Pictures of films: shapes drawn by tiny-skia, and fast operations on whole rows of pixels.
//!
//! `overtaking.show.video` draws each picture of a film on a `Canvas`: it copies the road, adds `Drawing`s of vehicles,
//! blends fog, darkens the night and converts the picture for the encoder. Copying, blending, darkening and conversion
//! are plain loops over integers. `dispatch` compiles each loop for vectors of all widths and runs the variant for the
//! widest vectors of the CPU. The compiler vectorizes the loops, so the argument `_simd` is not used. tiny-skia would
//! take ten times as long, because it is compiled for the narrowest vectors.

use std::ops::Range;

use fearless_simd::{Level, dispatch};
use numpy::{
    PyArray1, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArrayDyn,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use tiny_skia::{
    Color, FillRule, FilterQuality, GradientStop, Paint, Path, PathBuilder, Pixmap, PixmapMut,
    PixmapPaint, Point, RadialGradient, Rect, Shader, SpreadMode, Stroke, Transform,
};

use crate::inputs::expect_length;
use crate::spread::{expect_memory, reserve};

/// Number of bytes of a pixel: red, green, blue and opacity.
const PIXEL_BYTES: usize = 4;
/// The share 1 in integer arithmetic: a power of two, so that a division is a shift.
const WHOLE: u16 = 256;

/// An opaque picture.
///
/// `rows` are a pair: the first row and the row after the last. Rows or columns beyond the edges
/// of the picture raise `ValueError`, and so does an odd width in `darken`, or an odd width or
/// height in `write_yuv`.
#[pyclass]
pub struct Canvas(Pixmap);

impl Canvas {
    /// Number of columns.
    fn width(&self) -> usize {
        self.0.width() as usize
    }

    /// The bytes of some rows, row by row; an error if the canvas does not have them.
    fn rows(&mut self, rows: Range<usize>) -> PyResult<std::slice::ChunksExactMut<'_, u8>> {
        let size = self.width() * PIXEL_BYTES;
        // This check precedes the multiplication, which would overflow for a row far beyond the picture.
        if rows.start > rows.end || rows.end > self.0.height() as usize {
            return Err(PyValueError::new_err("rows: expected some of the canvas"));
        }
        let bytes = &mut self.0.data_mut()[rows.start * size..rows.end * size];
        Ok(bytes.chunks_exact_mut(size))
    }
}

#[pymethods]
impl Canvas {
    /// Make a picture of one colour.
    ///
    /// Raises:
    ///     SystemLimitError: The system grants too little memory.
    ///     ValueError: Width or height is 0, or the colour is invalid.
    #[new]
    #[pyo3(signature = (width: "int", height: "int", colour: "str"))]
    fn new(width: u32, height: u32, colour: &str) -> PyResult<Self> {
        let [red, green, blue] = parse_colour(colour)?;
        expect_memory(
            (width as usize)
                .saturating_mul(height as usize)
                .saturating_mul(PIXEL_BYTES),
        )?;
        let mut pixmap = Pixmap::new(width, height)
            .ok_or_else(|| PyValueError::new_err("canvas: expected a width and a height"))?;
        pixmap.fill(Color::from_rgba8(red, green, blue, 255));
        Ok(Self(pixmap))
    }

    /// Draw shapes with their origin at a column and a row, clipped to the picture.
    #[pyo3(signature = (drawing: "Drawing", x: "float" = 0.0, y: "float" = 0.0) -> "None")]
    fn draw(&mut self, drawing: &Drawing, x: f32, y: f32) {
        drawing.draw_on(&mut self.0.as_mut(), Transform::from_translate(x, y));
    }

    /// Draw shapes one after the other, clipped to the picture, without Python's lock.
    ///
    /// Args:
    ///     placed: Drawings, each with the column and the row of its origin and the angle by
    ///         which it is turned anticlockwise [rad].
    ///     scale: Number of pixels per unit of the shapes.
    #[pyo3(signature = (
        placed: "Sequence[tuple[Drawing, float, float, float]]",
        scale: "float",
    ) -> "None")]
    fn draw_placed(
        &mut self,
        py: Python<'_>,
        placed: Vec<(PyRef<'_, Drawing>, f32, f32, f32)>,
        scale: f32,
    ) {
        let placement = |(_, x, y, angle): &(PyRef<'_, Drawing>, f32, f32, f32)| {
            // Computed in double precision and then rounded, so that pictures do not depend on the last bit of the
            // system's sine and cosine.
            let (sine, cosine) = f64::from(*angle).sin_cos();
            let (along, across) = (scale * cosine as f32, scale * sine as f32);
            // Column = along * x + across * y, row = -across * x + along * y: anticlockwise, as rows grow downwards.
            Transform::from_row(along, -across, across, along, *x, *y)
        };
        let transforms: Vec<Transform> = placed.iter().map(placement).collect();
        let drawings: Vec<&Drawing> = placed.iter().map(|entry| &*entry.0).collect();
        py.detach(|| {
            for (drawing, transform) in drawings.into_iter().zip(transforms) {
                drawing.draw_on(&mut self.0.as_mut(), transform);
            }
        });
    }

    /// Copy some columns of another picture, over all of its rows.
    ///
    /// Args:
    ///     other: The other picture.
    ///     x: Column of this picture for the first copied column.
    ///     y: Row of this picture for the first row of the other.
    ///     columns: First column of the other to copy, and the column after the last.
    #[pyo3(signature = (
        other: "Canvas",
        x: "int",
        y: "int",
        columns: "tuple[int, int]",
    ) -> "None")]
    fn copy_columns(
        &mut self,
        other: &Self,
        x: usize,
        y: usize,
        columns: RowRange,
    ) -> PyResult<()> {
        let (first, end) = columns;
        let height = other.0.height() as usize;
        if first > end || end > other.width() || x + end - first > self.width() {
            return Err(PyValueError::new_err(
                "columns: expected some of both pictures",
            ));
        }
        let lines = other.0.data().chunks_exact(other.width() * PIXEL_BYTES);
        for (line, source) in self.rows(y..y + height)?.zip(lines) {
            line[x * PIXEL_BYTES..(x + end - first) * PIXEL_BYTES]
                .copy_from_slice(&source[first * PIXEL_BYTES..end * PIXEL_BYTES]);
        }
        Ok(())
    }

    /// Blend some rows with a colour.
    ///
    /// Args:
    ///     rows: First row, and the row after the last.
    ///     hidden: Share of the colour in each column, 0 (none) to 256 (only the colour), shape
    ///         (width,); contiguous.
    ///     colour: The colour, `#rrggbb`.
    #[pyo3(signature = (
        rows: "tuple[int, int]",
        hidden: "NDArray[np.uint16]",
        colour: "str",
    ) -> "None")]
    fn blend_colour(
        &mut self,
        py: Python<'_>,
        rows: RowRange,
        hidden: PyReadonlyArray1<'_, u16>,
        colour: &str,
    ) -> PyResult<()> {
        let [red, green, blue] = parse_colour(colour)?;
        expect_length("hidden", hidden.len(), self.width())?;
        let hidden = hidden.as_slice()?;
        // One factor and one summand for each byte of a row, computed once for all rows. The opacity stays 255.
        let values_per_byte = |compute: fn(u16, u16) -> u16| -> Vec<u16> {
            let pixel = |&share: &u16| {
                let share = share.min(WHOLE);
                [red, green, blue, 255].map(|component| compute(share, u16::from(component)))
            };
            hidden.iter().flat_map(pixel).collect()
        };
        let (factors, summands) = (
            values_per_byte(|share, _| WHOLE - share),
            values_per_byte(|share, component| share * component),
        );
        let lines = self.rows(rows.0..rows.1)?;
        py.detach(
            || dispatch!(Level::new(), _simd => lines.for_each(|line| blend(line, &factors, &summands))),
        );
        Ok(())
    }

    /// Multiply the brightness of some rows by the light that falls on each pixel.
    ///
    /// Args:
    ///     rows: First row, and the row after the last.
    ///     moonlight: Brightness without lamps, 0 (black) to 255 (unchanged).
    ///     lights: For each lamp the brightness that it adds, shape (height, width), and the column
    ///         and the row of the upper left corner of this array, counted from the upper left
    ///         corner of the rows. All in pixels of half the resolution; parts outside the rows
    ///         are ignored.
    #[pyo3(signature = (
        rows: "tuple[int, int]",
        moonlight: "int",
        lights: "Sequence[tuple[NDArray[np.uint8], int, int]]",
    ) -> "None")]
    fn darken(
        &mut self,
        py: Python<'_>,
        rows: RowRange,
        moonlight: u8,
        lights: Vec<(PyReadonlyArray2<'_, u8>, i32, i32)>,
    ) -> PyResult<()> {
        if !self.width().is_multiple_of(2) {
            return Err(PyValueError::new_err("canvas: expected an even width"));
        }
        let width = self.width() / 2;
        let lines = self.rows(rows.0..rows.1)?;
        // The light on each square of two times two pixels; half the resolution is enough for soft light.
        let mut lit = vec![moonlight; width * lines.len().div_ceil(2)];
        for (light, x, y) in &lights {
            add_light(
                &mut lit,
                width,
                (light.as_slice()?, light.shape()[1]),
                (i64::from(*x), i64::from(*y)),
            );
        }
        py.detach(|| dispatch!(Level::new(), _simd => darken_lines(lines, &lit, width)));
        Ok(())
    }

    /// The picture as red, green and blue, shape (height, width, 3).
    ///
    /// Raises:
    ///     SystemLimitError: The system grants too little memory.
    #[pyo3(signature = () -> "NDArray[np.uint8]")]
    fn to_rgb<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<u8>>> {
        let pixels = self.0.data().chunks_exact(PIXEL_BYTES);
        let mut components = reserve(3 * pixels.len())?;
        components.extend(pixels.flat_map(|pixel| &pixel[..3]));
        PyArray1::from_vec(py, components).reshape([self.0.height() as usize, self.width(), 3])
    }

    /// Write the picture for a video encoder, as YUV 4:2:0 (ITU-R BT.601-7, section 2.5).
    ///
    /// Args:
    ///     out: Memory for luma, then both chroma planes at half the resolution; contiguous.
    ///
    /// Raises:
    ///     ValueError: The array does not have 3 / 2 elements per pixel, or the width or height is
    ///         odd.
    #[pyo3(signature = (out: "NDArray[np.uint8]") -> "None")]
    fn write_yuv(&self, py: Python<'_>, mut out: PyReadwriteArrayDyn<'_, u8>) -> PyResult<()> {
        if !(self.0.width().is_multiple_of(2) && self.0.height().is_multiple_of(2)) {
            return Err(PyValueError::new_err(
                "canvas: expected an even width and height",
            ));
        }
        expect_length(
            "a frame",
            out.len(),
            self.0.data().len() / PIXEL_BYTES * 3 / 2,
        )?;
        let (out, size) = (out.as_slice_mut()?, self.0.data().len() / PIXEL_BYTES);
        let (luma, chroma) = out.split_at_mut(size);
        py.detach(
            || dispatch!(Level::new(), _simd => convert(self.0.data(), self.width(), luma, chroma)),
        );
        Ok(())
    }
}

/// The first row or column, and the row or column after the last.
type RowRange = (usize, usize);

/// Multiply each byte of a row by its factor, add its summand, and divide by `WHOLE`, rounding down.
#[inline(always)]
fn blend(line: &mut [u8], factors: &[u16], summands: &[u16]) {
    for ((sample, factor), summand) in line.iter_mut().zip(factors).zip(summands) {
        // The weights of sample and colour add up to `WHOLE`, so the sum is at most 255 * 256, and nothing wraps.
        *sample = ((u16::from(*sample)
            .wrapping_mul(*factor)
            .wrapping_add(*summand))
            >> 8) as u8;
    }
}

/// Add the light of a lamp to `lit`, rows of `width` values; ignore its parts outside.
///
/// `light` has rows of `columns` values, and its upper left corner is in column `x` and row `y` of `lit`.
fn add_light(lit: &mut [u8], width: usize, (light, columns): (&[u8], usize), (x, y): (i64, i64)) {
    // `chunks_exact` takes no length of 0; an array without columns is empty anyway.
    let columns = columns.max(1);
    let first = x.clamp(0, width as i64);
    let last = (x + columns as i64).clamp(first, width as i64);
    for (row, line) in (y..).zip(light.chunks_exact(columns)) {
        let start = row * width as i64;
        // For a row above the picture this number is wrong; `row >= 0` excludes such rows.
        let end = (start + last) as usize;
        if row >= 0 && first < last && end <= lit.len() {
            let visible = &line[(first - x) as usize..];
            let sums = &mut lit[(start + first) as usize..end];
            for (sum, brightness) in sums.iter_mut().zip(visible) {
                *sum = sum.saturating_add(*brightness);
            }
        }
    }
}

/// Multiply the pixels of each row by their light. Each value of `lit` is the light of a square of two times two
/// pixels.
#[inline(always)]
fn darken_lines(lines: std::slice::ChunksExactMut<'_, u8>, lit: &[u8], width: usize) {
    let mut factors = vec![WHOLE; 2 * width * PIXEL_BYTES];
    for (row, line) in lines.enumerate() {
        if row % 2 == 0 {
            let pairs = factors.chunks_exact_mut(2 * PIXEL_BYTES);
            for (pair, &light) in pairs.zip(&lit[row / 2 * width..]) {
                // Stretches 0..=255 to 0..=256, so that full light changes nothing.
                let light = u16::from(light) + u16::from(light >> 7);
                pair.copy_from_slice(&[light, light, light, WHOLE, light, light, light, WHOLE]);
            }
        }
        for (sample, factor) in line.iter_mut().zip(&factors) {
            // At most 255 * 256: nothing wraps.
            *sample = (u16::from(*sample).wrapping_mul(*factor) >> 8) as u8;
        }
    }
}

/// Compute the luma of each pixel and the chroma of each square of two times two pixels.
///
/// The factors of ITU-R BT.601 are rounded to 1/256; luma is from 16 to 235, chroma from 16 to 240 around 128. Adding
/// half a divisor before a shift rounds to the nearest.
#[inline(always)]
fn convert(data: &[u8], width: usize, luma: &mut [u8], chroma: &mut [u8]) {
    for (pixel, y) in data.chunks_exact(PIXEL_BYTES).zip(luma) {
        let [red, green, blue] = [0, 1, 2].map(|component| u16::from(pixel[component]));
        *y = ((66 * red + 129 * green + 25 * blue + 128) >> 8) as u8 + 16;
    }
    let (u, v) = chroma.split_at_mut(chroma.len() / 2);
    let row_pairs = data.chunks_exact(2 * width * PIXEL_BYTES);
    let planes = u
        .chunks_exact_mut(width / 2)
        .zip(v.chunks_exact_mut(width / 2));
    for (row_pair, (u, v)) in row_pairs.zip(planes) {
        let (upper, lower) = row_pair.split_at(width * PIXEL_BYTES);
        let squares = upper
            .chunks_exact(2 * PIXEL_BYTES)
            .zip(lower.chunks_exact(2 * PIXEL_BYTES));
        for ((up, down), (u, v)) in squares.zip(u.iter_mut().zip(v)) {
            let [red, green, blue] = [0, 1, 2].map(|component| {
                let next = component + PIXEL_BYTES;
                let samples = [up[component], up[next], down[component], down[next]];
                (samples.into_iter().map(i16::from).sum::<i16>() + 2) >> 2
            });
            // The sums are at most 112 * 255 + 128 in size, so they fit into 16 bits.
            *u = (((112 * blue - 74 * green - 38 * red + 128) >> 8) + 128) as u8;
            *v = (((112 * red - 94 * green - 18 * blue + 128) >> 8) + 128) as u8;
        }
    }
}

/// Lower and upper end along an axis. In a list of points, the pair is x and y.
type Interval = (f32, f32);

/// Distance of the control points of a cubic Bezier curve from its ends, in radii, with which the curve approximates a
/// quarter circle: 4 / 3 (sqrt(2) - 1).
const QUARTER: f32 = 0.552_285;

/// One shape of a drawing.
enum Shape {
    /// A filled outline.
    Fill(Path, Paint<'static>),
    /// A line, and its width.
    Line(Path, Paint<'static>, f32),
    /// An image, and the column and row of its upper left corner.
    Mask(Pixmap, (i32, i32)),
}

/// Shapes in the order in which they are drawn; x grows to the right, y downwards.
///
/// Colours are `#rrggbb`; any other text raises `ValueError`. Opacity is 0 (invisible) to 1.
#[pyclass]
#[derive(Default)]
pub struct Drawing(Vec<Shape>);

impl Drawing {
    /// Draw all shapes on a canvas, moved, turned and scaled by `transform`.
    fn draw_on(&self, canvas: &mut PixmapMut<'_>, transform: Transform) {
        for shape in &self.0 {
            match shape {
                Shape::Fill(path, paint) => {
                    canvas.fill_path(path, paint, FillRule::Winding, transform, None);
                }
                Shape::Line(path, paint, width) => {
                    let stroke = Stroke {
                        width: *width,
                        ..Stroke::default()
                    };
                    canvas.stroke_path(path, paint, &stroke, transform, None);
                }
                Shape::Mask(pixmap, (x, y)) => {
                    let paint = PixmapPaint {
                        quality: FilterQuality::Bilinear,
                        ..PixmapPaint::default()
                    };
                    canvas.draw_pixmap(*x, *y, pixmap.as_ref(), &paint, transform, None);
                }
            }
        }
    }

    /// Add the area inside a path; an empty path adds nothing.
    fn fill(&mut self, path: PathBuilder, paint: Paint<'static>) {
        self.0
            .extend(path.finish().map(|path| Shape::Fill(path, paint)));
    }
}

/// Read red, green and blue from a colour written as `#rrggbb`.
pub fn parse_colour(colour: &str) -> PyResult<[u8; 3]> {
    let digits = colour.strip_prefix('#').filter(|digits| digits.len() == 6);
    let number = digits.and_then(|digits| u32::from_str_radix(digits, 16).ok());
    let [_, rgb @ ..] = number
        .ok_or_else(|| PyValueError::new_err(format!("colour: expected #rrggbb, got {colour}")))?
        .to_be_bytes();
    Ok(rgb)
}

/// A colour written as `#rrggbb`, with an opacity of 0 to 1.
fn colour_with_opacity(colour: &str, opacity: f32) -> PyResult<Color> {
    let [red, green, blue] = parse_colour(colour)?;
    let mut shade = Color::from_rgba8(red, green, blue, 255);
    shade.set_alpha(opacity);
    Ok(shade)
}

/// A paint of one colour and opacity.
fn solid_paint(colour: &str, opacity: f32) -> PyResult<Paint<'static>> {
    Ok(Paint {
        shader: Shader::SolidColor(colour_with_opacity(colour, opacity)?),
        ..Paint::default()
    })
}

/// The outline of a rectangle with round corners; the radius is limited to half the shorter side.
fn rounded_rectangle(x: Interval, y: Interval, radius: f32) -> PathBuilder {
    let mut path = PathBuilder::new();
    let radius = radius.min(0.5 * (x.1 - x.0)).min(0.5 * (y.1 - y.0));
    if radius <= 0.0 {
        if let Some(rect) = Rect::from_ltrb(x.0, y.0, x.1, y.1) {
            path.push_rect(rect);
        }
        return path;
    }
    // Distance of the control points from the corner of the rectangle without rounding.
    let inner = radius * (1.0 - QUARTER);
    path.move_to(x.0 + radius, y.0);
    path.line_to(x.1 - radius, y.0);
    path.cubic_to(x.1 - inner, y.0, x.1, y.0 + inner, x.1, y.0 + radius);
    path.line_to(x.1, y.1 - radius);
    path.cubic_to(x.1, y.1 - inner, x.1 - inner, y.1, x.1 - radius, y.1);
    path.line_to(x.0 + radius, y.1);
    path.cubic_to(x.0 + inner, y.1, x.0, y.1 - inner, x.0, y.1 - radius);
    path.line_to(x.0, y.0 + radius);
    path.cubic_to(x.0, y.0 + inner, x.0 + inner, y.0, x.0 + radius, y.0);
    path.close();
    path
}

#[pymethods]
impl Drawing {
    /// Make a drawing without shapes.
    #[new]
    #[pyo3(signature = ())]
    fn new() -> Self {
        Self::default()
    }

    /// Add a filled rectangle; its corners are round if `radius` is above 0.
    #[pyo3(signature = (
        x: "tuple[float, float]",
        y: "tuple[float, float]",
        colour: "str",
        *,
        opacity: "float" = 1.0,
        radius: "float" = 0.0,
    ) -> "None")]
    fn rect(
        &mut self,
        x: Interval,
        y: Interval,
        colour: &str,
        opacity: f32,
        radius: f32,
    ) -> PyResult<()> {
        self.fill(
            rounded_rectangle(x, y, radius),
            solid_paint(colour, opacity)?,
        );
        Ok(())
    }

    /// Add the outline of a rectangle with round corners, `line` wide, inside its edges.
    #[pyo3(signature = (
        x: "tuple[float, float]",
        y: "tuple[float, float]",
        colour: "str",
        *,
        line: "float",
        radius: "float",
    ) -> "None")]
    fn outline(
        &mut self,
        x: Interval,
        y: Interval,
        colour: &str,
        line: f32,
        radius: f32,
    ) -> PyResult<()> {
        // tiny-skia draws half of a line on each side of its path.
        let inset = |ends: Interval| (ends.0 + 0.5 * line, ends.1 - 0.5 * line);
        let path = rounded_rectangle(inset(x), inset(y), radius - 0.5 * line).finish();
        let paint = solid_paint(colour, 1.0)?;
        self.0
            .extend(path.map(|path| Shape::Line(path, paint, line)));
        Ok(())
    }

    /// Add a filled polygon through points (x, y).
    #[pyo3(signature = (
        points: "Sequence[tuple[float, float]]",
        colour: "str",
        *,
        opacity: "float" = 1.0,
    ) -> "None")]
    fn polygon(&mut self, points: Vec<Interval>, colour: &str, opacity: f32) -> PyResult<()> {
        let mut path = PathBuilder::new();
        add_polyline(&mut path, &points);
        path.close();
        self.fill(path, solid_paint(colour, opacity)?);
        Ok(())
    }

    /// Add lines, each through a sequence of points (x, y).
    #[pyo3(signature = (
        lines: "Sequence[Sequence[tuple[float, float]]]",
        colour: "str",
        *,
        width: "float",
        opacity: "float" = 1.0,
    ) -> "None")]
    fn lines(
        &mut self,
        lines: Vec<Vec<Interval>>,
        colour: &str,
        width: f32,
        opacity: f32,
    ) -> PyResult<()> {
        let mut path = PathBuilder::new();
        lines.iter().for_each(|line| add_polyline(&mut path, line));
        let paint = solid_paint(colour, opacity)?;
        self.0
            .extend(path.finish().map(|path| Shape::Line(path, paint, width)));
        Ok(())
    }

    /// Add a light around a point, of opacity `strength` there and 0 at the distance `reach`.
    #[pyo3(signature = (
        x: "float",
        y: "float",
        reach: "float",
        colour: "str",
        strength: "float",
    ) -> "None")]
    fn glow(&mut self, x: f32, y: f32, reach: f32, colour: &str, strength: f32) -> PyResult<()> {
        // The opacity falls as (1 - distance^2)^2, in four linear pieces; it is smooth at the centre and at `reach`.
        let stop = |distance: f32| {
            let share = 1.0 - distance * distance;
            Ok(GradientStop::new(
                distance,
                colour_with_opacity(colour, strength * share * share)?,
            ))
        };
        let stops: PyResult<Vec<_>> = [0.0, 0.25, 0.5, 0.75, 1.0].map(stop).into_iter().collect();
        let centre = Point::from_xy(x, y);
        let light = RadialGradient::new(
            centre,
            0.0,
            centre,
            reach,
            stops?,
            SpreadMode::Pad,
            Transform::identity(),
        );
        let mut path = PathBuilder::new();
        path.push_circle(x, y, reach);
        if let Some(shader) = light {
            let paint = Paint {
                shader,
                ..Paint::default()
            };
            self.fill(path, paint);
        }
        Ok(())
    }

    /// Add an image of one colour, such as a letter.
    ///
    /// Args:
    ///     covered: Coverage of each pixel, 0 to 255; shape (height, width), contiguous.
    ///     place: Column and row of the upper left corner.
    ///     colour: Colour of the image.
    ///
    /// Raises:
    ///     ValueError: The array has no rows or no columns, or the colour is invalid.
    #[pyo3(signature = (
        covered: "NDArray[np.uint8]",
        place: "tuple[int, int]",
        colour: "str",
    ) -> "None")]
    fn mask(
        &mut self,
        covered: PyReadonlyArray2<'_, u8>,
        place: (i32, i32),
        colour: &str,
    ) -> PyResult<()> {
        let [red, green, blue] = parse_colour(colour)?;
        let (height, width) = (covered.shape()[0] as u32, covered.shape()[1] as u32);
        let mut pixmap = Pixmap::new(width, height)
            .ok_or_else(|| PyValueError::new_err("mask: expected rows and columns"))?;
        for (pixel, &share) in pixmap.pixels_mut().iter_mut().zip(covered.as_slice()?) {
            *pixel = tiny_skia::ColorU8::from_rgba(red, green, blue, share).premultiply();
        }
        self.0.push(Shape::Mask(pixmap, place));
        Ok(())
    }
}

/// Add a line through points to a path.
fn add_polyline(path: &mut PathBuilder, points: &[Interval]) {
    for (index, &(x, y)) in points.iter().enumerate() {
        if index == 0 {
            path.move_to(x, y);
        } else {
            path.line_to(x, y);
        }
    }
}
