//! The first pass: what must be known before the first city object is drawn.
//!
//! Memory: appearances outside of city objects in their compact form (about 16 bytes a vertex of a textured ring, `max_appearance_bytes`), and
//! 8 bytes for each id that is referred to from another city object.

use std::borrow::Cow;
use std::path::Path;

use map3d_base::{Error, Result};

use super::appearance::Appearances;
use super::appearance_parser::{AppearanceParser, Theme};
use super::ids::{IdSet, Target, id_of, target_of};
use super::scan::{Scanner, Tag};
use super::xml::{Step, Xml, attributes, local_name, refused, unescaped};
use crate::options::ReadOptions;
use crate::report::Log;
use crate::text::open_xml;

#[derive(Default)]
pub struct Survey {
    pub srs_name: Option<String>,
    pub theme: Theme,
    pub appearances: Appearances,
    /// Ids that one city object refers to and another has (or none).
    pub wanted: IdSet,
}

/// Looks through the whole document once. A document that breaks off is surveyed up to there.
pub fn survey(path: &Path, options: &ReadOptions, log: &mut Log) -> Result<Survey> {
    let io = |e| Error::storage(path, e);
    let mut survey = Survey { theme: Theme { asked: options.theme.clone(), ..Theme::default() }, ..Survey::default() };
    let mut scanner = Scanner::new(open_xml(path)?);
    let mut local = Local::default();
    let (mut depth, mut any) = (0usize, false);
    while let Some(tag) = scanner.next_tag().map_err(io)? {
        match tag {
            Tag::Doctype => return Err(refused(path, "a document type definition")),
            Tag::End => depth = depth.saturating_sub(1),
            Tag::Start | Tag::Empty => {
                any = true;
                let text = std::str::from_utf8(scanner.tag()).map_or_else(|_| String::from_utf8_lossy(scanner.tag()), Cow::Borrowed);
                let (name, rest) = text.split_at(text.bytes().position(|b| b.is_ascii_whitespace()).unwrap_or(text.len()));
                let name = local_name(name);
                survey.tag(path, depth, name, rest, &mut local, log)?;
                let parsed = match (tag, name) {
                    (Tag::Start, "appearanceMember") if depth == 1 => 1,
                    (Tag::Start, "theme") => 2,
                    _ => 0,
                };
                match parsed {
                    1 => scanner = survey.appearance(scanner, options, log)?,
                    2 => scanner = survey.theme(scanner, log),
                    _ => depth += usize::from(tag == Tag::Start),
                }
            }
        }
        if depth <= 1 {
            local.close(&mut survey.wanted);
        }
    }
    if !any {
        return Err(Error::format(path, "no XML element; expected a CityGML document"));
    }
    local.close(&mut survey.wanted);
    survey.appearances.resolve_links();
    Ok(survey)
}

/// Ids and references of the city object at hand.
#[derive(Default)]
struct Local {
    ids: IdSet,
    references: Vec<u64>,
}

impl Survey {
    fn tag(&mut self, path: &Path, depth: usize, name: &str, rest: &str, local: &mut Local, log: &mut Log) -> Result<()> {
        if depth == 0 && name != "CityModel" {
            return Err(Error::format(path, format!("the root element is {name:?}; expected CityModel")));
        }
        for (name, value) in attributes(rest) {
            match name {
                "id" => {
                    local.ids.insert(id_of(&unescaped(value)));
                }
                "href" => {
                    if let Target::Here(id) = target_of(&unescaped(value)) {
                        local.references.push(id);
                    }
                }
                "srsName" => self.see_srs(&unescaped(value), log),
                _ => {}
            }
        }
        Ok(())
    }

    fn see_srs(&mut self, name: &str, log: &mut Log) {
        match &self.srs_name {
            None if !name.trim().is_empty() => self.srs_name = Some(name.to_owned()),
            Some(first) if first.trim() != name.trim() => log.note("more than one coordinate system; the first counts", name),
            _ => {}
        }
    }

    /// Parses the appearanceMember that the scanner stands at; the scanner goes on behind it. One that breaks off is left to the second pass.
    fn appearance(&mut self, scanner: Scanner, options: &ReadOptions, log: &mut Log) -> Result<Scanner> {
        let path = log.path().to_path_buf();
        let mut xml = Xml::new(scanner, &path);
        let max_bytes = options.max_appearance_bytes;
        let (values, text) = (&mut Vec::new(), &mut String::new());
        let parsed = xml.step().and_then(|_| {
            AppearanceParser { xml: &mut xml, log, into: &mut self.appearances, theme: &mut self.theme, max_bytes, values, text }.property()
        });
        match parsed {
            Err(e) if !xml.is_broken() => Err(e),
            _ => Ok(xml.into_inner()),
        }
    }

    /// Reads the theme that the scanner stands at.
    fn theme(&mut self, scanner: Scanner, log: &Log) -> Scanner {
        let mut xml = Xml::new(scanner, log.path());
        if let Ok(Step::Start) = xml.step()
            && let Ok(name) = xml.whole_text()
        {
            self.theme.see(&name);
        }
        xml.into_inner()
    }
}

impl Local {
    fn close(&mut self, wanted: &mut IdSet) {
        wanted.extend(self.references.drain(..).filter(|r| !self.ids.contains(r)));
        self.ids.clear();
    }
}
