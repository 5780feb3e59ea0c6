//! Formats postal addresses of xAL 2 and 3 as one line: "Street 5, 12345 Town".

use map3d_base::Result;

use super::xml_reader::{XmlEvent, XmlReader};

#[derive(Default)]
struct AddressParts {
    /// A name of the place, such as that of an opera house.
    place: String,
    street: String,
    number: String,
    /// The document writes the number before the street, and means it (xAL 3).
    number_first: bool,
    postcode: String,
    town: String,
    lines: Vec<String>,
}

/// Reads the current address element; returns `None` if it is empty.
pub fn read_address(xml: &mut XmlReader) -> Result<Option<String>> {
    let mut parts = AddressParts::default();
    let mut parents = vec![xml.local_name().to_owned()];
    while let Some(parent) = parents.last() {
        match xml.next_event()? {
            XmlEvent::Start => {
                let name = xml.local_name().to_owned();
                if !read_part(xml, parent, &mut parts)? {
                    parents.push(name);
                }
            }
            XmlEvent::End => {
                parents.pop();
            }
            XmlEvent::Eof => break,
            XmlEvent::Text => {}
        }
    }
    Ok(parts.format())
}

/// Reads an element with text up to its end and returns true; does nothing for any other element.
fn read_part(xml: &mut XmlReader, parent: &str, parts: &mut AddressParts) -> Result<bool> {
    let local_name = xml.local_name();
    let is_place = xml.attribute("NameType").is_some_and(|kind| kind == "ReferenceLocation");
    let slot = match (parent, local_name) {
        (_, "AddressLine") => {
            let line = xml.read_text()?;
            parts.lines.push(line);
            return Ok(true);
        }
        (_, "multiPoint" | "CountryName" | "AdministrativeAreaName") | ("Country" | "AdministrativeArea", "NameElement") => {
            xml.skip()?;
            return Ok(true);
        }
        (_, "ThoroughfareName") => &mut parts.street,
        ("Thoroughfare", "NameElement") if is_place => &mut parts.place,
        ("Thoroughfare", "NameElement") => &mut parts.street,
        (_, "ThoroughfareNumber" | "PremiseNumber") => &mut parts.number,
        (_, "ThoroughfareNumberSuffix" | "PremiseNumberSuffix") => {
            let suffix = xml.read_text()?;
            parts.number.push_str(&suffix);
            return Ok(true);
        }
        ("Thoroughfare" | "Premises", "Number") => {
            parts.number_first = parts.street.is_empty();
            &mut parts.number
        }
        ("Premises", "NameElement") => &mut parts.place,
        (_, "PostalCodeNumber") | ("PostCode", "Identifier") => &mut parts.postcode,
        (_, "LocalityName") | ("Locality", "NameElement") => &mut parts.town,
        (_, "DependentLocalityName" | "PostalRouteName" | "NameElement" | "Identifier" | "Number") => {
            xml.skip()?;
            return Ok(true);
        }
        _ => return Ok(false),
    };
    let text = xml.read_text()?;
    if slot.is_empty() {
        *slot = text;
    }
    Ok(true)
}

impl AddressParts {
    fn format(self) -> Option<String> {
        let join = |words: [String; 2]| words.into_iter().filter(|w| !w.is_empty()).collect::<Vec<_>>().join(" ");
        let street = if self.number_first { [self.number, self.street] } else { [self.street, self.number] };
        let mut lines = vec![self.place, join(street), join([self.postcode, self.town])];
        lines.extend(self.lines);
        lines.retain(|l| !l.is_empty());
        (!lines.is_empty()).then(|| lines.join(", "))
    }
}
