//! Attributes of city objects: simple properties, generic attributes, external references.

use map3d_base::Result;
use serde_json::Value;

use super::feature::Attributes;
use super::xml::Xml;

/// Simple properties whose values are numbers.
const NUMBERS: [&str; 9] = [
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

/// Lists of repeated properties grow no longer than this.
const MAX_LIST_BYTES: usize = 4096;

/// Adds a value; a property that comes again makes a list, separated by commas.
pub fn put(attributes: &mut Attributes, name: &str, value: Value) {
    match attributes.get_mut(name) {
        None => {
            attributes.insert(name.to_owned(), value);
        }
        Some(old) if *old != value && old.as_str().is_none_or(|list| list.len() < MAX_LIST_BYTES) => {
            *old = Value::String(format!("{}, {}", shown(old), shown(&value)));
        }
        Some(_) => {}
    }
}

fn shown(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// The value of a simple property: numbers only where the standard says so, for codes have leading zeros.
pub fn simple_value(local: &str, text: &str) -> Value {
    if NUMBERS.contains(&local) { number_or_text(text) } else { Value::String(text.to_owned()) }
}

fn number_or_text(text: &str) -> Value {
    let whole = text.parse::<i64>().ok().map(Value::from);
    let number = || text.parse::<f64>().ok().and_then(serde_json::Number::from_f64).map(Value::Number);
    whole.or_else(number).unwrap_or_else(|| Value::String(text.to_owned()))
}

pub fn is_generic(local: &str) -> bool {
    local == "genericAttributeSet"
        || matches!(local, "stringAttribute" | "intAttribute" | "doubleAttribute" | "dateAttribute" | "uriAttribute" | "measureAttribute")
}

/// The generic attribute that has just started; those of a set are named `set/name`.
pub fn generic(xml: &mut Xml, prefix: &str, attributes: &mut Attributes) -> Result<()> {
    let local = xml.local().to_owned();
    let name = format!("{prefix}{}", xml.attribute("name").as_deref().unwrap_or("attribute").trim());
    while xml.next_child()? {
        if is_generic(xml.local()) {
            generic(xml, &format!("{name}/"), attributes)?;
        } else {
            let text = xml.whole_text()?;
            let is_number = matches!(local.as_str(), "intAttribute" | "doubleAttribute" | "measureAttribute");
            put(attributes, &name, if is_number { number_or_text(&text) } else { Value::String(text) });
        }
    }
    Ok(())
}

/// Generic attributes of CityGML 3.0 are objects, with name and value as properties.
pub fn is_generic_object(local: &str) -> bool {
    matches!(local, "StringAttribute" | "IntAttribute" | "DoubleAttribute" | "DateAttribute" | "UriAttribute" | "MeasureAttribute" | "CodeAttribute")
}

/// The generic attribute object that has just started.
pub fn generic_object(xml: &mut Xml, attributes: &mut Attributes) -> Result<()> {
    let is_number = matches!(xml.local(), "IntAttribute" | "DoubleAttribute" | "MeasureAttribute");
    let (mut name, mut value) = (String::new(), String::new());
    while xml.next_child()? {
        match xml.local() {
            "name" => name = xml.whole_text()?,
            "value" => value = xml.whole_text()?,
            _ => xml.skip()?,
        }
    }
    put(attributes, &name, if is_number { number_or_text(&value) } else { Value::String(value) });
    Ok(())
}

/// The external reference that has just started, as `system name`.
pub fn external_reference(xml: &mut Xml, attributes: &mut Attributes) -> Result<()> {
    let (mut system, mut object) = (String::new(), String::new());
    while xml.next_child()? {
        if xml.local() == "informationSystem" {
            system = xml.whole_text()?;
            continue;
        }
        while xml.next_child()? {
            let text = xml.whole_text()?;
            object = if text.is_empty() { object } else { text };
        }
    }
    let text = [system, object].into_iter().filter(|t| !t.is_empty()).collect::<Vec<_>>().join(" ");
    if !text.is_empty() {
        put(attributes, "externalReference", Value::String(text));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_stay_text_and_measures_are_numbers() {
        for (local, text, expected) in [
            ("function", "0100", Value::from("0100")),
            ("measuredHeight", "12.50", Value::from(12.5)),
            ("yearOfConstruction", "1985", Value::from(1985)),
            ("yearOfConstruction", "1985-01", Value::from("1985-01")),
            ("measuredHeight", "NaN", Value::from("NaN")),
        ] {
            assert_eq!(simple_value(local, text), expected, "{local}");
        }
    }

    #[test]
    fn a_property_that_comes_again_makes_a_list() {
        let mut attributes = Attributes::new();
        for value in ["1000", "1000", "1010"] {
            put(&mut attributes, "usage", Value::from(value));
        }
        assert_eq!(attributes["usage"], Value::from("1000, 1010"));
    }
}
