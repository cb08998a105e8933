//! The WGSL sources inside the binary, and their imports.
//!
//! `#import lib/random.wgsl` on a line of its own stands for that file's text, once in a kernel.

use std::collections::BTreeSet;

use include_dir::{Dir, include_dir};

static FILES: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/shaders");

/// The text of a kernel in `shaders/`, imports in place.
///
/// # Panics
/// When the file, or one that it imports, is not in the binary: that is a bug.
pub fn source(path: &str) -> String {
    let text = file(path);
    expand(text)
}

/// Puts the imports of `text` in place.
///
/// # Panics
/// As [`source`].
pub fn expand(text: &str) -> String {
    let mut out = String::with_capacity(text.len() * 2);
    append(text, &mut BTreeSet::new(), &mut out);
    out
}

/// Paths of all kernels: the files that stand directly in `shaders/`.
pub fn kernels() -> impl Iterator<Item = &'static str> {
    FILES.files().filter_map(|file| file.path().to_str())
}

fn file(path: &str) -> &'static str {
    FILES.get_file(path).and_then(|file| file.contents_utf8()).unwrap_or_else(|| panic!("there is no shader `{path}`"))
}

fn append(text: &str, seen: &mut BTreeSet<String>, out: &mut String) {
    for line in text.lines() {
        match line.strip_prefix("#import ") {
            Some(path) if seen.insert(path.trim().to_owned()) => append(file(path.trim()), seen, out),
            Some(_) => {}
            None => {
                out.push_str(line);
                out.push('\n');
            }
        }
    }
}
