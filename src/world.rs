//! What stands in a scene: its simulations and still grids, by the volume's name.

use std::collections::BTreeMap;

use crate::gpu::{Gpu, GpuError, Readback};
use crate::scene::param::Place;
use crate::scene::{File, Refusal, Scene, Source};
use crate::sim::{self, Agents, Simulation};
use crate::volume::{Field, Format, Grid, Samples, cloud};

/// Reads the field that a scene names; the error is a sentence that names the file and the reason.
pub type ReadFile<'a> = dyn Fn(&File) -> Result<Field, String> + 'a;

/// Why a scene's volumes cannot be had.
#[derive(Debug, Clone, thiserror::Error)]
pub enum WorldError {
    /// A file cannot be read.
    #[error(transparent)]
    Refused(#[from] Refusal),
    /// The adapter cannot hold it, or failed.
    #[error(transparent)]
    Gpu(#[from] GpuError),
}

/// The simulations and still grids of a scene.
pub struct World {
    gpu: Gpu,
    bodies: BTreeMap<String, Body>,
    grids: BTreeMap<String, Grid>,
}

struct Body {
    source: Source,
    matter: Matter,
}

enum Matter {
    /// Density 1 throughout: there is no grid.
    Plain,
    Still(Still),
    Living(Box<dyn Simulation>),
}

/// A grid that does not change, and what its field was called and made of.
struct Still {
    grid: Grid,
    name: String,
    unit: String,
    /// No values, of the type that the field's values have.
    kind: Samples,
}

/// What an update put away; [`World::restore`] puts it back, dropping it frees it.
#[derive(Default)]
pub struct Before {
    bodies: Vec<(String, Option<Body>)>,
    tuned: Vec<(String, Source)>,
}

impl World {
    /// Grows or reads every volume of a scene.
    ///
    /// # Errors
    /// [`WorldError::Refused`] for a file that cannot be read, [`WorldError::Gpu`] where the adapter cannot hold a grid.
    pub fn new(gpu: &Gpu, scene: &Scene, read: &ReadFile<'_>) -> Result<Self, WorldError> {
        let mut world = Self { gpu: gpu.clone(), bodies: BTreeMap::new(), grids: BTreeMap::new() };
        world.update(scene, read)?;
        Ok(world)
    }

    /// Follows the scene: volumes whose source is unchanged are kept, a simulation in flight is tuned where it can be,
    /// the others are built anew, from step 0.
    ///
    /// # Errors
    /// As [`World::new`]; the world is then as before.
    pub fn update(&mut self, scene: &Scene, read: &ReadFile<'_>) -> Result<Before, WorldError> {
        let mut before = Before::default();
        let result = self.exchange(scene, read, &mut before);
        match result {
            Ok(()) => {
                self.refresh();
                Ok(before)
            }
            Err(error) => {
                self.restore(before);
                Err(error)
            }
        }
    }

    fn exchange(&mut self, scene: &Scene, read: &ReadFile<'_>, before: &mut Before) -> Result<(), WorldError> {
        for (name, volume) in &scene.volumes {
            if let Some(body) = self.bodies.get_mut(name) {
                if body.source == volume.source {
                    continue;
                }
                if let Matter::Living(simulation) = &mut body.matter
                    && simulation.tune(&volume.source)
                {
                    before.tuned.push((name.clone(), std::mem::replace(&mut body.source, volume.source.clone())));
                    continue;
                }
            }
            let body = Body { source: volume.source.clone(), matter: grow(&self.gpu, name, &volume.source, read)? };
            let old = self.bodies.insert(name.clone(), body);
            before.bodies.push((name.clone(), old));
        }
        let gone: Vec<String> = self.bodies.keys().filter(|name| !scene.volumes.contains_key(*name)).cloned().collect();
        for name in gone {
            let old = self.bodies.remove(&name);
            before.bodies.push((name, old));
        }
        Ok(())
    }

    /// Takes the last update back; simulations that it had put away go on at the step at which they were.
    pub fn restore(&mut self, before: Before) {
        for (name, old) in before.bodies {
            match old {
                Some(body) => self.bodies.insert(name, body),
                None => self.bodies.remove(&name),
            };
        }
        for (name, source) in before.tuned {
            if let Some(Body { source: now, matter: Matter::Living(simulation) }) = self.bodies.get_mut(&name) {
                simulation.tune(&source);
                *now = source;
            }
        }
        self.refresh();
    }

    /// Takes one step in every simulation that is not frozen, without waiting for it.
    ///
    /// # Errors
    /// [`GpuError::Fault`] when the device reported an error.
    pub fn step(&mut self) -> Result<(), GpuError> {
        self.simulations().try_for_each(Simulation::step)?;
        self.refresh();
        Ok(())
    }

    /// Most steps that a simulation has taken since its start.
    pub fn steps(&self) -> u32 {
        self.living().map(Simulation::steps).max().unwrap_or(0)
    }

    /// Whether no simulation goes on: each has reached its `freeze_at`, or there is none.
    pub fn frozen(&self) -> bool {
        self.living().all(Simulation::frozen)
    }

    /// Starts every simulation again from its seed.
    ///
    /// # Errors
    /// As [`World::step`].
    pub fn reset(&mut self) -> Result<(), GpuError> {
        self.simulations().try_for_each(Simulation::reset)?;
        self.refresh();
        Ok(())
    }

    /// The grids by volume, as they are now; a homogeneous volume has none.
    pub fn grids(&self) -> &BTreeMap<String, Grid> {
        &self.grids
    }

    /// Whether a volume's grid changes with the steps.
    pub fn lives(&self, volume: &str) -> bool {
        matches!(self.bodies.get(volume), Some(Body { matter: Matter::Living(_), .. }))
    }

    /// Names of a volume's fields, the one that is shown first; none where the volume has no grid.
    pub fn fields(&self, volume: &str) -> Vec<&str> {
        match self.bodies.get(volume).map(|body| &body.matter) {
            Some(Matter::Living(simulation)) => simulation.fields().to_vec(),
            Some(Matter::Still(still)) => vec![&still.name],
            _ => Vec::new(),
        }
    }

    /// Reads a volume's field back; `None` where there is no such volume or field. A still grid's field is `density`,
    /// or what its file calls it.
    ///
    /// # Errors
    /// As [`World::step`].
    pub fn read(&mut self, volume: &str, field: &str) -> Result<Option<Field>, GpuError> {
        match self.bodies.get_mut(volume).map(|body| &mut body.matter) {
            Some(Matter::Living(simulation)) => simulation.read(field),
            Some(Matter::Still(still)) if field == "density" || field == still.name => still.read(&self.gpu).map(Some),
            _ => Ok(None),
        }
    }

    /// Reads the agents of a volume's simulation back; `None` where it has none.
    ///
    /// # Errors
    /// As [`World::step`].
    pub fn read_agents(&mut self, volume: &str) -> Result<Option<Agents>, GpuError> {
        match self.bodies.get_mut(volume).map(|body| &mut body.matter) {
            Some(Matter::Living(simulation)) => simulation.read_agents(),
            _ => Ok(None),
        }
    }

    /// Sums that were held at 2³²−1 instead of passing it, since the start.
    ///
    /// # Errors
    /// As [`World::step`].
    pub fn saturated(&mut self) -> Result<u64, GpuError> {
        self.simulations().try_fold(0, |sum: u64, simulation| Ok(sum.saturating_add(simulation.saturated()?)))
    }

    /// Bytes on the GPU.
    pub fn memory(&self) -> u64 {
        let of = |body: &Body| match &body.matter {
            Matter::Plain => 0,
            Matter::Still(still) => still.grid.words.size(),
            Matter::Living(_) => footprint(&body.source),
        };
        self.bodies.values().map(of).sum()
    }

    /// Bytes that the volumes of a scene will take, as far as can be said before files are read.
    pub fn estimate(scene: &Scene) -> u64 {
        scene.volumes.values().fold(0, |sum: u64, volume| sum.saturating_add(footprint(&volume.source)))
    }

    fn living(&self) -> impl Iterator<Item = &dyn Simulation> {
        self.bodies.values().filter_map(|body| match &body.matter {
            Matter::Living(simulation) => Some(&**simulation),
            _ => None,
        })
    }

    fn simulations(&mut self) -> impl Iterator<Item = &mut (dyn Simulation + 'static)> {
        self.bodies.values_mut().filter_map(|body| match &mut body.matter {
            Matter::Living(simulation) => Some(&mut **simulation),
            _ => None,
        })
    }

    fn refresh(&mut self) {
        let grids = self.bodies.iter().filter_map(|(name, body)| match &body.matter {
            Matter::Plain => None,
            Matter::Still(still) => Some((name.clone(), still.grid.clone())),
            Matter::Living(simulation) => Some((name.clone(), simulation.grid())),
        });
        self.grids = grids.collect();
    }
}

impl Drop for World {
    /// Waits for the steps under way: a process that ends while the software driver compiles a kernel for one crashes.
    fn drop(&mut self) {
        if self.living().next().is_some() {
            let _ = self.gpu.finish(self.gpu.encoder("last steps"));
        }
    }
}

fn grow(gpu: &Gpu, volume: &str, source: &Source, read: &ReadFile<'_>) -> Result<Matter, WorldError> {
    Ok(match source {
        Source::Homogeneous(_) | Source::Physarum(_) => sim::build(gpu, source)?.map_or(Matter::Plain, Matter::Living),
        Source::Cloud(cloud) => Matter::Still(Still {
            grid: cloud::grow(gpu, cloud)?,
            name: "density".to_owned(),
            unit: String::new(),
            kind: Samples::F32(Vec::new()),
        }),
        Source::File(file) => {
            let field = read(file).map_err(|text| {
                let volumes = Place::ROOT.key("volumes");
                let volume = volumes.key(volume);
                let source = volume.key("source");
                source.key(if file.path.is_some() { "path" } else { "dataset" }).refuse("unreadable_file", text)
            })?;
            let grid = field.upload(gpu)?;
            let kind = match field.samples {
                Samples::U8(_) => Samples::U8(Vec::new()),
                Samples::U16(_) => Samples::U16(Vec::new()),
                Samples::U32(_) => Samples::U32(Vec::new()),
                Samples::I16(_) => Samples::I16(Vec::new()),
                Samples::F32(_) => Samples::F32(Vec::new()),
            };
            Matter::Still(Still { grid, name: field.name, unit: field.unit, kind })
        }
    })
}

/// Bytes that a source takes on the GPU; 0 for a file, which says it only once it is read.
fn footprint(source: &Source) -> u64 {
    match source {
        Source::Cloud(cloud) => u64::from(cloud.size).pow(3).saturating_mul(4),
        Source::Homogeneous(_) | Source::File(_) | Source::Physarum(_) => sim::memory(source).unwrap_or(0),
    }
}

impl Still {
    /// The field in the type that it came in; integers up to 16 bits are floats on the GPU, exactly.
    fn read(&self, gpu: &Gpu) -> Result<Field, GpuError> {
        let count = self.grid.size.iter().map(|&edge| edge as usize).product();
        let samples = if self.grid.format == Format::U32 {
            Samples::U32(Readback::default().values(gpu, &self.grid.words, count)?)
        } else {
            let values: Vec<f32> = Readback::default().values(gpu, &self.grid.words, count)?;
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the values were of the smaller type")]
            match &self.kind {
                Samples::U8(_) => Samples::U8(values.into_iter().map(|x| x as u8).collect()),
                Samples::U16(_) => Samples::U16(values.into_iter().map(|x| x as u16).collect()),
                Samples::I16(_) => Samples::I16(values.into_iter().map(|x| x as i16).collect()),
                Samples::U32(_) | Samples::F32(_) => Samples::F32(values),
            }
        };
        Ok(Field { name: self.name.clone(), unit: self.unit.clone(), size: self.grid.size, spacing: self.grid.spacing, samples })
    }
}
