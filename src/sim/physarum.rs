//! A physarum in three dimensions: agents that follow trails, and leave them.
//!
//! Each agent has a place and a frame of its own, heading along the frame's z. A step is
//!
//! 1. the field is blurred over 27 voxels with weights 8-4-2-1 and multiplied by `decay`;
//! 2. every agent reads *that* field at one forward and three flanking taps, turns to the strongest and moves;
//! 3. every agent adds `deposit` to its voxel.
//!
//! Sensing apart from depositing, integer counts and random numbers hashed from seed, agent and step make a run
//! reproducible to the bit, in whatever order the device works. (Jones 2010, "Characteristics of pattern formation and
//! evolution in approximations of Physarum transport networks", in three dimensions with the axes of jbaker's physarum.)
//!
//! The blur's sum is exact, and so is its product with `decay`, which is rounded to a multiple of 2⁻¹⁶; the quotient is
//! then rounded towards 0. A voxel loses half a count a step by that, so the field's mean is
//! (agents/voxels·deposit − ½)/(1 − decay) where all voxels hold some. A sum past 2³²−1 is held there and counted; only
//! deposits can pass it, as blur and decay make nothing larger than what was.

use encase::ShaderType;
use glam::{Quat, UVec3, Vec2, Vec3};

use super::{Agents, Simulation, next_version};
use crate::gpu::{Gpu, GpuError, Kernel, Readback, groups_1d};
use crate::scene::{self, Edge, Reorient, Source};
use crate::volume::{AutoWindow, Field, Format, Grid, Samples};

/// The density window of `auto` goes from 0 to this many times the field's mean.
///
/// Half of a grown field's counts lie above 5 to 115 means: above 5 to 15 in sets of broad, soft strands (tangle,
/// fatworms, cells, tendrils, foam), above 30 to 115 in thin ones (mesh, loops, worms, hairs, cosmic). With 10, the cores
/// of the broad ones have a density of about 1, and the thin ones one that grows as they get thinner, so that the
/// optical depth across a strand stays alike. The mean optical depth of a world unit is σt/10 for every set.
const WINDOW_MEANS: f32 = 10.0;

/// Bytes of an agent: position and voxel index, quaternion.
const AGENT_BYTES: u64 = 32;

/// The largest deposit that the document allows, as a power of two.
const DEPOSIT_BITS: u32 = 24;

/// A physarum on the GPU.
pub struct Physarum {
    gpu: Gpu,
    source: scene::Physarum,
    steps: u32,
    version: u64,
    /// Holds the newest counts: 0 or 1, of `fields`.
    newest: usize,
    params: wgpu::Buffer,
    fields: [wgpu::Buffer; 2],
    places: wgpu::Buffer,
    headings: wgpu::Buffer,
    passed_count: wgpu::Buffer,
    held: wgpu::Buffer,
    kernels: Kernels,
    start: wgpu::BindGroup,
    /// For steps that write field 0, and field 1.
    bound: [Bound; 2],
    readback: Readback,
}

/// The kernels of a step; two of them are made for one kind of walls.
struct Kernels {
    start: Kernel,
    diffuse: Kernel,
    sense: Kernel,
    deposit: Kernel,
    hold: Kernel,
}

/// What the kernels of a step are bound to.
struct Bound {
    diffuse: wgpu::BindGroup,
    sense: wgpu::BindGroup,
    deposit: wgpu::BindGroup,
    hold: wgpu::BindGroup,
}

/// `Physarum` of shaders/lib/physarum.wgsl.
#[derive(ShaderType)]
struct Params {
    size: UVec3,
    agents: u32,
    inverse_size: Vec3,
    seed: u32,
    step_number: u32,
    deposit: u32,
    decay: u32,
    sense_ahead: f32,
    sense_flank: Vec2,
    move_flank: Vec2,
    half_tilt: Vec2,
    move_ahead: f32,
}

impl Params {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "decay is between 0 and 1")]
    fn new(source: &scene::Physarum, step_number: u32) -> Self {
        let polar = |degrees: f32, length: f32| Vec2::from_angle(degrees.to_radians()) * length;
        let size = UVec3::from(source.size);
        let tilt = match source.reorient_by {
            Reorient::Sense => source.sense_angle,
            Reorient::Turn => source.turn_angle,
        };
        Self {
            size,
            agents: source.agents,
            inverse_size: size.as_vec3().recip(),
            seed: source.seed,
            step_number,
            deposit: source.deposit,
            decay: (source.decay * 65_536.0).round() as u32,
            sense_ahead: source.sense_distance,
            sense_flank: polar(source.sense_angle, source.sense_distance),
            move_flank: polar(source.turn_angle, source.step),
            half_tilt: polar(tilt / 2.0, 1.0),
            move_ahead: source.step,
        }
    }
}

fn voxels(size: [u32; 3]) -> u64 {
    size.into_iter().map(u64::from).fold(1, u64::saturating_mul)
}

/// Bytes of one of the two fields. The one not shown serves as the list of the voxels whose sum has passed 2³²−1:
/// each once, and once more for every further 2³² of its deposits.
fn field_bytes(source: &scene::Physarum) -> u64 {
    let passes = voxels(source.size).saturating_add((u64::from(source.agents) << DEPOSIT_BITS) >> 32);
    passes.saturating_mul(4)
}

/// Bytes on the GPU that a physarum takes, at most `u64::MAX`.
pub fn memory(source: &scene::Physarum) -> u64 {
    field_bytes(source).saturating_mul(2).saturating_add(u64::from(source.agents) * AGENT_BYTES)
}

impl Physarum {
    /// A physarum at its start: agents at random places, the field empty.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] with the numbers where the adapter cannot hold it, [`GpuError::Fault`] when the device
    /// reported an error.
    ///
    /// # Panics
    /// When an edge is below four voxels, which the scene document refuses.
    pub fn new(gpu: &Gpu, source: &scene::Physarum) -> Result<Self, GpuError> {
        assert!(source.size.iter().all(|&edge| edge >= 4), "an edge is below 4 voxels: {:?}", source.size);
        let [nx, ny, nz] = source.size;
        let what = format!("the physarum field of {nx}×{ny}×{nz} voxels");
        let bytes = field_bytes(source);
        // Kernels number the words of a field by u32.
        let allowed = gpu.largest_binding().min(u64::from(u32::MAX) * 4);
        if bytes > allowed {
            return Err(GpuError::TooLarge { what, needed: bytes, allowed, adapter: gpu.info().name.clone() });
        }
        let fields = [gpu.storage(&what, bytes)?, gpu.storage(&what, bytes)?];
        let agents = |part: &str| {
            gpu.storage(&format!("{part} of {} physarum agents", source.agents), u64::from(source.agents) * AGENT_BYTES / 2)
        };
        let places = agents("the places")?;
        let headings = agents("the headings")?;
        let passed_count = gpu.storage("physarum passed_count", 4)?;
        let held = gpu.storage("physarum held", 8)?;
        let params = gpu.uniform("physarum params", &Params::new(source, 0));
        let kernels = Kernels::load(gpu, source);
        let start = kernels.start.bind(gpu, &[("params", &params), ("places", &places), ("headings", &headings)]);
        let bind = |next, previous| kernels.bind(gpu, &params, [next, previous], [&places, &headings], [&passed_count, &held]);
        let bound = [bind(&fields[0], &fields[1]), bind(&fields[1], &fields[0])];
        let mut physarum = Self {
            gpu: gpu.clone(),
            source: source.clone(),
            steps: 0,
            version: next_version(),
            newest: 0,
            params,
            fields,
            places,
            headings,
            passed_count,
            held,
            kernels,
            start,
            bound,
            readback: Readback::default(),
        };
        physarum.reset()?;
        Ok(physarum)
    }

    /// Takes over the walls that `source` has: kernels are made for one kind.
    fn rebuild_walls(&mut self) {
        self.kernels.load_walls(&self.gpu, &self.source);
        let bind = |next: usize| {
            let fields = [&self.fields[next], &self.fields[1 - next]];
            let agents = [&self.places, &self.headings];
            self.kernels.bind(&self.gpu, &self.params, fields, agents, [&self.passed_count, &self.held])
        };
        self.bound = [bind(0), bind(1)];
    }
}

impl Kernels {
    fn load(gpu: &Gpu, source: &scene::Physarum) -> Self {
        let [diffuse, sense] = Self::walled(gpu, source);
        Self {
            start: Kernel::load(gpu, "physarum_start.wgsl"),
            diffuse,
            sense,
            deposit: Kernel::load(gpu, "physarum_deposit.wgsl"),
            hold: Kernel::load(gpu, "physarum_hold.wgsl"),
        }
    }

    fn load_walls(&mut self, gpu: &Gpu, source: &scene::Physarum) {
        [self.diffuse, self.sense] = Self::walled(gpu, source);
    }

    fn walled(gpu: &Gpu, source: &scene::Physarum) -> [Kernel; 2] {
        let walls = match source.boundary {
            Edge::Periodic => 0.0,
            Edge::Reflect => 1.0,
            Edge::Absorb => 2.0,
        };
        let column = f64::from(column(gpu));
        [
            Kernel::load_with(gpu, diffuse_path(source), &[("walls", walls), ("column", column)]),
            Kernel::load_with(gpu, "physarum_sense.wgsl", &[("walls", walls)]),
        ]
    }

    fn bind(
        &self,
        gpu: &Gpu,
        params: &wgpu::Buffer,
        [next, previous]: [&wgpu::Buffer; 2],
        [places, headings]: [&wgpu::Buffer; 2],
        [passed_count, held]: [&wgpu::Buffer; 2],
    ) -> Bound {
        let agents = [("params", params), ("field", next), ("places", places)];
        let passed = [("passed", previous), ("passed_count", passed_count)];
        Bound {
            diffuse: self.diffuse.bind(gpu, &[("params", params), ("previous", previous), ("next", next)]),
            sense: self.sense.bind(gpu, &[&agents[..], &[("headings", headings)]].concat()),
            deposit: self.deposit.bind(gpu, &[&agents[..], &passed].concat()),
            hold: self.hold.bind(gpu, &[&[("field", next), ("held", held)][..], &passed].concat()),
        }
    }
}

/// Whether rows can be read four voxels at a time.
fn has_quads(source: &scene::Physarum) -> bool {
    source.size[0].is_multiple_of(4)
}

fn diffuse_path(source: &scene::Physarum) -> &'static str {
    if has_quads(source) { "physarum_diffuse.wgsl" } else { "physarum_diffuse_any.wgsl" }
}

/// Voxels along z that an invocation of the blur walks: long walks load less, short ones occupy a GPU.
fn column(gpu: &Gpu) -> u32 {
    if gpu.is_software() { 32 } else { 8 }
}

/// Invocations of the blur.
fn diffuse_items(gpu: &Gpu, source: &scene::Physarum) -> u64 {
    let [nx, ny, nz] = source.size;
    let rows = if has_quads(source) { ny.div_ceil(4) } else { ny };
    voxels([nx.div_ceil(4), rows, nz.div_ceil(column(gpu))])
}

impl Simulation for Physarum {
    fn step(&mut self) -> Result<(), GpuError> {
        if self.frozen() {
            return Ok(());
        }
        self.gpu.write_uniform(&self.params, &Params::new(&self.source, self.steps + 1));
        let next = 1 - self.newest;
        let (kernels, bound) = (&self.kernels, &self.bound[next]);
        let voxel_groups = groups_1d(diffuse_items(&self.gpu, &self.source), kernels.diffuse.workgroup_size()[0]);
        let agent_groups = groups_1d(u64::from(self.source.agents), kernels.sense.workgroup_size()[0]);
        let mut encoder = self.gpu.encoder("physarum step");
        encoder.clear_buffer(&self.passed_count, 0, None);
        kernels.diffuse.dispatch(&mut encoder, &bound.diffuse, voxel_groups);
        kernels.sense.dispatch(&mut encoder, &bound.sense, agent_groups);
        kernels.deposit.dispatch(&mut encoder, &bound.deposit, agent_groups);
        kernels.hold.dispatch(&mut encoder, &bound.hold, [16, 1, 1]);
        self.gpu.queue().submit([encoder.finish()]);
        self.newest = next;
        self.steps += 1;
        self.version = next_version();
        self.gpu.check()
    }

    fn steps(&self) -> u32 {
        self.steps
    }

    fn frozen(&self) -> bool {
        self.source.freeze_at.is_some_and(|step| self.steps >= step)
    }

    fn reset(&mut self) -> Result<(), GpuError> {
        self.gpu.write_uniform(&self.params, &Params::new(&self.source, 0));
        let groups = groups_1d(u64::from(self.source.agents), self.kernels.start.workgroup_size()[0]);
        let mut encoder = self.gpu.encoder("physarum start");
        encoder.clear_buffer(&self.fields[self.newest], 0, None);
        encoder.clear_buffer(&self.held, 0, None);
        self.kernels.start.dispatch(&mut encoder, &self.start, groups);
        self.gpu.queue().submit([encoder.finish()]);
        self.steps = 0;
        self.version = next_version();
        self.gpu.check()
    }

    fn tune(&mut self, source: &Source) -> bool {
        let Source::Physarum(source) = source else { return false };
        let built_for = |source: &scene::Physarum| (source.size, source.agents, source.seed);
        if built_for(source) != built_for(&self.source) {
            return false;
        }
        let walls = self.source.boundary;
        self.source = source.clone();
        if self.source.boundary != walls {
            self.rebuild_walls();
        }
        true
    }

    fn grid(&self) -> Grid {
        Grid {
            words: self.fields[self.newest].clone(),
            format: Format::U32,
            size: self.source.size,
            spacing: [1.0; 3],
            auto: AutoWindow::Mean(WINDOW_MEANS),
            version: self.version,
        }
    }

    fn fields(&self) -> &'static [&'static str] {
        &["trail", "density"]
    }

    fn read(&mut self, field: &str) -> Result<Option<Field>, GpuError> {
        if !self.fields().contains(&field) {
            return Ok(None);
        }
        let count = usize::try_from(voxels(self.source.size)).map_err(|error| GpuError::Fault(error.to_string()))?;
        let counts = self.readback.values(&self.gpu, &self.fields[self.newest], count)?;
        Ok(Some(Field {
            name: "trail".to_owned(),
            unit: "counts".to_owned(),
            size: self.source.size,
            spacing: [1.0; 3],
            samples: Samples::U32(counts),
        }))
    }

    fn read_agents(&mut self) -> Result<Option<Agents>, GpuError> {
        let count = self.source.agents as usize;
        if count == 0 {
            return Ok(Some(Agents::default()));
        }
        let places: Vec<[f32; 4]> = self.readback.values(&self.gpu, &self.places, count)?;
        let orientations: Vec<[f32; 4]> = self.readback.values(&self.gpu, &self.headings, count)?;
        Ok(Some(Agents {
            positions: places.into_iter().map(|[x, y, z, _]| [x, y, z]).collect(),
            headings: orientations.iter().map(|&turned| (Quat::from_array(turned) * Vec3::Z).into()).collect(),
            orientations,
        }))
    }

    fn saturated(&mut self) -> Result<u64, GpuError> {
        let words: Vec<u32> = self.readback.values(&self.gpu, &self.held, 2)?;
        Ok(words.iter().rev().fold(0, |sum, &word| sum << 32 | u64::from(word)))
    }
}
