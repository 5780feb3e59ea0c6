//! Reads what other documents of the given folder add to a document: geometry that it refers to, and appearances that target its surfaces.

use std::collections::HashSet;
use std::path::Path;

use map3d_base::{Error, Reason, Result};

use super::appearance_parser::{AppearanceParser, AppearanceScope};
use super::geometry_parser::{GeometryParser, is_surface};
use super::positions::PositionFormat;
use super::references::{DocumentNumber, References, WantedElements};
use super::tag_scanner::{TagKind, TagScanner};
use super::xml_reader::{XmlEvent, XmlReader, parse_attributes, unescape_lossy};
use crate::city_model::appearance::Appearances;
use crate::city_model::crs_table::{CrsTable, DOCUMENT_CRS};
use crate::city_model::geometry_arena::{GeometryArena, NO_NODE};
use crate::city_model::ids::hash_id;
use crate::city_model::own_appearance::add_own_appearances;
use crate::city_model::theme_selection::ThemeSelection;
use crate::document::options::ReadOptions;
use crate::document::report_builder::ReportBuilder;
use crate::document::text_input::open_xml;

/// Longest chain of references.
const MAX_CHAIN: usize = 16;
/// Bytes of other documents that are read for one document.
const MAX_BYTES: u64 = 1 << 30;

pub struct OtherDocuments<'a> {
    pub references: &'a mut References,
    /// Wanted geometry is added to it.
    pub geometry: &'a mut GeometryArena,
    /// Appearances of other documents are added to them.
    pub appearances: &'a mut Appearances,
    pub theme: &'a mut ThemeSelection,
    pub crs_table: &'a mut CrsTable,
    pub options: &'a ReadOptions,
    pub report: &'a mut ReportBuilder,
}

/// How much was read so far.
#[derive(Default)]
struct Progress {
    bytes: u64,
    /// Documents whose appearances were read.
    appearances: HashSet<DocumentNumber>,
}

impl OtherDocuments<'_> {
    /// Reads the geometry that the document refers to, what that refers to in turn, and the appearances in the documents of both.
    pub fn read_wanted(mut self) -> Result<()> {
        let mut progress = Progress::default();
        for _ in 0..MAX_CHAIN {
            for (document, wanted) in self.references.take_wanted() {
                let reason = self.read_geometry(document, &wanted, &mut progress)?;
                let missing = wanted.into_iter().filter(|(id, _)| !self.geometry.by_id.contains_key(id)).collect();
                self.references.fail(missing, reason);
            }
        }
        for (_, wanted) in self.references.take_wanted() {
            self.references.fail(wanted, Reason::OtherFileChainTooLong);
        }
        add_own_appearances(self.geometry, self.appearances);
        self.appearances.resolve_theme_xlinks();
        Ok(())
    }

    /// Reads wanted geometry. Returns the reason for what is not there.
    fn read_geometry(&mut self, document: DocumentNumber, wanted: &WantedElements, progress: &mut Progress) -> Result<Reason> {
        if progress.bytes < MAX_BYTES {
            let scope = progress.appearances.insert(document).then_some(AppearanceScope::Document);
            progress.bytes += self.read_document(document, wanted, scope, MAX_BYTES - progress.bytes)?;
        }
        Ok(if progress.bytes < MAX_BYTES { Reason::OtherFileWithoutGeometry } else { Reason::OtherFilesTooLarge })
    }

    /// Reads the appearances of other documents that target surfaces of the document. Reports the surfaces that are not there.
    pub fn read_appearances(mut self, files: &[impl AsRef<Path>]) -> Result<()> {
        for file in files {
            let Some(document) = self.references.add_document(file.as_ref())? else { continue };
            self.read_document(document, &WantedElements::default(), Some(AppearanceScope::OwnTargets), u64::MAX)?;
        }
        let path = self.report.path().to_path_buf();
        let missing = self.find_missing_targets(&path).map_err(|e| Error::storage(&path, e))?;
        let mut missing: Vec<String> = missing.into_values().collect();
        missing.sort_unstable();
        missing.into_iter().try_for_each(|href| self.report.warn(Reason::AppearanceTargetNotFound, href))
    }

    /// Reads one document to its end or up to `max_bytes`; returns the number of bytes read. A broken one is reported.
    fn read_document(
        &mut self,
        document: DocumentNumber,
        wanted: &WantedElements,
        appearances: Option<AppearanceScope>,
        max_bytes: u64,
    ) -> Result<u64> {
        let (mut bytes, outer) = (0, self.references.enter(document));
        let read = XmlReader::open(self.references.path(document)).and_then(|mut xml| {
            xml.set_document_key(self.references.key(document));
            let read = self.read_elements(&mut xml, wanted, appearances, max_bytes);
            bytes = xml.position();
            read
        });
        self.references.enter(outer);
        match read {
            Err(error) if self.options.strict => return Err(error),
            Err(error) => self.report.note(Reason::OtherFileBroken, format!("{}: {error}", self.references.file_name(document))),
            Ok(()) => {}
        }
        Ok(bytes)
    }

    fn read_elements(&mut self, xml: &mut XmlReader, wanted: &WantedElements, appearances: Option<AppearanceScope>, max_bytes: u64) -> Result<()> {
        // Depths and formats of the enclosing elements that say how positions are read.
        let mut formats = vec![(0, PositionFormat::new(DOCUMENT_CRS))];
        loop {
            match xml.next_tag()? {
                XmlEvent::Eof => return Ok(()),
                _ if xml.position() >= max_bytes => return Ok(()),
                XmlEvent::Start => {}
                XmlEvent::End | XmlEvent::Text => continue,
            }
            let depth = xml.depth();
            formats.retain(|(at, _)| *at < depth);
            let outer = formats.last().map_or(PositionFormat::new(DOCUMENT_CRS), |(_, format)| *format);
            let format = outer.refine(xml, self.crs_table);
            if format != outer {
                // An envelope speaks of the feature two elements above it.
                let at = if xml.local_name() == "Envelope" { depth.saturating_sub(2) } else { depth };
                formats.push((at, format));
            }
            match (xml.local_name(), appearances) {
                ("Appearance", Some(scope)) => self.read_appearance(xml, scope)?,
                (name, _) if !wanted.is_empty() && is_surface(name) && wanted.contains_key(&xml.gml_id()) => {
                    let (values, text) = (&mut Vec::new(), &mut String::new());
                    self.geometry_parser(xml, values, text).read_element(NO_NODE, format)?;
                }
                _ => {}
            }
        }
    }

    fn geometry_parser<'b>(&'b mut self, xml: &'b mut XmlReader, values: &'b mut Vec<f64>, text: &'b mut String) -> GeometryParser<'b> {
        GeometryParser {
            xml,
            report: self.report,
            geometry: self.geometry,
            crs_table: self.crs_table,
            references: self.references,
            max_bytes: self.options.max_object_bytes,
            values,
            text,
        }
    }

    fn read_appearance(&mut self, xml: &mut XmlReader, scope: AppearanceScope) -> Result<()> {
        AppearanceParser {
            xml,
            report: self.report,
            appearances: self.appearances,
            theme: self.theme,
            references: self.references,
            scope,
            max_bytes: self.options.max_appearance_bytes,
            values: &mut Vec::new(),
            text: &mut String::new(),
        }
        .read_appearance()
    }

    /// Returns the targets of appearances of other documents that the document does not have.
    fn find_missing_targets(&mut self, path: &Path) -> std::io::Result<WantedElements> {
        let mut missing = self.references.take_own_targets();
        if missing.is_empty() {
            return Ok(missing);
        }
        let mut scanner = TagScanner::new(open_xml(path).map_err(std::io::Error::other)?);
        while let Some(kind) = scanner.next_tag()? {
            if matches!(kind, TagKind::Start | TagKind::Empty) {
                let text = String::from_utf8_lossy(scanner.tag());
                let attributes = text.split_once(|c: char| c.is_ascii_whitespace()).map_or("", |(_, attributes)| attributes);
                for (_, id) in parse_attributes(attributes).filter(|(name, _)| *name == "id") {
                    missing.remove(&hash_id(&unescape_lossy(id)));
                }
            }
        }
        Ok(missing)
    }
}
