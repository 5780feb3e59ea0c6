//! The values of a grid coverage: their separators, and the order in which they run over the grid.

use super::xml_reader::XmlReader;

/// Where the heights of a grid are.
#[derive(Default)]
pub enum GridValues {
    #[default]
    None,
    /// In the document; not a number in gaps.
    Inline(Vec<f64>),
    /// In the document, more than are read.
    TooMany,
    /// In the file of this name.
    File(String),
}

/// How the words of a tuple list are separated; the first number of each tuple is the height.
pub struct ValueSeparators {
    decimal: char,
    coordinate: char,
    tuple: char,
}

impl ValueSeparators {
    /// Reads the attributes of the current element.
    pub fn of(xml: &XmlReader) -> Self {
        let first = |name: &str, default: char| xml.attribute(name).and_then(|text| text.chars().next()).unwrap_or(default);
        Self { decimal: first("decimal", '.'), coordinate: first("cs", ','), tuple: first("ts", ' ') }
    }

    /// Returns the first number of each tuple; not a number where it is none, such as `missing`.
    pub fn parse(&self, text: &str) -> Vec<f64> {
        let is_separator = |c: char| c == self.tuple || (self.tuple == ' ' && c.is_whitespace());
        let tuples = text.split(is_separator).map(str::trim).filter(|tuple| !tuple.is_empty());
        tuples.map(|tuple| self.parse_number(tuple.split(self.coordinate).next().unwrap_or_default().trim())).collect()
    }

    fn parse_number(&self, word: &str) -> f64 {
        let parsed = if self.decimal == '.' { word.parse() } else { word.replace(self.decimal, ".").parse() };
        parsed.unwrap_or(f64::NAN)
    }
}

/// One axis of a grid, and whether the values run against it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Along {
    pub axis: usize,
    pub descends: bool,
}

/// The sequence rule as written: by default, the first axis runs fastest.
#[derive(Default)]
pub struct ValueOrder {
    pub order: Option<String>,
    pub rule: String,
}

impl ValueOrder {
    /// Returns the axis that runs fastest, then the other one; `None` for a rule or order that is not read. `labels`: names of the axes.
    pub fn axes(&self, labels: &[String]) -> Option<[Along; 2]> {
        if !self.rule.is_empty() && !self.rule.eq_ignore_ascii_case("linear") {
            return None;
        }
        let Some(order) = &self.order else { return Some([0, 1].map(|axis| Along { axis, descends: false })) };
        let spaced = order.replace('+', " +").replace('-', " -");
        let parse = |word: &str| {
            let descends = word.starts_with('-');
            let name = word.trim_start_matches(['+', '-']);
            let axis = match name {
                "x" | "1" => Some(0),
                "y" | "2" => Some(1),
                _ => labels.iter().position(|label| label == name).filter(|axis| *axis < 2),
            };
            axis.map(|axis| Along { axis, descends })
        };
        let axes: Vec<Along> = spaced.split_whitespace().map(parse).collect::<Option<_>>()?;
        <[Along; 2]>::try_from(axes).ok().filter(|[fast, slow]| fast.axis != slow.axis)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_name_axes_by_letter_number_or_label() {
        let along = |axis, descends| Along { axis, descends };
        let labels = ["E".to_owned(), "N".to_owned()];
        for (order, rule, expected) in [
            (None, "", Some([along(0, false), along(1, false)])),
            (Some("+x+y"), "Linear", Some([along(0, false), along(1, false)])),
            (Some("+x-y"), "Linear", Some([along(0, false), along(1, true)])),
            (Some("+2 +1"), "linear", Some([along(1, false), along(0, false)])),
            (Some("-N +E"), "", Some([along(1, true), along(0, false)])),
            (Some("+x+x"), "", None),
            (Some("+x+z"), "", None),
            (Some("+x"), "", None),
            (None, "Boustrophedonic", None),
        ] {
            let order = ValueOrder { order: order.map(str::to_owned), rule: rule.to_owned() };
            assert_eq!(order.axes(&labels), expected, "{:?} {}", order.order, order.rule);
        }
    }

    #[test]
    fn the_first_number_of_each_tuple_counts() {
        let parse = |decimal, coordinate, tuple, text: &str| ValueSeparators { decimal, coordinate, tuple }.parse(text);
        assert_eq!(parse('.', ',', ' ', " 1,9 2.5,8\n\t3 "), [1.0, 2.5, 3.0]);
        assert_eq!(parse(',', ';', ' ', "1,5;9 2,5;8"), [1.5, 2.5]);
        assert_eq!(parse('.', ' ', ',', "1 9, 2 8"), [1.0, 2.0]);
        assert!(parse('.', ',', ' ', "missing")[0].is_nan());
    }
}
