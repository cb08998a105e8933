//! The parameters of a volume: where its density comes from, where it stands, how it meets light.
//!
//! A volume of NX×NY×NZ voxels fills a box centred on the origin whose longest edge is 1, and is then placed by its
//! [`Transform`].

use serde_json::{Value, json};

use super::declare::{choice, params, tagged};
use super::param::{Param, Place, Refusal};

params! {
    /// A body in the scene: where its density comes from, where it stands, how it meets light.
    pub struct Volume {
        /// Where the density comes from.
        source: Source = Source::default() => { tab: "Sim" },
        /// Where the volume stands.
        transform: Transform = Transform::default() => { tab: "Look" },
        /// How light moves inside.
        medium: Medium = Medium::default() => { tab: "Look" },
        /// What of the volume is shown.
        clip: Clip = Clip::default() => { tab: "Look" },
        /// Colour by a field's value.
        color: Color = Color::default() => { tab: "Look" },
        /// The surface around the volume.
        boundary: Boundary = Boundary::default() => { tab: "Look" },
    }
}

params! {
    /// Point in the world = T·Rz·Ry·Rx·S·point in the box.
    pub struct Transform {
        /// Moved by.
        translate: [f32; 3] = [0.0; 3] => { unit: "world units", min: -1e6, max: 1e6, kind: "vector" },
        /// Turned about x, then y, then z.
        rotate: [f32; 3] = [0.0; 3] => { unit: "°", min: -36000.0, max: 36000.0, kind: "vector" },
        /// Stretched by; density is unchanged, so twice the size is twice the optical depth.
        scale: [f32; 3] = [1.0; 3] => { min: -1e4, max: 1e4, nonzero: true, kind: "vector" },
    }
}

params! {
    /// The part of a volume that is shown; the rest is vacuum.
    pub struct Clip {
        /// The whole box, or the ball (stretched with the box) that touches its faces.
        shape: ClipShape = ClipShape::Box => {},
        /// ball alone: share of the radius over which density fades to 0.
        softness: f32 = 0.15 => { min: 0.0, max: 1.0 },
    }
}

choice! {
    /// A shape within a volume's box.
    pub enum ClipShape {
        /// All of it.
        Box = "box",
        /// The ball that touches the faces.
        Ball = "ball",
    }
}

tagged! {
    /// Where a volume's density comes from.
    pub enum Source {
        /// Density 1 throughout a cube.
        Homogeneous(Homogeneous) = "homogeneous",
        /// A 3D physarum: agents that follow and leave trails (Jones 2010 in three dimensions).
        Physarum(Physarum) = "physarum",
        /// A still cloud of gradient noise, cut by an ellipsoid.
        Cloud(Cloud) = "cloud",
        /// A volume file.
        File(File) = "file",
    }
}

params! {
    /// Density 1 throughout.
    pub struct Homogeneous {}
}

params! {
    /// Agents sense a field at one forward and three flanking taps, turn to the strongest, move and deposit.
    pub struct Physarum {
        /// Voxels along x, y and z.
        size: [u32; 3] = [128, 128, 128] => { unit: "voxels", min: 4.0, max: 2048.0, kind: "vector" },
        /// How many agents there are.
        agents: u32 = 156_000 => { min: 0.0, max: 134_217_728.0, slider: Some([1e4, 2e6]), log: true },
        /// Seed of the agents' start.
        seed: u32 = 1 => {},
        /// Angle between the forward tap and the flanking ones.
        sense_angle: f32 = 31.0 => { unit: "°", min: 0.0, max: 180.0 },
        /// Angle by which an agent turns towards a flanking tap.
        turn_angle: f32 = 32.0 => { unit: "°", min: 0.0, max: 180.0 },
        /// Distance at which an agent senses.
        sense_distance: f32 = 2.2 => { unit: "voxels", min: 0.0, max: 64.0, slider: Some([0.5, 18.0]) },
        /// Distance that an agent moves in a step.
        step: f32 = 0.6 => { title: "Step length", unit: "voxels", min: 0.0, max: 64.0, slider: Some([0.1, 10.0]) },
        /// Factor that the field keeps in a step.
        decay: f32 = 0.88 => { unit: "factor a step", min: 0.0, max: 0.999, slider: Some([0.25, 0.99]) },
        /// Counts that an agent adds to its voxel in a step.
        deposit: u32 = 4096 => { unit: "counts", min: 0.0, max: 16_777_216.0, slider: Some([256.0, 65536.0]), log: true },
        /// What happens at the walls.
        boundary: Edge = Edge::Periodic => { title: "Walls" },
        /// Angle by which the agent's own axes turn: the source's presets need the sense angle.
        reorient_by: Reorient = Reorient::Sense => {},
        /// Step at which the simulation stands still; null: never.
        freeze_at: Option<u32> = None => { unit: "steps", slider: Some([0.0, 2000.0]) },
    }
}

choice! {
    /// What a wall does to an agent, and what is read beyond it.
    pub enum Edge {
        /// The box repeats: who leaves on one side enters on the other.
        Periodic = "periodic",
        /// Agents bounce off, and the field is mirrored.
        Reflect = "reflect",
        /// Agents that leave start again at a random place, and the field beyond is 0.
        Absorb = "absorb",
    }
}

choice! {
    /// Which angle turns an agent's axes.
    pub enum Reorient {
        /// The sense angle, as in the source.
        Sense = "sense",
        /// The turn angle.
        Turn = "turn",
    }
}

params! {
    /// Gradient noise cut by an ellipsoid with random x and z radii, in five classes of density.
    pub struct Cloud {
        /// Voxels along each edge.
        size: u32 = 96 => { unit: "voxels", min: 8.0, max: 512.0, slider: Some([32.0, 256.0]) },
        /// Seed of noise and ellipsoid.
        seed: u32 = 1 => {},
        /// Cells of noise along an edge.
        frequency: f32 = 5.0 => { unit: "cells an edge", min: 0.1, max: 64.0, slider: Some([1.0, 16.0]) },
        /// Octaves of noise, each twice as fine and half as strong.
        octaves: u32 = 4 => { min: 1.0, max: 8.0 },
        /// Whether density is cut into the five classes of the recipe, or left continuous.
        classes: bool = false => { title: "Five classes" },
    }
}

params! {
    /// A volume read from a file.
    pub struct File {
        /// Path of an .nrrd or .npy file, relative to the scene file.
        path: Option<String> = None => {},
        /// Name of a dataset on the server.
        dataset: Option<String> = None => {},
    }
}

params! {
    /// What a ray meets inside a volume.
    pub struct Medium {
        /// beer: free flight is exponential in optical depth. threshold: one draw a voxel, the look of the source.
        law: Law = Law::Beer => {},
        /// Extinction coefficient where density is 1.
        sigma_t: f32 = 40.0 => { title: "Extinction", unit: "1/world unit", min: 0.0, max: 1e6, slider: Some([0.1, 1000.0]), log: true },
        /// Share of light that a scattering keeps, in red, green and blue.
        albedo: [f32; 3] = [0.9; 3] => { min: 0.0, max: 1.0, kind: "color" },
        /// The directions in which light scatters.
        phase: Phase = Phase::default() => {},
        /// How density is read between voxel centres.
        filter: Filter = Filter::Trilinear => {},
        /// Radiance added per world unit where density is 1.
        emission: [f32; 3] = [0.0; 3] => { unit: "radiance/world unit", min: 0.0, max: 1e6, slider: Some([0.0, 50.0]), kind: "color" },
        /// Threshold law alone: share of light lost at a scattering where density is 1.
        scatter_loss: f32 = 0.0 => { min: 0.0, max: 1.0 },
        /// Field values that become density 0 and 1; auto follows a simulation's mean or a file's type.
        window: Window = Window::Auto => {},
    }
}

choice! {
    /// How far a ray flies before it scatters.
    pub enum Law {
        /// Exponential in optical depth (Beer, Lambert).
        Beer = "beer",
        /// With probability min(1, σt·h) in each voxel entered, whatever the chord.
        Threshold = "threshold",
    }
}

choice! {
    /// How a grid is read between voxel centres.
    pub enum Filter {
        /// Linear between voxel centres, clamped at the edge.
        Trilinear = "trilinear",
        /// Constant in each voxel.
        Nearest = "nearest",
    }
}

params! {
    /// Density of the direction after a scattering, given that before it.
    pub struct Phase {
        /// Which function.
        type_: PhaseType = PhaseType::Isotropic => {},
        /// hg alone: mean cosine; above 0 light goes on forward.
        g: f32 = 0.0 => { min: -0.999, max: 0.999 },
        /// drift alone: share of the old direction that is kept; below 0 light turns back and the volume reads as a surface.
        weight: f32 = 0.0 => { min: -1.0, max: 1.0 },
    }
}

choice! {
    /// A phase function.
    pub enum PhaseType {
        /// All directions alike.
        Isotropic = "isotropic",
        /// Henyey and Greenstein 1941.
        Hg = "hg",
        /// normalize(weight·old direction + random unit vector).
        Drift = "drift",
    }
}

params! {
    /// Colour by a field's value, through a map.
    pub struct Color {
        /// Which field.
        by: ColorBy = ColorBy::None => {},
    }
}

choice! {
    /// The field that colours a volume.
    pub enum ColorBy {
        /// None: the albedo colours alone.
        None = "none",
    }
}

params! {
    /// The surface around a volume.
    pub struct Boundary {
        /// Which kind.
        type_: BoundaryType = BoundaryType::None => {},
    }
}

choice! {
    /// A kind of surface.
    pub enum BoundaryType {
        /// No surface: light passes.
        None = "none",
    }
}

/// Field values that become density 0 and 1.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Window {
    /// From a simulation's mean, or from a file's type.
    #[default]
    Auto,
    /// density = max(0, (value − a)/(b − a)).
    Values([f32; 2]),
}

impl Param for Window {
    fn schema() -> Value {
        json!({"anyOf": [{"const": "auto"}, {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}]})
    }
    fn read(value: &Value, at: &Place<'_>) -> Result<Self, Refusal> {
        if value.as_str() == Some("auto") {
            return Ok(Self::Auto);
        }
        if value.is_string() {
            return Err(at.refuse("unknown_choice", format!("{value} is neither \"auto\" nor [a, b]")));
        }
        let [a, b] = <[f32; 2]>::read(value, at)?;
        if a >= b {
            return Err(at.refuse("out_of_range", format!("[{a}, {b}] is empty: the first value must be the smaller")));
        }
        Ok(Self::Values([a, b]))
    }
    fn write(&self) -> Value {
        match self {
            Self::Auto => "auto".into(),
            Self::Values(window) => window.write(),
        }
    }
}
