//! Rebuilds the binary when a file that it holds is added or changed.

fn main() {
    for folder in ["shaders", "static", "presets"] {
        println!("cargo::rerun-if-changed={folder}");
    }
}
