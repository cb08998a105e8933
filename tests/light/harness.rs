//! Rendering a scene without server or files, and comparing pictures by their own standard errors.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use serde_json::Value;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use tyndall::gpu::{AdapterChoice, Gpu};
use tyndall::render::{Film, Stage, Tracer};
use tyndall::scene::Scene;
use tyndall::volume::Grid;

static GPU: LazyLock<Gpu> = LazyLock::new(|| Gpu::open(&AdapterChoice::Auto).expect("tests need an adapter; see `make test`"));

/// The adapter that all tests share.
pub fn gpu() -> &'static Gpu {
    &GPU
}

/// A picture in linear radiance with its standard errors.
pub struct Picture {
    pub size: [u32; 2],
    pub radiance: Vec<[f32; 4]>,
    pub error: Vec<[f32; 4]>,
}

impl Picture {
    /// Mean over all pixels, and its standard error.
    pub fn mean(&self, channel: usize) -> (f64, f64) {
        let n = self.radiance.len() as f64;
        let mean = self.radiance.iter().map(|pixel| f64::from(pixel[channel])).sum::<f64>() / n;
        let variance = self.error.iter().map(|error| f64::from(error[channel]).powi(2)).sum::<f64>();
        (mean, variance.sqrt() / n)
    }

    /// Mean and standard error of each tile of 8×8 pixels; `None` where any pixel's error is 0.
    pub fn tiles(&self, channel: usize) -> Vec<Option<(f64, f64)>> {
        let [width, height] = self.size.map(|edge| edge as usize / 8);
        let tile = |tx: usize, ty: usize| {
            let pixels = (0..64).map(|i| (ty * 8 + i / 8) * self.size[0] as usize + tx * 8 + i % 8);
            let (mut sum, mut variance) = (0.0, 0.0);
            for i in pixels {
                let error = f64::from(self.error[i][channel]);
                if error == 0.0 {
                    return None;
                }
                sum += f64::from(self.radiance[i][channel]);
                variance += error * error;
            }
            Some((sum / 64.0, variance.sqrt() / 64.0))
        };
        (0..height).flat_map(|ty| (0..width).map(move |tx| (tx, ty))).map(|(tx, ty)| tile(tx, ty)).collect()
    }
}

/// Renders a scene whose volumes need no grid.
pub fn render(scene: &Value, size: [u32; 2], spp: u32) -> Picture {
    render_with(scene, size, spp, &BTreeMap::new())
}

/// Renders a scene with these grids in the place of its sources.
pub fn render_with(scene: &Value, size: [u32; 2], spp: u32, grids: &BTreeMap<String, Grid>) -> Picture {
    let scene = Scene::from_json(scene).expect("the test's scene is valid");
    let mut tracer = Tracer::new(gpu()).expect("tracer");
    tracer.set_dispatch_time(0.2);
    let stage = Stage::new(gpu(), &scene, grids).expect("stage");
    let mut film = Film::new(gpu(), size, 0..size[1]).expect("film");
    assert!(tracer.sample(&mut film, &stage, spp, &mut || true).expect("samples"));
    assert_eq!(tracer.dropped(&film).expect("count"), 0, "no path may be dropped");
    Picture { size, radiance: tracer.radiance(&film).expect("radiance"), error: tracer.error(&film).expect("error") }
}

/// By how many of its standard errors the mean of the red channel differs from a known value.
pub fn mean_z(picture: &Picture, expected: f64) -> f64 {
    let (mean, error) = picture.mean(0);
    // A picture without noise must be exact within the precision of a 32-bit float.
    (mean - expected) / error.max(expected.abs() * 1e-6)
}

/// Checks that two pictures of one scene differ by no more than their noise: mean, and χ² over tiles.
pub fn assert_same_picture(a: &Picture, b: &Picture) {
    let pairs = a.tiles(0).into_iter().zip(b.tiles(0)).filter_map(|(a, b)| Some((a?, b?)));
    assert_tiles_agree("tiles", pairs);
}

/// χ² over pairs of (mean, standard error): the pairs must differ as chance would have it.
pub fn assert_tiles_agree(what: &str, pairs: impl Iterator<Item = ((f64, f64), (f64, f64))>) {
    let zs: Vec<f64> = pairs.map(|((a, se_a), (b, se_b))| (a - b) / se_a.hypot(se_b)).collect();
    assert!(zs.len() >= 8, "{what}: only {} tiles to compare", zs.len());
    let chi2: f64 = zs.iter().map(|z| z * z).sum();
    let p = ChiSquared::new(zs.len() as f64).expect("degrees of freedom").sf(chi2);
    assert!(p > 1e-4, "{what}: χ² = {chi2:.1} over {} tiles, p = {p:.2e}", zs.len());
    let worst = zs.iter().fold(0.0, |worst: f64, z| worst.max(z.abs()));
    assert!(worst < 5.0, "{what}: a tile is {worst:.1} standard errors off");
}
