//! Tyndall
#![forbid(unsafe_code)]
pub mod engine;
pub mod export;
pub mod gpu;
pub mod import;
pub mod render;
pub mod scene;
pub mod server;
pub mod sim;
pub mod stream;
pub mod volume;
pub mod world;
