//! Formats xAL postal addresses as one line: "Street 5, 12345 Town".

use map3d_base::Result;

use super::xml_reader::{XmlEvent, XmlReader};

#[derive(Default)]
struct AddressParts {
    street: String,
    number: String,
    postcode: String,
    town: String,
    lines: Vec<String>,
}

/// Reads the current address element; returns `None` if it is empty.
pub fn read_address(xml: &mut XmlReader) -> Result<Option<String>> {
    let mut parts = AddressParts::default();
    let depth = xml.depth();
    while xml.depth() >= depth {
        match xml.next_event()? {
            XmlEvent::Start => read_part(xml, &mut parts)?,
            XmlEvent::Eof => break,
            XmlEvent::End | XmlEvent::Text => {}
        }
    }
    Ok(parts.format())
}

/// Reads an element with text up to its end; enters any other element.
fn read_part(xml: &mut XmlReader, parts: &mut AddressParts) -> Result<()> {
    let slot = match xml.local_name() {
        "ThoroughfareName" | "NameElement" if parts.street.is_empty() => &mut parts.street,
        "ThoroughfareNumber" | "Number" if parts.number.is_empty() => &mut parts.number,
        "PostalCodeNumber" | "Identifier" if parts.postcode.is_empty() => &mut parts.postcode,
        "LocalityName" if parts.town.is_empty() => &mut parts.town,
        "AddressLine" => {
            let line = xml.read_text()?;
            parts.lines.push(line);
            return Ok(());
        }
        "multiPoint" | "CountryName" | "AdministrativeAreaName" => return xml.skip(),
        _ => return Ok(()),
    };
    *slot = xml.read_text()?;
    Ok(())
}

impl AddressParts {
    fn format(self) -> Option<String> {
        let join = |words: [String; 2]| words.into_iter().filter(|w| !w.is_empty()).collect::<Vec<_>>().join(" ");
        let mut lines = vec![join([self.street, self.number]), join([self.postcode, self.town])];
        lines.extend(self.lines);
        lines.retain(|l| !l.is_empty());
        (!lines.is_empty()).then(|| lines.join(", "))
    }
}
