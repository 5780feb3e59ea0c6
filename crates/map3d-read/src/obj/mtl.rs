//! MTL libraries: diffuse colour, opacity, colour map and opacity map of named materials.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::path::Path;

use map3d_base::Result;

use super::lines::{Lines, number, numbers, split_word};
use crate::asset_folder::AssetFolder;
use crate::report::Log;
use crate::text::name_of;

/// A `map_…` statement: an image and how texture coordinates become its own, `scale · uv + offset`.
#[derive(Clone, Debug, PartialEq)]
pub struct MapStatement {
    pub name: String,
    pub clamp: bool,
    pub scale: [f64; 2],
    pub offset: [f64; 2],
}

/// What a material statement says; `None` where it is silent.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MtlEntry {
    pub diffuse: Option<[f32; 3]>,
    pub opacity: Option<f32>,
    pub color_map: Option<MapStatement>,
    pub opacity_map: Option<MapStatement>,
}

/// Materials of all libraries of a document; a name's first definition counts.
#[derive(Default)]
pub struct Library {
    entries: HashMap<String, MtlEntry>,
}

impl Library {
    pub fn get(&self, name: &str) -> Option<&MtlEntry> {
        self.entries.get(name)
    }

    /// Reads what a `mtllib` line names: one file whose name has spaces, or several files.
    pub fn load_statement(&mut self, rest: &[u8], folder: &mut AssetFolder, log: &mut Log) -> Result<()> {
        let whole = name_of(rest).trim_matches('"').to_owned();
        if whole.is_empty() {
            return log.warn("mtllib without a file name", String::new());
        }
        if folder.find(&whole).is_ok() || !whole.contains(char::is_whitespace) {
            return self.load_named(&whole, folder, log);
        }
        let several: Vec<&str> = whole.split_whitespace().collect();
        if several.iter().all(|name| folder.find(name).is_err()) {
            return self.load_named(&whole, folder, log);
        }
        several.into_iter().try_for_each(|name| self.load_named(name, folder, log))
    }

    fn load_named(&mut self, name: &str, folder: &mut AssetFolder, log: &mut Log) -> Result<()> {
        match folder.find(name) {
            Ok(found) => {
                if let Some(oddity) = found.tolerated {
                    log.note(oddity, name);
                }
                let slashed = name.replace('\\', "/");
                let prefix = slashed.rsplit_once('/').map_or("", |(prefix, _)| prefix);
                self.load(&found.path, prefix, folder, log)
            }
            Err(refusal) => log.warn(&format!("material library: {}", refusal.reason()), name),
        }
    }

    /// `prefix`: folder of the library, seen from the document; images are looked for there first.
    fn load(&mut self, path: &Path, prefix: &str, folder: &mut AssetFolder, log: &mut Log) -> Result<()> {
        let mut lines = Lines::open(path)?;
        let mut current: Option<(String, MtlEntry)> = None;
        while let Some(line) = lines.next_line()? {
            let (word, rest) = split_word(line);
            if word.eq_ignore_ascii_case(b"newmtl") {
                self.keep(current.replace((name_of(rest).into_owned(), MtlEntry::default())), log);
            } else if let Some((_, entry)) = &mut current {
                statement(entry, word, rest, prefix, folder);
            }
        }
        self.keep(current, log);
        Ok(())
    }

    fn keep(&mut self, finished: Option<(String, MtlEntry)>, log: &mut Log) {
        let Some((name, entry)) = finished else { return };
        match self.entries.entry(name) {
            Entry::Occupied(first) => log.note("material defined more than once; the first counts", first.key().as_str()),
            Entry::Vacant(slot) => {
                slot.insert(entry);
            }
        }
    }
}

fn statement(entry: &mut MtlEntry, word: &[u8], rest: &[u8], prefix: &str, folder: &mut AssetFolder) {
    let mut map = || map_statement(rest).map(|map| beside_library(map, prefix, folder));
    match word.to_ascii_lowercase().as_slice() {
        b"kd" => entry.diffuse = color(rest).or(entry.diffuse),
        b"d" => entry.opacity = numbers(rest.strip_prefix(b"-halo").unwrap_or(rest)).next().map(|v| v.clamp(0.0, 1.0) as f32),
        b"tr" if entry.opacity.is_none() => entry.opacity = numbers(rest).next().map(|v| (1.0 - v).clamp(0.0, 1.0) as f32),
        b"map_kd" => entry.color_map = map(),
        b"map_d" => entry.opacity_map = map(),
        _ => {}
    }
}

/// One number is a grey; CIE XYZ and spectral curves are not colours we know.
fn color(rest: &[u8]) -> Option<[f32; 3]> {
    let values: Vec<f32> = numbers(rest).take(3).map(|v| if v.is_finite() { v.clamp(0.0, 1.0) as f32 } else { 0.8 }).collect();
    match values[..] {
        [grey] => Some([grey; 3]),
        [r, g, b] => Some([r, g, b]),
        _ => None,
    }
}

/// Options, then the file's name, which may have spaces.
fn map_statement(rest: &[u8]) -> Option<MapStatement> {
    let mut map = MapStatement { name: String::new(), clamp: false, scale: [1.0; 2], offset: [0.0; 2] };
    let mut rest = rest;
    while rest.first() == Some(&b'-') {
        let (option, after) = split_word(rest);
        rest = match option.to_ascii_lowercase().as_slice() {
            b"-clamp" => {
                let (value, after) = split_word(after);
                map.clamp = value.eq_ignore_ascii_case(b"on");
                after
            }
            b"-s" => up_to_three(after, &mut map.scale),
            b"-o" => up_to_three(after, &mut map.offset),
            b"-t" => up_to_three(after, &mut [0.0; 2]),
            b"-mm" => split_word(split_word(after).1).1,
            b"-blendu" | b"-blendv" | b"-cc" | b"-bm" | b"-boost" | b"-texres" | b"-imfchan" | b"-type" => split_word(after).1,
            _ => break,
        };
    }
    map.name = name_of(rest).trim_matches('"').to_owned();
    (!map.name.is_empty()).then_some(map)
}

/// Reads one to three numbers; the last word of the line is never taken, it is the file's name.
fn up_to_three<'a>(mut rest: &'a [u8], values: &mut [f64; 2]) -> &'a [u8] {
    for k in 0..3 {
        let (word, after) = split_word(rest);
        let Some(value) = number(word).filter(|v| v.is_finite() && !after.is_empty()) else { break };
        if let Some(slot) = values.get_mut(k) {
            *slot = value;
        }
        rest = after;
    }
    rest
}

fn beside_library(mut map: MapStatement, prefix: &str, folder: &mut AssetFolder) -> MapStatement {
    let beside = format!("{prefix}/{}", map.name);
    if !prefix.is_empty() && folder.find(&beside).is_ok() {
        map.name = beside;
    }
    map
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_of_maps_are_told_from_their_names() {
        for (line, name, clamp, scale, offset) in [
            ("a b.png", "a b.png", false, [1.0, 1.0], [0.0, 0.0]),
            ("-clamp on a.png", "a.png", true, [1.0, 1.0], [0.0, 0.0]),
            ("-s 2 3 1 -o 0.5 -clamp off \"a b.png\"", "a b.png", false, [2.0, 3.0], [0.5, 0.0]),
            ("-s 2 7.png", "7.png", false, [2.0, 1.0], [0.0, 0.0]),
            ("-mm 0 1 -blendu off -texres 512 -imfchan m a.png", "a.png", false, [1.0, 1.0], [0.0, 0.0]),
            ("-x.png", "-x.png", false, [1.0, 1.0], [0.0, 0.0]),
        ] {
            let expected = MapStatement { name: name.into(), clamp, scale, offset };
            assert_eq!(map_statement(line.as_bytes()), Some(expected), "{line}");
        }
        assert_eq!(map_statement(b"-clamp on"), None);
    }
}
