//! Positions as people write them.

use crate::failure::Failure;

/// `ID=x,y,z` or `x,y,z`, the nth of which is named after the first letter of its kind.
///
/// # Errors
/// A text that holds no three numbers.
pub fn places(texts: &[String], kind: &str) -> Result<Vec<(String, [f64; 3])>, Failure> {
    let place = |(index, text): (usize, &String)| {
        let (id, position) = match text.split_once('=') {
            Some((id, position)) => (id.trim().to_owned(), position),
            None => (format!("{}{}", &kind[..1], index + 1), text.as_str()),
        };
        let position_m = numbers(position, [',', ';', ' '])
            .ok_or_else(|| format!("--{kind} {text}: write x,y,z in metres, as 1,2,1.5, or name=1,2,1.5"))?;
        Ok((id, position_m))
    };
    texts.iter().enumerate().map(place).collect()
}

/// Length, width and height of `--size`.
///
/// # Errors
/// A text that holds no three numbers.
pub fn size(text: &str) -> Result<[f64; 3], Failure> {
    let size = numbers(text, ['x', 'X', '×']);
    Ok(size.ok_or_else(|| format!("--size {text}: write length x width x height in metres, as 5x4x2.6"))?)
}

fn numbers(text: &str, between: [char; 3]) -> Option<[f64; 3]> {
    let words = text.split(between).map(str::trim).filter(|word| !word.is_empty());
    <[f64; 3]>::try_from(words.map(|word| word.parse().ok()).collect::<Option<Vec<f64>>>()?).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_places_are_read_as_people_write_them() {
        for text in ["5x4x2.6", "5 x 4 x 2.6", "5X4X2.6", "5×4×2.6"] {
            assert_eq!(size(text).unwrap(), [5.0, 4.0, 2.6], "{text}");
        }
        for text in ["5x4", "5x4x2.6x1", "5x4xhigh", ""] {
            assert!(size(text).unwrap_err().to_string().contains("as 5x4x2.6"), "{text}");
        }
        let texts = ["1,2,1.5".to_owned(), "screen = -0.5, 2 ,1".to_owned()];
        let expected = [("s1".to_owned(), [1.0, 2.0, 1.5]), ("screen".to_owned(), [-0.5, 2.0, 1.0])];
        assert_eq!(places(&texts, "source").unwrap(), expected);
        assert!(
            places(&["1,2".to_owned()], "receiver")
                .unwrap_err()
                .to_string()
                .starts_with("--receiver 1,2: write")
        );
    }
}
