//! Files: what others wrote is read, what we write is read back, and what is broken is refused in words.
#![expect(clippy::unwrap_used, reason = "a test that panics has failed")]

use std::io::Write;
use std::path::{Path, PathBuf};

use serde_json::json;
use tyndall::export::{
    Attribute, Provenance, write_csv, write_exr, write_file, write_npy, write_npz, write_nrrd, write_ply, write_png, write_vtk,
};
use tyndall::import::{load, resolve};
use tyndall::volume::{Field, Samples};

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name)
}

/// The values of every fixture: x + 10 y + 100 z at voxel (x, y, z) of 4×3×2.
fn ramp() -> Vec<u8> {
    (0..24).map(|i| i % 4 + 10 * (i / 4 % 3) + 100 * (i / 12)).collect()
}

fn floats() -> Samples {
    Samples::F32(ramp().into_iter().map(f32::from).collect())
}

fn stored(name: &str, bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    (folder, path)
}

fn refusal(name: &str, bytes: &[u8]) -> String {
    let (_folder, path) = stored(name, bytes);
    load(&path).unwrap_err().to_string().replace(&path.display().to_string(), name)
}

#[test]
fn numpy_files_are_read_in_both_orders_and_all_types() {
    let shorts = Samples::I16(ramp().into_iter().map(|x| i16::from(x) - 50).collect());
    let words = Samples::U16(ramp().into_iter().map(u16::from).collect());
    for (name, samples) in
        [("c_f4.npy", floats()), ("fortran_f8.npy", floats()), ("big_endian_u2.npy", words), ("negative_i2.npy", shorts)]
    {
        let field = load(&fixture(name)).unwrap();
        assert_eq!((field.size, field.samples), ([4, 3, 2], samples), "{name}");
    }
}

#[test]
fn pynrrd_files_are_read_with_their_spacing() {
    let shorts = Samples::I16(ramp().into_iter().map(i16::from).collect());
    for (name, spacing, samples) in [
        ("gzip_u1.nrrd", [1.0, 1.0, 2.5], Samples::U8(ramp())),
        ("raw_f4.nrrd", [0.5, 0.5, 2.0], floats()),
        ("four_axes_i2.nrrd", [2.0, 2.0, 3.0], shorts),
        ("detached.nhdr", [1.0, 1.0, 1.0], floats()),
    ] {
        let field = load(&fixture(name)).unwrap();
        assert_eq!((field.size, field.spacing, field.samples), ([4, 3, 2], spacing, samples), "{name}");
    }
    assert_eq!(load(&fixture("gzip_u1.nrrd")).unwrap().name, "engine");
}

#[test]
fn every_type_written_is_read_back() {
    let types = [
        Samples::U8((0..24).collect()),
        Samples::U16((0..24).map(|x| x * 2700).collect()),
        Samples::U32((0..24).map(|x| x * 178_956_970).collect()),
        Samples::I16((-12..12).map(|x| x * 2700).collect()),
        Samples::F32((0..24_u8).map(|x| (f32::from(x) - 12.0).exp()).collect()),
    ];
    for samples in types {
        let field = Field { name: "density".into(), unit: "counts".into(), size: [4, 3, 2], spacing: [1.0, 0.5, 0.1], samples };
        let (_folder, path) = stored("a.nrrd", &write_nrrd(&field));
        assert_eq!(load(&path).unwrap(), field);
        let (_folder, path) = stored("a.npy", &write_npy(&field));
        assert_eq!(load(&path).unwrap(), Field { spacing: [1.0; 3], unit: String::new(), ..field });
    }
}

#[test]
fn a_written_name_cannot_end_the_header() {
    let name = "a\n\nb".to_owned();
    let field = Field { name, unit: String::new(), size: [1, 1, 1], spacing: [1.0; 3], samples: Samples::U8(vec![7]) };
    let (_folder, path) = stored("a.nrrd", &write_nrrd(&field));
    let back = load(&path).unwrap();
    assert_eq!((back.name.as_str(), back.samples), ("ab", Samples::U8(vec![7])));
}

#[test]
fn a_value_that_is_not_finite_is_refused_by_its_voxel() {
    let error = load(&fixture("not_a_number.npy")).unwrap_err();
    assert_eq!((error.place.as_str(), error.reason.as_str()), ("voxel 2,1,1", "NaN is not a finite 32-bit float"));
}

#[test]
fn a_double_beyond_a_float_is_refused_by_its_voxel() {
    let mut file = b"NRRD0001\ntype: double\ndimension: 3\nsizes: 1 1 2\nencoding: raw\nendian: little\n\n".to_vec();
    file.extend([1.0, 1e300].iter().flat_map(|x: &f64| x.to_le_bytes()));
    assert_eq!(refusal("big.nrrd", &file), "big.nrrd: voxel 0,0,1: inf is not a finite 32-bit float");
}

#[test]
fn what_is_wrong_is_said_with_file_and_place() {
    let nrrd = |changes: &str| format!("NRRD0004\ndimension: 3\nsizes: 2 2 2\n{changes}\n\n01234567").into_bytes();
    let cases: [(&str, Vec<u8>, &str); 16] = [
        ("x.nrrd", b"P6 3 3 255".to_vec(), "start: neither an NRRD nor an NPY file"),
        ("x.nrrd", Vec::new(), "start: neither"),
        ("x.nrrd", nrrd("encoding: raw"), "type: missing from the header"),
        ("x.nrrd", nrrd("encoding: raw\ntype: int"), "type: `int` is not read"),
        ("x.nrrd", nrrd("encoding: raw\ntype: float"), "endian: missing"),
        ("x.nrrd", nrrd("encoding: bzip2\ntype: uint8"), "encoding: `bzip2` is not read"),
        ("x.nrrd", nrrd("encoding: raw\ntype: int16\nendian: little"), "data: 16 bytes are needed, 8 are there"),
        ("x.nrrd", nrrd("encoding: gzip\ntype: uint8"), "data: "),
        ("x.nrrd", nrrd("encoding: raw\ntype: uint8\nspacings: 1 1"), "spacings: 2 for 3 axes"),
        ("x.nrrd", nrrd("encoding: raw\ntype: uint8\nspacings: 1 0 1"), "spacings: 0 is no length"),
        ("x.nrrd", nrrd("encoding: raw\ntype: uint8\nspace directions: (1,1,0) (0,1,0) (0,0,1)"), "not at right angles"),
        ("x.nrrd", nrrd("encoding: raw\ntype: uint8\ntype: uint8"), "line 6: a field that stands here for the second time"),
        ("x.nrrd", nrrd("encoding: raw\ntype: uint8\ndata file: ../x.raw"), "a plain file name"),
        ("x.npy", b"\x93NUMPY\x01\x00\xff\xff{'descr'".to_vec(), "header: the file ends inside"),
        ("x.npy", b"\x93NUMPY\x02\x00\xff\xff\xff\xff{'descr'".to_vec(), "header: 4294967295 bytes"),
        ("x.npy", b"\x93NUMPY\x01\x00\x04\x00{[[[".to_vec(), "header: not a dictionary"),
    ];
    for (name, bytes, words) in cases {
        let message = refusal(name, &bytes);
        assert!(message.starts_with(&format!("{name}: ")) && message.contains(words), "{message:?} lacks {words:?}");
        assert!(!message.contains('\n'), "{message:?} is more than one line");
    }
    for (name, words) in
        [("two_axes.npy", "shape: 2 axes"), ("complex.npy", "`<c8` is not read"), ("none.npy", "file: no such file")]
    {
        let message = load(&fixture(name)).unwrap_err().to_string();
        assert!(message.contains(words), "{message:?} lacks {words:?}");
    }
}

#[test]
fn sizes_that_overflow_are_refused_before_anything_is_allocated() {
    for sizes in ["4294967296 4294967296 4294967296", "2097152 2097152 4194304", "65536 65536 65536", "0 1 1"] {
        let file = format!("NRRD0004\ndimension: 3\ntype: uint8\nencoding: gzip\nsizes: {sizes}\n\n");
        assert!(refusal("x.nrrd", file.as_bytes()).starts_with("x.nrrd: sizes: "), "{sizes}");
    }
    let header = "{'descr': '<f8', 'fortran_order': True, 'shape': (18446744073709551615, 3, 2), }\n";
    let mut file = b"\x93NUMPY\x01\x00".to_vec();
    file.extend(u16::try_from(header.len()).unwrap().to_le_bytes());
    file.extend(header.bytes());
    assert!(refusal("x.npy", &file).starts_with("x.npy: shape: "));
}

#[test]
fn a_bomb_takes_no_more_than_its_header_says() {
    let mut deflated = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    deflated.write_all(&vec![1; 1 << 20]).unwrap();
    let mut file = b"NRRD0004\ndimension: 3\ntype: uint8\nencoding: gzip\nsizes: 2 2 2\n\n".to_vec();
    file.extend(deflated.finish().unwrap());
    let (_folder, path) = stored("x.nrrd", &file);
    assert_eq!(load(&path).unwrap().samples, Samples::U8(vec![1; 8]));
}

/// A small generator with a fixed seed (xorshift, Marsaglia 2003).
fn random(state: &mut u64) -> usize {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    usize::try_from(*state >> 33).unwrap()
}

#[test]
fn no_mutation_of_a_file_is_more_than_an_error() {
    let mut state = 0x9e37_79b9_7f4a_7c15;
    let alphabet = b"0123456789-.,(){}[]:='\"\n #\x00\xffaeT";
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mutant");
    let mut read = 0;
    let rounds = std::env::var("TYNDALL_TEST_ROUNDS").map_or(1, |rounds| rounds.parse().unwrap());
    for name in ["c_f4.npy", "fortran_f8.npy", "gzip_u1.nrrd", "raw_f4.nrrd", "four_axes_i2.nrrd"] {
        let original = std::fs::read(fixture(name)).unwrap();
        for _ in 0..400 * rounds {
            let mut bytes = original.clone();
            for _ in 0..=random(&mut state) % 4 {
                let at = random(&mut state) % bytes.len().max(1);
                let letter = alphabet[random(&mut state) % alphabet.len()];
                match random(&mut state) % 4 {
                    0 if !bytes.is_empty() => bytes[at] = letter,
                    1 => bytes.insert(at, letter),
                    2 if !bytes.is_empty() => drop(bytes.remove(at)),
                    _ => bytes.truncate(at + 1),
                }
            }
            // A file system may take care to have a file that is written over on its disk at once; a new one, it does not.
            let _ = std::fs::remove_file(&path);
            std::fs::write(&path, &bytes).unwrap();
            if let Ok(field) = load(&path) {
                let voxels: u32 = field.size.iter().product();
                assert!(voxels > 0);
                read += 1;
            }
        }
    }
    assert!(read > 0, "every mutation was refused: the loop tests nothing but the first check");
}

#[test]
fn a_dataset_is_a_plain_file_of_its_folder() {
    let world = tempfile::tempdir().unwrap();
    let folder = world.path().join("data");
    std::fs::create_dir_all(folder.join("sub")).unwrap();
    for file in ["secret.npy", "data/a.npy", "data/sub/b.npy", "data/.hidden"] {
        std::fs::write(world.path().join(file), b"x").unwrap();
    }
    std::os::unix::fs::symlink(world.path().join("secret.npy"), folder.join("link.npy")).unwrap();
    std::os::unix::fs::symlink(folder.join("a.npy"), folder.join("inside.npy")).unwrap();
    assert_eq!(resolve(&folder, "a.npy").unwrap(), folder.canonicalize().unwrap().join("a.npy"));
    assert!(resolve(&folder, "inside.npy").is_ok());
    let secret = world.path().join("secret.npy").display().to_string();
    let bad =
        ["", ".", "..", "../secret.npy", "sub/b.npy", "sub", "./a.npy", "a.npy/", "/etc/passwd", "link.npy", ".hidden", "..\\a"];
    for id in bad.into_iter().chain([secret.as_str()]) {
        let error = resolve(&folder, id).unwrap_err();
        assert!(
            ["there is no such dataset", "a dataset is named by a plain file name"].contains(&error.reason.as_str()),
            "{error}"
        );
    }
}

#[test]
fn a_file_is_written_whole_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.bin");
    write_file(&path, b"old").unwrap();
    write_file(&path, b"new").unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), b"new");
    assert!(write_file(&folder.path().join("no/such/folder.bin"), b"x").is_err());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left behind");
}

#[test]
fn a_device_is_written_to_and_not_replaced() {
    write_file(Path::new("/dev/null"), b"x").unwrap();
    assert!(!std::fs::metadata("/dev/null").unwrap().is_file());
}

fn about(scene: &serde_json::Value) -> Provenance<'_> {
    Provenance { scene, spp: 16, seed: 7, adapter: "an adapter, ünïcode and all" }
}

#[test]
fn an_exr_holds_float32_bit_for_bit_with_row_0_on_top() {
    let scene = json!({"camera": {"fov_y": 32}});
    let pixels: Vec<[f32; 4]> = (0..6_u8).map(|i| [f32::from(i) * 1e5, 1e-30, 0.1, 1.0]).collect();
    let bytes = write_exr([3, 2], &pixels, &about(&scene)).unwrap();
    assert_eq!(bytes, write_exr([3, 2], &pixels, &about(&scene)).unwrap(), "the same picture is the same bytes");
    let (_folder, path) = stored("a.exr", &bytes);
    let image = exr::prelude::read_first_flat_layer_from_file(&path).unwrap();
    let names: Vec<_> = image.layer_data.channel_data.list.iter().map(|channel| channel.name.to_string()).collect();
    assert_eq!(names, ["A", "B", "G", "R"]);
    for (channel, part) in image.layer_data.channel_data.list.iter().zip([3, 2, 1, 0]) {
        let exr::prelude::FlatSamples::F32(values) = &channel.sample_data else { panic!("{} is not float32", channel.name) };
        assert_eq!(*values, pixels.iter().map(|pixel| pixel[part]).collect::<Vec<_>>());
    }
    let exr::prelude::AttributeValue::Text(text) = &image.layer_data.attributes.other[&exr::prelude::Text::from("tyndall")]
    else {
        panic!()
    };
    let provenance: serde_json::Value = serde_json::from_str(&text.to_string()).unwrap();
    assert_eq!(
        provenance,
        json!({"version": env!("CARGO_PKG_VERSION"), "adapter": about(&scene).adapter, "seed": 7, "spp": 16, "scene": scene})
    );
}

#[test]
fn a_png_holds_the_pixels_in_srgb_and_the_scene() {
    let scene = json!({"about": {"title": "Fäden"}});
    let pixels: Vec<u8> = (0..24).map(|i| i * 10).collect();
    let bytes = write_png([3, 2], &pixels, &about(&scene)).unwrap();
    let mut reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
    let mut back = vec![0; 24];
    reader.next_frame(&mut back).unwrap();
    assert_eq!(back, pixels);
    assert!(reader.info().srgb.is_some());
    let text = reader.info().utf8_text.iter().find(|chunk| chunk.keyword == "tyndall").unwrap().get_text().unwrap();
    assert_eq!(serde_json::from_str::<serde_json::Value>(&text).unwrap()["scene"], scene);
}

#[test]
fn a_picture_without_its_pixels_is_refused() {
    let scene = json!({});
    assert!(write_png([3, 2], &[0; 23], &about(&scene)).is_err());
    assert!(write_png([0, 0], &[], &about(&scene)).is_err());
    assert!(write_exr([3, 2], &[[0.0; 4]; 5], &about(&scene)).is_err());
    assert!(write_exr([0, 7], &[], &about(&scene)).is_err());
}

/// Three particles with a position, a scalar and a quaternion, and a file of them written by `write`.
fn particles<E: std::fmt::Debug>(write: impl Fn(&[Attribute<'_>]) -> Result<Vec<u8>, E>) -> Vec<u8> {
    let (position, mass): (Vec<f32>, [f32; 3]) = ((0..9_u8).map(f32::from).collect(), [0.5, 1.5, 1e-9]);
    let turned: Vec<f32> = (0..12_u8).map(|x| -f32::from(x)).collect();
    let attributes = [
        Attribute { name: "position", parts: 3, values: &position },
        Attribute { name: "mass", parts: 1, values: &mass },
        Attribute { name: "orientation", parts: 4, values: &turned },
    ];
    assert!(write(&attributes[1..]).is_err(), "a file without positions was written");
    assert!(write(&[attributes[0], Attribute { values: &mass[..2], ..attributes[1] }]).is_err(), "a mass was missing");
    write(&attributes).unwrap()
}

/// A value at a place in a file.
fn float(bytes: &[u8], at: usize) -> [u8; 4] {
    bytes[at..at + 4].try_into().unwrap()
}

#[test]
fn a_csv_has_a_column_for_each_part() {
    let text = String::from_utf8(particles(write_csv)).unwrap();
    let header = "position_x,position_y,position_z,mass,orientation_x,orientation_y,orientation_z,orientation_w";
    assert_eq!(text.lines().collect::<Vec<_>>()[..2], [header, "0,1,2,0.5,-0,-1,-2,-3"]);
    assert_eq!(text.lines().last(), Some("6,7,8,0.000000001,-8,-9,-10,-11"));
}

#[test]
fn a_ply_holds_each_particle_in_a_row() {
    let bytes = particles(write_ply);
    let end = b"end_header\n";
    let start = bytes.windows(end.len()).position(|window| window == end).unwrap() + end.len();
    let header = String::from_utf8_lossy(&bytes[..start]).replace('\n', " ");
    assert!(
        header.contains("element vertex 3 property float x property float y property float z property float mass "),
        "{header}"
    );
    assert_eq!(bytes.len() - start, 3 * 8 * 4);
    assert_eq!(float(&bytes, start + 32), (3.0_f32).to_le_bytes());
    assert_eq!(float(&bytes, start + 32 + 12), (1.5_f32).to_le_bytes());
}

#[test]
fn a_vtk_holds_points_and_fields_in_big_endian() {
    let bytes = particles(write_vtk);
    let after = |words: &[u8]| bytes.windows(words.len()).position(|window| window == words).unwrap() + words.len();
    assert_eq!(float(&bytes, after(b"POINTS 3 float\n") + 4 * 8), (8.0_f32).to_be_bytes());
    assert_eq!(i32::from_be_bytes(float(&bytes, after(b"VERTICES 3 6\n") + 4 * 5)), 2);
    assert_eq!(float(&bytes, after(b"mass 1 3 float\n") + 4), (1.5_f32).to_be_bytes());
    assert_eq!(float(&bytes, after(b"orientation 4 3 float\n") + 44), (-11.0_f32).to_be_bytes());
}

#[test]
fn an_npz_is_an_archive_of_arrays() {
    let bytes = particles(write_npz);
    let end = bytes.len() - 22;
    assert_eq!(bytes[end..end + 4], *b"PK\x05\x06");
    assert_eq!(bytes[end + 10], 3, "entries");
    let mut entry = u32::from_le_bytes(float(&bytes, end + 16)) as usize;
    for (name, shape) in [("position.npy", "(3, 3)"), ("mass.npy", "(3,)"), ("orientation.npy", "(3, 4)")] {
        assert_eq!(bytes[entry..entry + 4], *b"PK\x01\x02");
        let (crc, length) =
            (u32::from_le_bytes(float(&bytes, entry + 16)), u32::from_le_bytes(float(&bytes, entry + 20)) as usize);
        let local = u32::from_le_bytes(float(&bytes, entry + 42)) as usize;
        assert_eq!(bytes[entry + 46..][..name.len()], *name.as_bytes());
        let array = &bytes[local + 30 + name.len()..][..length];
        assert!(array.starts_with(b"\x93NUMPY") && String::from_utf8_lossy(array).contains(shape), "{name}");
        let mut sum = flate2::Crc::new();
        sum.update(array);
        assert_eq!(sum.sum(), crc, "{name}");
        entry += 46 + name.len();
    }
    assert_eq!(entry, end);
}
