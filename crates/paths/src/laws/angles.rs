//! Angles of many directions, without the branches of the library's functions.

/// arctan(x) = x (1 + a2 x^2 + a4 x^4 + ...) for |x| <= 1, to 2e-8 (Abramowitz and Stegun 1964, 4.4.49), highest power first.
const ARCTAN: [f64; 9] = [
    0.002_866_225_7,
    -0.016_165_736_7,
    0.042_909_613_8,
    -0.075_289_64,
    0.106_562_639_3,
    -0.142_088_994_4,
    0.199_935_508_5,
    -0.333_331_452_8,
    1.0,
];
/// Taylor series of sin(x) / x and cos(x) in x^2, highest power first: to 1e-12 within an eighth of a turn.
const SINE: [f64; 7] = [
    1.0 / 6_227_020_800.0,
    -1.0 / 39_916_800.0,
    1.0 / 362_880.0,
    -1.0 / 5_040.0,
    1.0 / 120.0,
    -1.0 / 6.0,
    1.0,
];
const COSINE: [f64; 7] =
    [1.0 / 479_001_600.0, -1.0 / 3_628_800.0, 1.0 / 40_320.0, -1.0 / 720.0, 1.0 / 24.0, -0.5, 1.0];
/// Added to a number below 2^51 and subtracted again it leaves the nearest integer.
const ROUNDER: f64 = 6_755_399_441_055_744.0;

fn polynomial(coefficients: &[f64], x: f64) -> f64 {
    coefficients[1..].iter().fold(coefficients[0], |sum, c| sum * x + c)
}

/// Angle from +x towards +y, -180 to 180 degrees, to 1e-5 degrees: directions are kept to 0.005.
#[inline]
pub(crate) fn azimuth_degrees(x: f64, y: f64) -> f64 {
    let (across, along) = (y.abs(), x.abs());
    let (low, high) = if across > along { (along, across) } else { (across, along) };
    let ratio = low / if high > 0.0 { high } else { 1.0 };
    let eighth = ratio * polynomial(&ARCTAN, ratio * ratio) * (180.0 / std::f64::consts::PI);
    let quarter = if across > along { 90.0 - eighth } else { eighth };
    let half = if x < 0.0 { 180.0 - quarter } else { quarter };
    if y < 0.0 { -half } else { half }
}

/// Cosine of degrees, to 1e-11.
#[inline]
pub(crate) fn cos_degrees(degrees: f64) -> f64 {
    let quarters = (degrees * (1.0 / 90.0) + ROUNDER) - ROUNDER;
    let x = (degrees - 90.0 * quarters) * (std::f64::consts::PI / 180.0);
    let (sine, cosine) = (x * polynomial(&SINE, x * x), polynomial(&COSINE, x * x));
    // Which quarter of the turn: 0 to 3.
    let turns = (0.25 * quarters + ROUNDER) - ROUNDER;
    let quarter = quarters - 4.0 * turns;
    let odd = if quarter.abs() == 1.0 { sine } else { cosine };
    if quarter == 1.0 || quarter.abs() == 2.0 { -odd } else { odd }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_those_of_the_library() {
        for i in -40_000..40_000 {
            let degrees = 0.0317 * f64::from(i);
            let expected = degrees.to_radians().cos();
            assert!((cos_degrees(degrees) - expected).abs() < 1e-11, "{degrees}: {}", cos_degrees(degrees));
            let (y, x) = degrees.to_radians().sin_cos();
            let (found, expected) = (azimuth_degrees(x, y), y.atan2(x).to_degrees());
            assert!((found - expected).abs() < 1e-5, "{degrees}: {found} for {expected}");
        }
        for quarters in -9..9 {
            let degrees = 90.0 * f64::from(quarters);
            assert!((cos_degrees(degrees) - degrees.to_radians().cos()).abs() < 1e-14, "{degrees}");
        }
        for (x, y) in [(0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0), (-3.0, -3.0)] {
            assert!((azimuth_degrees(x, y) - f64::atan2(y, x).to_degrees()).abs() < 1e-5, "{x} {y}");
        }
    }
}
