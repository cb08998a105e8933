//! `tyndall simulate`: steps a scene's simulations and writes a field or the particles.

use std::path::{Path, PathBuf};

use tyndall::export::{Attribute, ParticlesError, write_csv, write_npz, write_ply, write_vtk};
use tyndall::gpu::{AdapterChoice, Gpu, GpuError};
use tyndall::volume::Field;
use tyndall::world::{World, WorldError};

use super::adapter::on_adapter;
use super::convert::FieldFormat;
use super::failure::Failure;
use super::output::Output;
use super::progress::{Progress, Style};
use super::scene::{Chosen, lives};

/// Steps submitted before they are waited for.
const STEPS_IN_FLIGHT: u32 = 8;

/// Run a scene's simulation and write its state.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// A preset's name, or a scene file.
    scene: String,
    /// Where to write: a field as .nrrd or .npy, indexed [z][y][x], or the particles as .npz, .csv, .ply or .vtk; with
    /// --every, %04d in the name is the step.
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Steps to take; by default those at which the scene is at its best.
    #[arg(long, conflicts_with = "time")]
    steps: Option<u32>,
    /// Time to simulate, in seconds of the simulation.
    #[arg(long)]
    time: Option<f64>,
    /// Write after every K steps, in place of once at the end.
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(1..))]
    every: Option<u32>,
    /// The volume to write, where the scene has several.
    #[arg(long, value_name = "NAME")]
    volume: Option<String>,
    /// The field to write; by default the one that is shown.
    #[arg(long, value_name = "NAME")]
    field: Option<String>,
    /// Seed of every simulation, in place of the scene's.
    #[arg(long)]
    seed: Option<u32>,
    /// auto, gpu, cpu, or a part of an adapter's name.
    #[arg(long, default_value = "auto")]
    adapter: AdapterChoice,
    /// What to tell on stderr: by default a bar on a terminal, and nothing on a pipe.
    #[arg(long)]
    progress: Option<Style>,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let format = format(args)?;
    let output = Output::new(&args.output)?;
    if args.every.is_some() != output.is_sequence() {
        return Err(Failure::usage("--every and a name with %04d need each other: out_%04d.nrrd"));
    }
    if args.time.is_some() {
        return Err(Failure::usage("--time: a physarum counts steps and knows no seconds; use --steps"));
    }
    let chosen = Chosen::read(&args.scene, args.seed)?;
    let volume = volume(args, &chosen)?;
    let chosen = chosen.read_fields()?;
    on_adapter(&args.adapter, |gpu| step_all(args, gpu, &chosen, &volume, &format, &output))
}

fn step_all(args: &Args, gpu: &Gpu, chosen: &Chosen, volume: &str, format: &Format, output: &Output) -> Result<(), Failure> {
    let steps = chosen.steps(args.steps);
    let mut world = grow(gpu, chosen)?;
    let write = |world: &mut World| {
        let bytes = match format {
            Format::Field(format) => format.write(&field(args, volume, world)?),
            Format::Particles(write) => particles(volume, world, *write)?,
        };
        output.write(world.steps(), &bytes)
    };
    let mut progress = Progress::new(args.progress, "simulate", steps.into());
    match args.every {
        None => {
            advance(gpu, &mut world, steps, &mut progress)?;
            write(&mut world)?;
        }
        Some(every) => {
            for _ in 0..steps / every {
                advance(gpu, &mut world, every, &mut progress)?;
                write(&mut world)?;
            }
        }
    }
    drop(progress);
    let held = world.saturated()?;
    if held > 0 {
        eprintln!("tyndall: {held} sums reached 2^32-1 and were held there; a lower `deposit` or `decay` keeps them below");
    }
    Ok(())
}

/// The volume that was named, or the only one that there can be talk of.
fn volume(args: &Args, chosen: &Chosen) -> Result<String, Failure> {
    let volumes = &chosen.scene.volumes;
    let names = || volumes.keys().map(String::as_str).collect::<Vec<_>>().join(", ");
    if let Some(name) = &args.volume {
        if !volumes.contains_key(name) {
            return Err(Failure::usage(format!("--volume: the scene has no volume `{name}`, but {}", names())));
        }
        return Ok(name.clone());
    }
    let mut living = volumes.iter().filter(|(_, volume)| lives(volume)).map(|(name, _)| name);
    match (living.next(), living.next(), volumes.len()) {
        (Some(only), None, _) => Ok(only.clone()),
        (None, _, 1) => Ok(names()),
        (None, _, 0) => Err(Failure::input(Path::new(&args.scene), "volumes", "there are none")),
        _ => Err(Failure::usage(format!("--volume: choose one of {}", names()))),
    }
}

/// What is written, and how.
enum Format {
    Field(FieldFormat),
    Particles(fn(&[Attribute<'_>]) -> Result<Vec<u8>, ParticlesError>),
}

fn format(args: &Args) -> Result<Format, Failure> {
    let path = &args.output;
    if let Some(format) = FieldFormat::of(path) {
        return Ok(Format::Field(format));
    }
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default().to_lowercase();
    let format = match extension.as_str() {
        "npz" => Format::Particles(write_npz),
        "csv" => Format::Particles(write_csv),
        "ply" => Format::Particles(write_ply),
        "vtk" => Format::Particles(write_vtk),
        _ => {
            let known = "fields are written as .nrrd and .npy, particles as .npz, .csv, .ply and .vtk";
            return Err(Failure::usage(format!("{}: {known}", path.display())));
        }
    };
    match args.field {
        Some(_) => Err(Failure::usage(format!("{}: holds particles, and no --field", path.display()))),
        None => Ok(format),
    }
}

fn field(args: &Args, volume: &str, world: &mut World) -> Result<Field, Failure> {
    let fields: Vec<String> = world.fields(volume).into_iter().map(str::to_owned).collect();
    let Some(name) = args.field.as_ref().or(fields.first()) else {
        return Err(Failure::input(Path::new(&args.scene), &format!("volumes.{volume}"), "it has no field to write"));
    };
    world
        .read(volume, name)?
        .ok_or_else(|| Failure::usage(format!("--field: the volume `{volume}` has no field `{name}`, but {}", fields.join(", "))))
}

fn particles(
    volume: &str,
    world: &mut World,
    write: fn(&[Attribute<'_>]) -> Result<Vec<u8>, ParticlesError>,
) -> Result<Vec<u8>, Failure> {
    let Some(agents) = world.read_agents(volume)? else {
        return Err(Failure::usage(format!("the volume `{volume}` has no particles; .nrrd and .npy hold its field")));
    };
    let attributes = [
        Attribute { name: "position", parts: 3, values: agents.positions.as_flattened() },
        Attribute { name: "heading", parts: 3, values: agents.headings.as_flattened() },
        Attribute { name: "orientation", parts: 4, values: agents.orientations.as_flattened() },
    ];
    write(&attributes).map_err(Failure::limit)
}

/// Grows and reads what stands in the scene.
pub(crate) fn grow(gpu: &Gpu, chosen: &Chosen) -> Result<World, Failure> {
    World::new(gpu, &chosen.scene, &|file| chosen.take(file)).map_err(|error| match error {
        WorldError::Refused(refusal) => chosen.refuse(&refusal),
        WorldError::Gpu(error) => error.into(),
    })
}

/// Takes steps, and waits until they are taken.
pub(crate) fn advance(gpu: &Gpu, world: &mut World, steps: u32, progress: &mut Progress) -> Result<(), GpuError> {
    let first = world.steps();
    for done in 1..=steps {
        world.step()?;
        if done % STEPS_IN_FLIGHT == 0 || done == steps {
            gpu.finish(gpu.encoder("steps"))?;
            progress.at((first + done).into());
        }
    }
    Ok(())
}
