//! Postal addresses in xAL, in one line: "Street 5, 12345 Town".

use map3d_base::Result;

use super::xml::{Step, Xml};

#[derive(Default)]
struct Parts {
    street: String,
    number: String,
    postcode: String,
    town: String,
    lines: Vec<String>,
}

/// The address that has just started; `None` when it says nothing.
pub fn address(xml: &mut Xml) -> Result<Option<String>> {
    let mut parts = Parts::default();
    let depth = xml.depth();
    while xml.depth() >= depth {
        match xml.step()? {
            Step::Start => take(xml, &mut parts)?,
            Step::Eof => break,
            Step::End | Step::Text => {}
        }
    }
    Ok(parts.in_one_line())
}

/// Elements that hold text are read to their end, all others are looked into.
fn take(xml: &mut Xml, parts: &mut Parts) -> Result<()> {
    let slot = match xml.local() {
        "ThoroughfareName" | "NameElement" if parts.street.is_empty() => &mut parts.street,
        "ThoroughfareNumber" | "Number" if parts.number.is_empty() => &mut parts.number,
        "PostalCodeNumber" | "Identifier" if parts.postcode.is_empty() => &mut parts.postcode,
        "LocalityName" if parts.town.is_empty() => &mut parts.town,
        "AddressLine" => {
            let line = xml.whole_text()?;
            parts.lines.push(line);
            return Ok(());
        }
        "multiPoint" | "CountryName" | "AdministrativeAreaName" => return xml.skip(),
        _ => return Ok(()),
    };
    *slot = xml.whole_text()?;
    Ok(())
}

impl Parts {
    fn in_one_line(self) -> Option<String> {
        let joined = |words: [String; 2]| words.into_iter().filter(|w| !w.is_empty()).collect::<Vec<_>>().join(" ");
        let mut lines = vec![joined([self.street, self.number]), joined([self.postcode, self.town])];
        lines.extend(self.lines);
        lines.retain(|l| !l.is_empty());
        (!lines.is_empty()).then(|| lines.join(", "))
    }
}
