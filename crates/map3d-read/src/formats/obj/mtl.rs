//! Reads MTL material libraries: diffuse colour, opacity, colour map and opacity map of named materials.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::path::Path;

use map3d_base::{Reason, Result};

use super::line_reader::{LineReader, numbers, parse_number, split_word};
use crate::document::asset_folder::{AssetFolder, MATERIAL_LIBRARY};
use crate::document::report_builder::ReportBuilder;
use crate::document::text_input::decode_name;
use crate::document::transparency::{Transparency, TransparencyCounts};

/// A `map_…` statement: an image and the transformation of texture coordinates, `scale · uv + offset`.
#[derive(Clone, Debug, PartialEq)]
pub struct TextureMap {
    /// File name of the image.
    pub name: String,
    pub clamp: bool,
    pub scale: [f64; 2],
    pub offset: [f64; 2],
}

/// A material definition; `None` for statements that it does not have.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MtlMaterial {
    pub diffuse: Option<[f32; 3]>,
    pub opacity: Option<f32>,
    pub color_map: Option<TextureMap>,
    pub opacity_map: Option<TextureMap>,
}

/// Materials of all libraries of a document. The first definition of a name wins.
#[derive(Default)]
pub struct MaterialLibrary {
    materials: HashMap<String, MtlMaterial>,
    transparency: Transparency,
    /// The transparency of a library is opacity.
    pub has_inverted: bool,
}

impl MaterialLibrary {
    pub fn new(transparency: Transparency) -> Self {
        Self { transparency, ..Self::default() }
    }

    pub fn get(&self, name: &str) -> Option<&MtlMaterial> {
        self.materials.get(name)
    }

    /// Loads the files that a `mtllib` line names: one file whose name contains spaces, or several files.
    pub fn load_statement(&mut self, rest: &[u8], folder: &mut AssetFolder, report: &mut ReportBuilder) -> Result<()> {
        let names = library_names(rest, folder);
        if names.is_empty() {
            return report.warn(Reason::MaterialLibraryUnnamed, String::new());
        }
        names.into_iter().try_for_each(|name| self.load_named(&name, folder, report))
    }

    fn load_named(&mut self, name: &str, folder: &mut AssetFolder, report: &mut ReportBuilder) -> Result<()> {
        match folder.find(name) {
            Ok(file) => {
                if let Some(note) = file.note {
                    report.note(note, name);
                }
                let slashed = name.replace('\\', "/");
                let prefix = slashed.rsplit_once('/').map_or("", |(prefix, _)| prefix);
                self.load(&file.path, prefix, folder, report)
            }
            Err(error) => report.warn(error.reason(MATERIAL_LIBRARY), name),
        }
    }

    /// `prefix`: folder of the library, relative to the document; images are searched there first.
    fn load(&mut self, path: &Path, prefix: &str, folder: &mut AssetFolder, report: &mut ReportBuilder) -> Result<()> {
        let mut lines = LineReader::open(path)?;
        let mut found: Vec<(String, MtlMaterial)> = Vec::new();
        while let Some(line) = lines.next_line()? {
            let (word, rest) = split_word(line);
            if word.eq_ignore_ascii_case(b"newmtl") {
                found.push((decode_name(rest).into_owned(), MtlMaterial::default()));
            } else if let Some((_, material)) = found.last_mut() {
                apply_statement(material, word, rest, prefix, folder);
            }
        }
        self.decide_transparency(&mut found, report);
        found.into_iter().for_each(|(name, material)| self.add(name, material, report));
        Ok(())
    }

    /// Inverts the opacity of a library's materials if it is transparency.
    fn decide_transparency(&mut self, found: &mut [(String, MtlMaterial)], report: &mut ReportBuilder) {
        let mut counts = TransparencyCounts::default();
        found.iter().for_each(|(_, material)| counts.add(material.opacity.map(|v| 1.0 - v)));
        if counts.is_inverted(self.transparency, report) {
            self.has_inverted = true;
            found.iter_mut().for_each(|(_, material)| material.opacity = material.opacity.map(|v| 1.0 - v));
        }
    }

    fn add(&mut self, name: String, material: MtlMaterial, report: &mut ReportBuilder) {
        match self.materials.entry(name) {
            Entry::Occupied(first) => report.note(Reason::MaterialDefinedTwice, first.key().as_str()),
            Entry::Vacant(slot) => {
                slot.insert(material);
            }
        }
    }
}

/// Returns the names of the files of a `mtllib` line: one whose name contains spaces, or several; none for an empty line.
pub fn library_names(rest: &[u8], folder: &mut AssetFolder) -> Vec<String> {
    let whole = decode_name(rest).trim().trim_matches('"').to_owned();
    let several: Vec<String> = whole.split_whitespace().map(|name| name.trim_matches('"').to_owned()).collect();
    if several.len() <= 1 || folder.find(&whole).is_ok() || several.iter().all(|name| folder.find(name).is_err()) {
        return if whole.is_empty() { Vec::new() } else { vec![whole] };
    }
    several
}

/// Returns the name of the file of a `map_…` line.
pub fn texture_name(rest: &[u8]) -> Option<String> {
    parse_texture_map(rest.trim_ascii()).map(|map| map.name)
}

fn apply_statement(material: &mut MtlMaterial, word: &[u8], rest: &[u8], prefix: &str, folder: &mut AssetFolder) {
    let mut map = || parse_texture_map(rest).map(|map| prefer_library_folder(map, prefix, folder));
    match word.to_ascii_lowercase().as_slice() {
        b"kd" => material.diffuse = parse_color(rest).or(material.diffuse),
        b"d" => material.opacity = numbers(rest.strip_prefix(b"-halo").unwrap_or(rest)).next().map(|v| v.clamp(0.0, 1.0) as f32),
        b"tr" if material.opacity.is_none() => material.opacity = numbers(rest).next().map(|v| (1.0 - v).clamp(0.0, 1.0) as f32),
        b"map_kd" => material.color_map = map(),
        b"map_d" => material.opacity_map = map(),
        _ => {}
    }
}

/// A single number is a grey value. CIE XYZ and spectral curves are not supported.
fn parse_color(rest: &[u8]) -> Option<[f32; 3]> {
    let values: Vec<f32> = numbers(rest).take(3).map(|v| if v.is_finite() { v.clamp(0.0, 1.0) as f32 } else { 0.8 }).collect();
    match values[..] {
        [grey] => Some([grey; 3]),
        [r, g, b] => Some([r, g, b]),
        _ => None,
    }
}

/// Parses options, then the file name, which may contain spaces.
fn parse_texture_map(rest: &[u8]) -> Option<TextureMap> {
    let mut map = TextureMap { name: String::new(), clamp: false, scale: [1.0; 2], offset: [0.0; 2] };
    let mut rest = rest;
    while rest.first() == Some(&b'-') {
        let (option, after) = split_word(rest);
        rest = match option.to_ascii_lowercase().as_slice() {
            b"-clamp" => {
                let (value, after) = split_word(after);
                map.clamp = value.eq_ignore_ascii_case(b"on");
                after
            }
            b"-s" => parse_up_to_three(after, &mut map.scale),
            b"-o" => parse_up_to_three(after, &mut map.offset),
            b"-t" => parse_up_to_three(after, &mut [0.0; 2]),
            b"-mm" => split_word(split_word(after).1).1,
            b"-blendu" | b"-blendv" | b"-cc" | b"-bm" | b"-boost" | b"-texres" | b"-imfchan" | b"-type" => split_word(after).1,
            _ => break,
        };
    }
    map.name = decode_name(rest).trim().trim_matches('"').to_owned();
    (!map.name.is_empty()).then_some(map)
}

/// Parses one to three numbers; keeps the first two. Never consumes the last word of the line, which is the file name.
fn parse_up_to_three<'a>(mut rest: &'a [u8], values: &mut [f64; 2]) -> &'a [u8] {
    for k in 0..3 {
        let (word, after) = split_word(rest);
        let Some(value) = parse_number(word).filter(|v| v.is_finite() && !after.is_empty()) else { break };
        if let Some(slot) = values.get_mut(k) {
            *slot = value;
        }
        rest = after;
    }
    rest
}

/// Prefers an image in the library's folder to one in the document's folder.
fn prefer_library_folder(mut map: TextureMap, prefix: &str, folder: &mut AssetFolder) -> TextureMap {
    let name = format!("{prefix}/{}", map.name);
    if !prefix.is_empty() && folder.find(&name).is_ok() {
        map.name = name;
    }
    map
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texture_map_options_are_separated_from_the_file_name() {
        for (line, name, clamp, scale, offset) in [
            ("a b.png", "a b.png", false, [1.0, 1.0], [0.0, 0.0]),
            ("-clamp on a.png", "a.png", true, [1.0, 1.0], [0.0, 0.0]),
            ("-s 2 3 1 -o 0.5 -clamp off \"a b.png\"", "a b.png", false, [2.0, 3.0], [0.5, 0.0]),
            ("-s 2 7.png", "7.png", false, [2.0, 1.0], [0.0, 0.0]),
            ("-mm 0 1 -blendu off -texres 512 -imfchan m a.png", "a.png", false, [1.0, 1.0], [0.0, 0.0]),
            ("-x.png", "-x.png", false, [1.0, 1.0], [0.0, 0.0]),
        ] {
            let expected = TextureMap { name: name.into(), clamp, scale, offset };
            assert_eq!(parse_texture_map(line.as_bytes()), Some(expected), "{line}");
        }
        assert_eq!(parse_texture_map(b"-clamp on"), None);
    }
}
