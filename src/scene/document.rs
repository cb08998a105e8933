//! Every parameter of a scene: name, meaning, unit, default, range. Declared here and nowhere else.
//!
//! World units are right-handed with y up. A volume of NX×NY×NZ voxels fills a box centred on the
//! origin whose longest edge is 1, and is then placed by its [`Transform`].

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};

use super::merge::merge_patch;
use super::param::{Param, Place, Refusal, choice, params, tagged};
use super::presets;

params! {
    /// The whole state of a picture.
    pub struct Scene {
        /// What the scene is, in words.
        about: About = About::default() => {},
        /// Where the picture is taken from.
        camera: Camera = Camera::default() => { tab: "Camera" },
        /// What is in the picture, by name.
        volumes: BTreeMap<String, Volume> = BTreeMap::new() => { tab: "Look" },
        /// What lights it.
        light: Light = Light::default() => { tab: "Look" },
        /// How light is followed.
        render: Render = Render::default() => { tab: "Camera", title: "Rendering" },
        /// How radiance becomes a picture; changing it never restarts the samples.
        display: Display = Display::default() => { tab: "Look" },
    }
}

params! {
    /// What a scene is, in words; nothing of the picture depends on it.
    pub struct About {
        /// A name to show.
        title: String = String::new() => {},
        /// A sentence on the look.
        description: String = String::new() => {},
        /// Simulation step at which the scene is at its best; null: it does not matter.
        best_step: Option<u32> = None => { unit: "steps" },
    }
}

params! {
    /// A thin-lens camera.
    pub struct Camera {
        /// Position of the lens.
        position: [f32; 3] = [1.6, 0.9, -2.1] => { unit: "world units", min: -1e6, max: 1e6, kind: "vector" },
        /// The point looked at.
        target: [f32; 3] = [0.0; 3] => { unit: "world units", min: -1e6, max: 1e6, kind: "vector" },
        /// The direction that is up in the picture.
        up: [f32; 3] = [0.0, 1.0, 0.0] => { min: -1e6, max: 1e6, kind: "vector" },
        /// Full vertical angle of view.
        fov_y: f32 = 32.0 => { title: "Field of view", unit: "°", min: 0.001, max: 179.0, slider: Some([10.0, 110.0]) },
        /// Radius of the lens; 0 is a pinhole, which has no blur.
        aperture: f32 = 0.0 => { unit: "world units", min: 0.0, max: 1e3, slider: Some([0.0, 0.1]) },
        /// Distance of the plane in focus; null: the target's.
        focus_distance: Option<f32> = None => { unit: "world units", min: 1e-4, max: 1e6, slider: Some([0.1, 6.0]) },
    }
}

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

params! {
    /// What lights the scene.
    pub struct Light {
        /// Light from all around.
        sky: Sky = Sky::default() => {},
        /// Light from one direction.
        sun: Sun = Sun::default() => {},
        /// Point lamps, by name.
        lamps: BTreeMap<String, Lamp> = BTreeMap::new() => {},
    }
}

tagged! {
    /// Light from all around.
    pub enum Sky {
        /// The same in all directions.
        Constant(ConstantSky) = "constant",
        /// From the zenith through the horizon to the ground.
        Gradient(GradientSky) = "gradient",
    }
}

params! {
    /// The same radiance in all directions.
    pub struct ConstantSky {
        /// Radiance.
        radiance: [f32; 3] = [0.6; 3] => { unit: "radiance", min: 0.0, max: 1e6, slider: Some([0.0, 2.0]), kind: "color" },
    }
}

params! {
    /// Linear in the direction's height: ground at y = −1, horizon at 0, zenith at 1.
    pub struct GradientSky {
        /// Radiance from straight above.
        radiance: [f32; 3] = [0.2, 0.4, 0.8] => { title: "Zenith", unit: "radiance", min: 0.0, max: 1e6, slider: Some([0.0, 2.0]), kind: "color" },
        /// Radiance from the horizon.
        horizon: [f32; 3] = [0.6; 3] => { unit: "radiance", min: 0.0, max: 1e6, slider: Some([0.0, 2.0]), kind: "color" },
        /// Radiance from straight below.
        ground: [f32; 3] = [0.1; 3] => { unit: "radiance", min: 0.0, max: 1e6, slider: Some([0.0, 2.0]), kind: "color" },
    }
}

params! {
    /// Light from one direction; not seen by the camera directly.
    pub struct Sun {
        /// Direction in which the light travels; it is normalised.
        direction: [f32; 3] = [0.45, -0.8, 0.4] => { min: -1e6, max: 1e6, kind: "direction" },
        /// Irradiance on a surface that faces the sun.
        irradiance: [f32; 3] = [4.0; 3] => { unit: "irradiance", min: 0.0, max: 1e6, slider: Some([0.0, 20.0]), kind: "color" },
    }
}

params! {
    /// A point that shines alike in all directions.
    pub struct Lamp {
        /// Where it hangs.
        position: [f32; 3] = [0.0, 1.5, 0.0] => { unit: "world units", min: -1e6, max: 1e6, kind: "vector" },
        /// Radiant intensity: irradiance at distance 1.
        intensity: [f32; 3] = [1.0; 3] => { unit: "intensity", min: 0.0, max: 1e6, slider: Some([0.0, 20.0]), kind: "color" },
    }
}

params! {
    /// How light is followed, and when it is enough.
    pub struct Render {
        /// What follows a ray.
        integrator: Integrator = Integrator::Path => {},
        /// Samples per pixel at which accumulation ends.
        spp: u32 = 512 => { title: "Samples", unit: "samples a pixel", min: 1.0, max: 1_048_576.0, slider: Some([1.0, 8192.0]), log: true },
        /// Mean relative standard error at which accumulation ends before that; null: never.
        noise: Option<f32> = None => { min: 1e-6, max: 1.0, slider: Some([0.001, 0.2]), log: true },
        /// Scatterings after which a path is cut short; large enough, none is.
        max_bounces: u32 = 1024 => { min: 0.0, max: 65536.0, slider: Some([1.0, 1024.0]), log: true },
        /// What is seen where a ray meets nothing.
        background: Background = Background::Sky => {},
        /// Constant weight of a new picture over the last ones, in place of accumulation: a biased look with trails; null: off.
        blend: Option<f32> = None => { min: 0.01, max: 1.0 },
        /// Seed of the samples.
        seed: u32 = 0 => {},
    }
}

choice! {
    /// What follows a ray through the scene.
    pub enum Integrator {
        /// Paths with any number of scatterings, unbiased.
        Path = "path",
    }
}

choice! {
    /// What is seen where a ray meets nothing.
    pub enum Background {
        /// The sky that lights the scene.
        Sky = "sky",
        /// Black.
        Black = "black",
        /// Nothing: alpha 0.
        Transparent = "transparent",
    }
}

params! {
    /// How radiance becomes a picture.
    pub struct Display {
        /// Exposure in stops: radiance is multiplied by 2 to this power.
        exposure: f32 = 0.0 => { unit: "EV", min: -32.0, max: 32.0, slider: Some([-6.0, 6.0]) },
        /// The curve from radiance to the screen.
        tonemap: Tonemap = Tonemap::Agx => { title: "Tone map" },
    }
}

choice! {
    /// A curve from radiance to the screen.
    pub enum Tonemap {
        /// AgX (Sobotka 2022), in the polynomial fit by Wrensch.
        Agx = "agx",
        /// ACES filmic, in the fit by Narkowicz 2015.
        Aces = "aces",
        /// Reinhard 2002 on luminance.
        Reinhard = "reinhard",
        /// Clipped at 1.
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

impl Scene {
    /// Reads a whole document; one without `volumes` stands for the default preset with its own keys on top.
    ///
    /// # Errors
    /// A [`Refusal`] that names the key at fault.
    pub fn from_json(document: &Value) -> Result<Self, Refusal> {
        let Some(object) = document.as_object() else { return Self::read(document, &Place::ROOT) };
        let full = if object.get("volumes").is_none_or(Value::is_null) {
            let mut base = presets::default_document();
            merge_patch(&mut base, document);
            base
        } else {
            document.clone()
        };
        let scene = Self::read(&full, &Place::ROOT)?;
        scene.check()?;
        Ok(scene)
    }

    /// The document, every key written out.
    pub fn to_json(&self) -> Value {
        self.write()
    }

    /// JSON Schema (2020-12) of the document.
    pub fn json_schema() -> Value {
        let mut schema = Self::schema();
        let mut head = Map::new();
        head.insert("$schema".into(), "https://json-schema.org/draft/2020-12/schema".into());
        head.insert("title".into(), "Tyndall scene".into());
        if let Some(body) = schema.as_object_mut() {
            head.append(body);
        }
        head.into()
    }

    /// Fixes sampling and every simulation to one seed.
    pub fn reseed(&mut self, seed: u32) {
        self.render.seed = seed;
        for volume in self.volumes.values_mut() {
            match &mut volume.source {
                Source::Physarum(physarum) => physarum.seed = seed,
                Source::Cloud(_) | Source::File(_) | Source::Homogeneous(_) => {}
            }
        }
    }

    /// What no single key shows: directions that vanish, windows that are empty.
    fn check(&self) -> Result<(), Refusal> {
        let root = Place::ROOT;
        let camera = root.key("camera");
        let view = glam::Vec3::from(self.camera.target) - glam::Vec3::from(self.camera.position);
        if view.length_squared() < 1e-12 {
            return Err(camera.key("target").refuse("out_of_range", "the same point as camera.position"));
        }
        if view.normalize_or_zero().cross(glam::Vec3::from(self.camera.up).normalize_or_zero()).length_squared() < 1e-12 {
            return Err(camera.key("up").refuse("out_of_range", "parallel to the view, or zero"));
        }
        if glam::Vec3::from(self.light.sun.direction).length_squared() < 1e-12 {
            let light = root.key("light");
            let sun = light.key("sun");
            return Err(sun.key("direction").refuse("out_of_range", "a direction cannot be zero"));
        }
        let volumes = root.key("volumes");
        for (name, volume) in &self.volumes {
            let at = volumes.key(name);
            let at = at.key("source");
            if let Source::File(file) = &volume.source
                && file.path.is_some() == file.dataset.is_some()
            {
                return Err(at.key("path").refuse("missing_key", "a file needs either `path` or `dataset`"));
            }
        }
        Ok(())
    }
}
