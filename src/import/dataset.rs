//! Names of datasets: plain files of one folder, and nothing that leads out of it.

use std::path::{Component, Path, PathBuf};

use super::{Fault, ImportError};

/// The file that the name `id` stands for in `folder`: a file directly inside it, reached by no separator, no `..`
/// and no link that leads out.
///
/// # Errors
/// An [`ImportError`] that tells no more of the world outside than that there is no such dataset.
pub fn resolve(folder: &Path, id: &str) -> Result<PathBuf, ImportError> {
    beside(folder, id).map_err(|fault| fault.of(Path::new(id)))
}

/// [`resolve`] for a name that stands in a file.
pub(super) fn beside(folder: &Path, id: &str) -> Result<PathBuf, Fault> {
    let mut parts = Path::new(id).components();
    let plain = matches!((parts.next(), parts.next()), (Some(Component::Normal(name)), None) if name == id);
    // A backslash separates on some systems; a colon names a drive or a stream there.
    if !plain || id.starts_with('.') || id.contains(['/', '\\', ':', '\0']) {
        return Err(Fault::new("name", "a dataset is named by a plain file name"));
    }
    let missing = || Fault::new("name", "there is no such dataset");
    let folder = folder.canonicalize().map_err(|_| missing())?;
    let file = folder.join(id).canonicalize().map_err(|_| missing())?;
    if file.parent() == Some(&folder) && file.is_file() { Ok(file) } else { Err(missing()) }
}
