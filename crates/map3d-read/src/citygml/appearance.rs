//! Appearances as parsed: which surface data bear on which ids. Compact, for one file may texture tens of millions of rings.

use map3d_base::Vec3;
use map3d_base::asset::Wrap;

use super::georeference::Georeference;
use super::ids::{self, Id, IdMap};

/// A texture or a colour.
#[derive(Clone, Debug, PartialEq)]
pub enum Look {
    /// sRGB and opacity.
    Color([f32; 4]),
    Texture {
        image: String,
        wrap: Wrap,
        border: [f32; 4],
        placed: Placement,
    },
    /// Neither; counted when it was parsed.
    Nothing,
}

/// How a texture finds its coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Placement {
    /// Each target brings its own.
    ByTarget,
    World(Georeference),
    /// By a world file beside the image.
    WorldFile,
}

#[derive(Clone, Debug)]
pub struct SurfaceData {
    pub look: Look,
    pub front: bool,
    pub in_theme: bool,
    /// Made ready by the painter when first used; `Some(None)`: unusable.
    pub ready: Option<Option<Ready>>,
}

/// A look as the table of materials has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ready {
    pub material: u32,
    pub wrap: Wrap,
    pub textured: bool,
    pub invisible: bool,
    pub world: Option<Georeference>,
    pub size_px: [u32; 2],
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mapping {
    None,
    /// Index into `matrices`.
    Matrix(u32),
    /// Range of `rings`, sorted by id.
    Rings {
        first: u32,
        count: u32,
    },
    /// A mapping that stands elsewhere.
    Named(Id),
}

#[derive(Clone, Copy, Debug)]
pub struct Binding {
    pub data: u32,
    pub mapping: Mapping,
    next: u32,
}

#[derive(Clone, Copy, Debug)]
pub struct RingUvs {
    pub ring: Id,
    pub start: u32,
    pub count: u32,
}

const LAST: u32 = u32::MAX;

#[derive(Default)]
pub struct Appearances {
    pub data: Vec<SurfaceData>,
    pub data_by_id: IdMap<u32>,
    /// Surface data that an appearance of the theme refers to.
    pub linked: Vec<Id>,
    bindings: Vec<Binding>,
    /// First and last binding of a target.
    targets: IdMap<(u32, u32)>,
    pub rings: Vec<RingUvs>,
    pub uvs: Vec<[f32; 2]>,
    matrices: Vec<[f64; 12]>,
    named: IdMap<Mapping>,
}

impl Appearances {
    pub fn clear(&mut self) {
        *self = Self::default();
    }

    pub fn is_empty(&self) -> bool {
        self.bindings.is_empty()
    }

    pub fn bytes(&self) -> u64 {
        let fixed = size_of_val(&*self.data) + size_of_val(&*self.bindings) + size_of_val(&*self.rings) + size_of_val(&*self.uvs);
        (fixed + self.targets.len() * 24 + self.matrices.len() * 96 + self.named.len() * 32) as u64
    }

    pub fn add_data(&mut self, id: Id, data: SurfaceData) -> u32 {
        let number = self.data.len() as u32;
        self.data.push(data);
        if id != ids::NONE {
            self.data_by_id.entry(id).or_insert(number);
        }
        number
    }

    pub fn bind(&mut self, target: Id, data: u32, mapping: Mapping) {
        let number = self.bindings.len() as u32;
        self.bindings.push(Binding { data, mapping, next: LAST });
        let ends = self.targets.entry(target).or_insert((number, number));
        if ends.1 != number {
            self.bindings[ends.1 as usize].next = number;
            ends.1 = number;
        }
    }

    pub fn name_mapping(&mut self, id: Id, mapping: Mapping) {
        if id != ids::NONE {
            self.named.entry(id).or_insert(mapping);
        }
    }

    pub fn add_matrix(&mut self, matrix: [f64; 12]) -> Mapping {
        self.matrices.push(matrix);
        Mapping::Matrix(self.matrices.len() as u32 - 1)
    }

    /// Makes the rings since `first` a mapping.
    pub fn close_rings(&mut self, first: usize) -> Mapping {
        self.rings[first..].sort_by_key(|r| r.ring);
        Mapping::Rings { first: first as u32, count: (self.rings.len() - first) as u32 }
    }

    /// Marks what appearances of the theme refer to.
    pub fn resolve_links(&mut self) {
        for id in std::mem::take(&mut self.linked) {
            if let Some(number) = self.data_by_id.get(&id) {
                self.data[*number as usize].in_theme = true;
            }
        }
    }

    /// Bindings of a target in the order of the document, of the chosen theme.
    pub fn of_target(&self, target: Id) -> impl Iterator<Item = Binding> + '_ {
        let first = self.targets.get(&target).map_or(LAST, |ends| ends.0);
        let follow = move |at: &u32| Some(self.bindings.get(*at as usize)?.next);
        std::iter::successors(Some(first), follow)
            .map_while(|at| self.bindings.get(at as usize).copied())
            .filter(|b| self.data[b.data as usize].in_theme)
    }

    /// A mapping with its names followed; `Mapping::None` when a name leads nowhere.
    pub fn mapping(&self, mapping: Mapping) -> Mapping {
        match mapping {
            Mapping::Named(id) => match self.named.get(&id) {
                Some(Mapping::Named(_)) | None => Mapping::None,
                Some(found) => *found,
            },
            found => found,
        }
    }

    /// Texture coordinates that a mapping has for a ring.
    pub fn uvs_of_ring(&self, first: u32, count: u32, ring: Id) -> Option<&[[f32; 2]]> {
        let rings = &self.rings[first as usize..(first + count) as usize];
        let at = rings.partition_point(|r| r.ring < ring);
        let found = rings.get(at).filter(|r| r.ring == ring && ring != ids::NONE)?;
        Some(&self.uvs[found.start as usize..(found.start + found.count) as usize])
    }

    /// (s, t) of a point by a worldToTexture matrix.
    pub fn project(&self, matrix: u32, p: Vec3) -> [f64; 2] {
        let m = &self.matrices[matrix as usize];
        let row = |k: usize| m[4 * k] * p[0] + m[4 * k + 1] * p[1] + m[4 * k + 2] * p[2] + m[4 * k + 3];
        [row(0) / row(2), row(1) / row(2)]
    }
}
