//! Parses generic attributes and external references.

use map3d_base::Result;
use serde_json::Value;

use super::xml_reader::{XmlEvent, XmlReader};
use crate::city_model::attributes::{Attributes, add_attribute, add_code, add_unit, parse_number_or_text};

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
            let unit = xml.attribute("uom").map(|unit| unit.into_owned());
            let text = xml.read_text()?;
            let is_number = matches!(element.as_str(), "intAttribute" | "doubleAttribute" | "measureAttribute");
            add_attribute(attributes, &name, if is_number { parse_number_or_text(&text) } else { Value::String(text) });
            add_unit(attributes, &name, unit.as_deref());
        }
    }
    Ok(())
}

/// Returns true for the generic attribute objects of CityGML 3.0; name and value are their properties.
pub fn is_generic_attribute_object(local_name: &str) -> bool {
    matches!(
        local_name,
        "StringAttribute"
            | "IntAttribute"
            | "DoubleAttribute"
            | "DateAttribute"
            | "UriAttribute"
            | "MeasureAttribute"
            | "CodeAttribute"
            | "GenericAttributeSet"
    )
}

/// A generic attribute object of CityGML 3.0, or those of a set.
#[derive(Default)]
pub struct GenericAttribute {
    name: String,
    /// `None` for a set.
    value: Option<String>,
    is_number: bool,
    code_space: Option<String>,
    unit: Option<String>,
    members: Vec<GenericAttribute>,
}

/// Reads the current generic attribute object.
pub fn read_generic_attribute_object(xml: &mut XmlReader) -> Result<GenericAttribute> {
    let is_number = matches!(xml.local_name(), "IntAttribute" | "DoubleAttribute" | "MeasureAttribute");
    let mut attribute = GenericAttribute { is_number, ..GenericAttribute::default() };
    while xml.next_child()? {
        match xml.local_name() {
            "name" => attribute.name = xml.read_text()?,
            "value" => {
                attribute.unit = xml.attribute("uom").map(|unit| unit.into_owned());
                attribute.code_space = xml.attribute("codeSpace").map(|space| space.into_owned());
                attribute.value = Some(xml.read_text()?);
            }
            "genericAttribute" => {
                while xml.next_child()? {
                    attribute.members.push(read_generic_attribute_object(xml)?);
                }
            }
            _ => xml.skip()?,
        }
    }
    Ok(attribute)
}

impl GenericAttribute {
    /// Adds the attribute, or the members of a set as `set/name`. `find_label`: property, code space and code → label.
    pub fn add_to(self, prefix: &str, attributes: &mut Attributes, find_label: &mut dyn FnMut(&str, &str, &str) -> Option<String>) {
        let name = format!("{prefix}{}", self.name);
        let prefix = format!("{name}/");
        self.members.into_iter().for_each(|member| member.add_to(&prefix, attributes, find_label));
        let Some(value) = self.value else { return };
        match self.code_space.and_then(|space| find_label(&self.name, &space, &value)) {
            Some(label) => add_code(attributes, &name, label, &value),
            None if self.is_number => add_attribute(attributes, &name, parse_number_or_text(&value)),
            None => add_attribute(attributes, &name, Value::String(value)),
        }
        add_unit(attributes, &name, self.unit.as_deref());
    }
}

/// Reads the current external reference into the attribute `externalReference`: `system object`.
pub fn read_external_reference(xml: &mut XmlReader, attributes: &mut Attributes) -> Result<()> {
    let (mut system, mut object) = (String::new(), String::new());
    let depth = xml.depth();
    while xml.depth() >= depth {
        match xml.next_tag()? {
            XmlEvent::Start => match xml.local_name() {
                "informationSystem" => system = xml.read_text()?,
                "name" | "uri" | "targetResource" => {
                    let text = xml.read_text()?;
                    object = if text.is_empty() { object } else { text };
                }
                "externalObject" | "ExternalReference" => {}
                _ => xml.skip()?,
            },
            XmlEvent::Eof => break,
            XmlEvent::End | XmlEvent::Text => {}
        }
    }
    let text = [system, object].into_iter().filter(|t| !t.is_empty()).collect::<Vec<_>>().join(" ");
    if !text.is_empty() {
        add_attribute(attributes, "externalReference", Value::String(text));
    }
    Ok(())
}
