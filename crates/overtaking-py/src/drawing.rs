//! Shapes that tiny-skia draws on the frames of films.

use numpy::{PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use tiny_skia::{
    Color, FillRule, FilterQuality, GradientStop, Paint, Path, PathBuilder, Pixmap, PixmapMut,
    PixmapPaint, Point, RadialGradient, Rect, Shader, SpreadMode, Stroke, Transform,
};

/// Lower and upper end along an axis.
type Ends = (f32, f32);

/// Distance of the control points of a quarter circle from its ends, in radii.
const QUARTER: f32 = 0.552_285;

enum Shape {
    Fill(Path, Paint<'static>),
    Line(Path, Paint<'static>, f32),
    Mask(Pixmap, (i32, i32)),
}

/// Shapes, the first below the others; x grows to the right, y downwards.
#[pyclass]
#[derive(Default)]
pub struct Drawing(Vec<Shape>);

impl Drawing {
    /// Draws all shapes, moved, turned and scaled.
    pub fn on(&self, canvas: &mut PixmapMut<'_>, transform: Transform) {
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

    fn fill(&mut self, path: PathBuilder, paint: Paint<'static>) {
        self.0
            .extend(path.finish().map(|path| Shape::Fill(path, paint)));
    }
}

/// A colour written as `#rrggbb`.
pub fn parsed(colour: &str) -> PyResult<[u8; 3]> {
    let digits = colour.strip_prefix('#').filter(|digits| digits.len() == 6);
    let number = digits.and_then(|digits| u32::from_str_radix(digits, 16).ok());
    let [_, rgb @ ..] = number
        .ok_or_else(|| PyValueError::new_err(format!("colour: expected #rrggbb, got {colour}")))?
        .to_be_bytes();
    Ok(rgb)
}

fn shaded(colour: &str, opacity: f32) -> PyResult<Color> {
    let [red, green, blue] = parsed(colour)?;
    let mut shade = Color::from_rgba8(red, green, blue, 255);
    shade.set_alpha(opacity);
    Ok(shade)
}

fn plain(colour: &str, opacity: f32) -> PyResult<Paint<'static>> {
    Ok(Paint {
        shader: Shader::SolidColor(shaded(colour, opacity)?),
        ..Paint::default()
    })
}

/// A rectangle with round corners.
fn rounded(x: Ends, y: Ends, radius: f32) -> PathBuilder {
    let mut path = PathBuilder::new();
    let radius = radius.min(0.5 * (x.1 - x.0)).min(0.5 * (y.1 - y.0));
    if radius <= 0.0 {
        if let Some(rect) = Rect::from_ltrb(x.0, y.0, x.1, y.1) {
            path.push_rect(rect);
        }
        return path;
    }
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
    #[new]
    fn new() -> Self {
        Self::default()
    }

    /// A rectangle, with round corners if it has a radius.
    #[pyo3(signature = (x, y, colour, *, opacity = 1.0, radius = 0.0))]
    fn rect(&mut self, x: Ends, y: Ends, colour: &str, opacity: f32, radius: f32) -> PyResult<()> {
        self.fill(rounded(x, y, radius), plain(colour, opacity)?);
        Ok(())
    }

    /// The outline of a rectangle with round corners, `line` wide, inside its edges.
    #[pyo3(signature = (x, y, colour, *, line, radius))]
    fn frame(&mut self, x: Ends, y: Ends, colour: &str, line: f32, radius: f32) -> PyResult<()> {
        let inner = |ends: Ends| (ends.0 + 0.5 * line, ends.1 - 0.5 * line);
        let path = rounded(inner(x), inner(y), radius - 0.5 * line).finish();
        let paint = plain(colour, 1.0)?;
        self.0
            .extend(path.map(|path| Shape::Line(path, paint, line)));
        Ok(())
    }

    /// A polygon.
    #[pyo3(signature = (points, colour, *, opacity = 1.0))]
    fn polygon(&mut self, points: Vec<Ends>, colour: &str, opacity: f32) -> PyResult<()> {
        let mut path = PathBuilder::new();
        go(&mut path, &points);
        path.close();
        self.fill(path, plain(colour, opacity)?);
        Ok(())
    }

    /// Lines, each through points.
    #[pyo3(signature = (lines, colour, *, width, opacity = 1.0))]
    fn lines(
        &mut self,
        lines: Vec<Vec<Ends>>,
        colour: &str,
        width: f32,
        opacity: f32,
    ) -> PyResult<()> {
        let mut path = PathBuilder::new();
        lines.iter().for_each(|line| go(&mut path, line));
        let paint = plain(colour, opacity)?;
        self.0
            .extend(path.finish().map(|path| Shape::Line(path, paint, width)));
        Ok(())
    }

    /// Light around a point that fades towards `reach`.
    fn glow(&mut self, x: f32, y: f32, reach: f32, colour: &str, strength: f32) -> PyResult<()> {
        let stop = |away: f32| {
            let left = 1.0 - away * away;
            Ok(GradientStop::new(
                away,
                shaded(colour, strength * left * left)?,
            ))
        };
        let stops: PyResult<Vec<_>> = [0.0, 0.25, 0.5, 0.75, 1.0].map(stop).into_iter().collect();
        let (centre, whole) = (Point::from_xy(x, y), Transform::identity());
        let light = RadialGradient::new(centre, 0.0, centre, reach, stops?, SpreadMode::Pad, whole);
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

    /// A mask of one colour, its left upper corner at a pixel.
    fn mask(
        &mut self,
        covered: PyReadonlyArray2<'_, u8>,
        place: (i32, i32),
        colour: &str,
    ) -> PyResult<()> {
        let [red, green, blue] = parsed(colour)?;
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

/// Adds a line through points to a path.
fn go(path: &mut PathBuilder, points: &[Ends]) {
    for (place, &(x, y)) in points.iter().enumerate() {
        if place == 0 {
            path.move_to(x, y);
        } else {
            path.line_to(x, y);
        }
    }
}
