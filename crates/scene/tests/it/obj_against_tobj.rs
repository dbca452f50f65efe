//! The OBJ reader against `tobj`, which shares no code with it; and what `tobj` does not do, which is why it is not the reader.

use sabine_scene::Mesh;
use std::path::Path;
use tempfile::TempDir;

/// What `tobj` reads: faces as corners in metres, and the name of their material. Names reach it only by a material library,
/// so one is made up in front of the text.
fn by_tobj(text: &str) -> Vec<(Vec<[f64; 3]>, String)> {
    let mut names: Vec<&str> =
        text.lines().filter_map(|l| l.strip_prefix("usemtl ")).map(str::trim).collect();
    names.sort_unstable();
    names.dedup();
    let library: String = names.iter().map(|name| format!("newmtl {name}\n")).collect();
    let (models, materials) = load(&format!("mtllib made-up\n{text}"), &library).unwrap();
    let mut faces = Vec::new();
    for tobj::Model { mesh, .. } in models {
        let name = mesh.material_id.map_or("default", |id| &materials[id].name);
        let mut start = 0;
        let count =
            if mesh.face_arities.is_empty() { mesh.indices.len() / 3 } else { mesh.face_arities.len() };
        for i in 0..count {
            let corners = mesh.face_arities.get(i).map_or(3, |&n| n as usize);
            let at = |&v: &u32| std::array::from_fn(|k| mesh.positions[3 * v as usize + k]);
            faces.push((mesh.indices[start..start + corners].iter().map(at).collect(), name.to_owned()));
            start += corners;
        }
    }
    faces
}

type Loaded = (Vec<tobj::Model>, Vec<tobj::Material>);

fn load(text: &str, library: &str) -> Result<Loaded, tobj::LoadError> {
    let options = tobj::LoadOptions::default();
    let (models, materials) =
        tobj::load_obj_buf(&mut text.as_bytes(), &options, |_| tobj::load_mtl_buf(&mut library.as_bytes()))?;
    Ok((models, materials.unwrap_or_default()))
}

fn ours(text: impl AsRef<[u8]>) -> Result<Mesh, sabine_scene::Error> {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.obj");
    std::fs::write(&path, text).unwrap();
    Mesh::read(&path)
}

/// Twice the vector area of an outline.
fn area(points: &[[f64; 3]]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for (i, p) in points.iter().enumerate() {
        let q = points[(i + 1) % points.len()];
        for k in 0..3 {
            sum[k] += p[(k + 1) % 3] * q[(k + 2) % 3] - p[(k + 2) % 3] * q[(k + 1) % 3];
        }
    }
    sum
}

/// Without area, but for rounding.
fn is_line(points: &[[f64; 3]]) -> bool {
    let square = |v: [f64; 3]| v.iter().map(|c| c * c).sum::<f64>();
    let side = |q: &[f64; 3]| square(std::array::from_fn(|k| q[k] - points[0][k]));
    square(area(points)).sqrt() < 1e-12 * points.iter().map(side).fold(0.0, f64::max)
}

/// The faces of both, one after the other: triangles corner by corner, polygons by their number of triangles and their area.
fn compare(text: &str) {
    let mesh = ours(text).unwrap();
    let mut triangles = mesh.triangles().iter();
    for (corners, name) in by_tobj(text) {
        if corners.len() == 3 && is_line(&corners) {
            continue;
        }
        let parts: Vec<_> = triangles.by_ref().take(corners.len() - 2).collect();
        assert_eq!(parts.len(), corners.len() - 2);
        let mut sum = [0.0; 3];
        for part in &parts {
            assert_eq!(mesh.material_names()[part.material as usize], name);
            let points = part.vertices.map(|v| mesh.vertices_m()[v as usize]);
            assert!(points.iter().all(|p| corners.contains(p)));
            area(&points).iter().zip(&mut sum).for_each(|(a, s)| *s += a);
        }
        for (found, expected) in sum.iter().zip(area(&corners)) {
            assert!((found - expected).abs() < 1e-9 * (1.0 + expected.abs()), "{corners:?}");
        }
    }
    assert_eq!(triangles.next(), None);
}

#[test]
fn both_read_the_same_from_plain_files() {
    compare(
        "o one\nv 0 0 0 0.5 0.5 0.5\nv 4 0 0 1 0 0\nv 4 3 0 0 0 0\nv 0 3 0 0 1 0\nv 2 1 0 0 0 1\nvn 0 0 1\nvt 0 0\n\
         f 1 2 3\nusemtl bare wood\nf 1/1/1 2/1/1 3/1/1 4/1/1\ng two\nf -5 -4 -3 -1 -2\nusemtl glass\nf 1//1 2//1 3//1\n\
         o three\nusemtl bare wood\nv 0 0 2 0 0 0\nf 1 2 6\ns off\nf 2 3 6\n",
    );
}

#[test]
fn both_read_the_same_from_real_rooms() {
    let rooms = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/rooms"));
    let fixture = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/room/room.obj"));
    let mut files = vec![fixture.to_path_buf()];
    match std::fs::read_dir(rooms) {
        Ok(list) => files.extend(list.map(|room| room.unwrap().path().join("room.obj"))),
        Err(_) => eprintln!("skipped: {} is absent", rooms.display()),
    }
    for file in files {
        compare(&std::fs::read_to_string(&file).unwrap_or_else(|e| panic!("{}: {e}", file.display())));
    }
}

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

/// If one of these fails, `tobj` has learnt something, and may be worth another look.
#[test]
fn what_tobj_does_not_do() {
    // 1. Names that no .mtl defines are lost, and what they set apart becomes one.
    let two = format!("{SQUARE}usemtl wood\nf 1 2 3\nusemtl glass\nf 1 3 4\n");
    let (models, materials) = load(&two, "").unwrap();
    assert_eq!((models.len(), models[0].mesh.material_id, materials.len()), (1, None, 0));
    assert_eq!(ours(&two).unwrap().material_names(), ["wood", "glass"]);
    // 2. A surface of another kind is left out without a word: a hole in the room.
    let bent = format!("{SQUARE}usemtl wood\nf 1 2 3\nsurf 0 1 0 1 1 2 3 4\n");
    assert_eq!(load(&bent, "newmtl wood\n").unwrap().0.len(), 1);
    assert!(ours(&bent).unwrap_err().to_string().contains("line 7: cannot read `surf`"));
    // 3. Its errors know neither line nor word.
    let slip = format!("{SQUARE}usemtl wood\nf 1 2 9\n");
    assert_eq!(load(&slip, "").unwrap_err().to_string(), "face vertex index out of bounds");
    assert!(ours(&slip).unwrap_err().to_string().contains("line 6: cannot read `9`"));
    // 4. Coordinates that are no numbers pass.
    let nan = "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    assert!(load(nan, "").unwrap().0[0].mesh.positions[0].is_nan());
    assert!(ours(nan).unwrap_err().to_string().contains("line 1: vertex coordinate (m) is NaN"));
    // 5. One byte of an old encoding, even in a comment, and nothing is read.
    let latin: Vec<u8> = [b"# H\xf6rsaal\n", SQUARE.as_bytes(), b"usemtl a\nf 1 2 3\n"].concat();
    let options = tobj::LoadOptions::default();
    let read = tobj::load_obj_buf(&mut &latin[..], &options, |_| Err(tobj::LoadError::GenericFailure));
    assert_eq!(read.unwrap_err(), tobj::LoadError::ReadError);
    assert_eq!(ours(&latin).unwrap().triangles().len(), 1);
    // 6. Comments behind a statement, and statements that go on in the next line.
    let comment = format!("{SQUARE}usemtl wood\nf 1 2 3 # a corner\n");
    assert_eq!(load(&comment, "").unwrap_err(), tobj::LoadError::FaceParseError);
    let long = format!("{SQUARE}usemtl wood\nf 1 2 \\\n3 4\n");
    assert_eq!(load(&long, "").unwrap_err(), tobj::LoadError::FaceParseError);
    assert_eq!(ours(&comment).unwrap().triangles().len(), 1);
    assert_eq!(ours(&long).unwrap().triangles().len(), 2);
    // 7. Colours at some vertices and not at others.
    let coloured = "v 0 0 0 1 1 1\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    assert_eq!(load(coloured, "").unwrap_err(), tobj::LoadError::FaceColorOutOfBounds);
    assert_eq!(ours(coloured).unwrap().triangles().len(), 1);
}
