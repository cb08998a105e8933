//! Every kernel is valid WGSL with its imports in place, begins with a sentence and has the entry point `main`.

use naga::valid::{Capabilities, ValidationFlags, Validator};
use tyndall::gpu::shader;

#[test]
fn every_kernel_passes_naga() {
    let mut validator = Validator::new(ValidationFlags::all(), Capabilities::all());
    for path in shader::kernels() {
        let text = shader::source(path);
        let module =
            naga::front::wgsl::parse_str(&text).unwrap_or_else(|error| panic!("{}", error.emit_to_string_with_path(&text, path)));
        if let Err(error) = validator.validate(&module) {
            panic!("{}", error.emit_to_string_with_path(&text, path));
        }
        assert!(module.entry_points.iter().any(|entry| entry.name == "main"), "{path} has no entry point `main`");
    }
}

#[test]
fn every_shader_begins_with_what_it_does() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders");
    for folder in [folder.clone(), folder.join("lib")] {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|extension| extension == "wgsl") {
                let text = std::fs::read_to_string(&path).unwrap();
                assert!(text.starts_with("// "), "{} does not begin with a sentence", path.display());
            }
        }
    }
}
