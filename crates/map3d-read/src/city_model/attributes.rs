//! Attributes of city objects: how they are named and which of them are numbers.

use std::collections::BTreeMap;

use serde_json::Value;

/// Attributes of a city object by name.
pub type Attributes = BTreeMap<String, Value>;

/// Simple properties with numeric values.
const NUMERIC_PROPERTIES: [&str; 9] = [
    "measuredHeight",
    "storeysAboveGround",
    "storeysBelowGround",
    "yearOfConstruction",
    "yearOfDemolition",
    "height",
    "trunkDiameter",
    "crownDiameter",
    "averageHeight",
];

/// Symbols, names and EPSG code of the metre, and symbols of the square and the cubic metre.
const METRIC: [&str; 11] = ["m", "metre", "meter", "metres", "meters", "9001", "m2", "m²", "m3", "m³", "sqm"];

/// Largest list of values of a repeated property.
const MAX_LIST_BYTES: usize = 4096;

/// Largest number of data types in a repeated property; further ones are dropped.
const MAX_REPEATED: usize = 100;

/// Names of the properties that are the value of a data type. Those of PLATEAU's pairs of key and value end in `Value`.
const VALUE_NAMES: [&str; 8] = ["value", "stringValue", "intValue", "doubleValue", "codeValue", "dateValue", "uriValue", "measuredValue"];

/// Adds a value. Values of a repeated property are joined with commas.
pub fn add_attribute(attributes: &mut Attributes, name: &str, value: Value) {
    match attributes.get_mut(name) {
        None => {
            attributes.insert(name.to_owned(), value);
        }
        Some(old) if *old != value && old.as_str().is_none_or(|list| list.len() < MAX_LIST_BYTES) => {
            *old = Value::String(format!("{}, {}", format_value(old), format_value(&value)));
        }
        Some(_) => {}
    }
}

/// Adds the label of a code, and the code itself as `name/code`.
pub fn add_code(attributes: &mut Attributes, name: &str, label: String, code: &str) {
    add_attribute(attributes, name, Value::String(label));
    add_attribute(attributes, &format!("{name}/code"), Value::from(code));
}

/// Adds the unit of a measure as `name/unit`, unless it is metres, square or cubic metres. `unit`: as written, a symbol or the address of a definition.
pub fn add_unit(attributes: &mut Attributes, name: &str, unit: Option<&str>) {
    let unit = unit.unwrap_or_default().trim();
    // The last part of an address is the symbol, which may have a slash itself: kWh/a.
    let symbol = match unit {
        _ if unit.contains("://") => unit.rsplit(['#', '/']).next(),
        _ if unit.starts_with("urn:") => unit.rsplit(':').next(),
        _ => unit.strip_prefix('#').or(Some(unit)),
    };
    let symbol = symbol.unwrap_or_default();
    if !symbol.is_empty() && !METRIC.contains(&symbol.to_ascii_lowercase().as_str()) {
        add_attribute(attributes, &format!("{name}/unit"), Value::from(symbol));
    }
}

fn format_value(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// Parses the value of a simple property. Only measures and properties that the standard defines as numeric become numbers: codes have leading
/// zeros.
pub fn parse_property(local_name: &str, is_measure: bool, text: &str) -> Value {
    if is_measure || NUMERIC_PROPERTIES.contains(&local_name) { parse_number_or_text(text) } else { Value::String(text.to_owned()) }
}

pub fn parse_number_or_text(text: &str) -> Value {
    let whole = text.parse::<i64>().ok().map(Value::from);
    let number = || text.parse::<f64>().ok().and_then(serde_json::Number::from_f64).map(Value::Number);
    whole.or_else(number).unwrap_or_else(|| Value::String(text.to_owned()))
}

/// Adds the attributes of a data type to those of its owner, named after the property that contains it: `Property/name`. The value of a data
/// type that has one is that of the property itself. A data type with a key (PLATEAU's `KeyValuePairAttribute`) is named after its key.
pub fn add_data_type(owner: &mut Attributes, property: &str, type_name: &str, mut values: Attributes) {
    if values.is_empty() {
        return;
    }
    let mut path = join_path(property, type_name);
    if let Some(key) = take_key(&mut values) {
        path = format!("{path}/{key}");
    } else if has_path(owner, &path) {
        let Some(free) = (2..=MAX_REPEATED).map(|number| format!("{path}[{number}]")).find(|path| !has_path(owner, path)) else { return };
        path = free;
    }
    for (name, value) in values {
        let (first, rest) = name.split_once('/').map_or((name.as_str(), ""), |(first, _)| (first, &name[first.len()..]));
        let is_value = VALUE_NAMES.contains(&first) || first == property || first.strip_suffix("Value") == Some(property);
        add_attribute(owner, &if is_value { format!("{path}{rest}") } else { format!("{path}/{name}") }, value);
    }
}

/// Joins the names of a property and of the data type in it; of two similar names, the first suffices.
fn join_path(property: &str, type_name: &str) -> String {
    let (a, b) = (property.to_lowercase(), type_name.to_lowercase());
    if a.contains(&b) || b.contains(&a) { property.to_owned() } else { format!("{property}/{type_name}") }
}

fn has_path(attributes: &Attributes, path: &str) -> bool {
    let below = format!("{path}/");
    attributes.contains_key(path) || attributes.range(below.clone()..).next().is_some_and(|(name, _)| name.starts_with(&below))
}

/// Removes and returns the key of a pair of key and value, if the data type is one.
fn take_key(values: &mut Attributes) -> Option<String> {
    if !values.keys().any(|name| name != "value" && VALUE_NAMES.contains(&name.as_str())) {
        return None;
    }
    let key = values.remove("key")?;
    values.remove("key/code");
    Some(format_value(&key))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_stay_text_and_measures_are_numbers() {
        for (name, text, expected) in [
            ("function", "0100", Value::from("0100")),
            ("measuredHeight", "12.50", Value::from(12.5)),
            ("yearOfConstruction", "1985", Value::from(1985)),
            ("yearOfConstruction", "1985-01", Value::from("1985-01")),
            ("measuredHeight", "NaN", Value::from("NaN")),
        ] {
            assert_eq!(parse_property(name, false, text), expected, "{name}");
        }
    }

    #[test]
    fn units_other_than_metres_stay_with_their_measure() {
        for (unit, expected) in [
            (None, None),
            (Some("m"), None),
            (Some("#m"), None),
            (Some("urn:adv:uom:m"), None),
            (Some("urn:ogc:def:uom:EPSG::9001"), None),
            (Some(""), None),
            (Some("ft"), Some("ft")),
            (Some("urn:ogc:def:uom:UCUM::[ft_i]"), Some("[ft_i]")),
            (Some("http://www.opengis.net/def/uom/UCUM/0/m2"), None),
            (Some("#m2"), None),
            (Some("http://www.opengis.net/def/uom/UCUM/0/deg"), Some("deg")),
            (Some("kWh/a"), Some("kWh/a")),
        ] {
            let mut attributes = Attributes::from([("height".into(), Value::from(30))]);
            add_unit(&mut attributes, "height", unit);
            assert_eq!(attributes.get("height/unit").and_then(Value::as_str), expected, "{unit:?}");
        }
    }

    #[test]
    fn values_of_a_repeated_property_are_joined() {
        let mut attributes = Attributes::new();
        for value in ["1000", "1000", "1010"] {
            add_attribute(&mut attributes, "usage", Value::from(value));
        }
        assert_eq!(attributes["usage"], Value::from("1000, 1010"));
    }
}
