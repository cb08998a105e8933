//! Pictures on their way to a client.

mod picture;

pub use picture::Picture;
