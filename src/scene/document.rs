//! Every parameter of a scene: name, meaning, unit, default, range. Declared here, or for volumes in
//! [`volumes`](super::volumes), and nowhere else. World units are right-handed with y up.

use std::collections::BTreeMap;

use serde_json::{Map, Value};

use super::declare::{choice, params, tagged};
use super::merge::merge_patch;
use super::param::{Param, Place, Refusal};
use super::presets;
use super::volumes::{Source, Volume};

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
