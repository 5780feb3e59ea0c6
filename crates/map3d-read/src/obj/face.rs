//! Corners of faces.

use super::lines::words;

/// Numbers of position, texture coordinate and normal, counted from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Corner {
    pub position: u32,
    pub uv: Option<u32>,
    pub normal: Option<u32>,
}

/// How many of each the file has given so far; negative numbers count back from here.
#[derive(Clone, Copy, Debug, Default)]
pub struct Counts {
    pub positions: usize,
    pub uvs: usize,
    pub normals: usize,
}

/// Parses `1 2/3 4//5 -1/-1/-1 …`; `None`: a corner cannot be read. Numbers may be larger than what the file has given so far.
pub fn parse_face(rest: &[u8], counts: Counts, corners: &mut Vec<Corner>) -> Option<()> {
    corners.clear();
    for word in words(rest) {
        corners.push(parse_corner(word, counts)?);
    }
    Some(())
}

fn parse_corner(word: &[u8], counts: Counts) -> Option<Corner> {
    let mut parts = word.split(|b| *b == b'/');
    let position = index(parts.next()?, counts.positions)?;
    let mut other = |count| match parts.next() {
        None | Some(b"") => Some(None),
        Some(part) => index(part, count).map(Some),
    };
    Some(Corner { position, uv: other(counts.uvs)?, normal: other(counts.normals)? })
}

/// 1 is the first, −1 the last so far; 0 and what lies before the first become a number that no file reaches.
fn index(part: &[u8], count: usize) -> Option<u32> {
    let n: i64 = std::str::from_utf8(part).ok()?.parse().ok()?;
    let at = if n < 0 { n + count as i64 } else { n - 1 };
    Some(u32::try_from(at).unwrap_or(u32::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_are_read_in_every_spelling() {
        let counts = Counts { positions: 4, uvs: 3, normals: 2 };
        let corner = |position, uv, normal| Some(Corner { position, uv, normal });
        for (word, expected) in [
            ("1", corner(0, None, None)),
            ("2/3", corner(1, Some(2), None)),
            ("2//1", corner(1, None, Some(0))),
            ("2/1/", corner(1, Some(0), None)),
            ("-1/-3/-2", corner(3, Some(0), Some(0))),
            ("9", corner(8, None, None)),
            ("0", corner(u32::MAX, None, None)),
            ("-5", corner(u32::MAX, None, None)),
            ("a", None),
            ("1.5", None),
            ("99999999999", corner(u32::MAX, None, None)),
        ] {
            assert_eq!(parse_corner(word.as_bytes(), counts), expected, "{word}");
        }
    }
}
