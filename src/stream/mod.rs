//! Pictures on their way to a client: encoded once for all who want the same codec, framed by a 40-byte header,
//! and never more of them under way than a client has acknowledged room for.

pub mod codec;
mod credit;
mod header;
mod picture;

pub use codec::{Codec, EncodeError, Encoded, encode, encode_jpeg, encode_png};
pub use credit::{Credit, WINDOW};
pub use header::{FLAG_FINAL, FLAG_KEY, FLAG_LOSSLESS, FrameHeader, HEADER_LEN, HEADER_VERSION};
pub use picture::{Encodings, Picture};
