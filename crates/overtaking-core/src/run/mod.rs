//! The loop over time: batches in blocks of sixteen simulations, steps, and batches that wait at every decision.

pub(crate) mod block;
pub(crate) mod engine;
pub(crate) mod step;
pub mod stepped_batch;
