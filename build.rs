//! Builds again when a file joins or leaves a folder that is inside the binary.

fn main() {
    for folder in ["presets", "shaders", "static"] {
        println!("cargo::rerun-if-changed={folder}");
    }
}
