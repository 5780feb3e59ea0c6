//! Reads attributes of city objects: simple properties, generic attributes, external references.

use std::collections::BTreeMap;

use map3d_base::Result;
use serde_json::Value;

use super::xml_reader::XmlReader;

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

/// Largest list of values of a repeated property.
const MAX_LIST_BYTES: usize = 4096;

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

fn format_value(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// Parses the value of a simple property. Only properties that the standard defines as numeric become numbers: codes have leading zeros.
pub fn parse_property(local_name: &str, text: &str) -> Value {
    if NUMERIC_PROPERTIES.contains(&local_name) { parse_number_or_text(text) } else { Value::String(text.to_owned()) }
}

fn parse_number_or_text(text: &str) -> Value {
    let whole = text.parse::<i64>().ok().map(Value::from);
    let number = || text.parse::<f64>().ok().and_then(serde_json::Number::from_f64).map(Value::Number);
    whole.or_else(number).unwrap_or_else(|| Value::String(text.to_owned()))
}

/// Returns true for the generic attribute elements of CityGML 1.0 and 2.0.
pub fn is_generic_attribute(local_name: &str) -> bool {
    local_name == "genericAttributeSet"
        || matches!(local_name, "stringAttribute" | "intAttribute" | "doubleAttribute" | "dateAttribute" | "uriAttribute" | "measureAttribute")
}

/// Reads the current generic attribute or set. Attributes of a set are named `set/name`.
pub fn read_generic_attribute(xml: &mut XmlReader, prefix: &str, attributes: &mut Attributes) -> Result<()> {
    let element = xml.local_name().to_owned();
    let name = format!("{prefix}{}", xml.attribute("name").as_deref().unwrap_or("attribute").trim());
    while xml.next_child()? {
        if is_generic_attribute(xml.local_name()) {
            read_generic_attribute(xml, &format!("{name}/"), attributes)?;
        } else {
            let text = xml.read_text()?;
            let is_number = matches!(element.as_str(), "intAttribute" | "doubleAttribute" | "measureAttribute");
            add_attribute(attributes, &name, if is_number { parse_number_or_text(&text) } else { Value::String(text) });
        }
    }
    Ok(())
}

/// Returns true for the generic attribute objects of CityGML 3.0; name and value are their properties.
pub fn is_generic_attribute_object(local_name: &str) -> bool {
    matches!(
        local_name,
        "StringAttribute" | "IntAttribute" | "DoubleAttribute" | "DateAttribute" | "UriAttribute" | "MeasureAttribute" | "CodeAttribute"
    )
}

/// Reads the current generic attribute object.
pub fn read_generic_attribute_object(xml: &mut XmlReader, attributes: &mut Attributes) -> Result<()> {
    let is_number = matches!(xml.local_name(), "IntAttribute" | "DoubleAttribute" | "MeasureAttribute");
    let (mut name, mut value) = (String::new(), String::new());
    while xml.next_child()? {
        match xml.local_name() {
            "name" => name = xml.read_text()?,
            "value" => value = xml.read_text()?,
            _ => xml.skip()?,
        }
    }
    add_attribute(attributes, &name, if is_number { parse_number_or_text(&value) } else { Value::String(value) });
    Ok(())
}

/// Reads the current external reference into the attribute `externalReference`: `system object`.
pub fn read_external_reference(xml: &mut XmlReader, attributes: &mut Attributes) -> Result<()> {
    let (mut system, mut object) = (String::new(), String::new());
    while xml.next_child()? {
        if xml.local_name() == "informationSystem" {
            system = xml.read_text()?;
            continue;
        }
        while xml.next_child()? {
            let text = xml.read_text()?;
            object = if text.is_empty() { object } else { text };
        }
    }
    let text = [system, object].into_iter().filter(|t| !t.is_empty()).collect::<Vec<_>>().join(" ");
    if !text.is_empty() {
        add_attribute(attributes, "externalReference", Value::String(text));
    }
    Ok(())
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
            assert_eq!(parse_property(name, text), expected, "{name}");
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
