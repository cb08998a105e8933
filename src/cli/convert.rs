//! Volume files: what they hold, and the same in another format.

use std::path::Path;

use tyndall::export::{write_file, write_npy, write_nrrd};
use tyndall::import::load;
use tyndall::volume::{Field, Samples};

use super::failure::Failure;
use super::print;

/// How a field is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FieldFormat {
    Nrrd,
    Npy,
}

impl FieldFormat {
    /// By the name's extension.
    pub(crate) fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_lowercase().as_str() {
            "nrrd" => Some(Self::Nrrd),
            "npy" => Some(Self::Npy),
            _ => None,
        }
    }

    pub(crate) fn write(self, field: &Field) -> Vec<u8> {
        match self {
            Self::Nrrd => write_nrrd(field),
            Self::Npy => write_npy(field),
        }
    }
}

/// Prints type, size, spacing and statistics of a volume file.
pub(crate) fn info(file: &Path) -> Result<(), Failure> {
    let field = load(file)?;
    let facts = Facts::of(&field.samples);
    let ([nx, ny, nz], [sx, sy, sz]) = (field.size, field.spacing);
    print::out(&format!(
        "name     {}\nunit     {}\ntype     {}\nsize     {nx} {ny} {nz}\nspacing  {sx} {sy} {sz}\nmin      {}\nmax      {}\nmean     {}\n",
        field.name,
        if field.unit.is_empty() { "-" } else { &field.unit },
        facts.kind,
        facts.min,
        facts.max,
        facts.mean,
    ))
}

/// Reads a volume file and writes it again by the extension of `output`.
pub(crate) fn convert(input: &Path, output: &Path) -> Result<(), Failure> {
    let Some(format) = FieldFormat::of(output) else {
        let refused = format!("{}: volumes are written as .nrrd and .npy", output.display());
        return Err(Failure::usage(refused));
    };
    let field = load(input)?;
    write_file(output, &format.write(&field)).map_err(|error| Failure::input(output, "file", error))
}

struct Facts {
    kind: &'static str,
    min: f64,
    max: f64,
    mean: f64,
}

impl Facts {
    fn of(samples: &Samples) -> Self {
        match samples {
            Samples::U8(values) => Self::over("uint8", values),
            Samples::U16(values) => Self::over("uint16", values),
            Samples::U32(values) => Self::over("uint32", values),
            Samples::I16(values) => Self::over("int16", values),
            Samples::F32(values) => Self::over("float", values),
        }
    }

    fn over<T: Copy + Into<f64>>(kind: &'static str, values: &[T]) -> Self {
        let (mut min, mut max, mut sum) = (f64::INFINITY, f64::NEG_INFINITY, 0.0);
        for value in values {
            let value: f64 = (*value).into();
            min = min.min(value);
            max = max.max(value);
            sum += value;
        }
        #[expect(clippy::cast_precision_loss, reason = "counts are far below 2^53")]
        let mean = sum / values.len() as f64;
        Self { kind, min, max, mean }
    }
}
