//! `tyndall render`: a still, or a sequence, without a server.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tyndall::export::{Provenance, write_exr, write_jpg, write_png};
use tyndall::gpu::{AdapterChoice, Gpu};
use tyndall::render::{Film, Stage, Tracer};
use tyndall::scene::Scene;
use tyndall::world::World;

use super::adapter::on_adapter;
use super::exposure::{Budget, Picture, mean_and_error};
use super::failure::Failure;
use super::output::{self, Output};
use super::progress::{Progress, Style};
use super::scene::Chosen;
use super::simulate;

/// Largest edge of a picture, in pixels.
const MAX_EDGE: u32 = 16_384;
/// Most samples per pixel, as in a scene document.
const MAX_SPP: u32 = 1 << 20;
/// Seconds that a dispatch should take: nobody waits for the next picture, and watchdogs bite at two.
const DISPATCH_S: f32 = 0.2;
/// Fewest samples that tell a standard error.
const MIN_SPP_FOR_ERROR: u32 = 16;

/// Take a picture of a scene, or a sequence of pictures.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// A preset's name, or a scene file.
    scene: String,
    /// Where to write: .exr is linear radiance, .png and .jpg the picture as shown; with --frames, %04d in the name is the
    /// frame, from 0.
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Width and height in pixels.
    #[arg(long, value_name = "WxH", default_value = "1280x720", value_parser = size)]
    size: [u32; 2],
    /// Samples per pixel; by default the scene's own `render.spp` and `render.noise` decide.
    #[arg(long, value_name = "N", group = "until", value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_SPP)))]
    spp: Option<u32>,
    /// Time to spend on samples, for each frame.
    #[arg(long, value_name = "S", group = "until", value_parser = above_zero, allow_negative_numbers = true)]
    seconds: Option<f32>,
    /// Mean relative standard error to reach.
    #[arg(long, value_name = "X", group = "until", value_parser = above_zero, allow_negative_numbers = true)]
    noise: Option<f32>,
    /// Seed of every simulation and of the samples, in place of the scene's.
    #[arg(long)]
    seed: Option<u32>,
    /// Simulation steps before the first sample; by default those at which the scene is at its best.
    #[arg(long, value_name = "N")]
    steps: Option<u32>,
    /// Pictures to take, with one simulation step between one and the next.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// Write what was done and how long it took, as JSON; of a sequence, means are those of the last frame.
    #[arg(long, value_name = "STATS.json")]
    stats: Option<PathBuf>,
    /// Write each pixel's standard error of the mean, from at least 16 samples.
    #[arg(long, value_name = "OUT2.exr")]
    error: Option<PathBuf>,
    /// auto, gpu, cpu, or a part of an adapter's name.
    #[arg(long, default_value = "auto")]
    adapter: AdapterChoice,
    /// What to tell on stderr: by default a bar on a terminal, and nothing on a pipe.
    #[arg(long)]
    progress: Option<Style>,
}

#[derive(Clone, Copy, PartialEq)]
enum Format {
    Png,
    Jpg,
    Exr,
}

fn size(text: &str) -> Result<[u32; 2], String> {
    let edge = |text: &str| text.parse().ok().filter(|edge| (1..=MAX_EDGE).contains(edge));
    text.split_once('x')
        .and_then(|(width, height)| Some([edge(width)?, edge(height)?]))
        .ok_or_else(|| format!("a size is WIDTHxHEIGHT, each from 1 to {MAX_EDGE}"))
}

fn above_zero(text: &str) -> Result<f32, String> {
    text.parse().ok().filter(|x: &f32| x.is_finite() && *x > 0.0).ok_or_else(|| "a number above 0 is needed".to_owned())
}

fn extension(path: &Path) -> String {
    path.extension().and_then(|extension| extension.to_str()).unwrap_or_default().to_lowercase()
}

fn format(path: &Path) -> Result<Format, Failure> {
    match extension(path).as_str() {
        "png" => Ok(Format::Png),
        "jpg" | "jpeg" => Ok(Format::Jpg),
        "exr" => Ok(Format::Exr),
        "mp4" => Err(Failure::usage(format!("{}: films are not written yet; name_%04d.png is", path.display()))),
        _ => Err(Failure::usage(format!("{}: pictures are written as .png, .jpg and .exr", path.display()))),
    }
}

/// Everything that can be refused before the work begins.
fn check(args: &Args, output: &Output, budget: &Budget) -> Result<(), Failure> {
    if args.frames.is_some() != output.is_sequence() {
        return Err(Failure::usage("--frames and a name with %04d need each other: out_%04d.png"));
    }
    if let Some(path) = &args.error {
        if extension(path) != "exr" {
            return Err(Failure::usage(format!("{}: the standard error is written as .exr", path.display())));
        }
        if args.frames.is_some() {
            return Err(Failure::usage("--error is for one picture, not for --frames"));
        }
        if budget.spp < MIN_SPP_FOR_ERROR {
            let words = format!("--error needs at least {MIN_SPP_FOR_ERROR} samples a pixel; {} are too few", budget.spp);
            return Err(Failure::usage(words));
        }
        Output::new(path)?;
    }
    args.stats.as_deref().map(Output::new).transpose().map(|_| ())
}

fn budget(args: &Args, scene: &Scene) -> Budget {
    let free = args.seconds.is_some() || args.noise.is_some();
    let own = args.spp.is_none() && !free;
    Budget {
        at_least: if args.error.is_some() { MIN_SPP_FOR_ERROR } else { 1 },
        spp: args.spp.unwrap_or(if free { MAX_SPP } else { scene.render.spp }),
        noise: args.noise.or(scene.render.noise.filter(|_| own)),
        time: args.seconds.map(Duration::from_secs_f32),
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let format = format(&args.output)?;
    let output = Output::new(&args.output)?;
    let chosen = Chosen::read(&args.scene, args.seed)?;
    let budget = budget(args, &chosen.scene);
    check(args, &output, &budget)?;
    let chosen = chosen.read_fields()?;
    on_adapter(&args.adapter, |gpu| take_all(args, gpu, &chosen, format, &budget, &output))
}

fn take_all(args: &Args, gpu: &Gpu, chosen: &Chosen, format: Format, budget: &Budget, output: &Output) -> Result<(), Failure> {
    let mut studio = Studio::new(args, gpu, chosen, format)?;
    let mut reached = true;
    let frames = args.frames.unwrap_or(1);
    for frame in 0..frames {
        let steps = if frame == 0 { chosen.steps(args.steps) } else { 1 };
        studio.advance(steps)?;
        reached &= studio.take(budget)?;
        // All that can fail comes before the first file, so that a failure leaves none.
        let mut files = vec![(output.file(frame), studio.encode()?)];
        if let Some(path) = &args.error {
            files.push((path.clone(), studio.encode_error()?));
        }
        if let Some(path) = args.stats.as_ref().filter(|_| frame + 1 == frames) {
            files.push((path.clone(), format!("{:#}\n", studio.stats()?).into_bytes()));
        }
        files.iter().try_for_each(|(path, bytes)| output::write(path, bytes))?;
    }
    match args.noise {
        Some(noise) if !reached => Err(Failure::limit(format!("a noise of {noise} was not reached within {MAX_SPP} samples"))),
        _ => Ok(()),
    }
}

/// What it takes to take pictures of one scene.
struct Studio<'a> {
    args: &'a Args,
    gpu: &'a Gpu,
    scene: &'a Scene,
    document: Value,
    format: Format,
    world: World,
    stage: Stage,
    tracer: Tracer,
    picture: Picture,
    simulate: Duration,
    render: Duration,
    paths: u64,
}

impl<'a> Studio<'a> {
    fn new(args: &'a Args, gpu: &'a Gpu, chosen: &'a Chosen, format: Format) -> Result<Self, Failure> {
        let scene = &chosen.scene;
        let begun = Instant::now();
        let world = simulate::grow(gpu, chosen)?;
        let simulate = begun.elapsed();
        let stage = Stage::new(gpu, scene, world.grids())?;
        let mut tracer = Tracer::new(gpu)?;
        tracer.set_dispatch_time(DISPATCH_S);
        // The kernel is compiled at its first use, which is no part of the time that paths take.
        tracer.sample(&mut Film::new(gpu, [8, 8], 0..8)?, &stage, 1, &mut || true)?;
        let picture = Picture::new(gpu, args.size)?;
        let document = scene.to_json();
        let (render, paths) = (Duration::ZERO, 0);
        Ok(Self { args, gpu, scene, document, format, world, stage, tracer, picture, simulate, render, paths })
    }

    fn advance(&mut self, steps: u32) -> Result<(), Failure> {
        let begun = Instant::now();
        let mut progress = Progress::new(self.args.progress, "simulate", steps.into());
        simulate::advance(self.gpu, &mut self.world, steps, &mut progress)?;
        self.simulate += begun.elapsed();
        self.stage.update(self.scene, self.world.grids())?;
        Ok(())
    }

    /// Takes a picture; `false` where a bound on its noise was not reached.
    fn take(&mut self, budget: &Budget) -> Result<bool, Failure> {
        let begun = Instant::now();
        let mut progress = Progress::new(self.args.progress, "render", budget.spp.into());
        let reached = self.picture.expose(&mut self.tracer, &self.stage, budget, &mut progress)?;
        self.render += begun.elapsed();
        let [width, height] = self.picture.size.map(u64::from);
        self.paths += width * height * u64::from(self.picture.samples());
        Ok(reached)
    }

    fn provenance(&self) -> Provenance<'_> {
        Provenance {
            scene: &self.document,
            spp: self.picture.samples(),
            seed: self.scene.render.seed,
            adapter: &self.gpu.info().name,
        }
    }

    fn encode(&mut self) -> Result<Vec<u8>, Failure> {
        let size = self.picture.size;
        if self.format == Format::Exr {
            let radiance = self.picture.radiance(&mut self.tracer)?;
            return Ok(write_exr(size, &radiance, &self.provenance())?);
        }
        let shown = self.picture.develop(&mut self.tracer, &self.scene.display)?;
        Ok(if self.format == Format::Png { write_png(size, &shown, &self.provenance()) } else { write_jpg(size, &shown) }?)
    }

    fn encode_error(&mut self) -> Result<Vec<u8>, Failure> {
        let error = self.picture.error(&mut self.tracer)?;
        Ok(write_exr(self.picture.size, &error, &self.provenance())?)
    }

    fn stats(&mut self) -> Result<Value, Failure> {
        let radiance = self.picture.radiance(&mut self.tracer)?;
        let error = self.picture.error(&mut self.tracer)?;
        let (mean, se_of_mean) = mean_and_error(&radiance, &error);
        let info = self.gpu.info();
        let render_s = self.render.as_secs_f64();
        #[expect(clippy::cast_precision_loss, reason = "a rate, to a few digits")]
        let paths_per_s = self.paths as f64 / render_s.max(1e-9);
        Ok(json!({
            "adapter": info.name,
            "backend": info.backend.to_str(),
            "width": self.picture.size[0],
            "height": self.picture.size[1],
            "spp": self.picture.samples(),
            "paths": self.paths,
            "simulate_s": self.simulate.as_secs_f64(),
            "render_s": render_s,
            "paths_per_s": paths_per_s,
            "mean": mean,
            "se_of_mean": se_of_mean,
        }))
    }
}
