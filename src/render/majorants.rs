//! All volumes' words in one buffer, and each one's greatest value in every macrocell, found on the GPU.

use encase::ShaderType;
use glam::UVec3;

use super::stage::reach;
use crate::gpu::{Gpu, GpuError, Kernel, groups_1d};
use crate::scene::{Volume, Window};
use crate::volume::{AutoWindow, Format, Grid};

/// Edge of a macrocell in voxels; `CELL` in `volume.wgsl`.
pub(super) const CELL: u32 = 4;

#[derive(ShaderType)]
struct CellJob {
    size: UVec3,
    format: u32,
    cells: UVec3,
    first_word: u32,
    first_cell: u32,
    reach: u32,
}

#[derive(ShaderType)]
struct WindowJob {
    first_cell: u32,
    cells: u32,
    per_voxel: f32,
    multiple: f32,
    volume: u32,
}

/// Where a volume's words and cells stand, and what they were made from.
#[derive(Clone, PartialEq)]
struct Placed {
    grid: Option<(wgpu::Buffer, u64)>,
    size: [u32; 3],
    auto: Option<AutoWindow>,
    window: Window,
    reach: u32,
    first_word: u32,
    first_cell: u32,
}

/// What the tracer reads of the volumes' contents.
pub(super) struct Majorants {
    gpu: Gpu,
    cells_kernel: Kernel,
    window_kernel: Kernel,
    /// The one gridded volume's own buffer, or a copy of all of them, end to end.
    pub(super) words: wgpu::Buffer,
    pub(super) cell_max: wgpu::Buffer,
    pub(super) windows: wgpu::Buffer,
    cell_sum: wgpu::Buffer,
    placed: Vec<Placed>,
    copied: bool,
}

impl Majorants {
    pub(super) fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        Ok(Self {
            gpu: gpu.clone(),
            cells_kernel: Kernel::load(gpu, "macrocells.wgsl"),
            window_kernel: Kernel::load(gpu, "window.wgsl"),
            words: gpu.storage("words", 4)?,
            cell_max: gpu.storage("cell_max", 4)?,
            cell_sum: gpu.storage("cell_sum", 4)?,
            windows: gpu.storage("windows", 8 * crate::scene::param::MAX_ENTRIES as u64)?,
            placed: Vec::new(),
            copied: false,
        })
    }

    /// First word and first cell of the volume of this index.
    pub(super) fn place(&self, index: usize) -> (u32, u32) {
        self.placed.get(index).map_or((0, 0), |placed| (placed.first_word, placed.first_cell))
    }

    pub(super) fn memory(&self) -> u64 {
        let words = if self.copied { self.words.size() } else { 0 };
        words + self.cell_max.size() + self.cell_sum.size()
    }

    pub(super) fn update(&mut self, volumes: &[(&Volume, Option<&Grid>)]) -> Result<(), GpuError> {
        let (placed, word_count, cell_count) = lay_out(volumes);
        let gridded: Vec<&Grid> = volumes.iter().filter_map(|(_, grid)| *grid).collect();
        let same_layout = self.placed.len() == placed.len()
            && self.placed.iter().zip(&placed).all(|(old, new)| old.size == new.size && old.first_cell == new.first_cell);
        let copied = gridded.len() > 1;
        if !same_layout || copied != self.copied {
            if copied {
                self.words = self.gpu.storage("the words of all volumes", word_count * 4)?;
            }
            self.cell_max = self.gpu.storage("majorants", cell_count * 4)?;
            self.cell_sum = self.gpu.storage("cell sums", cell_count * 4)?;
            self.placed.clear();
            self.copied = copied;
        }
        if let [grid] = gridded.as_slice() {
            self.words = grid.words.clone();
        }
        let mut encoder = self.gpu.encoder("majorants");
        for (i, ((_, grid), now)) in volumes.iter().zip(&placed).enumerate() {
            if self.placed.get(i) == Some(now) {
                continue;
            }
            if let Some(grid) = grid {
                if copied {
                    let bytes = voxels(grid.size) * 4;
                    encoder.copy_buffer_to_buffer(&grid.words, 0, &self.words, u64::from(now.first_word) * 4, bytes);
                }
                self.find_cells(&mut encoder, grid, now);
            }
            self.set_window(&mut encoder, i, *grid, now);
        }
        self.gpu.queue().submit([encoder.finish()]);
        self.placed = placed;
        Ok(())
    }

    fn find_cells(&self, encoder: &mut wgpu::CommandEncoder, grid: &Grid, placed: &Placed) {
        let job = CellJob {
            size: grid.size.into(),
            format: u32::from(grid.format == Format::F32),
            cells: cells(grid.size).into(),
            first_word: placed.first_word,
            first_cell: placed.first_cell,
            reach: placed.reach,
        };
        let job = self.gpu.uniform("macrocells", &job);
        let bound = self.cells_kernel.bind(
            &self.gpu,
            &[("job", &job), ("words", &self.words), ("cell_max", &self.cell_max), ("cell_sum", &self.cell_sum)],
        );
        self.cells_kernel.dispatch(encoder, &bound, groups_1d(voxels(cells(grid.size)), 64));
    }

    fn set_window(&self, encoder: &mut wgpu::CommandEncoder, index: usize, grid: Option<&Grid>, placed: &Placed) {
        let at = index as u64 * 8;
        match grid.map(|grid| (grid.fixed_window(placed.window), grid)) {
            None => self.gpu.queue().write_buffer(&self.windows, at, bytemuck::bytes_of(&[0.0f32, 1.0])),
            Some((Some([a, b]), _)) => self.gpu.queue().write_buffer(&self.windows, at, bytemuck::bytes_of(&[a, 1.0 / (b - a)])),
            Some((None, grid)) => {
                let AutoWindow::Mean(multiple) = grid.auto else { return };
                #[expect(
                    clippy::cast_precision_loss,
                    clippy::cast_possible_truncation,
                    reason = "a count to 24 bits is enough for a mean"
                )]
                let job = WindowJob {
                    first_cell: placed.first_cell,
                    cells: voxels(cells(grid.size)) as u32,
                    per_voxel: 1.0 / voxels(grid.size) as f32,
                    multiple,
                    volume: index as u32,
                };
                let job = self.gpu.uniform("window", &job);
                let bound = self
                    .window_kernel
                    .bind(&self.gpu, &[("job", &job), ("cell_sum", &self.cell_sum), ("windows", &self.windows)]);
                self.window_kernel.dispatch(encoder, &bound, [1, 1, 1]);
            }
        }
    }
}

/// Places volumes end to end; gives also the number of words and cells.
fn lay_out(volumes: &[(&Volume, Option<&Grid>)]) -> (Vec<Placed>, u64, u64) {
    let (mut words, mut cell_count) = (0u64, 0u64);
    let placed = volumes
        .iter()
        .map(|(volume, grid)| {
            let size = grid.map_or([1; 3], |grid| grid.size);
            let placed = Placed {
                grid: grid.map(|grid| (grid.words.clone(), grid.version)),
                size,
                auto: grid.map(|grid| grid.auto),
                window: volume.medium.window,
                reach: reach(volume, *grid),
                // A buffer that would need more than 32 bits to index is refused before it is used.
                first_word: u32::try_from(words).unwrap_or(u32::MAX),
                first_cell: u32::try_from(cell_count).unwrap_or(u32::MAX),
            };
            if grid.is_some() {
                words += voxels(size);
            }
            cell_count += voxels(cells(size));
            placed
        })
        .collect();
    (placed, words, cell_count)
}

fn cells(size: [u32; 3]) -> [u32; 3] {
    size.map(|edge| edge.div_ceil(CELL))
}

fn voxels(size: [u32; 3]) -> u64 {
    size.into_iter().map(u64::from).product()
}

#[cfg(test)]
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss,
    reason = "a test's counts and sizes are small"
)]
mod tests {
    use std::sync::LazyLock;

    use serde_json::json;

    use super::*;
    use crate::gpu::{AdapterChoice, Readback};
    use crate::scene::Scene;
    use crate::volume::{Field, Samples};

    static GPU: LazyLock<Gpu> = LazyLock::new(|| Gpu::open(&AdapterChoice::Auto).unwrap());

    #[test]
    fn majorants_are_the_greatest_values_in_reach() {
        let sizes = [[19u32, 8, 30], [8, 8, 8], [1, 9, 5]];
        for (filter, reach) in [("nearest", 0i64), ("trilinear", 1)] {
            let volume = json!({"source": {"type": "file", "path": "x"}, "medium": {"filter": filter}});
            let scene = Scene::from_json(&json!({"volumes": {"a": volume, "b": volume, "c": volume}})).unwrap();
            let fields: Vec<Field> = sizes.iter().map(|size| noise(*size)).collect();
            let grids: Vec<Grid> = fields.iter().map(|field| field.upload(&GPU).unwrap()).collect();
            let volumes: Vec<_> = scene.volumes.values().zip(grids.iter().map(Some)).collect();
            let mut majorants = Majorants::new(&GPU).unwrap();
            majorants.update(&volumes).unwrap();
            let total: u64 = sizes.iter().map(|size| voxels(cells(*size))).sum();
            let found: Vec<f32> = Readback::default().values(&GPU, &majorants.cell_max, total as usize).unwrap();
            let expected: Vec<f32> = fields.iter().flat_map(|field| brute_force(field, reach)).collect();
            assert_eq!(found, expected, "{filter}");
        }
    }

    fn noise(size: [u32; 3]) -> Field {
        let value = |i: u32| (i.wrapping_mul(2_654_435_761) >> 8) as f32 / 1000.0 - 3000.0;
        let samples = Samples::F32((0..voxels(size) as u32).map(value).collect());
        Field { name: "n".into(), unit: String::new(), size, spacing: [1.0; 3], samples }
    }

    fn brute_force(field: &Field, reach: i64) -> Vec<f32> {
        let Samples::F32(values) = &field.samples else { panic!("floats") };
        let [nx, ny, nz] = field.size.map(i64::from);
        let [cx, cy, cz] = cells(field.size).map(i64::from);
        let near = |v: i64, c: i64| v >= c * i64::from(CELL) - reach && v < (c + 1) * i64::from(CELL) + reach;
        let mut out = Vec::new();
        for cell in 0..cx * cy * cz {
            let (i, j, k) = (cell % cx, cell / cx % cy, cell / (cx * cy));
            let greatest = (0..nx * ny * nz)
                .filter(|v| near(v % nx, i) && near(v / nx % ny, j) && near(v / (nx * ny), k))
                .map(|v| values[v as usize])
                .fold(f32::MIN, f32::max);
            out.push(greatest);
        }
        out
    }
}
