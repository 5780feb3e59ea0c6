//! Parses the numbers of `posList`, `pos` and `coordinates`.

use map3d_base::Vec3;

/// Appends the numbers of a list separated by white space; returns `None` if a word is not a number.
pub fn parse_numbers(text: &str, out: &mut Vec<f64>) -> Option<()> {
    let mut rest = text.as_bytes();
    loop {
        rest = rest.trim_ascii_start();
        if rest.is_empty() {
            return Some(());
        }
        let (value, length) = fast_float2::parse_partial::<f64, _>(rest).ok()?;
        out.push(value);
        rest = &rest[length..];
        if rest.first().is_some_and(|b| !b.is_ascii_whitespace()) {
            return None;
        }
    }
}

/// How many numbers a position has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dimension {
    /// x and y: there is no height, and z is 0.
    Two = 2,
    Three = 3,
}

impl Dimension {
    /// Returns the dimension of the positions in a list. Where the stated one does not divide the list, the other one may if it closes the ring or the
    /// list is a single position; where none is stated and both divide it, a closed ring decides, and otherwise positions have heights.
    fn of_list(values: &[f64], stated: Option<usize>) -> Option<Self> {
        let fits = |dimension: Self| values.len().is_multiple_of(dimension as usize);
        let is_closed = |n: Self| values.first_chunk::<2>() == values.get(values.len() - n as usize..).and_then(|last| last.first_chunk());
        let (first, second) = match stated {
            Some(2) => (Self::Two, Self::Three),
            Some(3) => (Self::Three, Self::Two),
            Some(_) => return None,
            None if values.len() > 6 && fits(Self::Two) && !is_closed(Self::Three) && is_closed(Self::Two) => (Self::Two, Self::Three),
            None => (Self::Three, Self::Two),
        };
        let replaces = |dimension: &Self| values.len() == *dimension as usize || is_closed(*dimension);
        if fits(first) { Some(first) } else { Some(second).filter(|second| fits(*second)).filter(replaces) }
    }
}

/// Appends the points of a list; `stated`: numbers of each, if the document says. Returns `None` if the text is invalid or numbers are left over.
pub fn parse_points(text: &str, stated: Option<usize>, values: &mut Vec<f64>, out: &mut Vec<Vec3>) -> Option<Dimension> {
    values.clear();
    parse_numbers(text, values)?;
    let dimension = Dimension::of_list(values, stated)?;
    append_points(values, dimension, out);
    Some(dimension)
}

fn append_points(values: &[f64], dimension: Dimension, out: &mut Vec<Vec3>) {
    out.extend(values.chunks_exact(dimension as usize).map(|p| [p[0], p[1], p.get(2).copied().unwrap_or(0.0)]));
}

/// Separators of a `coordinates` element; by default `x,y,z x,y,z` with decimal points.
pub struct Separators {
    pub decimal: char,
    pub coordinate: char,
    pub tuple: char,
}

impl Default for Separators {
    fn default() -> Self {
        Self { decimal: '.', coordinate: ',', tuple: ' ' }
    }
}

/// Appends the points of a `coordinates` element; returns `None` if it is invalid. Its dimension is the lowest of its positions.
pub fn parse_coordinates(text: &str, separators: &Separators, out: &mut Vec<Vec3>) -> Option<Dimension> {
    let mut lowest = Dimension::Three;
    let matches = |c: char, separator: char| c == separator || (separator == ' ' && c.is_whitespace());
    for tuple in text.trim().split(|c| matches(c, separators.tuple)).filter(|t| !t.is_empty()) {
        let mut values = Vec::with_capacity(3);
        for word in tuple.split(|c| matches(c, separators.coordinate)).map(str::trim).filter(|w| !w.is_empty()) {
            let word = if separators.decimal == '.' { word.to_owned() } else { word.replace(separators.decimal, ".") };
            values.push(word.parse().ok()?);
        }
        let dimension = match values.len() {
            2 => Dimension::Two,
            3 => Dimension::Three,
            _ => return None,
        };
        append_points(&values, dimension, out);
        if dimension == Dimension::Two {
            lowest = dimension;
        }
    }
    Some(lowest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_separated_by_white_space() {
        for (text, expected) in [
            ("1 2.5 -3e2", Some(vec![1.0, 2.5, -300.0])),
            ("\n 1\t2 ", Some(vec![1.0, 2.0])),
            ("", Some(vec![])),
            ("1 a", None),
            ("1,2", None),
            ("1.0.0", None),
        ] {
            let mut out = Vec::new();
            assert_eq!(parse_numbers(text, &mut out).map(|()| out), expected, "{text:?}");
        }
    }

    #[test]
    fn lists_without_heights_are_recognized() {
        let ring = "0 0 9 0 9 9 0 9 0 0 ";
        for (text, stated, expected) in [
            (ring, Some(2), Some((Dimension::Two, 5))),
            (ring, Some(3), Some((Dimension::Two, 5))),
            (ring, None, Some((Dimension::Two, 5))),
            ("0 0 9 0 9 9 9 9 0 9 0 0", None, Some((Dimension::Two, 6))),
            ("0 0 5 9 0 5 9 9 5 0 0 5", None, Some((Dimension::Three, 4))),
            ("0 0 5 9 0 5 9 9 5 0 9 5", None, Some((Dimension::Three, 4))),
            ("0 0 5 9 0 5 9 9 5 0 9 5 0 0 5", Some(2), Some((Dimension::Three, 5))),
            ("0 0 9 0 9 9 9 9 0 9 0 0", Some(3), Some((Dimension::Three, 4))),
            ("1 2", None, Some((Dimension::Two, 1))),
            ("1 2 3", None, Some((Dimension::Three, 1))),
            ("1 2 3 4 5", None, None),
            ("1 2", Some(4), None),
            ("0 0 0 1 1 1 2 2", None, None),
        ] {
            let mut out = Vec::new();
            let found = parse_points(text, stated, &mut Vec::new(), &mut out).map(|dimension| (dimension, out.len()));
            assert_eq!(found, expected, "{text:?} {stated:?}");
        }
    }

    #[test]
    fn coordinates_may_use_any_separators() {
        let parse = |text: &str, separators: &Separators| {
            let mut out = Vec::new();
            parse_coordinates(text, separators, &mut out).map(|_| out)
        };
        let expected = Some(vec![[1.5, 2.0, 3.0], [4.0, 5.0, 6.0]]);
        assert_eq!(parse(" 1.5,2,3\n4,5,6 ", &Separators::default()), expected);
        assert_eq!(parse("1,5;2;3 4;5;6", &Separators { decimal: ',', coordinate: ';', tuple: ' ' }), expected);
        assert_eq!(parse("1.5 2 3,4 5 6", &Separators { decimal: '.', coordinate: ' ', tuple: ',' }), expected);
        assert_eq!(parse("1,2 3,4", &Separators::default()), Some(vec![[1.0, 2.0, 0.0], [3.0, 4.0, 0.0]]));
        assert_eq!(parse("1,2,3,4", &Separators::default()), None);
        assert_eq!(parse("1,x", &Separators::default()), None);
    }
}
