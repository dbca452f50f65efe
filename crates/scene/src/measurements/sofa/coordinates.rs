//! Places and directions of a SOFA file, in metres and unit vectors of the room.

use super::arrays::{Array, SofaFile};
use crate::error::Error;
use crate::scene::{cross, norm};
use sabine_acoustics::OutOfRange;

/// Least length of a direction, and least angle between view and up (sine): below it they name no frame.
const MIN_DIRECTION: f64 = 1e-6;

/// Positions or directions: one of each measurement, or one for all.
pub(super) struct Points {
    name: &'static str,
    /// Of how many objects (receivers of a listener, emitters of a source).
    objects: usize,
    /// Of how many measurements: all of them, or one.
    measurements: usize,
    /// Cartesian, of each object the measurements in turn.
    points: Vec<[f64; 3]>,
}

impl Points {
    /// Reads `[M or I, C]`, which belongs to a listener or source.
    pub(super) fn of_measurements(
        file: &SofaFile,
        name: &'static str,
        m: usize,
    ) -> Result<Option<Self>, Error> {
        let Some(array) = file.numbers(name)? else { return Ok(None) };
        let (&[rows, 3], true) =
            (array.shape.as_slice(), matches!(array.shape.first(), Some(&n) if n == 1 || n == m))
        else {
            return Err(wrong(file, name, format!("[{m}, 3] or [1, 3]"), &array));
        };
        let read = coordinates(file, name)?;
        let points = array.values.chunks_exact(3).map(|p| read([p[0], p[1], p[2]])).collect();
        Ok(Some(Self { name, objects: 1, measurements: rows, points }))
    }

    /// Reads `[R, C, M or I]`, or `[I, C]` for one that all share, which belongs to the parts of a listener or source.
    pub(super) fn of_parts(
        file: &SofaFile,
        name: &'static str,
        parts: usize,
        m: usize,
    ) -> Result<Option<Self>, Error> {
        let Some(array) = file.numbers(name)? else { return Ok(None) };
        let (objects, measurements) = match *array.shape.as_slice() {
            [1, 3] => (1, 1),
            // Some writers drop the last dimension.
            [r, 3] if r == parts => (r, 1),
            [r, 3, k] if (r == parts || r == 1) && (k == 1 || k == m) => (r, k),
            _ => {
                let expected = format!("[{parts}, 3, 1], [{parts}, 3, {m}] or [1, 3]");
                return Err(wrong(file, name, expected, &array));
            }
        };
        let read = coordinates(file, name)?;
        let at = |o: usize, c: usize, k: usize| array.values[(o * 3 + c) * measurements + k];
        let points = (0..objects)
            .flat_map(|o| (0..measurements).map(move |k| (o, k)))
            .map(|(o, k)| read([at(o, 0, k), at(o, 1, k), at(o, 2, k)]))
            .collect();
        Ok(Some(Self { name, objects, measurements, points }))
    }

    /// Of an object in a measurement.
    pub(super) fn at(&self, object: usize, measurement: usize) -> [f64; 3] {
        let object = if self.objects == 1 { 0 } else { object };
        let measurement = if self.measurements == 1 { 0 } else { measurement };
        self.points[object * self.measurements + measurement]
    }
}

/// How a listener or source stands: the axes x (view), y (left) and z (up) of its own coordinates.
pub(super) struct Frames {
    view: Option<Points>,
    up: Option<Points>,
}

impl Frames {
    pub(super) fn read(
        file: &SofaFile,
        view: &'static str,
        up: &'static str,
        m: usize,
    ) -> Result<Self, Error> {
        let view = Points::of_measurements(file, view, m)?;
        // The type of `up` is that of `view`: the standard gives it none of its own.
        let up = Points::of_measurements(file, up, m)?;
        Ok(Self { view, up })
    }

    /// Axes in a measurement.
    pub(super) fn at(&self, file: &SofaFile, measurement: usize) -> Result<[[f64; 3]; 3], Error> {
        let (Some(view), Some(up)) = (&self.view, &self.up) else {
            return Ok([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        };
        let named = |name: &'static str| {
            move |error: OutOfRange| Error::from(error).in_file(file.path(), format!("{name}[{measurement}]"))
        };
        let x = unit(view.at(0, measurement)).map_err(named(view.name))?;
        // Up need not be square to view: its part along it is of no use.
        let left = unit(cross(up.at(0, measurement), x)).map_err(named(up.name))?;
        Ok([x, left, cross(x, left)])
    }
}

/// A point of a part's own coordinates in those of the room.
pub(super) fn placed(origin: [f64; 3], axes: [[f64; 3]; 3], point: [f64; 3]) -> [f64; 3] {
    let turned = turned(axes, point);
    [0, 1, 2].map(|k| origin[k] + turned[k])
}

/// A direction of a part's own coordinates in those of the room.
pub(super) fn turned(axes: [[f64; 3]; 3], point: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|k| (0..3).map(|axis| axes[axis][k] * point[axis]).sum())
}

/// The vector of length 1 in this direction.
pub(super) fn unit(direction: [f64; 3]) -> Result<[f64; 3], OutOfRange> {
    let length = norm(direction);
    OutOfRange::check(
        "length of the direction",
        length,
        MIN_DIRECTION,
        1e9,
        "that of a direction, not zero",
    )?;
    Ok(direction.map(|c| c / length))
}

/// What turns the values of a variable into metres along x, y, z (AES69-2022, coordinate systems).
fn coordinates(file: &SofaFile, name: &'static str) -> Result<impl Fn([f64; 3]) -> [f64; 3] + use<>, Error> {
    let kind = file.attribute_of(name, "Type")?.unwrap_or_else(|| "cartesian".into());
    let units = file.attribute_of(name, "Units")?.unwrap_or_default().to_ascii_lowercase();
    let spherical = match kind.to_ascii_lowercase().as_str() {
        "cartesian" => false,
        "spherical" => true,
        _ => {
            let error = Error::Unit { found: kind, expected: "cartesian or spherical" };
            return Err(error.in_file(file.path(), format!("{name}:Type")));
        }
    };
    let words: Vec<&str> = units.split([',', ' ']).filter(|word| !word.is_empty()).collect();
    let metres = |word: &&str| matches!(*word, "metre" | "metres" | "meter" | "meters" | "m");
    let degrees = |word: &&str| matches!(*word, "degree" | "degrees");
    let known = match (spherical, words.as_slice()) {
        // The variable `...Up` has no attributes of its own.
        (_, []) => true,
        (false, all) => all.iter().all(metres),
        (true, [azimuth, elevation, radius]) => degrees(azimuth) && degrees(elevation) && metres(radius),
        (true, _) => false,
    };
    if !known {
        let error = Error::Unit { found: units, expected: "metre, or degree, degree, metre" };
        return Err(error.in_file(file.path(), format!("{name}:Units")));
    }
    Ok(move |[a, b, c]: [f64; 3]| {
        if !spherical {
            return [a, b, c];
        }
        let ((sin_a, cos_a), (sin_e, cos_e)) = (a.to_radians().sin_cos(), b.to_radians().sin_cos());
        [c * cos_e * cos_a, c * cos_e * sin_a, c * sin_e]
    })
}

fn wrong(file: &SofaFile, name: &str, expected: String, array: &Array) -> Error {
    Error::Shape { expected, found: format!("{:?}", array.shape) }.in_file(file.path(), name)
}
