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

/// Appends points with `dimension` numbers each; z is 0 if `dimension` is 2. Returns `None` if the text is invalid or numbers are left over.
pub fn parse_points(text: &str, dimension: usize, values: &mut Vec<f64>, out: &mut Vec<Vec3>) -> Option<()> {
    values.clear();
    parse_numbers(text, values)?;
    append_points(values, dimension, out)
}

fn append_points(values: &[f64], dimension: usize, out: &mut Vec<Vec3>) -> Option<()> {
    if !(2..=3).contains(&dimension) || !values.len().is_multiple_of(dimension) {
        return None;
    }
    out.extend(values.chunks_exact(dimension).map(|p| [p[0], p[1], p.get(2).copied().unwrap_or(0.0)]));
    Some(())
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

/// Appends the points of a `coordinates` element; returns `None` if it is invalid.
pub fn parse_coordinates(text: &str, separators: &Separators, out: &mut Vec<Vec3>) -> Option<()> {
    let matches = |c: char, separator: char| c == separator || (separator == ' ' && c.is_whitespace());
    for tuple in text.trim().split(|c| matches(c, separators.tuple)).filter(|t| !t.is_empty()) {
        let mut values = Vec::with_capacity(3);
        for word in tuple.split(|c| matches(c, separators.coordinate)).map(str::trim).filter(|w| !w.is_empty()) {
            let word = if separators.decimal == '.' { word.to_owned() } else { word.replace(separators.decimal, ".") };
            values.push(word.parse().ok()?);
        }
        append_points(&values, values.len(), out)?;
    }
    Some(())
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
    fn coordinates_may_use_any_separators() {
        let parse = |text: &str, separators: &Separators| {
            let mut out = Vec::new();
            parse_coordinates(text, separators, &mut out).map(|()| out)
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
