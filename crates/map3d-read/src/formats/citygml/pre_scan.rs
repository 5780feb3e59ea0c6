//! The first of the two passes over a CityGML file: collects what must be known before the first city object is converted.
//!
//! Memory: appearances outside city objects in their compact form (about 16 bytes per vertex of a textured ring, limited by
//! `max_appearance_bytes`), and 8 bytes per id that another city object refers to.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use map3d_base::{Error, Reason, Result};

use super::appearance_parser::{AppearanceParser, AppearanceScope, parse_transparency};
use super::members::{OpenLevels, is_collection};
use super::options::CityGmlOptions;
use super::other_documents::OtherDocuments;
use super::references::References;
use super::tag_scanner::{TagKind, TagScanner};
use super::xml_reader::{XmlEvent, XmlReader, local_part, parse_attributes, unescape_lossy, unsupported};
use crate::city_model::appearance::Appearances;
use crate::city_model::crs_table::CrsTable;
use crate::city_model::geometry_arena::GeometryArena;
use crate::city_model::ids::{IdSet, hash_id};
use crate::city_model::theme_selection::ThemeSelection;
use crate::document::asset_folder::AssetFolder;
use crate::document::options::ReadOptions;
use crate::document::report_builder::ReportBuilder;
use crate::document::text_input::{EncodingFault, open_checked_xml};
use crate::document::transparency::TransparencyCounts;

#[derive(Default)]
pub struct PreScan {
    /// The first coordinate system that any element names.
    pub srs_name: Option<String>,
    pub theme: ThemeSelection,
    /// Appearances outside city objects.
    pub appearances: Appearances,
    /// Ids that a city object refers to but does not define.
    pub referenced_ids: IdSet,
    /// Counts of all materials, in city objects and outside.
    pub transparency: TransparencyCounts,
}

impl PreScan {
    /// Scans the whole document, then the appearances that other documents have for it. A truncated document is scanned up to its end.
    pub fn run(
        path: &Path,
        options: &ReadOptions,
        of_format: &CityGmlOptions,
        references: &mut References,
        report: &mut ReportBuilder,
    ) -> Result<Self> {
        let io = |e| Error::storage(path, e);
        let mut scan = Self { theme: ThemeSelection::new(of_format.theme.clone()), ..Self::default() };
        let (input, faults) = open_checked_xml(path)?;
        for EncodingFault { reason, example } in faults {
            report.warn(reason, example)?;
        }
        let mut scanner = TagScanner::new(input);
        let mut links = ObjectReferences::default();
        let (mut depth, mut has_elements) = (0usize, false);
        let mut levels = OpenLevels::default();
        while let Some(kind) = scanner.next_tag().map_err(io)? {
            match kind {
                TagKind::Doctype => return Err(unsupported(path, "a document type definition")),
                TagKind::End => {
                    depth = depth.saturating_sub(1);
                    if depth < levels.depth() {
                        levels.end();
                    }
                }
                TagKind::Start | TagKind::Empty => {
                    has_elements = true;
                    let text = std::str::from_utf8(scanner.tag()).map_or_else(|_| String::from_utf8_lossy(scanner.tag()), Cow::Borrowed);
                    let (name, attributes) = text.split_at(text.bytes().position(|b| b.is_ascii_whitespace()).unwrap_or(text.len()));
                    let name = local_part(name);
                    if depth == 0 && !is_collection(name) {
                        return Err(Error::format(path, format!("the root element is {name:?}; expected CityModel or FeatureCollection")));
                    }
                    let is_property = depth == levels.depth() && levels.is_in_collection();
                    if kind == TagKind::Start && depth == levels.depth() {
                        levels.start(name);
                    }
                    scan.scan_attributes(attributes, references, &mut links);
                    let parse: Option<Parse> = match (kind, name) {
                        (TagKind::Start, "appearanceMember") if is_property => Some(Self::parse_appearance_member),
                        (TagKind::Start, "theme") => Some(Self::parse_theme),
                        (TagKind::Start, "X3DMaterial") => Some(Self::parse_material),
                        (TagKind::Start, "imageURI") => Some(Self::parse_image),
                        _ => None,
                    };
                    match parse {
                        Some(parse) => scanner = parse(&mut scan, scanner, options, references, report)?,
                        None => depth += usize::from(kind == TagKind::Start),
                    }
                }
            }
            if depth <= levels.depth() {
                links.finish_object(&mut scan.referenced_ids);
            }
        }
        if !has_elements {
            return Err(Error::format(path, "no XML element; expected a CityGML document"));
        }
        links.finish_object(&mut scan.referenced_ids);
        scan.read_other_appearances(options, &of_format.appearance_files, references, report)?;
        scan.appearances.count_themes(&mut scan.theme);
        let mut folder = AssetFolder::for_document(path, options.folder.as_deref())?;
        for missed in scan.theme.choose(&mut |image| folder.find(image).is_ok()) {
            report.note(Reason::ThemeWithoutImages, missed);
        }
        scan.appearances.count_transparency(&mut scan.transparency);
        for other in scan.appearances.resolve_pending(scan.theme.selected()) {
            report.note(Reason::AppearanceOfOtherTheme, other);
        }
        scan.appearances.resolve_theme_xlinks();
        Ok(scan)
    }

    fn scan_attributes(&mut self, attributes: &str, references: &References, links: &mut ObjectReferences) {
        for (name, value) in parse_attributes(attributes) {
            match name {
                "id" => {
                    links.ids.insert(hash_id(&unescape_lossy(value)));
                }
                "href" => {
                    if let Some(id) = references.find_own_id(&unescape_lossy(value)) {
                        links.targets.push(id);
                    }
                }
                "srsName" if self.srs_name.is_none() => {
                    self.srs_name = Some(unescape_lossy(value).into_owned()).filter(|name| !name.trim().is_empty())
                }
                _ => {}
            }
        }
    }

    /// Reads the appearances that other documents have for surfaces of this one.
    fn read_other_appearances(
        &mut self,
        options: &ReadOptions,
        files: &[PathBuf],
        references: &mut References,
        report: &mut ReportBuilder,
    ) -> Result<()> {
        if files.is_empty() {
            return Ok(());
        }
        OtherDocuments {
            references,
            geometry: &mut GeometryArena::default(),
            appearances: &mut self.appearances,
            theme: &mut self.theme,
            crs_table: &mut CrsTable::new(self.srs_name.clone()),
            options,
            report,
        }
        .read_appearances(files)
    }

    /// Parses the current appearanceMember; the scanner continues after it. The second pass reports a malformed one.
    fn parse_appearance_member(
        &mut self,
        scanner: TagScanner,
        options: &ReadOptions,
        references: &mut References,
        report: &mut ReportBuilder,
    ) -> Result<TagScanner> {
        let mut xml = XmlReader::new(scanner, report.path());
        let max_bytes = options.max_appearance_bytes;
        let (values, text) = (&mut Vec::new(), &mut String::new());
        let parsed = xml.next_event().and_then(|_| {
            let (appearances, theme, scope) = (&mut self.appearances, &mut self.theme, AppearanceScope::Document);
            AppearanceParser { xml: &mut xml, report, appearances, theme, references, scope, max_bytes, values, text }.read_property()
        });
        match parsed {
            Err(e) if !xml.is_malformed() => Err(e),
            _ => Ok(xml.into_inner()),
        }
    }

    /// Parses the current material of a city object; the scanner continues after it.
    fn parse_material(&mut self, scanner: TagScanner, _: &ReadOptions, _: &mut References, report: &mut ReportBuilder) -> Result<TagScanner> {
        let mut xml = XmlReader::new(scanner, report.path());
        let mut transparency = None;
        if let Ok(XmlEvent::Start) = xml.next_event() {
            while let Ok(true) = xml.next_child() {
                let read = if xml.local_name() == "transparency" {
                    xml.read_text().map(|text| transparency = parse_transparency(&text))
                } else {
                    xml.skip()
                };
                if read.is_err() {
                    break;
                }
            }
            self.transparency.add(transparency);
            self.theme.count_material();
        }
        Ok(xml.into_inner())
    }

    /// Parses the current name of an image; the scanner continues after it.
    fn parse_image(&mut self, scanner: TagScanner, _: &ReadOptions, _: &mut References, report: &mut ReportBuilder) -> Result<TagScanner> {
        let mut xml = XmlReader::new(scanner, report.path());
        if let Ok(XmlEvent::Start) = xml.next_event()
            && let Ok(name) = xml.read_text()
        {
            self.theme.count_image(&name);
        }
        Ok(xml.into_inner())
    }

    /// Parses the current theme; the scanner continues after it.
    fn parse_theme(&mut self, scanner: TagScanner, _: &ReadOptions, _: &mut References, report: &mut ReportBuilder) -> Result<TagScanner> {
        let mut xml = XmlReader::new(scanner, report.path());
        if let Ok(XmlEvent::Start) = xml.next_event()
            && let Ok(name) = xml.read_text()
        {
            self.theme.register(&name);
        }
        Ok(xml.into_inner())
    }
}

/// Parses the current element instead of scanning it.
type Parse = fn(&mut PreScan, TagScanner, &ReadOptions, &mut References, &mut ReportBuilder) -> Result<TagScanner>;

/// Ids and references in the current city object.
#[derive(Default)]
struct ObjectReferences {
    ids: IdSet,
    targets: Vec<u64>,
}

impl ObjectReferences {
    /// Keeps the references to ids outside the city object, and starts the next one.
    fn finish_object(&mut self, referenced_ids: &mut IdSet) {
        referenced_ids.extend(self.targets.drain(..).filter(|t| !self.ids.contains(t)));
        self.ids.clear();
    }
}
