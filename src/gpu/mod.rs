//! The GPU: opening an adapter, asking it for the limits that it has, and saying in words what does not fit.

mod kernel;
mod readback;
pub mod shader;

use std::fmt;
use std::sync::{Arc, Mutex};

pub use kernel::{Kernel, groups_1d, groups_3d};
pub use readback::Readback;

/// A device with its queue and what is known of its adapter. Cloning is cheap.
#[derive(Clone)]
pub struct Gpu(Arc<Inner>);

struct Inner {
    device: wgpu::Device,
    queue: wgpu::Queue,
    info: wgpu::AdapterInfo,
    limits: wgpu::Limits,
    fault: Arc<Mutex<Option<String>>>,
    lost: Arc<Mutex<Option<String>>>,
}

/// Why the GPU cannot do what was asked.
#[derive(Debug, Clone, thiserror::Error)]
pub enum GpuError {
    /// There is no adapter of the kind that was asked for.
    #[error("no adapter matches `{wanted}`; found: {found}. `tyndall doctor` says what to install")]
    NoAdapter {
        /// The choice as it was given.
        wanted: String,
        /// Names of the adapters there are.
        found: String,
    },
    /// The driver refused to open the device.
    #[error("{adapter} could not be opened: {reason}")]
    Device {
        /// Name of the adapter.
        adapter: String,
        /// The driver's words.
        reason: String,
    },
    /// A buffer would be larger than the adapter allows.
    #[error("{what} needs {needed} bytes; {adapter} allows {allowed} in one buffer")]
    TooLarge {
        /// What the buffer is for.
        what: String,
        /// Bytes needed.
        needed: u64,
        /// Bytes allowed.
        allowed: u64,
        /// Name of the adapter.
        adapter: String,
    },
    /// Work failed on the device, or did not end in time.
    #[error("the GPU failed: {0}")]
    Fault(String),
}

/// Which adapter to open.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum AdapterChoice {
    /// A GPU if there is one, else software.
    #[default]
    Auto,
    /// A GPU and nothing else.
    Gpu,
    /// Software on the CPU.
    Cpu,
    /// The first adapter whose name contains this, without regard to case.
    Named(String),
}

impl std::str::FromStr for AdapterChoice {
    type Err = std::convert::Infallible;
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Ok(match text {
            "auto" => Self::Auto,
            "gpu" => Self::Gpu,
            "cpu" => Self::Cpu,
            name => Self::Named(name.to_owned()),
        })
    }
}

impl fmt::Display for AdapterChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Auto => "auto",
            Self::Gpu => "gpu",
            Self::Cpu => "cpu",
            Self::Named(name) => name,
        })
    }
}

impl AdapterChoice {
    /// How well an adapter fits; lower is better, `None` not at all.
    fn rank(&self, info: &wgpu::AdapterInfo) -> Option<u32> {
        let by_type = match info.device_type {
            wgpu::DeviceType::DiscreteGpu => 0,
            wgpu::DeviceType::IntegratedGpu => 1,
            wgpu::DeviceType::VirtualGpu => 2,
            wgpu::DeviceType::Other => 3,
            wgpu::DeviceType::Cpu => 4,
        };
        // GL has no compute on many drivers; it serves only where nothing else does.
        let rank = by_type * 2 + u32::from(info.backend == wgpu::Backend::Gl);
        let fits = match self {
            Self::Auto => true,
            Self::Gpu => info.device_type != wgpu::DeviceType::Cpu,
            Self::Cpu => info.device_type == wgpu::DeviceType::Cpu,
            Self::Named(name) => info.name.to_lowercase().contains(&name.to_lowercase()),
        };
        fits.then_some(rank)
    }
}

fn adapters() -> Vec<wgpu::Adapter> {
    // GL is asked only where nothing else answers: it is slower, and complains where there is no display.
    let found = |backends| {
        let given = wgpu::InstanceDescriptor::new_without_display_handle_from_env();
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor { backends, ..given });
        pollster::block_on(instance.enumerate_adapters(backends))
    };
    let first = found(wgpu::Backends::PRIMARY);
    if first.is_empty() { found(wgpu::Backends::GL) } else { first }
}

/// Every adapter of this machine with its limits.
pub fn survey() -> Vec<(wgpu::AdapterInfo, wgpu::Limits)> {
    adapters().iter().map(|adapter| (adapter.get_info(), adapter.limits())).collect()
}

impl Gpu {
    /// Opens the best adapter of the kind asked for, with all the limits that it has.
    ///
    /// # Errors
    /// [`GpuError::NoAdapter`] or [`GpuError::Device`].
    pub fn open(choice: &AdapterChoice) -> Result<Self, GpuError> {
        let adapters = adapters();
        let found = adapters.iter().map(|a| a.get_info().name).collect::<Vec<_>>().join(", ");
        let best = adapters
            .into_iter()
            .filter_map(|adapter| Some((choice.rank(&adapter.get_info())?, adapter)))
            .min_by_key(|(rank, _)| *rank);
        let Some((_, adapter)) = best else {
            let found = if found.is_empty() { "none".to_owned() } else { found };
            return Err(GpuError::NoAdapter { wanted: choice.to_string(), found });
        };
        let info = adapter.get_info();
        let limits = adapter.limits();
        let request = adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("tyndall"),
            required_limits: limits.clone(),
            ..Default::default()
        });
        let (device, queue) = pollster::block_on(request)
            .map_err(|error| GpuError::Device { adapter: info.name.clone(), reason: error.to_string() })?;
        let fault = Arc::new(Mutex::new(None));
        let seen = Arc::clone(&fault);
        // The default handler panics on whatever thread meets the error; a fault belongs to the session whose turn it is.
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            tracing::error!(%error, "the GPU reported an error");
            if let Ok(mut fault) = seen.lock() {
                fault.get_or_insert_with(|| error.to_string());
            }
        }));
        let lost = Arc::new(Mutex::new(None));
        let gone = Arc::clone(&lost);
        device.set_device_lost_callback(move |reason, words| {
            if let Ok(mut lost) = gone.lock() {
                lost.get_or_insert_with(|| format!("{reason:?}: {words}"));
            }
        });
        Ok(Self(Arc::new(Inner { device, queue, info, limits, fault, lost })))
    }

    /// The wgpu device.
    pub fn device(&self) -> &wgpu::Device {
        &self.0.device
    }

    /// The wgpu queue.
    pub fn queue(&self) -> &wgpu::Queue {
        &self.0.queue
    }

    /// Name, driver and kind of the adapter.
    pub fn info(&self) -> &wgpu::AdapterInfo {
        &self.0.info
    }

    /// The adapter's limits, all of which the device was opened with.
    pub fn limits(&self) -> &wgpu::Limits {
        &self.0.limits
    }

    /// Whether the adapter computes on the CPU.
    pub fn is_software(&self) -> bool {
        self.0.info.device_type == wgpu::DeviceType::Cpu
    }

    /// The largest storage buffer that a kernel can see whole, in bytes.
    pub fn largest_binding(&self) -> u64 {
        self.0.limits.max_storage_buffer_binding_size.min(self.0.limits.max_buffer_size)
    }

    /// Makes a zeroed storage buffer that can be copied from and to.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] with the numbers where the adapter does not allow the size.
    pub fn storage(&self, what: &str, bytes: u64) -> Result<wgpu::Buffer, GpuError> {
        let allowed = self.largest_binding();
        if bytes > allowed {
            let adapter = self.0.info.name.clone();
            return Err(GpuError::TooLarge { what: what.to_owned(), needed: bytes, allowed, adapter });
        }
        Ok(self.0.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(what),
            size: bytes.next_multiple_of(4).max(16),
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        }))
    }

    /// Makes a storage buffer that holds `data`.
    ///
    /// # Errors
    /// As [`Gpu::storage`].
    pub fn storage_of<T: bytemuck::NoUninit>(&self, what: &str, data: &[T]) -> Result<wgpu::Buffer, GpuError> {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        let buffer = self.storage(what, bytes.len() as u64)?;
        self.0.queue.write_buffer(&buffer, 0, bytes);
        Ok(buffer)
    }

    /// Makes a parameter buffer that holds `value`, laid out as WGSL wants it.
    ///
    /// A kernel may bind it as `uniform`, or as `storage, read`. Parameters that a loop or branch depends on
    /// belong in storage: Mesa 22's software driver compiles a variant of the kernel for every value of a uniform
    /// that control flow depends on, and crashes where there are more than a few.
    pub fn uniform<T: encase::ShaderType + encase::internal::WriteInto>(&self, what: &str, value: &T) -> wgpu::Buffer {
        let bytes = uniform_bytes(value);
        let buffer = self.0.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(what),
            size: bytes.len() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        self.0.queue.write_buffer(&buffer, 0, &bytes);
        buffer
    }

    /// Writes `value` to a buffer made by [`Gpu::uniform`].
    pub fn write_uniform<T: encase::ShaderType + encase::internal::WriteInto>(&self, buffer: &wgpu::Buffer, value: &T) {
        self.0.queue.write_buffer(buffer, 0, &uniform_bytes(value));
    }

    /// A command encoder.
    pub fn encoder(&self, label: &str) -> wgpu::CommandEncoder {
        self.0.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some(label) })
    }

    /// Submits the commands and waits until they are done.
    ///
    /// # Errors
    /// [`GpuError::Fault`] when the device reported an error or did not finish within a minute.
    pub fn finish(&self, encoder: wgpu::CommandEncoder) -> Result<(), GpuError> {
        let submission = self.0.queue.submit([encoder.finish()]);
        self.wait(submission)
    }

    /// Waits for a submission.
    ///
    /// # Errors
    /// As [`Gpu::finish`].
    pub fn wait(&self, submission: wgpu::SubmissionIndex) -> Result<(), GpuError> {
        let timeout = Some(std::time::Duration::from_secs(60));
        let waited = self.0.device.poll(wgpu::PollType::Wait { submission_index: Some(submission), timeout });
        self.check()?;
        waited.map(|_| ()).map_err(|error| GpuError::Fault(error.to_string()))
    }

    /// The driver's words if the device is lost: nothing can be done on it any more.
    pub fn lost(&self) -> Option<String> {
        // The loss is told while the device is polled, and only then.
        let _ = self.0.device.poll(wgpu::PollType::Poll);
        self.0.lost.lock().ok().and_then(|lost| lost.clone())
    }

    /// Takes the error that the device has reported since the last call, if any.
    ///
    /// # Errors
    /// [`GpuError::Fault`] with the driver's words.
    pub fn check(&self) -> Result<(), GpuError> {
        let fault = self.0.fault.lock().ok().and_then(|mut fault| fault.take());
        fault.map_or(Ok(()), |words| Err(GpuError::Fault(words)))
    }
}

fn uniform_bytes<T: encase::ShaderType + encase::internal::WriteInto>(value: &T) -> Vec<u8> {
    let mut bytes = encase::UniformBuffer::new(Vec::new());
    bytes.write(value).unwrap_or_else(|error| panic!("a uniform could not be laid out: {error}"));
    bytes.into_inner()
}
