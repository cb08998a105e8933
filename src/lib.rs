//! Tyndall
#![forbid(unsafe_code)]
pub mod engine;
pub mod gpu;
pub mod scene;
pub mod sim;
pub mod stream;
pub mod volume;
