//! Appearances as parsed: surface data and the ids that they target. Stored compactly, because one file may texture tens of millions of rings.

use std::ops::Range;

use map3d_base::Vec3;
use map3d_base::asset::Wrap;

use super::crs_table::HorizontalKey;
use super::geo_transform::GeoTransform;
use super::ids::{self, Id, IdMap};
use super::theme_selection::ThemeSelection;
use crate::document::transparency::TransparencyCounts;

/// The type of a surface data element and its properties.
#[derive(Clone, Debug, PartialEq)]
pub enum SurfaceDataKind {
    /// `color`: sRGB; `transparency`: 0 (opaque) to 1 as written.
    X3DMaterial {
        color: [f32; 3],
        transparency: Option<f32>,
    },
    Texture(TextureProperties),
    Unsupported,
}

/// Properties of a ParameterizedTexture or GeoreferencedTexture.
#[derive(Clone, Debug, PartialEq)]
pub struct TextureProperties {
    pub image: String,
    pub wrap: Wrap,
    /// sRGB and opacity.
    pub border: [f32; 4],
    pub placement: TexturePlacement,
    /// Name of the coordinate system of the reference point.
    pub crs_name: Option<String>,
}

/// The source of a texture's coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TexturePlacement {
    /// Each target has a parameterization.
    Parameterized,
    Georeferenced(GeoTransform),
    /// A world file next to the image.
    WorldFile,
}

impl SurfaceDataKind {
    /// Describes surface data in the report: the image of a texture, else the type.
    pub fn describe(&self) -> String {
        match self {
            Self::Texture(texture) => texture.image.clone(),
            Self::X3DMaterial { .. } | Self::Unsupported => "X3DMaterial".into(),
        }
    }
}

#[derive(Clone, Debug)]
pub struct SurfaceData {
    pub kind: SurfaceDataKind,
    pub is_front: bool,
    /// Belongs to an appearance of the selected theme.
    pub in_theme: bool,
    pub resolution: Resolution,
}

/// Surface data are resolved when they are first used.
#[derive(Clone, Copy, Debug, Default)]
pub enum Resolution {
    #[default]
    Unresolved,
    Unusable,
    Resolved(ResolvedSurfaceData),
}

/// Surface data whose material is in the material table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResolvedSurfaceData {
    pub material: ResolvedMaterial,
    /// Set for georeferenced textures.
    pub geo_transform: Option<GeoTransform>,
    /// Coordinate system of that transformation; none if it is that of the surfaces.
    pub crs: Option<HorizontalKey>,
    /// Width and height of the image.
    pub size_px: [u32; 2],
}

/// An entry of the material table and its properties that matter for triangles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResolvedMaterial {
    pub index: u32,
    pub wrap: Wrap,
    pub textured: bool,
    /// Fully transparent.
    pub invisible: bool,
}

/// How texture coordinates are assigned to a target (`TextureParameterization`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Parameterization {
    None,
    /// Index into `matrices`.
    TexCoordGen(u32),
    TexCoordList(TexCoordRange),
    /// The list is for this polygon alone, which has one ring: of a single ring in the list, the name does not matter.
    OwnTexCoordList(TexCoordRange),
    /// A parameterization defined elsewhere in the document.
    XLink(Id),
}

/// A range of `rings`, sorted by id.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TexCoordRange {
    first: u32,
    count: u32,
}

/// Links a target to surface data.
#[derive(Clone, Copy, Debug)]
pub struct TargetBinding {
    pub surface_data: u32,
    pub parameterization: Parameterization,
    /// Next binding of the same target.
    next: u32,
}

/// First and last binding of a target.
#[derive(Clone, Copy)]
struct BindingList {
    first: u32,
    last: u32,
    /// The document has the target, or it is looked for elsewhere.
    is_found: bool,
}

/// Texture coordinates of a ring: a range of `uvs`.
#[derive(Clone, Copy, Debug)]
pub struct RingTexCoords {
    pub ring: Id,
    pub start: u32,
    pub count: u32,
}

/// An appearance whose theme may become the selected one.
pub struct PendingAppearance {
    pub theme: String,
    pub surface_data: Range<usize>,
    pub xlinks: Vec<Id>,
}

const NO_BINDING: u32 = u32::MAX;

#[derive(Default)]
pub struct Appearances {
    pub surface_data: Vec<SurfaceData>,
    /// Some surface data are for back sides.
    pub has_backs: bool,
    surface_data_by_id: IdMap<u32>,
    /// Surface data that appearances of the selected theme refer to by XLink.
    pub theme_xlinks: Vec<Id>,
    /// Appearances read before the theme was chosen.
    pub pending: Vec<PendingAppearance>,
    bindings: Vec<TargetBinding>,
    targets: IdMap<BindingList>,
    pub rings: Vec<RingTexCoords>,
    pub uvs: Vec<[f32; 2]>,
    matrices: Vec<[f64; 12]>,
    parameterizations_by_id: IdMap<Parameterization>,
}

impl Appearances {
    pub fn clear(&mut self) {
        *self = Self::default();
    }

    pub fn is_empty(&self) -> bool {
        self.bindings.is_empty()
    }

    /// Returns the memory in use, approximately.
    pub fn byte_count(&self) -> u64 {
        let lists = size_of_val(&*self.surface_data) + size_of_val(&*self.bindings) + size_of_val(&*self.rings) + size_of_val(&*self.uvs);
        (lists + self.targets.len() * 24 + self.matrices.len() * 96 + self.parameterizations_by_id.len() * 32) as u64
    }

    pub fn add_surface_data(&mut self, id: Id, surface_data: SurfaceData) -> u32 {
        let number = self.surface_data.len() as u32;
        self.has_backs |= !surface_data.is_front;
        self.surface_data.push(surface_data);
        if id != ids::NONE {
            self.surface_data_by_id.entry(id).or_insert(number);
        }
        number
    }

    /// Appends a binding to a target's list.
    pub fn bind(&mut self, target: Id, surface_data: u32, parameterization: Parameterization) {
        let number = self.bindings.len() as u32;
        self.bindings.push(TargetBinding { surface_data, parameterization, next: NO_BINDING });
        let list = self.targets.entry(target).or_insert(BindingList { first: number, last: number, is_found: false });
        if list.last != number {
            self.bindings[list.last as usize].next = number;
            list.last = number;
        }
    }

    pub fn has_target(&self, id: Id) -> bool {
        self.targets.contains_key(&id)
    }

    /// Notes that the document has a target, or that it is looked for elsewhere.
    pub fn mark_found(&mut self, target: Id) {
        if let Some(list) = self.targets.get_mut(&target) {
            list.is_found = true;
        }
    }

    /// Returns the surface data of each target of the selected theme that was not found, sorted by their order in the document.
    pub fn surface_data_without_target(&self) -> Vec<&SurfaceData> {
        let missing = self.targets.iter().filter(|(_, list)| !list.is_found);
        let mut numbers: Vec<u32> = missing.filter_map(|(id, _)| self.theme_bindings(*id).next()).map(|binding| binding.surface_data).collect();
        numbers.sort_unstable();
        numbers.into_iter().map(|number| &self.surface_data[number as usize]).collect()
    }

    /// Makes a parameterization available to XLinks; the first with an id wins.
    pub fn register_parameterization(&mut self, id: Id, parameterization: Parameterization) {
        if id != ids::NONE {
            self.parameterizations_by_id.entry(id).or_insert(parameterization);
        }
    }

    pub fn add_matrix(&mut self, matrix: [f64; 12]) -> Parameterization {
        self.matrices.push(matrix);
        Parameterization::TexCoordGen(self.matrices.len() as u32 - 1)
    }

    /// Completes a TexCoordList with the rings added since `first`.
    pub fn finish_tex_coord_list(&mut self, first: usize) -> Parameterization {
        self.rings[first..].sort_by_key(|r| r.ring);
        Parameterization::TexCoordList(TexCoordRange { first: first as u32, count: (self.rings.len() - first) as u32 })
    }

    /// Marks the surface data that appearances of the selected theme refer to by XLink.
    pub fn resolve_theme_xlinks(&mut self) {
        for id in std::mem::take(&mut self.theme_xlinks) {
            if let Some(number) = self.surface_data_by_id.get(&id) {
                self.surface_data[*number as usize].in_theme = true;
            }
        }
    }

    /// Counts the materials by their transparency.
    pub fn count_transparency(&self, counts: &mut TransparencyCounts) {
        for data in &self.surface_data {
            if let SurfaceDataKind::X3DMaterial { transparency, .. } = data.kind {
                counts.add(transparency);
            }
        }
    }

    /// Counts the textures and materials of each pending appearance for its theme.
    pub fn count_themes(&self, theme: &mut ThemeSelection) {
        for pending in &self.pending {
            theme.register(&pending.theme);
            let linked = pending.xlinks.iter().filter_map(|id| self.surface_data_by_id.get(id)).map(|number| &self.surface_data[*number as usize]);
            for data in self.surface_data[pending.surface_data.clone()].iter().chain(linked) {
                match &data.kind {
                    SurfaceDataKind::Texture(texture) => theme.count_image(&texture.image),
                    SurfaceDataKind::X3DMaterial { .. } => theme.count_material(),
                    SurfaceDataKind::Unsupported => {}
                }
            }
        }
    }

    /// Marks the surface data of pending appearances of the selected theme. Returns the themes of the others.
    pub fn resolve_pending(&mut self, selected: Option<&str>) -> Vec<String> {
        let mut others = Vec::new();
        for pending in std::mem::take(&mut self.pending) {
            if selected == Some(&pending.theme) {
                self.surface_data[pending.surface_data].iter_mut().for_each(|d| d.in_theme = true);
                self.theme_xlinks.extend(pending.xlinks);
            } else {
                others.push(pending.theme);
            }
        }
        others
    }

    /// Iterates over the bindings of a target in the selected theme, in document order.
    pub fn theme_bindings(&self, target: Id) -> impl Iterator<Item = TargetBinding> + '_ {
        let first = self.targets.get(&target).map_or(NO_BINDING, |list| list.first);
        let next = move |number: &u32| Some(self.bindings.get(*number as usize)?.next);
        std::iter::successors(Some(first), next)
            .map_while(|number| self.bindings.get(number as usize).copied())
            .filter(|b| self.surface_data[b.surface_data as usize].in_theme)
    }

    /// Follows an XLink to its parameterization; returns `Parameterization::None` if it cannot be resolved.
    pub fn resolve_parameterization(&self, parameterization: Parameterization) -> Parameterization {
        match parameterization {
            Parameterization::XLink(id) => match self.parameterizations_by_id.get(&id) {
                Some(Parameterization::XLink(_)) | None => Parameterization::None,
                Some(resolved) => *resolved,
            },
            resolved => resolved,
        }
    }

    /// Returns the texture coordinates of a ring in a TexCoordList.
    pub fn find_ring_uvs(&self, range: TexCoordRange, ring: Id) -> Option<&[[f32; 2]]> {
        let rings = &self.rings[range.first as usize..(range.first + range.count) as usize];
        let at = rings.partition_point(|r| r.ring < ring);
        let found = rings.get(at).filter(|r| r.ring == ring && ring != ids::NONE)?;
        Some(&self.uvs[found.start as usize..(found.start + found.count) as usize])
    }

    /// Returns the texture coordinates of a TexCoordList with a single ring.
    pub fn find_only_ring_uvs(&self, range: TexCoordRange) -> Option<&[[f32; 2]]> {
        let [ring] = &self.rings[range.first as usize..(range.first + range.count) as usize] else { return None };
        Some(&self.uvs[ring.start as usize..(ring.start + ring.count) as usize])
    }

    /// Projects a point to (s, t) with a worldToTexture matrix.
    pub fn project(&self, matrix: u32, p: Vec3) -> [f64; 2] {
        let m = &self.matrices[matrix as usize];
        let row = |k: usize| m[4 * k] * p[0] + m[4 * k + 1] * p[1] + m[4 * k + 2] * p[2] + m[4 * k + 3];
        [row(0) / row(2), row(1) / row(2)]
    }
}
