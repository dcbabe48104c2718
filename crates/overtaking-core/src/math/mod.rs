//! Arithmetic on sixteen simulations at a time, and on whole arrays for Python.

pub mod bulk;
pub mod elementary;
pub(crate) mod philox;
pub mod vectors;
