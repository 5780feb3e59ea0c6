//! The second pass: one city object after the other to batches.

use std::collections::{HashMap, VecDeque};
use std::path::Path;

use map3d_base::asset::{AssetReport, Batch, Instance, Material, Object};
use map3d_base::{Error, Result, Vec3};

use super::appearance_parser::Theme;
use super::canvas::Canvas;
use super::draw::Drawer;
use super::feature::Member;
use super::feature_parser::FeatureParser;
use super::paint::Painter;
use super::shared::Shared;
use super::survey::{Survey, survey};
use super::xml::{Step, Xml};
use crate::asset_folder::AssetFolder;
use crate::document::DocumentReader;
use crate::image_file::{Texture, Textures};
use crate::materials::MaterialTable;
use crate::options::ReadOptions;
use crate::report::Log;

/// Reads CityGML. Memory: what `survey` keeps, one city object, the tables of objects and materials.
pub struct CityGmlReader {
    xml: Xml,
    log: Log,
    options: ReadOptions,
    srs_name: Option<String>,
    theme: Theme,
    member: Member,
    canvas: Canvas,
    instances: Vec<Instance>,
    values: Vec<f64>,
    text: String,
    entered: bool,
    at_end: bool,
}

impl CityGmlReader {
    /// Surveys the document; names in it may lead to files in its folder (`options.folder` widens that).
    pub fn open(path: &Path, options: &ReadOptions) -> Result<Self> {
        let lod = asked_lod(options)?;
        let folder = AssetFolder::of_document(path, options.folder.as_deref())?;
        let mut log = Log::new(path, "citygml", options.strict);
        let Survey { srs_name, theme, appearances, wanted } = survey(path, options, &mut log)?;
        log.report.crs = srs_name.clone();
        note_theme(&theme, &mut log);
        let painter = Painter { textures: Textures::default(), table: MaterialTable::default(), folder, options: options.clone() };
        let canvas = Canvas {
            painter,
            drawer: Drawer::new(metres_per_unit(srs_name.as_deref()), options.max_ring_vertices, options.max_triangles),
            appearances,
            wanted,
            lod,
            shared: Shared::default(),
            objects: Vec::new(),
            placements: Vec::new(),
            prototypes: HashMap::new(),
            queue: VecDeque::new(),
        };
        Ok(Self {
            xml: Xml::open(path)?,
            log,
            options: options.clone(),
            srs_name,
            theme,
            member: Member::default(),
            canvas,
            instances: Vec::new(),
            values: Vec::new(),
            text: String::new(),
            entered: false,
            at_end: false,
        })
    }

    /// Reads on to the end of the next city object (or of something else at the top). False at the end of the document.
    fn advance(&mut self) -> Result<bool> {
        while !self.entered {
            match self.xml.step()? {
                Step::Start => self.entered = true,
                Step::Eof => return Ok(false),
                Step::End | Step::Text => {}
            }
        }
        if !self.xml.next_child()? {
            return Ok(false);
        }
        match self.xml.local() {
            "cityObjectMember" | "featureMember" | "featureMembers" => {
                while self.xml.next_child()? {
                    self.city_object()?;
                }
            }
            _ => self.xml.skip()?,
        }
        Ok(true)
    }

    fn city_object(&mut self) -> Result<()> {
        self.member.clear();
        FeatureParser {
            xml: &mut self.xml,
            log: &mut self.log,
            options: &self.options,
            member: &mut self.member,
            theme: &mut self.theme,
            values: &mut self.values,
            text: &mut self.text,
        }
        .city_object()?;
        self.canvas.draw(&mut self.member, &mut self.log)
    }

    fn finish(&mut self) -> Result<()> {
        self.at_end = true;
        self.canvas.draw_borrowed(&mut self.log)?;
        self.instances = self.canvas.finish_instances(&mut self.log)?;
        Ok(())
    }
}

fn asked_lod(options: &ReadOptions) -> Result<Option<u8>> {
    let Some(text) = &options.lod else { return Ok(None) };
    match text.as_bytes() {
        [digit @ b'0'..=b'4'] | [digit @ b'0'..=b'4', b'.', _] => Ok(Some(digit - b'0')),
        _ => Err(Error::argument(format!("lod {text:?}: expected 0, 1, 2, 3 or 4"))),
    }
}

fn note_theme(theme: &Theme, log: &mut Log) {
    match (&theme.asked, &theme.first) {
        (None, Some(first)) if theme.several => log.note("appearance theme drawn", first.as_str()),
        (Some(asked), first) if first.as_ref() != Some(asked) => log.note("appearance theme drawn, if the document has it", asked.as_str()),
        _ => {}
    }
}

/// Roughly, so that planes can be fitted: geographic systems have degrees in the horizontal.
fn metres_per_unit(srs_name: Option<&str>) -> Vec3 {
    const METRES_PER_DEGREE: f64 = 111_320.0;
    if srs_name.is_some_and(is_geographic) { [METRES_PER_DEGREE, METRES_PER_DEGREE, 1.0] } else { [1.0; 3] }
}

/// EPSG keeps geographic systems at 4001 … 4999 (geocentric ones apart), newer ones at the numbers listed.
fn is_geographic(srs_name: &str) -> bool {
    const NEWER: [u32; 14] = [6318, 6319, 6668, 6697, 6783, 7843, 7844, 7912, 8999, 9000, 9057, 9755, 10_176, 10_299];
    const GEOCENTRIC: [u32; 6] = [4328, 4936, 4978, 4896, 4910, 4911];
    let code = srs_name.split(|c: char| !c.is_ascii_alphanumeric()).find_map(|word| word.parse::<u32>().ok().filter(|n| *n > 1000));
    let named = srs_name.to_ascii_uppercase().contains("CRS84");
    named || code.is_some_and(|code| NEWER.contains(&code) || ((4001..=4999).contains(&code) && !GEOCENTRIC.contains(&code)))
}

impl DocumentReader for CityGmlReader {
    fn next_batch(&mut self) -> Result<Option<Batch>> {
        loop {
            if let Some(batch) = self.canvas.queue.pop_front() {
                return Ok(Some(batch));
            }
            if self.at_end {
                return Ok(None);
            }
            match self.advance() {
                Ok(true) => {}
                Ok(false) => self.finish()?,
                Err(e) if self.xml.is_broken() && !self.options.strict => {
                    self.log.note("document broken; what comes after is lost", e.to_string());
                    self.finish()?;
                }
                Err(e) => return Err(e),
            }
        }
    }

    fn srs_name(&self) -> Option<&str> {
        self.srs_name.as_deref()
    }

    fn materials(&self) -> &[Material] {
        self.canvas.painter.table.all()
    }

    fn objects(&self) -> &[Object] {
        &self.canvas.objects
    }

    fn instances(&self) -> &[Instance] {
        &self.instances
    }

    fn instances_mut(&mut self) -> &mut [Instance] {
        &mut self.instances
    }

    fn textures(&self) -> &[Texture] {
        self.canvas.painter.textures.files()
    }

    fn report(&self) -> &AssetReport {
        &self.log.report
    }
}

#[cfg(test)]
mod tests {
    use super::is_geographic;

    #[test]
    fn geographic_systems_are_known_by_their_number() {
        for name in ["EPSG:4326", "http://www.opengis.net/def/crs/EPSG/0/6697", "urn:ogc:def:crs:EPSG::4979", "urn:ogc:def:crs:OGC:1.3:CRS84"] {
            assert!(is_geographic(name), "{name}");
        }
        for name in ["EPSG:25832+5783", "urn:adv:crs:DE_DHDN_3GK4*DE_DHN92_NH", "urn:ogc:def:crs,crs:EPSG:6.12:3068,crs:EPSG:6.12:5783", "EPSG:4978"]
        {
            assert!(!is_geographic(name), "{name}");
        }
    }
}
