//! A compute kernel whose resources are bound by their WGSL names.

use std::borrow::Cow;

use wgpu::naga;

use super::{Gpu, shader};

/// A compiled kernel with entry point `main`, and its bindings by name.
pub struct Kernel {
    label: String,
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
    names: Vec<(String, u32)>,
    workgroup_size: [u32; 3],
}

impl Kernel {
    /// Compiles `shaders/{path}`.
    ///
    /// # Panics
    /// When the shader is missing or invalid: that is a bug.
    pub fn load(gpu: &Gpu, path: &str) -> Self {
        Self::new(gpu, path, &shader::source(path), &[])
    }

    /// Compiles `shaders/{path}` with values for its `override` constants.
    ///
    /// # Panics
    /// As [`Kernel::load`].
    pub fn load_with(gpu: &Gpu, path: &str, constants: &[(&str, f64)]) -> Self {
        Self::new(gpu, path, &shader::source(path), constants)
    }

    /// Compiles WGSL whose imports are in place.
    ///
    /// # Panics
    /// When the text is not valid WGSL, or a resource stands outside group 0: that is a bug.
    pub fn new(gpu: &Gpu, label: &str, wgsl: &str, constants: &[(&str, f64)]) -> Self {
        let module = naga::front::wgsl::parse_str(wgsl)
            .unwrap_or_else(|error| panic!("{label}: {}", error.emit_to_string_with_path(wgsl, label)));
        let mut names = Vec::new();
        let mut entries = Vec::new();
        for (_, variable) in module.global_variables.iter() {
            let (Some(name), Some(binding)) = (&variable.name, variable.binding) else { continue };
            assert_eq!(binding.group, 0, "{label}: `{name}` must be in group 0");
            names.push((name.clone(), binding.binding));
            entries.push(layout_entry(label, name, binding.binding, variable, &module));
        }
        let workgroup_size = module.entry_points.first().map_or([1; 3], |entry| entry.workgroup_size);
        let device = gpu.device();
        let shader = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(label),
            source: wgpu::ShaderSource::Naga(Cow::Owned(module)),
        });
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(label),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(label),
            layout: Some(&pipeline_layout),
            module: &shader,
            entry_point: Some("main"),
            // Every kernel fills its shared memory before it reads it.
            compilation_options: wgpu::PipelineCompilationOptions { constants, zero_initialize_workgroup_memory: false },
            cache: None,
        });
        Self { label: label.to_owned(), pipeline, layout, names, workgroup_size }
    }

    /// Invocations of a workgroup along x, y and z.
    pub fn workgroup_size(&self) -> [u32; 3] {
        self.workgroup_size
    }

    /// Binds a resource to each of the kernel's variables.
    ///
    /// # Panics
    /// When a variable is left out or a name is not one of the kernel's: that is a bug.
    pub fn bind(&self, gpu: &Gpu, resources: &[(&str, &wgpu::Buffer)]) -> wgpu::BindGroup {
        for (name, _) in resources {
            assert!(self.names.iter().any(|(known, _)| known == name), "{}: there is no variable `{name}`", self.label);
        }
        let entries: Vec<_> = self
            .names
            .iter()
            .map(|(name, binding)| {
                let buffer = resources.iter().find(|(given, _)| given == name);
                let (_, buffer) = buffer.unwrap_or_else(|| panic!("{}: nothing is bound to `{name}`", self.label));
                wgpu::BindGroupEntry { binding: *binding, resource: buffer.as_entire_binding() }
            })
            .collect();
        gpu.device().create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(&self.label),
            layout: &self.layout,
            entries: &entries,
        })
    }

    /// Records one dispatch as a pass of its own.
    pub fn dispatch(&self, encoder: &mut wgpu::CommandEncoder, bound: &wgpu::BindGroup, groups: [u32; 3]) {
        let mut pass =
            encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some(&self.label), timestamp_writes: None });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, bound, &[]);
        pass.dispatch_workgroups(groups[0], groups[1], groups[2]);
    }
}

fn layout_entry(
    label: &str,
    name: &str,
    binding: u32,
    variable: &naga::GlobalVariable,
    module: &naga::Module,
) -> wgpu::BindGroupLayoutEntry {
    let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    let ty = match variable.space {
        naga::AddressSpace::Uniform => buffer(wgpu::BufferBindingType::Uniform),
        naga::AddressSpace::Storage { access } => {
            let read_only = !access.contains(naga::StorageAccess::STORE);
            buffer(wgpu::BufferBindingType::Storage { read_only })
        }
        _ => panic!("{label}: `{name}` is a resource of a kind not bound here: {:?}", module.types[variable.ty].inner),
    };
    wgpu::BindGroupLayoutEntry { binding, visibility: wgpu::ShaderStages::COMPUTE, ty, count: None }
}

/// Workgroups of `size` that cover `items` in one dimension, folded into x and y where there are more
/// than a dimension may hold. A kernel numbers its items by
/// `(workgroup.y * num_workgroups.x + workgroup.x) * size + local`.
pub fn groups_1d(items: u64, size: u32) -> [u32; 3] {
    const MAX: u64 = 65_535;
    let groups = items.div_ceil(u64::from(size)).max(1);
    let y = groups.div_ceil(MAX);
    let x = groups.div_ceil(y);
    #[expect(clippy::cast_possible_truncation, reason = "x is at most 65535; y too for any buffer that fits")]
    [x as u32, y as u32, 1]
}

/// Workgroups that cover a box of items.
pub fn groups_3d(items: [u32; 3], size: [u32; 3]) -> [u32; 3] {
    std::array::from_fn(|axis| items[axis].div_ceil(size[axis]).max(1))
}
