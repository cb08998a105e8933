//! A raw picture, and its encodings once somebody wanted them.

use std::sync::{Arc, LazyLock};
use std::time::Instant;

use tokio::sync::{OnceCell, Semaphore};

use super::codec::{self, Codec, EncodeError, Encoded};
use crate::engine::ClientId;

/// Encoders that run at once, over all sessions: more than there are cores only take time from each other.
static ENCODERS: LazyLock<Arc<Semaphore>> = LazyLock::new(|| {
    let cores = std::thread::available_parallelism().map_or(2, std::num::NonZero::get);
    Arc::new(Semaphore::new(cores))
});

/// A picture of a session as the engine made it.
#[derive(Debug)]
pub struct Picture {
    /// Size in pixels.
    pub size: [u32; 2],
    /// RGBA, 8 bits, sRGB, row 0 on top.
    pub pixels: Vec<u8>,
    /// Revision of the scene shown.
    pub revision: u32,
    /// Samples per pixel shown.
    pub spp: u32,
    /// Whether accumulation has ended: the picture is to be sent lossless.
    pub converged: bool,
    /// The newest camera message of each client that the picture shows.
    pub seen: Vec<(ClientId, u32)>,
    /// Server's monotonic clock when the picture was begun, in µs.
    pub begun_us: u64,
    /// Time spent on simulation and rendering, in µs.
    pub work_us: u32,
    /// Time spent on tone mapping and read-back, in µs.
    pub readback_us: u32,
    /// What has been encoded of it; `Encodings::default()` for a new picture.
    pub encodings: Encodings,
}

/// The encodings of one picture, each made when the first client wants it and shared by all.
#[derive(Debug, Default)]
pub struct Encodings {
    jpeg: OnceCell<Arc<Encoded>>,
    png: OnceCell<Arc<Encoded>>,
}

impl Picture {
    /// The picture in this codec. The first caller has it encoded on a blocking thread; the others wait for the same bytes.
    ///
    /// # Errors
    /// [`EncodeError`] where the codec cannot hold the picture.
    pub async fn encoded(self: &Arc<Self>, codec: Codec) -> Result<Arc<Encoded>, EncodeError> {
        let cell = match codec {
            Codec::Jpeg => &self.encodings.jpeg,
            Codec::Png => &self.encodings.png,
        };
        cell.get_or_try_init(|| Self::encode(Arc::clone(self), codec)).await.cloned()
    }

    async fn encode(picture: Arc<Self>, codec: Codec) -> Result<Arc<Encoded>, EncodeError> {
        let size = picture.size;
        let refuse = |reason: String| EncodeError { size, codec, reason };
        // The permit moves to the thread: a client that leaves does not free an encoder that still runs.
        let permit = Arc::clone(&ENCODERS).acquire_owned().await.map_err(|closed| refuse(closed.to_string()))?;
        let work = move || {
            let _permit = permit;
            let begun = Instant::now();
            let bytes = codec::encode(codec, picture.size, &picture.pixels)?;
            let encode_us = u32::try_from(begun.elapsed().as_micros()).unwrap_or(u32::MAX);
            Ok(Arc::new(Encoded { codec, bytes, encode_us }))
        };
        tokio::task::spawn_blocking(work).await.map_err(|panic| refuse(panic.to_string()))?
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(size: [u32; 2], pixels: Vec<u8>) -> Arc<Picture> {
        Arc::new(Picture {
            size,
            pixels,
            revision: 1,
            spp: 1,
            converged: false,
            seen: Vec::new(),
            begun_us: 0,
            work_us: 0,
            readback_us: 0,
            encodings: Encodings::default(),
        })
    }

    #[tokio::test]
    async fn clients_that_want_the_same_codec_share_one_encoding() {
        let picture = picture([8, 8], vec![200; 256]);
        let (a, b) = tokio::join!(picture.encoded(Codec::Jpeg), picture.encoded(Codec::Jpeg));
        assert!(Arc::ptr_eq(&a.unwrap(), &b.unwrap()));
        assert_eq!(picture.encoded(Codec::Png).await.unwrap().codec, Codec::Png);
    }

    #[tokio::test]
    async fn a_picture_that_cannot_be_encoded_is_an_error_and_no_panic() {
        assert!(picture([8, 8], vec![0; 3]).encoded(Codec::Jpeg).await.is_err());
    }
}
