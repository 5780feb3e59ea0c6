//! Reads CityGML. `open` runs the first pass (`pre_scan`); this file is the second pass, which parses and converts one city object after another.

use std::path::Path;

use map3d_base::asset::{AssetReport, Batch, Instance, Material, Object};
use map3d_base::{Reason, Result};

use super::city_object_parser::CityObjectParser;
use super::dictionary_parser::read_dictionary;
use super::members::{Level, OpenLevels};
use super::options::CityGmlOptions;
use super::other_documents::OtherDocuments;
use super::pre_scan::PreScan;
use super::references::References;
use super::xml_reader::{Malformed, XmlEvent, XmlReader};
use crate::city_model::city_object::CityObject;
use crate::city_model::code_lists::CodeLists;
use crate::city_model::converter::{Conversion, FeatureConverter};
use crate::city_model::crs_table::{CrsNumber, CrsTable, DOCUMENT_CRS};
use crate::city_model::theme_selection::ThemeSelection;
use crate::document::asset_folder::AssetFolder;
use crate::document::images::DocumentImage;
use crate::document::options::ReadOptions;
use crate::document::report_builder::ReportBuilder;
use crate::document::source_format::SourceFormat;
use crate::document::text_input::count_lines;
use crate::document::transparency::report_invisible;
use crate::document::{DocumentReader, ReliefGrid};

pub const NAME: &str = "citygml";

/// Reads CityGML. Memory: the results of the first pass (see `pre_scan`), one city object, and the tables of objects and materials.
pub struct CityGmlReader {
    xml: XmlReader,
    report: ReportBuilder,
    options: ReadOptions,
    crs_table: CrsTable,
    /// Coordinate system of the model's envelope.
    crs: CrsNumber,
    references: References,
    theme: ThemeSelection,
    /// The current city object.
    city_object: CityObject,
    converter: FeatureConverter,
    code_lists: CodeLists,
    instances: Vec<Instance>,
    /// Buffers for numbers and text.
    values: Vec<f64>,
    text: String,
    levels: OpenLevels,
    at_end: bool,
    /// The document's transparency is opacity.
    inverted: bool,
}

impl CityGmlReader {
    /// Opens a document and runs the first pass. File names in the document are resolved inside its folder, or inside `options.folder`.
    pub fn open(path: &Path, options: &ReadOptions, formats: &'static [SourceFormat]) -> Result<Self> {
        let of_format: CityGmlOptions = options.parse_of_format()?;
        let (lod, date) = (of_format.parse_lod()?, of_format.parse_date()?);
        let folder = AssetFolder::for_document(path, options.folder.as_deref())?;
        let mut report = ReportBuilder::new(path, NAME, options.strict);
        let mut references = References::new(path, options.folder.as_deref())?;
        let PreScan { srs_name, theme, appearances, referenced_ids, transparency } =
            PreScan::run(path, options, &of_format, &mut references, &mut report)?;
        report.set_crs(srs_name.clone());
        report_theme(&theme, &mut report);
        let inverted = transparency.is_inverted(options.transparency, &mut report);
        let conversion = Conversion { lod, interiors: of_format.interiors, date, inverted, formats };
        Ok(Self {
            xml: XmlReader::open(path)?,
            report,
            options: options.clone(),
            crs_table: CrsTable::new(srs_name),
            crs: DOCUMENT_CRS,
            references,
            theme,
            city_object: CityObject::default(),
            converter: FeatureConverter::new(folder, options, conversion, appearances, referenced_ids),
            code_lists: CodeLists::new(AssetFolder::for_document(path, options.folder.as_deref())?, read_dictionary),
            instances: Vec::new(),
            values: Vec::new(),
            text: String::new(),
            levels: OpenLevels::default(),
            at_end: false,
            inverted,
        })
    }

    /// Reads up to the end of the next city object, which is converted, or of another element. Returns false at the end of the document.
    fn read_member(&mut self) -> Result<bool> {
        match self.xml.next_tag()? {
            XmlEvent::Eof => return Ok(false),
            XmlEvent::End => return Ok(self.levels.end()),
            XmlEvent::Text => {}
            XmlEvent::Start => match self.levels.start(self.xml.local_name()) {
                Level::Collection | Level::Member => {}
                Level::CityObject => self.read_city_object()?,
                Level::Other if self.xml.local_name() == "boundedBy" => self.read_envelope()?,
                Level::Other => self.xml.skip()?,
            },
        }
        Ok(true)
    }

    /// Reads the model's envelope, in whose coordinate system is what names none.
    fn read_envelope(&mut self) -> Result<()> {
        while self.xml.next_child()? {
            if let Some(crs) = self.xml.attribute("srsName").and_then(|name| self.crs_table.find(&name)) {
                self.crs = crs;
            }
            self.xml.skip()?;
        }
        Ok(())
    }

    fn read_city_object(&mut self) -> Result<()> {
        self.city_object.clear();
        let parsed = CityObjectParser {
            xml: &mut self.xml,
            report: &mut self.report,
            options: &self.options,
            city_object: &mut self.city_object,
            theme: &mut self.theme,
            code_lists: &mut self.code_lists,
            crs_table: &mut self.crs_table,
            references: &mut self.references,
            folder: &mut self.converter.resolver.folder,
            crs: self.crs,
            values: &mut self.values,
            text: &mut self.text,
        }
        .read_city_object();
        // If the document breaks off in an object, its complete polygons are kept.
        let is_kept = match &parsed {
            Ok(()) => true,
            Err(_) => self.xml.is_malformed() && !self.options.strict && self.city_object.has_geometry(),
        };
        if is_kept {
            self.converter.set_coordinate_systems(self.crs_table.names());
            self.converter.convert(&mut self.city_object, &mut self.report)?;
        }
        parsed
    }

    /// Reports where the document breaks off.
    fn report_malformed(&mut self) {
        let Some(Malformed { byte, what }) = self.xml.malformed().cloned() else { return };
        let line = count_lines(self.report.path(), byte).map_or_else(|_| String::new(), |line| format!(", line {line}"));
        self.report.note(Reason::DocumentBroken, format!("at byte {byte}{line} ({what})"));
    }

    /// Reads the geometry that is in other documents of the folder.
    fn read_other_documents(&mut self) -> Result<()> {
        let (geometry, appearances) = self.converter.other_geometry();
        OtherDocuments {
            references: &mut self.references,
            geometry,
            appearances,
            theme: &mut self.theme,
            crs_table: &mut self.crs_table,
            options: &self.options,
            report: &mut self.report,
        }
        .read_wanted()?;
        self.converter.set_coordinate_systems(self.crs_table.names());
        Ok(())
    }

    fn finish(&mut self) -> Result<()> {
        self.at_end = true;
        self.read_other_documents()?;
        if !self.xml.is_malformed() {
            self.converter.report_missing_targets(&mut self.report)?;
        }
        self.converter.convert_deferred(self.references.missing(), &mut self.report)?;
        self.instances = self.converter.finish_instances(self.references.missing(), &mut self.report)?;
        let interiors = self.report.count(Reason::PolygonOfInterior);
        if interiors > 0 {
            self.report.note(Reason::InteriorsNotDrawn, format!("{interiors}; --interiors draws them"));
        }
        if let Some(found) = self.converter.other_lods() {
            self.report.note(Reason::NothingAtLod, found);
        }
        report_invisible(self.report.count(Reason::PolygonTransparent), self.inverted, &mut self.report);
        Ok(())
    }
}

/// Themes that the report names.
const MAX_NAMED_THEMES: usize = 5;

fn report_theme(theme: &ThemeSelection, report: &mut ReportBuilder) {
    match (&theme.requested, theme.selected()) {
        (None, Some(selected)) if theme.has_several() => report.note(Reason::ThemeUsed, selected),
        (Some(requested), _) if !theme.names().is_empty() && !theme.names().contains(&requested.as_str()) => {
            let names = theme.names().into_iter().take(MAX_NAMED_THEMES).collect::<Vec<_>>().join(", ");
            report.note(Reason::ThemeNotInFile, format!("{requested}; the file has {names}"));
        }
        _ => {}
    }
}

impl DocumentReader for CityGmlReader {
    fn next_batch(&mut self) -> Result<Option<Batch>> {
        loop {
            if let Some(batch) = self.converter.batches.pop_front() {
                return Ok(Some(batch));
            }
            if self.at_end {
                return Ok(None);
            }
            match self.read_member() {
                Ok(true) => {}
                Ok(false) => self.finish()?,
                Err(_) if self.xml.is_malformed() && !self.options.strict => {
                    self.report_malformed();
                    self.finish()?;
                }
                Err(e) => return Err(e),
            }
        }
    }

    fn srs_name(&self) -> Option<&str> {
        self.crs_table.names()[0].as_deref()
    }

    fn crs_names(&self) -> Vec<Option<&str>> {
        self.crs_table.names().iter().map(Option::as_deref).collect()
    }

    fn instance_crs(&self) -> &[CrsNumber] {
        &self.converter.instance_crs
    }

    fn grids(&self) -> &[ReliefGrid] {
        &self.converter.grids
    }

    fn materials(&self) -> &[Material] {
        self.converter.resolver.table.materials()
    }

    fn objects(&self) -> &[Object] {
        &self.converter.objects
    }

    fn instances(&self) -> &[Instance] {
        &self.instances
    }

    fn instances_mut(&mut self) -> &mut Vec<Instance> {
        &mut self.instances
    }

    fn textures(&self) -> &[DocumentImage] {
        self.converter.resolver.images.files()
    }

    fn report(&self) -> &AssetReport {
        self.report.report()
    }
}
