//! Pictures of another renderer, kept as tile means: `tests/fixtures/mitsuba_*.json` says by what they were made.

use serde::Deserialize;
use serde_json::Value;
use tyndall::volume::{Field, Grid, Samples};

use crate::harness::{Picture, assert_tiles_agree, gpu};

/// A reference picture of 128×128 pixels: means of its 16×16 tiles, row 0 on top.
#[derive(Deserialize)]
pub struct Reference {
    pub scene: Value,
    mean: f64,
    se_of_mean: f64,
    tiles: Vec<f64>,
    tile_errors: Vec<f64>,
}

/// Reads the fixture of this name.
pub fn read(name: &str) -> Reference {
    let path = format!("{}/tests/fixtures/mitsuba_{name}.json", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&std::fs::read_to_string(&path).expect(&path)).expect(&path)
}

impl Reference {
    /// Checks a picture of the reference's scene: its mean, and every tile that has noise.
    pub fn check(&self, picture: &Picture) {
        let (mean, error) = picture.mean(0);
        let z = (mean - self.mean) / error.hypot(self.se_of_mean);
        assert!(z.abs() < 3.5, "mean {mean}, expected {}: z = {z}", self.mean);
        let reference = self.tiles.iter().copied().zip(self.tile_errors.iter().copied());
        assert_tiles_agree(
            "reference",
            picture.tiles(0).into_iter().zip(reference).filter_map(|(ours, theirs)| Some((ours?, theirs))),
        );
    }
}

/// The grid of the reference scenes: 64³ voxels by formula, rounded to 16 bits. With the voxel's centre
/// c = (i + ½)/64 and X = 2c − 1: density = clamp(1.6(1 − r/0.95) + 0.9w − 0.25, 0, 1),
/// w = sin(9X + 1.3 sin 7Y)·sin(8Y + 1.1 sin 6Z)·sin(10Z + 1.7 sin 5X).
pub fn cloud() -> Grid {
    let n = 64;
    let value = |i: u32| {
        let [x, y, z] = [i % n, i / n % n, i / (n * n)].map(|a| 2.0 * (f64::from(a) + 0.5) / f64::from(n) - 1.0);
        let w = (9.0 * x + 1.3 * (7.0 * y).sin()).sin()
            * (8.0 * y + 1.1 * (6.0 * z).sin()).sin()
            * (10.0 * z + 1.7 * (5.0 * x).sin()).sin();
        let r = (x * x + y * y + z * z).sqrt();
        let density = (1.6 * (1.0 - r / 0.95) + 0.9 * w - 0.25).clamp(0.0, 1.0);
        ((65_535.0 * density).round_ties_even() / 65_535.0) as f32
    };
    let samples = Samples::F32((0..n * n * n).map(value).collect());
    Field { name: "density".into(), unit: String::new(), size: [n; 3], spacing: [1.0; 3], samples }.upload(gpu()).expect("upload")
}
