//! The first pass: what must be known before the first city object is drawn.
//!
//! Memory: appearances outside of city objects in their compact form (about 16 bytes a vertex of a textured ring, `max_appearance_bytes`), and
//! 8 bytes for each id that is referred to from another city object.

use std::path::Path;

use map3d_base::{Error, Result};

use super::appearance::Appearances;
use super::appearance_parser::{AppearanceParser, Theme};
use super::ids::{IdSet, Target, id_of, target_of};
use super::xml::{Step, Xml};
use crate::options::ReadOptions;
use crate::report::Log;

#[derive(Default)]
pub struct Survey {
    pub srs_name: Option<String>,
    pub theme: Theme,
    pub appearances: Appearances,
    /// Ids that one city object refers to and another has (or none).
    pub wanted: IdSet,
}

/// Ids and references of the city object at hand.
#[derive(Default)]
struct Local {
    ids: IdSet,
    references: Vec<u64>,
}

/// Reads the whole document once. A document that breaks off is surveyed up to there.
pub fn survey(path: &Path, options: &ReadOptions, log: &mut Log) -> Result<Survey> {
    let mut survey = Survey { theme: Theme { asked: options.theme.clone(), first: None }, ..Survey::default() };
    let mut xml = Xml::open(path)?;
    let mut local = Local::default();
    check_root(&mut xml, path)?;
    loop {
        match survey.step(&mut xml, &mut local, options, log) {
            Ok(true) => {}
            Ok(false) => break,
            Err(_) if xml.is_broken() && !options.strict => break,
            Err(e) => return Err(e),
        }
    }
    local.close(&mut survey.wanted);
    survey.appearances.resolve_links();
    Ok(survey)
}

fn check_root(xml: &mut Xml, path: &Path) -> Result<()> {
    loop {
        match xml.step()? {
            Step::Start if xml.local() == "CityModel" => return Ok(()),
            Step::Start => return Err(Error::format(path, format!("the root element is {:?}; expected CityModel", xml.local()))),
            Step::Eof => return Err(Error::format(path, "no XML element; expected a CityGML document")),
            Step::Text | Step::End => {}
        }
    }
}

impl Survey {
    /// One step; false at the end of the document.
    fn step(&mut self, xml: &mut Xml, local: &mut Local, options: &ReadOptions, log: &mut Log) -> Result<bool> {
        match xml.step()? {
            Step::Eof => return Ok(false),
            Step::Text => {}
            Step::End if xml.depth() == 1 => local.close(&mut self.wanted),
            Step::End => {}
            Step::Start => self.start(xml, local, options, log)?,
        }
        Ok(true)
    }

    fn start(&mut self, xml: &mut Xml, local: &mut Local, options: &ReadOptions, log: &mut Log) -> Result<()> {
        for (name, value) in xml.attributes() {
            match name {
                "id" => {
                    local.ids.insert(id_of(&value));
                }
                "href" => {
                    if let Target::Here(id) = target_of(&value) {
                        local.references.push(id);
                    }
                }
                "srsName" => self.see_srs(&value, log),
                _ => {}
            }
        }
        match xml.local() {
            "appearanceMember" if xml.depth() == 2 => self.appearance(xml, options, log),
            "theme" => {
                let name = xml.whole_text()?;
                self.theme.see(&name);
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn see_srs(&mut self, name: &str, log: &mut Log) {
        match &self.srs_name {
            None if !name.trim().is_empty() => self.srs_name = Some(name.to_owned()),
            Some(first) if first.trim() != name.trim() => log.note("more than one coordinate system; the first counts", name),
            _ => {}
        }
    }

    fn appearance(&mut self, xml: &mut Xml, options: &ReadOptions, log: &mut Log) -> Result<()> {
        let max_bytes = options.max_appearance_bytes;
        let (values, text) = (&mut Vec::new(), &mut String::new());
        AppearanceParser { xml, log, into: &mut self.appearances, theme: &mut self.theme, max_bytes, values, text }.property()
    }
}

impl Local {
    fn close(&mut self, wanted: &mut IdSet) {
        wanted.extend(self.references.drain(..).filter(|r| !self.ids.contains(r)));
        self.ids.clear();
    }
}
