//! Parses the vertex references of faces.

use super::line_reader::words;

/// Zero-based indices of a face vertex's position, texture coordinate and normal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaceVertex {
    pub position: u32,
    pub uv: Option<u32>,
    pub normal: Option<u32>,
}

/// Numbers of positions, texture coordinates and normals read so far; negative references count back from them.
#[derive(Clone, Copy, Debug, Default)]
pub struct ElementCounts {
    pub positions: usize,
    pub uvs: usize,
    pub normals: usize,
}

/// Parses `1 2/3 4//5 -1/-1/-1 …`; returns `None` if a reference is invalid. References may point to vertices that the file defines later.
pub fn parse_face(rest: &[u8], counts: ElementCounts, vertices: &mut Vec<FaceVertex>) -> Option<()> {
    vertices.clear();
    for word in words(rest) {
        vertices.push(parse_vertex(word, counts)?);
    }
    Some(())
}

fn parse_vertex(word: &[u8], counts: ElementCounts) -> Option<FaceVertex> {
    let mut parts = word.split(|b| *b == b'/');
    let position = parse_index(parts.next()?, counts.positions)?;
    // An unreadable one is out of range: the face keeps its geometry.
    let mut other = |count| match parts.next() {
        None | Some(b"") => None,
        Some(part) => Some(parse_index(part, count).unwrap_or(u32::MAX)),
    };
    Some(FaceVertex { position, uv: other(counts.uvs), normal: other(counts.normals) })
}

/// 1 is the first element, −1 the last so far. 0 and references before the first become `u32::MAX`, which is always out of range.
fn parse_index(part: &[u8], count: usize) -> Option<u32> {
    let n: i64 = std::str::from_utf8(part).ok()?.parse().ok()?;
    let at = if n < 0 { n + count as i64 } else { n - 1 };
    Some(u32::try_from(at).unwrap_or(u32::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vertex_references_have_one_to_three_indices() {
        let counts = ElementCounts { positions: 4, uvs: 3, normals: 2 };
        let vertex = |position, uv, normal| Some(FaceVertex { position, uv, normal });
        for (word, expected) in [
            ("1", vertex(0, None, None)),
            ("2/3", vertex(1, Some(2), None)),
            ("2//1", vertex(1, None, Some(0))),
            ("2/1/", vertex(1, Some(0), None)),
            ("-1/-3/-2", vertex(3, Some(0), Some(0))),
            ("9", vertex(8, None, None)),
            ("0", vertex(u32::MAX, None, None)),
            ("-5", vertex(u32::MAX, None, None)),
            ("1/x/1", vertex(0, Some(u32::MAX), Some(0))),
            ("a", None),
            ("1.5", None),
            ("99999999999", vertex(u32::MAX, None, None)),
        ] {
            assert_eq!(parse_vertex(word.as_bytes(), counts), expected, "{word}");
        }
    }
}
