//! The engine.
pub fn hello() {}
