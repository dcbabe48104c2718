//! Draws and elementary functions of many numbers.

use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1, PyReadwriteArray1, PyUntypedArrayMethods};
use overtaking_core::math::bulk::{self as core, DrawBlock, Operand};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::expect_length;
use crate::spread::expect_room;

/// Four arrays of words.
type Words<'py> = [Bound<'py, PyArray1<u32>>; 4];

/// The four words of a block of draws of every simulation and stream.
#[pyfunction]
#[pyo3(signature = (*, seed, index, stream, draw, level=None))]
pub fn words<'py>(
    py: Python<'py>,
    seed: u64,
    index: PyReadonlyArray1<'py, u64>,
    stream: PyReadonlyArray1<'py, u32>,
    draw: u32,
    level: Option<&str>,
) -> PyResult<Words<'py>> {
    expect_length("stream", stream.len(), index.len())?;
    let block = DrawBlock {
        seed,
        index: index.as_slice()?,
        stream: stream.as_slice()?,
        draw,
    };
    expect_room(4 * size_of_val(block.index))?;
    let mut found: [Vec<u32>; 4] = std::array::from_fn(|_| vec![0; block.index.len()]);
    let out = found.each_mut().map(Vec::as_mut_slice);
    let done = py.detach(|| core::random_words(&block, level, out));
    done.map_err(PyValueError::new_err)?;
    Ok(found.map(|row| PyArray1::from_vec(py, row)))
}

/// Put the exponential of each number in its place.
#[pyfunction]
#[pyo3(signature = (values, *, level=None))]
pub fn exponentials(
    py: Python<'_>,
    mut values: PyReadwriteArray1<'_, f32>,
    level: Option<&str>,
) -> PyResult<()> {
    let values = values.as_slice_mut()?;
    let done = py.detach(|| core::exp_in_place(level, values));
    done.map_err(PyValueError::new_err)
}

/// Put the natural logarithm of each number in its place.
#[pyfunction]
#[pyo3(signature = (values, *, level=None))]
pub fn logarithms(
    py: Python<'_>,
    mut values: PyReadwriteArray1<'_, f32>,
    level: Option<&str>,
) -> PyResult<()> {
    let values = values.as_slice_mut()?;
    let done = py.detach(|| core::log_in_place(level, values));
    done.map_err(PyValueError::new_err)
}

/// The uniform number in (0, 1) that each word stands for.
#[pyfunction]
pub fn uniforms<'py>(
    py: Python<'py>,
    words: PyReadonlyArray1<'py, u32>,
) -> PyResult<Bound<'py, PyArray1<f32>>> {
    let found = core::uniform_numbers(words.as_slice()?);
    Ok(PyArray1::from_vec(py, found))
}

/// Put the larger of each number and another in its place; the other is one, or one for each.
#[pyfunction]
pub fn larger(mut values: PyReadwriteArray1<'_, f32>, others: &Bound<'_, PyAny>) -> PyResult<()> {
    with_others(values.as_slice_mut()?, others, core::maximum_in_place)
}

/// Put the smaller of each number and another in its place; the other is one, or one for each.
#[pyfunction]
pub fn smaller(mut values: PyReadwriteArray1<'_, f32>, others: &Bound<'_, PyAny>) -> PyResult<()> {
    with_others(values.as_slice_mut()?, others, core::minimum_in_place)
}

fn with_others(
    values: &mut [f32],
    others: &Bound<'_, PyAny>,
    work: impl Fn(&mut [f32], &Operand<'_>),
) -> PyResult<()> {
    if let Ok(each) = others.cast::<PyArray1<f32>>() {
        expect_length("others", each.len(), values.len())?;
        let each = each.try_readonly()?;
        work(values, &Operand::Each(each.as_slice()?));
    } else {
        work(values, &Operand::One(others.extract()?));
    }
    Ok(())
}

/// Put two independent normal numbers in the place of each two uniform ones.
#[pyfunction]
#[pyo3(signature = (u, v, *, level=None))]
pub fn normal_pairs(
    py: Python<'_>,
    mut u: PyReadwriteArray1<'_, f32>,
    mut v: PyReadwriteArray1<'_, f32>,
    level: Option<&str>,
) -> PyResult<()> {
    expect_length("v", v.len(), u.len())?;
    let (u, v) = (u.as_slice_mut()?, v.as_slice_mut()?);
    let done = py.detach(|| core::normal_pairs_in_place(level, u, v));
    done.map_err(PyValueError::new_err)
}
