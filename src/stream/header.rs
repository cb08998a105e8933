//! The 40 bytes before each frame's payload, little-endian.

use super::Codec;

/// Length of a header in bytes.
pub const HEADER_LEN: usize = 40;
/// The only version there is.
pub const HEADER_VERSION: u8 = 1;
/// The frame can be shown without any other.
pub const FLAG_KEY: u8 = 1;
/// Accumulation has ended; no other picture follows until something changes.
pub const FLAG_FINAL: u8 = 2;
/// The payload holds the picture's exact bytes.
pub const FLAG_LOSSLESS: u8 = 4;

/// What a client is told of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameHeader {
    /// How the payload is encoded.
    pub codec: Codec,
    /// [`FLAG_KEY`], [`FLAG_FINAL`], [`FLAG_LOSSLESS`].
    pub flags: u8,
    /// Width and height of the payload in pixels.
    pub size: [u16; 2],
    /// Rises by one within a connection, from 1.
    pub frame: u32,
    /// `seq` of the client's newest camera message that this picture shows; 0: none.
    pub seq: u32,
    /// Scene revision shown.
    pub revision: u32,
    /// Samples per pixel shown.
    pub spp: u32,
    /// Server's monotonic clock when the picture was begun, in µs.
    pub begun_us: u64,
    /// Time spent on simulation and rendering, in µs.
    pub work_us: u32,
    /// Time spent on read-back and encoding, in µs.
    pub encode_us: u32,
}

impl FrameHeader {
    /// The header as it goes over the wire.
    pub fn to_bytes(&self) -> [u8; HEADER_LEN] {
        let mut bytes = [0; HEADER_LEN];
        bytes[0] = HEADER_VERSION;
        bytes[1] = self.codec.wire();
        bytes[2] = self.flags;
        bytes[4..6].copy_from_slice(&self.size[0].to_le_bytes());
        bytes[6..8].copy_from_slice(&self.size[1].to_le_bytes());
        bytes[8..12].copy_from_slice(&self.frame.to_le_bytes());
        bytes[12..16].copy_from_slice(&self.seq.to_le_bytes());
        bytes[16..20].copy_from_slice(&self.revision.to_le_bytes());
        bytes[20..24].copy_from_slice(&self.spp.to_le_bytes());
        bytes[24..32].copy_from_slice(&self.begun_us.to_le_bytes());
        bytes[32..36].copy_from_slice(&self.work_us.to_le_bytes());
        bytes[36..40].copy_from_slice(&self.encode_us.to_le_bytes());
        bytes
    }

    /// Reads a message into its header and payload; `None` where it is too short, or of another version or codec.
    pub fn split(message: &[u8]) -> Option<(Self, &[u8])> {
        let (bytes, payload) = message.split_first_chunk::<HEADER_LEN>()?;
        if bytes[0] != HEADER_VERSION {
            return None;
        }
        let header = Self {
            codec: Codec::from_wire(bytes[1])?,
            flags: bytes[2],
            size: [u16::from_le_bytes(at(bytes, 4)), u16::from_le_bytes(at(bytes, 6))],
            frame: u32::from_le_bytes(at(bytes, 8)),
            seq: u32::from_le_bytes(at(bytes, 12)),
            revision: u32::from_le_bytes(at(bytes, 16)),
            spp: u32::from_le_bytes(at(bytes, 20)),
            begun_us: u64::from_le_bytes(at(bytes, 24)),
            work_us: u32::from_le_bytes(at(bytes, 32)),
            encode_us: u32::from_le_bytes(at(bytes, 36)),
        };
        Some((header, payload))
    }
}

fn at<const N: usize>(bytes: &[u8; HEADER_LEN], start: usize) -> [u8; N] {
    std::array::from_fn(|i| bytes[start + i])
}

#[cfg(test)]
mod tests {
    use super::*;

    const SAMPLE: FrameHeader = FrameHeader {
        codec: Codec::Jpeg,
        flags: FLAG_KEY | FLAG_FINAL,
        size: [1280, 720],
        frame: 9001,
        seq: 812,
        revision: 0x0102_0304,
        spp: 64,
        begun_us: 0x1122_3344_5566_7788,
        work_us: 16_000,
        encode_us: 5_100,
    };

    #[test]
    fn the_header_has_these_bytes() {
        #[rustfmt::skip]
        let golden: [u8; HEADER_LEN] = [
            1, 1, 3, 0,
            0x00, 0x05, 0xd0, 0x02,
            0x29, 0x23, 0, 0,
            0x2c, 0x03, 0, 0,
            4, 3, 2, 1,
            64, 0, 0, 0,
            0x88, 0x77, 0x66, 0x55, 0x44, 0x33, 0x22, 0x11,
            0x80, 0x3e, 0, 0,
            0xec, 0x13, 0, 0,
        ];
        assert_eq!(SAMPLE.to_bytes(), golden);
    }

    #[test]
    fn a_header_reads_back_as_it_was_written() {
        let mut message = SAMPLE.to_bytes().to_vec();
        message.extend(b"payload");
        assert_eq!(FrameHeader::split(&message), Some((SAMPLE, &b"payload"[..])));
    }

    #[test]
    fn another_version_and_a_short_message_are_no_header() {
        let mut bytes = SAMPLE.to_bytes();
        assert!(FrameHeader::split(&bytes[..39]).is_none());
        bytes[0] = 2;
        assert!(FrameHeader::split(&bytes).is_none());
    }
}
