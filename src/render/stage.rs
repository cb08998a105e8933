//! The stage: what stands before the camera, as the tracer's kernel sees it.

use std::collections::BTreeMap;

use encase::ShaderType;
use glam::{Affine3A, EulerRot, Mat3, Quat, UVec3, Vec3, Vec4};

use super::majorants::Majorants;
use crate::gpu::{Gpu, GpuError};
use crate::scene::{Background, Camera, ClipShape, Filter, Law, Light, PhaseType, Scene, Sky, Transform, Volume};
use crate::volume::{Format, Grid};

/// Most volumes of a scene.
const MAX_VOLUMES: usize = crate::scene::param::MAX_ENTRIES;
/// Most lamps of a scene.
const MAX_LAMPS: usize = crate::scene::param::MAX_ENTRIES;
/// Tentative collisions across a volume that shines but hardly scatters, which sample its emission.
const GLOW_SAMPLES: f32 = 8.0;

#[derive(ShaderType, Default)]
struct CameraData {
    position: Vec3,
    forward: Vec3,
    right: Vec3,
    up: Vec3,
    lens_right: Vec3,
    lens_up: Vec3,
    focus: f32,
}

#[derive(ShaderType, Default)]
struct SceneData {
    camera: CameraData,
    seed: u32,
}

#[derive(ShaderType, Default)]
struct LimitsData {
    volume_count: u32,
    max_bounces: u32,
    background: u32,
    suns: u32,
    lamps: u32,
}

#[derive(ShaderType, Default, Clone, Copy)]
struct LampData {
    position: Vec3,
    intensity: Vec3,
}

#[derive(ShaderType, Default)]
struct LightData {
    zenith: Vec3,
    horizon: Vec3,
    ground: Vec3,
    to_sun: Vec3,
    sun_irradiance: Vec3,
    lamps: [LampData; MAX_LAMPS],
}

#[derive(ShaderType, Default, Clone, Copy)]
struct VolumeData {
    voxel_from_world_x: Vec4,
    voxel_from_world_y: Vec4,
    voxel_from_world_z: Vec4,
    size: UVec3,
    format: u32,
    cells: UVec3,
    first_cell: u32,
    albedo: Vec3,
    first_word: u32,
    emission: Vec3,
    law: u32,
    sigma_t: f32,
    track: f32,
    voxel_probability: f32,
    scatter_loss: f32,
    phase: u32,
    phase_shape: f32,
    reach: u32,
    ball: u32,
    softness: f32,
}

/// Which of the kernel's variants a scene needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Variant {
    pub(super) single: bool,
    pub(super) threshold: bool,
    pub(super) emission: bool,
}

/// A scene's parameters, the words of its volumes and their majorants, on the GPU.
pub struct Stage {
    gpu: Gpu,
    pub(super) scene: wgpu::Buffer,
    pub(super) limits: wgpu::Buffer,
    pub(super) light: wgpu::Buffer,
    pub(super) volumes: wgpu::Buffer,
    pub(super) majorants: Majorants,
    pub(super) variant: Variant,
}

impl Stage {
    /// Puts a scene on the stage; `grids` holds each volume's grid by its name.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] where the adapter cannot hold the volumes.
    pub fn new(gpu: &Gpu, scene: &Scene, grids: &BTreeMap<String, Grid>) -> Result<Self, GpuError> {
        let mut stage = Self {
            gpu: gpu.clone(),
            scene: gpu.uniform("scene", &SceneData::default()),
            limits: gpu.uniform("limits", &LimitsData::default()),
            light: gpu.uniform("light", &LightData::default()),
            volumes: gpu.uniform("volumes", &[VolumeData::default(); MAX_VOLUMES]),
            majorants: Majorants::new(gpu)?,
            variant: Variant { single: true, threshold: false, emission: false },
        };
        stage.update(scene, grids)?;
        Ok(stage)
    }

    /// Takes over what has changed: parameters are written anew, majorants only where words, window or filter changed.
    ///
    /// # Errors
    /// As [`Stage::new`].
    pub fn update(&mut self, scene: &Scene, grids: &BTreeMap<String, Grid>) -> Result<(), GpuError> {
        let volumes: Vec<(&Volume, Option<&Grid>)> =
            scene.volumes.iter().map(|(name, volume)| (volume, grids.get(name))).take(MAX_VOLUMES).collect();
        self.majorants.update(&volumes)?;
        let mut data = [VolumeData::default(); MAX_VOLUMES];
        for (i, (slot, (volume, grid))) in data.iter_mut().zip(&volumes).enumerate() {
            *slot = volume_data(volume, *grid);
            (slot.first_word, slot.first_cell) = self.majorants.place(i);
        }
        self.gpu.write_uniform(&self.volumes, &data);
        self.gpu.write_uniform(&self.scene, &scene_data(scene));
        let (light, lamps) = light_data(&scene.light);
        self.gpu.write_uniform(&self.light, &light);
        self.gpu.write_uniform(&self.limits, &limits_data(scene, volumes.len(), lamps));
        self.variant = Variant {
            single: volumes.len() == 1,
            threshold: volumes.iter().any(|(volume, _)| volume.medium.law == Law::Threshold),
            emission: volumes.iter().any(|(volume, _)| shines(volume.medium.emission)),
        };
        Ok(())
    }

    /// Bytes on the GPU, without the grids' own.
    pub fn memory(&self) -> u64 {
        self.scene.size() + self.light.size() + self.volumes.size() + self.majorants.memory()
    }
}

fn shines(rgb: [f32; 3]) -> bool {
    rgb.iter().any(|x| *x > 0.0)
}

fn scene_data(scene: &Scene) -> SceneData {
    SceneData { camera: camera_data(&scene.camera), seed: scene.render.seed }
}

fn limits_data(scene: &Scene, volume_count: usize, lamps: u32) -> LimitsData {
    LimitsData {
        volume_count: u32::try_from(volume_count).unwrap_or(0),
        max_bounces: scene.render.max_bounces,
        background: match scene.render.background {
            Background::Sky => 0,
            Background::Black => 1,
            Background::Transparent => 2,
        },
        suns: u32::from(shines(scene.light.sun.irradiance)),
        lamps,
    }
}

/// The camera's axes; `right` and `up` are as long as half the picture's height at distance 1.
fn camera_data(camera: &Camera) -> CameraData {
    let position = Vec3::from(camera.position);
    let way = Vec3::from(camera.target) - position;
    let forward = way.normalize_or(Vec3::NEG_Z);
    let right = forward.cross(Vec3::from(camera.up)).normalize_or(Vec3::X);
    let up = right.cross(forward);
    let k = (camera.fov_y.to_radians() / 2.0).tan();
    CameraData {
        position,
        forward,
        right: right * k,
        up: up * k,
        lens_right: right * camera.aperture,
        lens_up: up * camera.aperture,
        focus: camera.focus_distance.unwrap_or(way.length()),
    }
}

/// The lights, and how many of the lamps shine.
fn light_data(light: &Light) -> (LightData, u32) {
    let (zenith, horizon, ground) = match &light.sky {
        Sky::Constant(sky) => (sky.radiance, sky.radiance, sky.radiance),
        Sky::Gradient(sky) => (sky.radiance, sky.horizon, sky.ground),
    };
    let mut lamps = [LampData::default(); MAX_LAMPS];
    let lit = light.lamps.values().filter(|lamp| shines(lamp.intensity));
    let mut lamp_count = 0;
    for (slot, lamp) in lamps.iter_mut().zip(lit) {
        *slot = LampData { position: lamp.position.into(), intensity: lamp.intensity.into() };
        lamp_count += 1;
    }
    let data = LightData {
        zenith: zenith.into(),
        horizon: horizon.into(),
        ground: ground.into(),
        to_sun: -Vec3::from(light.sun.direction).normalize_or(Vec3::NEG_Y),
        sun_irradiance: light.sun.irradiance.into(),
        lamps,
    };
    (data, lamp_count)
}

fn volume_data(volume: &Volume, grid: Option<&Grid>) -> VolumeData {
    let size = UVec3::from(grid.map_or([1; 3], |grid| grid.size));
    let edges = Vec3::from(grid.map_or([1.0; 3], Grid::edges));
    let medium = &volume.medium;
    let world_from_box = world_from_box(&volume.transform);
    // From the box [−e/2, e/2] to voxels [0, N].
    let voxel_from_box = Affine3A::from_scale_rotation_translation(size.as_vec3() / edges, Quat::IDENTITY, size.as_vec3() / 2.0);
    let voxel_from_world = voxel_from_box * world_from_box.inverse();
    let rows = Mat3::from(voxel_from_world.matrix3).transpose();
    let shift = Vec3::from(voxel_from_world.translation);
    let scale = Vec3::from(volume.transform.scale);
    let longest_edge = (edges * scale).abs().max_element();
    let glows = shines(medium.emission);
    #[expect(clippy::cast_precision_loss, reason = "sizes are far below 2^24")]
    let voxel = (scale.element_product().abs()).cbrt() / size.max_element() as f32;
    VolumeData {
        voxel_from_world_x: rows.x_axis.extend(shift.x),
        voxel_from_world_y: rows.y_axis.extend(shift.y),
        voxel_from_world_z: rows.z_axis.extend(shift.z),
        size,
        format: match grid.map(|grid| grid.format) {
            Some(Format::U32) => 0,
            Some(Format::F32) => 1,
            None => 2,
        },
        cells: size.map(|edge| edge.div_ceil(super::majorants::CELL)),
        first_cell: 0,
        albedo: medium.albedo.into(),
        first_word: 0,
        emission: medium.emission.into(),
        law: u32::from(medium.law == Law::Threshold),
        sigma_t: medium.sigma_t,
        track: if glows { medium.sigma_t.max(GLOW_SAMPLES / longest_edge) } else { medium.sigma_t },
        voxel_probability: medium.sigma_t * voxel,
        scatter_loss: medium.scatter_loss,
        phase: match medium.phase.type_ {
            PhaseType::Isotropic => 0,
            PhaseType::Hg => 1,
            PhaseType::Drift => 2,
        },
        phase_shape: match medium.phase.type_ {
            PhaseType::Isotropic => 0.0,
            PhaseType::Hg => medium.phase.g,
            PhaseType::Drift => medium.phase.weight,
        },
        reach: reach(volume, grid),
        ball: u32::from(volume.clip.shape == ClipShape::Ball),
        softness: volume.clip.softness,
    }
}

/// Voxels beyond its own cell that a lookup can reach.
pub(super) fn reach(volume: &Volume, grid: Option<&Grid>) -> u32 {
    u32::from(grid.is_some() && volume.medium.filter == Filter::Trilinear && volume.medium.law == Law::Beer)
}

/// T·Rz·Ry·Rx·S, from the box around the origin to the world.
fn world_from_box(transform: &Transform) -> Affine3A {
    let [x, y, z] = transform.rotate.map(f32::to_radians);
    let rotation = Quat::from_euler(EulerRot::ZYX, z, y, x);
    Affine3A::from_scale_rotation_translation(transform.scale.into(), rotation, transform.translate.into())
}
