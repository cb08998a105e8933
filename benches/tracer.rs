//! Paths a second, milliseconds of majorants, tone map, read-back and encoding.
//!
//! The floor. A step of a flight needs one word of the majorants and, at a tentative collision, one of the volume:
//! 8 bytes. The cloud takes 18 steps a path and the tendrils some 100: 0.15 and 0.8 kB a path, so that memory is no
//! bound (26 GB/s on two cores would feed 30 to 170 M paths a second). Software Vulkan runs 8 lanes abreast, with a
//! loop over lanes for each load, some 600 cycles a step of 8: what counts is how many steps a path takes, and how
//! many of the 8 lanes have work. Hence macrocells of 4³ voxels (8³ took twice the steps among tendrils), lanes that
//! go on to their next sample at once, long dispatches, and even odds for light that has faded to half.

use std::collections::BTreeMap;
use std::time::Instant;

use serde_json::json;
use tyndall::gpu::{AdapterChoice, Gpu, GpuError};
use tyndall::render::{Film, Stage, Tracer};
use tyndall::scene::{Scene, Source, presets};
use tyndall::stream::{Codec, encode};
use tyndall::volume::{AutoWindow, Grid, cloud};

const SIZE: [u32; 2] = [1280, 720];
/// Steps after which the tendrils are pictured.
const STEPS: u32 = 200;

fn main() -> Result<(), GpuError> {
    let gpu = Gpu::open(&AdapterChoice::Auto)?;
    println!("{}", gpu.info().name);
    let tendrils = read(&presets::default_document());
    let grown = grow(&gpu, &tendrils)?;
    let smooth = json!({"source": {"type": "cloud", "size": 64}, "medium": {"sigma_t": 24}});
    let smooth = read(&json!({"camera": {"fov_y": 24}, "volumes": {"main": smooth}}));
    println!("{:>10} {:>14} {:>14}", "scene", "12 ms dispatch", "250 ms dispatch");
    for (name, scene, grid) in [("tendrils", &tendrils, &grown), ("cloud", &smooth, &cloud_of(&gpu, &smooth)?)] {
        let rates = [0.012, 0.25].map(|dispatch_s| paths_per_second(&gpu, scene, grid, dispatch_s));
        let [short, long] = rates;
        println!("{name:>10} {:>8.2} Mpath/s {:>8.2} Mpath/s", short? / 1e6, long? / 1e6);
    }
    println!("majorants of 128³ voxels: {:.1} ms", majorants_ms(&gpu, &tendrils, &grown)?);
    finish_picture(&gpu, &tendrils, &grown)
}

fn read(document: &serde_json::Value) -> Scene {
    Scene::from_json(document).unwrap_or_else(|refusal| panic!("{refusal}"))
}

fn grow(gpu: &Gpu, scene: &Scene) -> Result<Grid, GpuError> {
    let volume = scene.volumes.values().next().unwrap_or_else(|| panic!("the preset has no volume"));
    let Some(mut simulation) = tyndall::sim::build(gpu, &volume.source)? else { panic!("the preset is no simulation") };
    for _ in 0..STEPS {
        simulation.step()?;
    }
    Ok(simulation.grid())
}

fn cloud_of(gpu: &Gpu, scene: &Scene) -> Result<Grid, GpuError> {
    match scene.volumes.values().next().map(|volume| &volume.source) {
        Some(Source::Cloud(source)) => cloud::grow(gpu, source),
        _ => panic!("the scene is no cloud"),
    }
}

fn stage(gpu: &Gpu, scene: &Scene, grid: &Grid) -> Result<(Stage, BTreeMap<String, Grid>), GpuError> {
    let grids: BTreeMap<_, _> = scene.volumes.keys().map(|name| (name.clone(), grid.clone())).collect();
    Ok((Stage::new(gpu, scene, &grids)?, grids))
}

fn paths_per_second(gpu: &Gpu, scene: &Scene, grid: &Grid, dispatch_s: f32) -> Result<f64, GpuError> {
    let (stage, _) = stage(gpu, scene, grid)?;
    let mut tracer = Tracer::new(gpu)?;
    tracer.set_dispatch_time(dispatch_s);
    let size = [320, 180];
    let mut film = Film::new(gpu, size, 0..size[1])?;
    tracer.sample(&mut film, &stage, 4, &mut || true)?;
    let clock = Instant::now();
    let mut spp = 4;
    while clock.elapsed().as_secs_f64() < 3.0 {
        spp += 8;
        tracer.sample(&mut film, &stage, spp, &mut || true)?;
    }
    Ok(f64::from(size[0] * size[1] * (spp - 4)) / clock.elapsed().as_secs_f64())
}

fn majorants_ms(gpu: &Gpu, scene: &Scene, grid: &Grid) -> Result<f64, GpuError> {
    let (mut stage, mut grids) = stage(gpu, scene, grid)?;
    assert_eq!(grid.auto, AutoWindow::Mean(10.0), "the window must be part of what is timed");
    median_ms(15, || {
        for grid in grids.values_mut() {
            grid.version += 1;
        }
        stage.update(scene, &grids)?;
        gpu.finish(gpu.encoder("wait"))
    })
}

fn finish_picture(gpu: &Gpu, scene: &Scene, grid: &Grid) -> Result<(), GpuError> {
    let (stage, _) = stage(gpu, scene, grid)?;
    let mut tracer = Tracer::new(gpu)?;
    let mut film = Film::new(gpu, SIZE, 0..SIZE[1])?;
    tracer.sample(&mut film, &stage, 4, &mut || true)?;
    let mut pixels = Vec::new();
    let develop = median_ms(15, || tracer.develop(&film, &scene.display).map(|picture| pixels = picture))?;
    println!("1280×720 at 4 samples: tone map and read-back {develop:.1} ms");
    for codec in [Codec::Jpeg, Codec::Png] {
        let mut bytes = 0;
        let ms = median_ms(15, || {
            bytes = encode(codec, SIZE, &pixels).map_or(0, |encoded| encoded.len());
            Ok(())
        })?;
        println!("1280×720 at 4 samples: {} {ms:.1} ms, {} kB", codec.name(), bytes / 1000);
    }
    Ok(())
}

/// Median time of a run, in milliseconds.
fn median_ms(runs: usize, mut run: impl FnMut() -> Result<(), GpuError>) -> Result<f64, GpuError> {
    let mut times = Vec::with_capacity(runs);
    for _ in 0..runs {
        let clock = Instant::now();
        run()?;
        times.push(clock.elapsed().as_secs_f64() * 1e3);
    }
    times.sort_by(f64::total_cmp);
    Ok(times[runs / 2])
}
