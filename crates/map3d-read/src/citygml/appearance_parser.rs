//! app:Appearance into the compact form.

use std::io::BufRead;

use map3d_base::asset::Wrap;
use map3d_base::{Error, Result, Vec3};

use super::appearance::{Appearances, Look, Mapping, Placement, RingUvs, SurfaceData};
use super::coordinates::parse_list;
use super::georeference::Georeference;
use super::ids::{self, Id, Target, id_of, target_of};
use super::implicit::point;
use super::xml::Xml;
use crate::report::Log;

/// Colours of X3D materials that say nothing.
const DEFAULT_DIFFUSE: [f32; 3] = [0.8; 3];

/// Which theme is drawn: the asked one, else the first that the file has.
#[derive(Clone, Debug, Default)]
pub struct Theme {
    pub asked: Option<String>,
    pub first: Option<String>,
    /// The file has more than one.
    pub several: bool,
}

impl Theme {
    /// Called with every theme in the order of the file.
    pub fn see(&mut self, name: &str) {
        match &self.first {
            None => self.first = Some(name.to_owned()),
            Some(first) => self.several |= first != name,
        }
    }

    pub fn chosen(&self) -> Option<&str> {
        self.asked.as_deref().or(self.first.as_deref())
    }
}

pub struct AppearanceParser<'a, R> {
    pub xml: &'a mut Xml<R>,
    pub log: &'a mut Log,
    pub into: &'a mut Appearances,
    pub theme: &'a mut Theme,
    pub max_bytes: u64,
    pub values: &'a mut Vec<f64>,
    pub text: &'a mut String,
}

/// What the elements of one piece of surface data said.
#[derive(Default)]
struct Parts {
    back: bool,
    image: Option<String>,
    wrap: Option<Wrap>,
    border: Option<[f32; 4]>,
    diffuse: Option<[f32; 4]>,
    transparency: f32,
    reference: Option<Vec3>,
    orientation: Option<[f64; 4]>,
    targets: Vec<(Id, Mapping)>,
}

impl<R: BufRead> AppearanceParser<'_, R> {
    /// The property that has just started and holds an Appearance (or refers to one, which is read where it stands).
    pub fn property(&mut self) -> Result<()> {
        while self.xml.next_child()? {
            if self.xml.local() == "Appearance" {
                self.appearance()?;
            } else {
                self.xml.skip()?;
            }
        }
        Ok(())
    }

    fn appearance(&mut self) -> Result<()> {
        let first = self.into.data.len();
        let mut linked = Vec::new();
        let mut name = String::new();
        while self.xml.next_child()? {
            match self.xml.local() {
                "theme" => name = self.xml.whole_text()?,
                "surfaceDataMember" | "surfaceData" => {
                    if let Some(Target::Here(id)) = self.xml.attribute("href").map(|h| target_of(&h)) {
                        linked.push(id);
                    }
                    while self.xml.next_child()? {
                        self.surface_data()?;
                    }
                }
                _ => self.xml.skip()?,
            }
        }
        self.theme.see(&name);
        if self.theme.chosen() == Some(&name) {
            self.into.data[first..].iter_mut().for_each(|d| d.in_theme = true);
            self.into.linked.extend(linked);
        } else {
            self.log.note("appearance of another theme not drawn", name);
        }
        Ok(())
    }

    fn surface_data(&mut self) -> Result<()> {
        let local = self.xml.local().to_owned();
        let id = self.xml.attribute("id").map_or(ids::NONE, |id| id_of(&id));
        let mut parts = Parts::default();
        while self.xml.next_child()? {
            self.part(&mut parts)?;
        }
        let targets = std::mem::take(&mut parts.targets);
        let front = !parts.back;
        let look = look(&local, parts);
        if look == Look::Nothing {
            self.log.warn("surface data that cannot be drawn", local)?;
        }
        if !front {
            self.log.note("appearance of back sides not drawn", local_name(&look));
        }
        let data = self.into.add_data(id, SurfaceData { look, front, in_theme: false, ready: None });
        targets.into_iter().for_each(|(target, mapping)| self.into.bind(target, data, mapping));
        self.check_size()
    }

    fn check_size(&self) -> Result<()> {
        let (got, value) = (self.into.bytes(), self.max_bytes);
        if got <= value {
            return Ok(());
        }
        Err(Error::Limit { path: self.log.path().to_path_buf(), what: "appearances, bytes", got, limit: "max_appearance_bytes", value })
    }

    fn part(&mut self, parts: &mut Parts) -> Result<()> {
        match self.xml.local() {
            "isFront" => parts.back = matches!(self.xml.whole_text()?.as_str(), "false" | "0"),
            "imageURI" => parts.image = Some(self.xml.whole_text()?).filter(|name| !name.is_empty()),
            "wrapMode" => parts.wrap = self.wrap_mode()?,
            "borderColor" => parts.border = self.color()?,
            "diffuseColor" => parts.diffuse = self.color()?,
            "transparency" => parts.transparency = self.xml.whole_text()?.parse().unwrap_or(0.0),
            "referencePoint" => parts.reference = point(self.xml)?,
            "orientation" => parts.orientation = self.numbers()?.and_then(|v| v.try_into().ok()),
            "target" => self.target(parts)?,
            "textureParameterization" => self.association(parts)?,
            _ => self.xml.skip()?,
        }
        Ok(())
    }

    fn wrap_mode(&mut self) -> Result<Option<Wrap>> {
        let text = self.xml.whole_text()?;
        Ok(match text.to_ascii_lowercase().as_str() {
            "none" => Some(Wrap::None),
            "wrap" => Some(Wrap::Wrap),
            "mirror" => Some(Wrap::Mirror),
            "clamp" => Some(Wrap::Clamp),
            "border" => Some(Wrap::Border),
            _ => {
                self.log.warn("unknown wrap mode", text)?;
                None
            }
        })
    }

    fn numbers(&mut self) -> Result<Option<Vec<f64>>> {
        let mut values = Vec::new();
        Ok(parse_list(&self.xml.whole_text()?, &mut values).map(|()| values))
    }

    /// Red, green, blue and perhaps opacity.
    fn color(&mut self) -> Result<Option<[f32; 4]>> {
        let values = self.numbers()?.unwrap_or_default();
        let channel = |k: usize| values.get(k).map(|v: &f64| if v.is_finite() { v.clamp(0.0, 1.0) as f32 } else { 0.0 });
        Ok(channel(2).map(|blue| [channel(0).unwrap_or(0.0), channel(1).unwrap_or(0.0), blue, channel(3).unwrap_or(1.0)]))
    }

    /// `<target uri="#a">mapping</target>` or `<target>#a</target>`.
    fn target(&mut self, parts: &mut Parts) -> Result<()> {
        let uri = self.xml.attribute("uri").map(|uri| target_of(&uri));
        let named = self.xml.attribute("href").map(|href| target_of(&href));
        if uri.is_none() {
            let text = self.xml.whole_text()?;
            return self.add_target(Some(target_of(&text)).filter(|_| !text.is_empty()), Mapping::None, parts);
        }
        let mut mapping = match named {
            Some(Target::Here(id)) => Mapping::Named(id),
            _ => Mapping::None,
        };
        while self.xml.next_child()? {
            mapping = self.mapping()?;
        }
        self.add_target(uri, mapping, parts)
    }

    fn add_target(&mut self, target: Option<Target>, mapping: Mapping, parts: &mut Parts) -> Result<()> {
        match target {
            Some(Target::Here(id)) => {
                parts.targets.push((id, mapping));
                Ok(())
            }
            Some(Target::OtherDocument) => self.log.warn("appearance of another document's surfaces", "target"),
            None => Ok(()),
        }
    }

    /// CityGML 3.0: target and mapping side by side in a TextureAssociation.
    fn association(&mut self, parts: &mut Parts) -> Result<()> {
        while self.xml.next_child()? {
            let (mut target, mut mapping) = (None, Mapping::None);
            while self.xml.next_child()? {
                if self.xml.local() == "target" {
                    target = Some(target_of(&self.xml.whole_text()?));
                    continue;
                }
                while self.xml.next_child()? {
                    mapping = self.mapping()?;
                }
            }
            self.add_target(target, mapping, parts)?;
        }
        Ok(())
    }

    fn mapping(&mut self) -> Result<Mapping> {
        let id = self.xml.attribute("id").map_or(ids::NONE, |id| id_of(&id));
        let mapping = match self.xml.local() {
            "TexCoordList" => self.tex_coord_list()?,
            "TexCoordGen" => self.tex_coord_gen()?,
            other => {
                let other = other.to_owned();
                self.log.warn("unknown texture mapping", other)?;
                self.xml.skip()?;
                Mapping::None
            }
        };
        self.into.name_mapping(id, mapping);
        Ok(mapping)
    }

    fn tex_coord_list(&mut self) -> Result<Mapping> {
        let first = self.into.rings.len();
        // In CityGML 3.0 the rings stand in elements of their own, in the same order.
        let mut named_after = first;
        while self.xml.next_child()? {
            if self.xml.local() == "ring" {
                let ring = self.xml.whole_text()?;
                if let (Target::Here(id), Some(entry)) = (target_of(&ring), self.into.rings.get_mut(named_after)) {
                    entry.ring = id;
                }
                named_after += 1;
                continue;
            }
            let ring = match self.xml.attribute("ring").map(|ring| target_of(&ring)) {
                Some(Target::Here(id)) => id,
                _ => ids::NONE,
            };
            self.tex_coords(ring)?;
        }
        Ok(self.into.close_rings(first))
    }

    fn tex_coords(&mut self, ring: Id) -> Result<()> {
        self.text.clear();
        self.xml.append_text(self.text)?;
        self.values.clear();
        let start = self.into.uvs.len() as u32;
        if parse_list(self.text, self.values).is_none() || !self.values.len().is_multiple_of(2) {
            return self.log.warn("texture coordinates that cannot be read", self.text.chars().take(40).collect::<String>());
        }
        self.into.uvs.extend(self.values.as_chunks::<2>().0.iter().map(|uv| uv.map(|v| v as f32)));
        self.into.rings.push(RingUvs { ring, start, count: self.into.uvs.len() as u32 - start });
        Ok(())
    }

    fn tex_coord_gen(&mut self) -> Result<Mapping> {
        let mut mapping = Mapping::None;
        while self.xml.next_child()? {
            let matrix = self.numbers()?.and_then(|v| <[f64; 12]>::try_from(v).ok());
            match matrix {
                Some(matrix) => mapping = self.into.add_matrix(matrix),
                None => self.log.warn("worldToTexture matrix that cannot be read", "TexCoordGen")?,
            }
        }
        Ok(mapping)
    }
}

fn local_name(look: &Look) -> String {
    match look {
        Look::Texture { image, .. } => image.clone(),
        Look::Color(_) | Look::Nothing => "X3DMaterial".into(),
    }
}

fn look(local: &str, parts: Parts) -> Look {
    let placed = match (local, parts.reference, parts.orientation) {
        ("GeoreferencedTexture", Some(reference), Some(orientation)) => match Georeference::new(reference, orientation) {
            Some(world) => Placement::World(world),
            None => Placement::WorldFile,
        },
        ("GeoreferencedTexture", ..) => Placement::WorldFile,
        _ => Placement::ByTarget,
    };
    match (local, parts.image) {
        ("X3DMaterial", _) => {
            let [r, g, b, _] = parts.diffuse.unwrap_or([DEFAULT_DIFFUSE[0], DEFAULT_DIFFUSE[1], DEFAULT_DIFFUSE[2], 1.0]);
            let opacity = if parts.transparency.is_finite() { 1.0 - parts.transparency.clamp(0.0, 1.0) } else { 1.0 };
            Look::Color([r, g, b, opacity])
        }
        ("ParameterizedTexture" | "GeoreferencedTexture", Some(image)) => {
            Look::Texture { image, wrap: parts.wrap.unwrap_or_default(), border: parts.border.unwrap_or([0.0; 4]), placed }
        }
        _ => Look::Nothing,
    }
}
