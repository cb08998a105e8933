//! Which files a scene from the network may name: datasets of the server's own folder, and never a path.

use std::path::Path;

use serde_json::Value;

use crate::import::resolve;
use crate::scene::Refusal;

/// Checks the files that a document or a patch from the network names. A `path` that already stands in `current`, the
/// session's scene, may be sent back: the operator put it there.
///
/// # Errors
/// A [`Refusal`] that names the key.
pub(super) fn check(document: &Value, current: Option<&Value>, data: Option<&Path>) -> Result<(), Refusal> {
    let Some(volumes) = document.get("volumes").and_then(Value::as_object) else { return Ok(()) };
    for (name, volume) in volumes {
        let Some(source) = volume.get("source") else { continue };
        let key = |key: &str| format!("volumes.{name}.source.{key}");
        if let Some(path) = source.get("path").filter(|path| !path.is_null()) {
            let known = current.and_then(|scene| scene.get("volumes")?.get(name)?.get("source")?.get("path"));
            if known != Some(path) {
                let text = "a path is for scene files of this machine; over the network, name a `dataset`".to_owned();
                return Err(Refusal { code: "not_allowed", path: key("path"), text });
            }
        }
        if let Some(dataset) = source.get("dataset").and_then(Value::as_str)
            && data.is_none_or(|data| resolve(data, dataset).is_err())
        {
            let text = format!("there is no dataset {dataset:?} on this server");
            return Err(Refusal { code: "unknown_dataset", path: key("dataset"), text });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn source(source: &Value) -> Value {
        json!({"volumes": {"main": {"source": source}}})
    }

    #[test]
    fn only_files_directly_in_the_data_folder_are_datasets() {
        let root = tempfile::tempdir().unwrap();
        let data = root.path().join("data");
        std::fs::create_dir(&data).unwrap();
        std::fs::write(root.path().join("secret.nrrd"), "secret").unwrap();
        std::fs::write(data.join("smoke.nrrd"), "smoke").unwrap();
        #[cfg(unix)]
        std::os::unix::fs::symlink("../secret.nrrd", data.join("link.nrrd")).unwrap();
        let checked = |name: &str| check(&source(&json!({"type": "file", "dataset": name})), None, Some(&data));
        assert_eq!(checked("smoke.nrrd"), Ok(()));
        let absolute = root.path().join("secret.nrrd").display().to_string();
        for name in
            ["", ".", "..", "../secret.nrrd", "..\\secret.nrrd", "x/../smoke.nrrd", "link.nrrd", "other.nrrd", "a\0b", &absolute]
        {
            let refusal = checked(name).unwrap_err();
            assert_eq!((refusal.code, refusal.path.as_str()), ("unknown_dataset", "volumes.main.source.dataset"), "{name:?}");
        }
    }

    #[test]
    fn a_path_from_the_network_is_refused_unless_it_stands_in_the_scene() {
        let patch = source(&json!({"type": "file", "path": "/etc/passwd"}));
        let refusal = check(&patch, None, None).unwrap_err();
        assert_eq!((refusal.code, refusal.path.as_str()), ("not_allowed", "volumes.main.source.path"));
        assert!(check(&source(&json!({"path": "a.nrrd"})), Some(&source(&json!({"path": "b.nrrd"}))), None).is_err());
        assert!(check(&source(&json!({"path": "a.nrrd"})), Some(&source(&json!({"path": "a.nrrd"}))), None).is_ok());
        assert!(check(&source(&json!({"path": null, "type": "cloud"})), None, None).is_ok());
        assert_eq!(check(&source(&json!({"dataset": "../x"})), None, None).unwrap_err().code, "unknown_dataset");
    }
}
