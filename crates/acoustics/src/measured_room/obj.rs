//! The part of Wavefront OBJ that a room needs: vertices, faces and the names of their materials.

use super::polygon::triangulate;
use crate::{Error, Triangle};
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

/// Triangles and the names of the materials that they use, in the order of first use.
pub(super) struct ObjMesh {
    pub vertices: Vec<[f64; 3]>,
    pub triangles: Vec<Triangle>,
    pub materials: Vec<String>,
    pub faces_without_area: usize,
}

/// Reads the text of an OBJ file; `path` is for the errors.
pub(super) fn parse_obj(path: &Path, text: &str) -> Result<ObjMesh, Error> {
    let mut mesh =
        ObjMesh { vertices: Vec::new(), triangles: Vec::new(), materials: Vec::new(), faces_without_area: 0 };
    let mut current: Option<&str> = None;
    let mut corners = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default().trim();
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let result = match keyword {
            "v" => vertex(rest).map(|v| mesh.vertices.push(v)),
            "f" => {
                corners.clear();
                face(rest, mesh.vertices.len(), &mut corners)
                    .and_then(|()| current.ok_or(Error::NoMaterial))
                    .and_then(|name| mesh.add(name, &corners))
            }
            "usemtl" if rest.trim().is_empty() => Err(syntax("", "the name of a material")),
            "usemtl" => {
                current = Some(rest.trim());
                Ok(())
            }
            "" => Ok(()),
            ignored if IGNORED.contains(&ignored) => Ok(()),
            // Free-form surfaces among them: to skip one would leave a hole.
            other => Err(syntax(other, "a statement of a mesh of polygons")),
        };
        result.map_err(|error| error.in_file(path, format!("line {}", number + 1)))?;
    }
    Ok(mesh)
}

impl ObjMesh {
    fn add(&mut self, name: &str, corners: &[u32]) -> Result<(), Error> {
        let points: Vec<[f64; 3]> = corners.iter().map(|&i| self.vertices[i as usize]).collect();
        let triangles = triangulate(&points)?;
        if triangles.is_empty() {
            self.faces_without_area += 1;
            return Ok(());
        }
        let material = match self.materials.iter().position(|m| m == name) {
            Some(known) => known,
            None => {
                self.materials.push(name.to_owned());
                self.materials.len() - 1
            }
        } as u32;
        let indexed = |t: [usize; 3]| Triangle { vertices: t.map(|i| corners[i]), material };
        self.triangles.extend(triangles.into_iter().map(indexed));
        Ok(())
    }
}

fn vertex(rest: &str) -> Result<[f64; 3], Error> {
    let mut words = rest.split_whitespace();
    let mut next = || {
        let word = words.next().unwrap_or_default();
        let value = word.parse::<f64>().map_err(|_| syntax(word, "a coordinate in metres"))?;
        crate::error::check_range("vertex coordinate (m)", value, -1e5, 1e5, "finite and within 100 km")?;
        Ok(value)
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
            return Err(Error::Length { expected: MOST_CORNERS, found: rest.split_whitespace().count() });
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
    use proptest::prelude::*;

    fn parse(text: &str) -> Result<ObjMesh, Error> {
        parse_obj(Path::new("room.obj"), text)
    }

    const CORNERS: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

    #[test]
    fn faces_of_all_spellings_are_read() {
        let text = format!(
            "# a square\r\nmtllib x.mtl\n{CORNERS}vt 0 0\nvn 0 0 1\nusemtl old wood\nf 1/1 2/1 3/1 4/1\n\
             usemtl glass # thin\nf -4//1 -3//1 -2//1\nusemtl old wood\nf 1/1/1 3/1/1 4/1/1\n"
        );
        let mesh = parse(&text).unwrap();
        assert_eq!(mesh.materials, ["old wood", "glass"]);
        assert_eq!(mesh.triangles.iter().map(|t| t.material).collect::<Vec<_>>(), [0, 0, 1, 0]);
        assert_eq!(
            mesh.triangles[2]
                .vertices
                .map(|v| mesh.vertices[v as usize])
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
            let message = parse(text).err().expect(text).to_string();
            assert!(message.starts_with(&format!("room.obj: {line}: ")), "{text:?} gave {message}");
        }
        let bare = format!("{CORNERS}f 1 2 3");
        match parse(&bare).err() {
            Some(Error::InFile { field, source, .. }) => {
                assert!(field == "line 5" && matches!(*source, Error::NoMaterial));
            }
            other => panic!("{other:?}"),
        }
        let crossed = format!("{CORNERS}usemtl a\nf 1 3 2 4");
        assert!(parse(&crossed).is_err_and(|e| e.to_string().contains("crosses itself")));
        let long = format!("{CORNERS}usemtl a\nf {}", "1 2 ".repeat(MOST_CORNERS));
        assert!(parse(&long).is_err());
    }

    proptest! {
        /// No text makes the reader panic, and what it lets through is sound.
        #[test]
        fn any_text_gives_a_mesh_or_an_error(lines in prop::collection::vec(
            prop_oneof!["v [0-9.-]{1,3} [0-9]{1,2} [0-9]", "f( -?[0-9]{1,2}(/[0-9]?)?){0,6}", "usemtl [a-c]", "\\PC{0,12}"], 0..30)
        ) {
            if let Ok(mesh) = parse(&lines.join("\n")) {
                for triangle in &mesh.triangles {
                    prop_assert!(triangle.vertices.iter().all(|&v| (v as usize) < mesh.vertices.len()));
                    prop_assert!((triangle.material as usize) < mesh.materials.len());
                }
            }
        }
    }
}
