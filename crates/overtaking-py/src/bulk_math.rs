//! Python functions for random numbers and elementary functions of whole float32 arrays.
//!
//! `overtaking.core.native` wraps them. Each gives the same bits as the Python function that its documentation names;
//! `overtaking_core::math::bulk` does the work. An array that is not contiguous or holds another type of number raises
//! `TypeError`. The annotation `np.floating[Any]` is how type checkers see `overtaking.core.arrays.F32`, a float32
//! array.

use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1, PyReadwriteArray1, PyUntypedArrayMethods};
use overtaking_core::math::bulk::{self as core, DrawBlock, Operand};
use overtaking_core::require_level;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::inputs::expect_length;
use crate::spread::expect_memory;

/// Four arrays of random words of 32 bits.
type Words<'py> = [Bound<'py, PyArray1<u32>>; 4];

/// Draw four random words for each simulation and stream, as `core.random_numbers.philox_words`.
///
/// Args:
///     seed: Seed of the data set.
///     index: Scenario index of each simulation.
///     stream: Purpose of the draws for each simulation: the number of a
///         `core.random_numbers.Stream`, plus the vehicle's slot or role if the purpose concerns a
///         single vehicle.
///     draw: Number of the block of four words within the stream, from 0.
///     level: SIMD level, None for the fastest of this CPU; the results are the same.
///
/// Raises:
///     SystemLimitError: The system grants too little memory.
///     ValueError: The arrays differ in length, or the SIMD level is unknown or not available.
#[pyfunction]
#[pyo3(signature = (
    *,
    seed: "int",
    index: "NDArray[np.uint64]",
    stream: "NDArray[np.uint32]",
    draw: "int",
    level: "str | None" = None,
) -> "list[NDArray[np.uint32]]")]
pub fn random_words<'py>(
    py: Python<'py>,
    seed: u64,
    index: PyReadonlyArray1<'py, u64>,
    stream: PyReadonlyArray1<'py, u32>,
    draw: u32,
    level: Option<&str>,
) -> PyResult<Words<'py>> {
    let level = require_level(level).map_err(PyValueError::new_err)?;
    expect_length("stream", stream.len(), index.len())?;
    let block = DrawBlock {
        seed,
        index: index.as_slice()?,
        stream: stream.as_slice()?,
        draw,
    };
    // Memory for the four arrays below, each as large as `stream`: both have 32 bits for each simulation.
    expect_memory(4 * size_of_val(block.stream))?;
    let mut words: [Vec<u32>; 4] = std::array::from_fn(|_| vec![0; block.index.len()]);
    let out = words.each_mut().map(Vec::as_mut_slice);
    py.detach(|| core::random_words(level, &block, out));
    Ok(words.map(|column| PyArray1::from_vec(py, column)))
}

/// Replace each number of a flat float32 array by `core.float32_math.exp` of it.
///
/// Raises:
///     ValueError: The SIMD level is unknown or not available.
#[pyfunction]
#[pyo3(signature = (values: "NDArray[np.floating[Any]]", *, level: "str | None" = None) -> "None")]
pub fn exp_in_place(
    py: Python<'_>,
    mut values: PyReadwriteArray1<'_, f32>,
    level: Option<&str>,
) -> PyResult<()> {
    let level = require_level(level).map_err(PyValueError::new_err)?;
    let values = values.as_slice_mut()?;
    py.detach(|| core::exp_in_place(level, values));
    Ok(())
}

/// Replace each number of a flat float32 array by `core.float32_math.log` of it.
///
/// Raises:
///     ValueError: The SIMD level is unknown or not available.
#[pyfunction]
#[pyo3(signature = (values: "NDArray[np.floating[Any]]", *, level: "str | None" = None) -> "None")]
pub fn log_in_place(
    py: Python<'_>,
    mut values: PyReadwriteArray1<'_, f32>,
    level: Option<&str>,
) -> PyResult<()> {
    let level = require_level(level).map_err(PyValueError::new_err)?;
    let values = values.as_slice_mut()?;
    py.detach(|| core::log_in_place(level, values));
    Ok(())
}

/// Convert random words to uniform numbers, as `core.random_numbers.uniform_from_word`.
#[pyfunction]
#[pyo3(signature = (words: "NDArray[np.uint32]") -> "NDArray[np.float32]")]
pub fn uniform_numbers<'py>(
    py: Python<'py>,
    words: PyReadonlyArray1<'py, u32>,
) -> PyResult<Bound<'py, PyArray1<f32>>> {
    let numbers = core::uniform_numbers(words.as_slice()?);
    Ok(PyArray1::from_vec(py, numbers))
}

/// Replace each number by the larger of itself and another one, as `core.float32_math.maximum`.
///
/// Args:
///     values: Flat float32 array.
///     others: A float32 array of the same length, or one number.
///
/// Raises:
///     ValueError: The arrays differ in length.
#[pyfunction]
#[pyo3(signature = (values: "NDArray[np.floating[Any]]", others: "Any") -> "None")]
pub fn maximum_in_place(
    mut values: PyReadwriteArray1<'_, f32>,
    others: &Bound<'_, PyAny>,
) -> PyResult<()> {
    combine_in_place(values.as_slice_mut()?, others, core::maximum_in_place)
}

/// Replace each number by the smaller of itself and another one, as `core.float32_math.minimum`.
///
/// Arguments and errors as in `maximum_in_place`.
#[pyfunction]
#[pyo3(signature = (values: "NDArray[np.floating[Any]]", others: "Any") -> "None")]
pub fn minimum_in_place(
    mut values: PyReadwriteArray1<'_, f32>,
    others: &Bound<'_, PyAny>,
) -> PyResult<()> {
    combine_in_place(values.as_slice_mut()?, others, core::minimum_in_place)
}

/// Combine each number with an operand: an array of the same length, or one number.
fn combine_in_place(
    values: &mut [f32],
    others: &Bound<'_, PyAny>,
    combine: impl Fn(&mut [f32], &Operand<'_>),
) -> PyResult<()> {
    if let Ok(array) = others.cast::<PyArray1<f32>>() {
        expect_length("others", array.len(), values.len())?;
        let array = array.try_readonly()?;
        combine(values, &Operand::Each(array.as_slice()?));
    } else {
        combine(values, &Operand::One(others.extract()?));
    }
    Ok(())
}

/// Replace two flat float32 arrays of uniform numbers by `core.random_numbers.box_muller`.
///
/// Raises:
///     ValueError: The arrays differ in length, or the SIMD level is unknown or not available.
#[pyfunction]
#[pyo3(signature = (
    u: "NDArray[np.floating[Any]]",
    v: "NDArray[np.floating[Any]]",
    *,
    level: "str | None" = None,
) -> "None")]
pub fn normal_pairs_in_place(
    py: Python<'_>,
    mut u: PyReadwriteArray1<'_, f32>,
    mut v: PyReadwriteArray1<'_, f32>,
    level: Option<&str>,
) -> PyResult<()> {
    let level = require_level(level).map_err(PyValueError::new_err)?;
    expect_length("v", v.len(), u.len())?;
    let (u, v) = (u.as_slice_mut()?, v.as_slice_mut()?);
    py.detach(|| core::normal_pairs_in_place(level, u, v));
    Ok(())
}
