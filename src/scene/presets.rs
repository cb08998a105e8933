//! The scene documents inside the binary.

use std::sync::LazyLock;

use include_dir::{Dir, include_dir};
use serde_json::Value;

static FILES: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/presets");

/// The preset that a document without volumes stands for.
pub const DEFAULT: &str = "tendrils";

static PRESETS: LazyLock<Vec<(&'static str, Value)>> = LazyLock::new(|| {
    let mut presets: Vec<_> = FILES
        .files()
        .filter_map(|file| {
            let name = file.path().file_stem()?.to_str()?;
            let document =
                serde_json::from_slice(file.contents()).unwrap_or_else(|error| panic!("the preset {name} is not JSON: {error}"));
            Some((name, document))
        })
        .collect();
    presets.sort_by_key(|(name, _)| (*name != DEFAULT, *name));
    presets
});

/// All presets, the default one first, the others by name.
pub fn all() -> impl Iterator<Item = (&'static str, &'static Value)> {
    PRESETS.iter().map(|(name, document)| (*name, document))
}

/// The document of the preset with this name.
pub fn get(name: &str) -> Option<&'static Value> {
    all().find(|(known, _)| *known == name).map(|(_, document)| document)
}

/// The document of the default preset.
pub fn default_document() -> Value {
    get(DEFAULT).cloned().unwrap_or_else(|| panic!("the preset {DEFAULT} is missing from the binary"))
}
