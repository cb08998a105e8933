//! What a film shows, as one comparable value.

use std::collections::BTreeMap;

use crate::scene::{Camera, Light, Render, Scene, Volume};
use crate::volume::Grid;

/// Everything that a picture's samples depend on; when it differs, the film starts over. How long to
/// sample, and how the film is developed, are no part of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Subject {
    camera: Camera,
    volumes: BTreeMap<String, Volume>,
    light: Light,
    render: Render,
    grids: Vec<(wgpu::Buffer, u64)>,
}

impl Subject {
    /// The subject of a scene with these grids.
    pub fn of(scene: &Scene, grids: &BTreeMap<String, Grid>) -> Self {
        Self {
            camera: scene.camera.clone(),
            volumes: scene.volumes.clone(),
            light: scene.light.clone(),
            render: Render { spp: 0, noise: None, ..scene.render.clone() },
            grids: grids.values().map(|grid| (grid.words.clone(), grid.version)).collect(),
        }
    }

    /// Whether the two differ in nothing but what a simulation has grown.
    pub fn grew_from(&self, before: &Self) -> bool {
        self.grids.len() == before.grids.len() && Self { grids: before.grids.clone(), ..self.clone() } == *before
    }

    /// Whether pictures blend over one another in place of starting over.
    pub fn blends(&self) -> bool {
        self.render.blend.is_some()
    }

    /// Weight of a new sample where pictures blend, else 0.
    pub(super) fn blend(&self) -> f32 {
        self.render.blend.unwrap_or(0.0)
    }
}
