//! The part of Wavefront OBJ that a room needs: vertices, faces and the names of their materials.
//!
//! Why not `tobj`: it drops the names of materials that no `.mtl` defines (here the room file is the table), skips
//! statements that it does not know (a hole where a free-form surface was), says neither which line nor which word is at
//! fault, refuses a file for one byte that is not UTF-8, and reads a trailing comment as part of a name.
//! `tests/it/obj_against_tobj.rs` holds a case for each; there it is the oracle on what both read.

use super::MeshDraft;
use crate::error::Error;
use std::borrow::Cow;
use std::path::Path;

/// Corners that a polygon may have: clipping ears takes time that grows with their square or cube.
const MOST_CORNERS: usize = 1024;

/// Keywords that have no bearing on where sound is reflected.
const IGNORED: [&str; 16] = [
    "vt",
    "vn",
    "vp",
    "g",
    "o",
    "s",
    "mg",
    "mtllib",
    "l",
    "p",
    "bevel",
    "c_interp",
    "d_interp",
    "lod",
    "shadow_obj",
    "trace_obj",
];

/// Reads the text of an OBJ file; `path` is for the errors.
pub(super) fn parse_obj(path: &Path, text: &str, draft: &mut MeshDraft) -> Result<(), Error> {
    let mut material: Option<String> = None;
    let mut corners = Vec::new();
    let mut lines = text.lines().enumerate();
    while let Some((number, line)) = lines.next() {
        let mut line = Cow::Borrowed(bare(line));
        // A backslash at the end: the statement goes on.
        while line.ends_with('\\') {
            let whole = line.to_mut();
            whole.pop();
            whole.push(' ');
            whole.push_str(lines.next().map_or("", |(_, next)| bare(next)));
        }
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((&line, ""));
        let result = match keyword {
            "v" => vertex(rest).and_then(|point| draft.vertex(point)),
            "f" => {
                corners.clear();
                face(rest, draft.mesh.vertices_m.len(), &mut corners)
                    .and_then(|()| draft.face(material.as_deref(), &corners))
            }
            "usemtl" if rest.trim().is_empty() => Err(syntax("", "the name of a material")),
            "usemtl" => {
                material = Some(rest.trim().to_owned());
                Ok(())
            }
            "" => Ok(()),
            ignored if IGNORED.contains(&ignored) => Ok(()),
            // Free-form surfaces among them: to skip one would leave a hole.
            other => Err(syntax(other, "a statement of a mesh of polygons")),
        };
        result.map_err(|error| error.in_file(path, format!("line {}", number + 1)))?;
    }
    Ok(())
}

/// A line without its comment.
fn bare(line: &str) -> &str {
    line.split('#').next().unwrap_or_default().trim()
}

fn vertex(rest: &str) -> Result<[f64; 3], Error> {
    let mut words = rest.split_whitespace();
    let mut next = || {
        let word = words.next().unwrap_or_default();
        word.parse::<f64>().map_err(|_| syntax(word, "a coordinate"))
    };
    Ok([next()?, next()?, next()?])
}

/// Corners of a face as indices from zero; a corner that repeats the one before it is left out.
fn face(rest: &str, vertices: usize, corners: &mut Vec<u32>) -> Result<(), Error> {
    for word in rest.split_whitespace() {
        let index = word.split('/').next().unwrap_or_default();
        let number: i64 = index.parse().map_err(|_| syntax(word, "a corner of a face"))?;
        // Counted from 1, or from -1 backwards.
        let from_zero = if number < 0 { number.checked_add(vertices as i64) } else { number.checked_sub(1) };
        let index = from_zero.and_then(|i| usize::try_from(i).ok()).filter(|&i| i < vertices);
        let index = index
            .and_then(|i| u32::try_from(i).ok())
            .ok_or_else(|| syntax(word, "a vertex defined above"))?;
        if corners.last() != Some(&index) {
            corners.push(index);
        }
        if corners.len() > MOST_CORNERS {
            let found = rest.split_whitespace().count() as u64;
            return Err(Error::MeshTooLarge { what: "corners of a face", found, limit: MOST_CORNERS as u64 });
        }
    }
    if corners.len() > 1 && corners.first() == corners.last() {
        corners.pop();
    }
    match rest.split_whitespace().count() {
        0..3 => Err(syntax(rest, "a face of three corners or more")),
        _ => Ok(()),
    }
}

fn syntax(text: &str, expected: &'static str) -> Error {
    Error::ObjSyntax { expected, text: text.chars().take(40).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh_file::Mesh;
    use crate::mesh_file::mesh_options::LengthUnit;
    use crate::mesh_file::mesh_options::Placement;
    use crate::mesh_file::up_axis::UpAxis;
    use proptest::prelude::*;

    fn parse(text: &str) -> Result<Mesh, Error> {
        let path = Path::new("room.obj");
        let placement = Placement { unit: LengthUnit::Metre, up_axis: UpAxis::Z };
        let mut draft = MeshDraft::new(path, placement);
        parse_obj(path, text, &mut draft).map(|()| draft.mesh)
    }

    const CORNERS: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

    #[test]
    fn faces_of_all_spellings_are_read() {
        let text = format!(
            "# a square\r\nmtllib x.mtl\n{CORNERS}vt 0 0\nvn 0 0 1\nusemtl old wood\nf 1/1 2/1 3/1 4/1\n\
             usemtl glass # thin\nf -4//1 -3//1 -2//1\nusemtl old wood\nf 1/1/1 3/1/1 4/1/1\n"
        );
        let mesh = parse(&text).unwrap();
        assert_eq!(mesh.material_names(), ["old wood", "glass"]);
        assert_eq!(mesh.triangles().iter().map(|t| t.material).collect::<Vec<_>>(), [0, 0, 1, 0]);
        assert_eq!(
            mesh.triangles()[2]
                .vertices
                .map(|v| mesh.vertices_m()[v as usize])
                .iter()
                .map(|p| p[0] + p[1])
                .sum::<f64>(),
            3.0
        );
    }

    #[test]
    fn each_slip_names_its_line() {
        for (text, line) in [
            ("v 0 0", "line 1"),
            ("v 0 0 nan", "line 1"),
            ("v 0 0 1e9", "line 1"),
            ("v 0 zero 0", "line 1"),
            ("v 0 0 0\nusemtl a\nf 1 2 3", "line 3"),
            ("v 0 0 0\nusemtl a\nf 0 1 1", "line 3"),
            ("v 0 0 0\nusemtl a\nf -2 1 1", "line 3"),
            ("v 0 0 0\nusemtl a\nf 99999999999999999999 1 1", "line 3"),
            ("v 0 0 0\nusemtl a\nf -9223372036854775808 1 1", "line 3"),
            ("v 0 0 0\nusemtl a\nf 1 1", "line 3"),
            ("v 0 0 0\nusemtl a\nf", "line 3"),
            ("usemtl", "line 1"),
            ("surf 0 1 0 1", "line 1"),
        ] {
            let message = parse(text).expect_err(text).to_string();
            assert!(message.starts_with(&format!("room.obj: {line}: ")), "{text:?} gave {message}");
        }
        let crossed = format!("{CORNERS}usemtl a\nf 1 3 2 4");
        assert!(parse(&crossed).is_err_and(|e| e.to_string().contains("crosses itself")));
        let long = format!("{CORNERS}usemtl a\nf {}", "1 2 ".repeat(MOST_CORNERS));
        let message = parse(&long).unwrap_err().to_string();
        assert!(message.ends_with("line 6: 2048 corners of a face; at most 1024 are read"), "{message}");
    }

    #[test]
    fn faces_before_the_first_name_have_the_default_one() {
        let mesh = parse(&format!("{CORNERS}f 1 2 3\nusemtl glass\nf 1 3 4\n")).unwrap();
        assert_eq!(mesh.material_names(), [Mesh::DEFAULT_MATERIAL, "glass"]);
        assert_eq!(mesh.faces_without_material(), 1);
    }

    #[test]
    fn a_statement_may_go_on_after_a_backslash() {
        let mesh = parse(&format!("{CORNERS}usemtl a # b \\\nf 1 2 \\\n3 \\\n4\n")).unwrap();
        assert_eq!((mesh.triangles().len(), mesh.material_names()), (2, &["a".to_owned()][..]));
        assert!(
            parse("v 0 0 0\nf 1 1 9 \\").is_err_and(|e| e.to_string().contains("line 2: cannot read `9`"))
        );
        assert!(parse("\\").unwrap().triangles().is_empty());
    }

    proptest! {
        /// No text makes the reader panic, and what it lets through is sound.
        #[test]
        fn any_text_gives_a_mesh_or_an_error(lines in prop::collection::vec(
            prop_oneof!["v [0-9.-]{1,3} [0-9]{1,2} [0-9]", "f( -?[0-9]{1,2}(/[0-9]?)?){0,6}", "usemtl [a-c]", "\\PC{0,12}"], 0..30)
        ) {
            if let Ok(mesh) = parse(&lines.join("\n")) {
                for triangle in mesh.triangles() {
                    prop_assert!(triangle.vertices.iter().all(|&v| (v as usize) < mesh.vertices_m().len()));
                    prop_assert!((triangle.material as usize) < mesh.material_names().len());
                }
            }
        }
    }
}
