//! Converts parsed city objects to batches, objects and instances.

use std::collections::VecDeque;

use map3d_base::asset::{Batch, Instance, Object, Rank};
use map3d_base::{Reason, Result};

use super::appearance::Appearances;
use super::city_object::{CityObject, Representation};
use super::crs_table::CrsNumber;
use super::feature_types::to_class_name;
use super::geometry_arena::{GeometryArena, NodeId};
use super::ids::{self, Id, IdSet};
use super::implicit_geometry::PrototypeSource;
use super::lifespan::VersionDate;
use super::lod_selection::{representations_at, select_lods};
use super::material_resolver::MaterialResolver;
use super::own_appearance::add_own_appearances;
use super::polygons::{CollectedPolygons, LinkedGeometry, OrientedPolygon, UnresolvedXLink, VisitState, XLinkIndex, collect_polygons};
use super::prototype_table::{PrototypePlacement, PrototypeTable, read_library_object};
use super::shared_geometry::{DeferredXLink, MissingGeometry, SharedGeometry};
use super::tessellate::{MaterialSources, Tessellator, ThematicSurface};
use crate::document::ReliefGrid;
use crate::document::asset_folder::{AssetFolder, LIBRARY_OBJECT};
use crate::document::file_head::FileHead;
use crate::document::options::ReadOptions;
use crate::document::report_builder::{LimitCheck, ReportBuilder};
use crate::document::source_format::SourceFormat;

const BATCH_TRIANGLES: usize = 1 << 14;

/// What of a document is converted, and how.
#[derive(Clone, Copy)]
pub struct Conversion {
    /// The requested level of detail; by default, the finest of each object.
    pub lod: Option<u8>,
    /// Rooms and what is in them are converted.
    pub interiors: bool,
    /// Date of the versions of features that are converted.
    pub date: VersionDate,
    /// The document's transparency is opacity.
    pub inverted: bool,
    /// Formats of the files that the document may name.
    pub formats: &'static [SourceFormat],
}

pub struct FeatureConverter {
    pub resolver: MaterialResolver,
    tessellator: Tessellator,
    /// Appearances outside city objects.
    document_appearances: Appearances,
    /// Appearances of other documents that have geometry of this one.
    other_appearances: Appearances,
    /// Ids that other city objects refer to.
    referenced_ids: IdSet,
    conversion: Conversion,
    /// Levels of detail of the document: bit n is level n.
    levels: u8,
    shared: SharedGeometry,
    pub objects: Vec<Object>,
    /// Rasters of reliefs.
    pub grids: Vec<ReliefGrid>,
    /// Coordinate systems of the instances.
    pub instance_crs: Vec<CrsNumber>,
    prototypes: PrototypeTable,
    /// Completed batches.
    pub batches: VecDeque<Batch>,
}

/// The state of one city object's conversion.
struct ConversionContext<'a> {
    city_object: &'a mut CityObject,
    xlinks: XLinkIndex,
    visits: Vec<VisitState>,
    /// For each feature that is an object or part: its index in the asset.
    object_numbers: Vec<u32>,
}

impl ConversionContext<'_> {
    /// Returns the index in the asset of the object that a feature belongs to.
    fn object_number(&self, feature: u32) -> u32 {
        self.object_numbers[self.city_object.find_object(feature) as usize]
    }
}

impl FeatureConverter {
    pub fn new(folder: AssetFolder, options: &ReadOptions, conversion: Conversion, document_appearances: Appearances, referenced_ids: IdSet) -> Self {
        Self {
            resolver: MaterialResolver::new(folder, options.clone(), conversion.inverted),
            tessellator: Tessellator::new(options.clone()),
            document_appearances,
            other_appearances: Appearances::default(),
            referenced_ids,
            conversion,
            levels: 0,
            shared: SharedGeometry::default(),
            objects: Vec::new(),
            grids: Vec::new(),
            instance_crs: Vec::new(),
            prototypes: PrototypeTable::default(),
            batches: VecDeque::new(),
        }
    }

    /// Adds the coordinate systems that are new.
    pub fn set_coordinate_systems(&mut self, names: &[Option<String>]) {
        for name in names.iter().flatten() {
            self.resolver.add_crs(name);
        }
        self.tessellator.set_coordinate_systems(names);
    }

    /// Converts a city object at its selected level of detail. Surfaces, openings and installations come before objects and parts: a polygon that
    /// both contain gets the class of its surface.
    pub fn convert(&mut self, city_object: &mut CityObject, report: &mut ReportBuilder) -> Result<()> {
        if city_object.features.is_empty() {
            return Ok(());
        }
        city_object.appearances.resolve_theme_xlinks();
        self.find_targets(city_object, report)?;
        add_own_appearances(&mut city_object.geometry, &mut city_object.appearances);
        self.leave_out_versions(city_object, report);
        city_object.extend_interiors();
        city_object.expose_shared_interiors();
        let lods = select_lods(city_object, self.conversion.lod);
        self.levels |= city_object.features.iter().flat_map(|f| &f.representations).fold(0, |levels, r| levels | 1 << r.lod);
        let object_numbers = self.add_objects(city_object, &lods);
        let xlinks = XLinkIndex::build(&city_object.geometry);
        let visits = vec![VisitState::Unvisited; city_object.geometry.nodes.len()];
        let mut context = ConversionContext { city_object, xlinks, visits, object_numbers };
        let draws_interiors = self.conversion.interiors;
        for objects in [false, true] {
            for (f, lod) in lods.iter().enumerate() {
                let feature = &context.city_object.features[f];
                if feature.is_object() != objects || feature.representations.is_empty() {
                    continue;
                }
                match *lod {
                    Some(_) if feature.is_interior && !draws_interiors => {}
                    Some(lod) => self.convert_feature(&mut context, f as u32, lod, report)?,
                    None => {}
                }
            }
        }
        if !draws_interiors {
            count_interiors(&context, &lods, report);
        }
        self.shared.copy_referenced(&context.city_object.geometry, &context.visits, &self.referenced_ids);
        self.complete_batch(BATCH_TRIANGLES);
        Ok(())
    }

    /// Leaves out features that do not exist at the date of the conversion. Their geometry stays for features that refer to it.
    fn leave_out_versions(&self, city_object: &mut CityObject, report: &mut ReportBuilder) {
        for f in 0..city_object.features.len() {
            let feature = &city_object.features[f];
            let is_within = feature.parent.is_some_and(|p| city_object.features[p as usize].is_left_out);
            let exists = feature.lifespan.exists(self.conversion.date);
            if let VersionDate::Current(day) = self.conversion.date
                && feature.lifespan.has_end()
            {
                report.set_versions_on(day.to_string());
            }
            if !exists && !is_within {
                let object = &city_object.features[city_object.find_object(f as u32) as usize];
                report.omit_one(self.conversion.date.reason(), &object.name);
            }
            if !exists || is_within {
                let feature = &mut city_object.features[f];
                feature.is_left_out = true;
                feature.representations.clear();
            }
        }
    }

    /// Notes which targets of appearances the city object has. Reports those of its own appearances that it lacks.
    fn find_targets(&mut self, city_object: &mut CityObject, report: &mut ReportBuilder) -> Result<()> {
        let CityObject { features, geometry, appearances, .. } = city_object;
        if appearances.is_empty() && self.document_appearances.is_empty() {
            return Ok(());
        }
        let ids = features.iter().map(|f| f.id).chain(geometry.nodes.iter().map(|n| n.id)).chain(geometry.rings.iter().map(|r| r.id));
        for id in ids.filter(|id| *id != ids::NONE) {
            self.document_appearances.mark_found(id);
            appearances.mark_found(id);
        }
        report_targets(appearances, report)
    }

    /// Reports the targets of appearances outside city objects that no city object has.
    pub fn report_missing_targets(&self, report: &mut ReportBuilder) -> Result<()> {
        report_targets(&self.document_appearances, report)
    }

    /// Adds the objects and parts of a city object to the asset; returns their indices by feature.
    fn add_objects(&mut self, city_object: &mut CityObject, lods: &[Option<u8>]) -> Vec<u32> {
        let mut numbers = vec![u32::MAX; city_object.features.len()];
        for f in 0..city_object.features.len() {
            let feature = &city_object.features[f];
            let parent = feature.parent.map(|p| numbers[city_object.find_object(p) as usize]);
            if !feature.is_object() || feature.is_left_out {
                continue;
            }
            numbers[f] = self.objects.len() as u32;
            let lod = find_object_lod(city_object, lods, f as u32);
            let feature = &mut city_object.features[f];
            let class = to_class_name(&feature.type_name);
            let name = if feature.name.is_empty() { format!("{class}-{}", numbers[f] + 1) } else { std::mem::take(&mut feature.name) };
            let attributes = std::mem::take(&mut feature.attributes);
            self.objects.push(Object { name, class, parent, lod, attributes, without_height: false });
        }
        numbers
    }

    fn convert_feature(&mut self, context: &mut ConversionContext, f: u32, lod: u8, report: &mut ReportBuilder) -> Result<()> {
        let representations: Vec<Representation> = representations_at(&context.city_object.features[f as usize].representations, lod).collect();
        for representation in representations {
            match representation {
                Representation::Surfaces(node) | Representation::RoofEdge(node) => {
                    let collected = collect_polygons(&context.city_object.geometry, &mut context.visits, node, false);
                    report.skip_many(Reason::GeometryRefersToItself, collected.cycles, || "a cycle of references".to_owned())?;
                    self.tessellate_feature(context, f, &collected.polygons, report)?;
                    self.defer_xlinks(context, f, &collected.unresolved);
                }
                Representation::Implicit(index) => self.convert_implicit_geometry(context, f, index, report)?,
                Representation::Raster(index) => self.add_grid(context, index),
            }
        }
        Ok(())
    }

    /// Returns the requested level of detail and those that the document has, if it has others only.
    pub fn other_lods(&self) -> Option<String> {
        let requested = self.conversion.lod.filter(|lod| self.levels != 0 && self.levels >> lod & 1 == 0)?;
        let levels: Vec<String> = (0..8).filter(|lod| self.levels >> lod & 1 == 1).map(|lod: u8| lod.to_string()).collect();
        Some(format!("{requested}; the file has {}", levels.join(", ")))
    }

    /// Adds the raster of a relief, up to a limit that no document reaches in earnest.
    fn add_grid(&mut self, context: &ConversionContext, index: u32) {
        const MAX_GRIDS: usize = 10_000;
        if self.grids.len() < MAX_GRIDS {
            self.grids.push(context.city_object.grids[index as usize].clone());
        }
    }

    fn tessellate_feature(
        &mut self,
        context: &mut ConversionContext,
        f: u32,
        polygons: &[OrientedPolygon],
        report: &mut ReportBuilder,
    ) -> Result<()> {
        let object = context.object_number(f);
        let object_feature = context.city_object.find_object(f);
        let feature_ids: Vec<Id> = context.city_object.with_ancestors(f).map(|a| context.city_object.features[a as usize].id).collect();
        let CityObject { features, geometry, appearances, .. } = &mut *context.city_object;
        let surface = ThematicSurface {
            object,
            rank: features[f as usize].rank,
            type_names: [&features[f as usize].type_name, &features[object_feature as usize].type_name],
            feature_ids: &feature_ids,
            object_name: &self.objects[object as usize].name,
        };
        let mut sources = MaterialSources { resolver: &mut self.resolver, appearances: [appearances, &mut self.document_appearances] };
        let geometry = LinkedGeometry { geometry, xlinks: &context.xlinks };
        polygons.iter().try_for_each(|polygon| self.tessellator.add_polygon(geometry, *polygon, &surface, &mut sources, report))
    }

    /// Keeps XLinks to geometry of other city objects until the end of the document.
    fn defer_xlinks(&mut self, context: &ConversionContext, f: u32, unresolved: &[UnresolvedXLink]) {
        let object = context.object_number(f);
        let rank = context.city_object.features[f as usize].rank;
        let defer = |link: &UnresolvedXLink| DeferredXLink { target: link.target, reversed: link.reversed, object, rank };
        self.shared.deferred.extend(unresolved.iter().map(defer));
    }

    /// Where geometry of other documents is to be added, and the appearances of these documents.
    pub fn other_geometry(&mut self) -> (&mut GeometryArena, &mut Appearances) {
        (&mut self.shared.geometry, &mut self.other_appearances)
    }

    /// After the last city object: converts geometry that other city objects refer to and that its owner did not convert, and that of other documents.
    pub fn convert_deferred(&mut self, missing: &MissingGeometry, report: &mut ReportBuilder) -> Result<()> {
        self.shared.add_unvisited();
        for link in std::mem::take(&mut self.shared.deferred) {
            let Some(node) = self.shared.geometry.by_id.get(&link.target).copied() else {
                self.report_unresolved(link.target, link.object, missing, report)?;
                continue;
            };
            let collected = collect_polygons(&self.shared.geometry, &mut self.shared.visits, node, link.reversed);
            report.skip_many(Reason::GeometryRefersToItself, collected.cycles, || self.objects[link.object as usize].name.clone())?;
            for unresolved in &collected.unresolved {
                self.report_unresolved(unresolved.target, link.object, missing, report)?;
            }
            self.tessellate_shared(&collected.polygons, link.object, link.rank, report)?;
        }
        self.complete_batch(1);
        for object in self.tessellator.objects_without_height() {
            self.objects[object].without_height = true;
        }
        Ok(())
    }

    fn report_unresolved(&self, target: Id, object: u32, missing: &MissingGeometry, report: &mut ReportBuilder) -> Result<()> {
        match missing.get(&target) {
            Some((reason, href)) => report.warn(*reason, href),
            None => report.warn(Reason::ReferenceUnresolved, self.objects[object as usize].name.as_str()),
        }
    }

    fn tessellate_shared(&mut self, polygons: &[OrientedPolygon], object: u32, rank: Rank, report: &mut ReportBuilder) -> Result<()> {
        let object_name = &self.objects[object as usize].name;
        let surface = ThematicSurface { object, rank, type_names: ["", ""], feature_ids: &[ids::NONE], object_name };
        let appearances = [&mut self.document_appearances, &mut self.other_appearances];
        let mut sources = MaterialSources { resolver: &mut self.resolver, appearances };
        let geometry = LinkedGeometry { geometry: &self.shared.geometry, xlinks: &XLinkIndex::default() };
        polygons.iter().try_for_each(|polygon| self.tessellator.add_polygon(geometry, *polygon, &surface, &mut sources, report))
    }

    /// Queues the batches that have at least `min_triangles`, and at least one.
    fn complete_batch(&mut self, min_triangles: usize) {
        self.batches.extend(self.tessellator.take(min_triangles));
    }

    /// Adds a placement; converts its prototype if that is new and available now.
    fn convert_implicit_geometry(&mut self, context: &mut ConversionContext, f: u32, index: u32, report: &mut ReportBuilder) -> Result<()> {
        let implicit = context.city_object.implicit_geometries[index as usize].clone();
        let object = context.object_number(f);
        let key = self.prototypes.build_key(&implicit, &context.city_object.geometry);
        let instance = Instance { prototype: 0, object, transform: implicit.transform };
        self.prototypes.placements.push(PrototypePlacement { key, instance, crs: implicit.crs });
        let (got, value) = (self.prototypes.placements.len() as u64, self.resolver.options.max_instances);
        report.check_limit(LimitCheck { what: "number of instances", got, limit: "max_instances", value })?;
        if self.prototypes.find(key).is_some() {
            return Ok(());
        }
        match &implicit.prototype {
            PrototypeSource::Library(name) => self.convert_library_object(name, object, key, report),
            PrototypeSource::Geometry(node) => match context.city_object.geometry.resolve_xlink(*node) {
                Some(node) => self.convert_prototype(context, f, key, node, report),
                None => Ok(()),
            },
        }
    }

    fn convert_prototype(&mut self, context: &mut ConversionContext, f: u32, key: Id, node: NodeId, report: &mut ReportBuilder) -> Result<()> {
        let geometry = &context.city_object.geometry;
        let CollectedPolygons { polygons, .. } = collect_polygons(geometry, &mut vec![VisitState::Unvisited; geometry.nodes.len()], node, false);
        self.complete_batch(1);
        self.tessellator.begin_prototype();
        self.tessellate_feature(context, f, &polygons, report)?;
        let prototype = self.tessellator.take_prototype();
        self.add_prototype(key, vec![prototype]);
        Ok(())
    }

    fn convert_shared_prototype(&mut self, key: Id, node: NodeId, object: u32, report: &mut ReportBuilder) -> Result<()> {
        let geometry = &self.shared.geometry;
        let CollectedPolygons { polygons, .. } = collect_polygons(geometry, &mut vec![VisitState::Unvisited; geometry.nodes.len()], node, false);
        self.complete_batch(1);
        self.tessellator.begin_prototype();
        self.tessellate_shared(&polygons, object, Rank::Other, report)?;
        let prototype = self.tessellator.take_prototype();
        self.add_prototype(key, vec![prototype]);
        Ok(())
    }

    /// Converts a prototype in its own file.
    fn convert_library_object(&mut self, name: &str, object: u32, key: Id, report: &mut ReportBuilder) -> Result<()> {
        let file = match self.resolver.folder.find(name) {
            Ok(file) => file,
            Err(error) => return report.warn(error.reason(LIBRARY_OBJECT), name),
        };
        let head = FileHead::read(&file.path);
        let has_format = |format: &&SourceFormat| format.is_library_object && head.as_ref().is_ok_and(|head| (format.detect)(head));
        let Some(format) = self.conversion.formats.iter().find(has_format) else {
            return report.warn(Reason::LibraryObjectFormatNotRead, name);
        };
        let mut document = (format.open)(&file.path, &self.resolver.options.without_format(), self.conversion.formats)?;
        let batches = read_library_object(document.as_mut(), object, &mut self.resolver)?;
        self.add_prototype(key, batches);
        Ok(())
    }

    fn add_prototype(&mut self, key: Id, mut batches: Vec<Batch>) {
        self.prototypes.register(key, &mut batches);
        self.batches.extend(batches.into_iter().filter(|b| !b.triangles.is_empty()));
    }

    /// After the last city object: converts prototypes that are defined in other city objects, then returns the instances with their prototypes'
    /// numbers.
    pub fn finish_instances(&mut self, missing: &MissingGeometry, report: &mut ReportBuilder) -> Result<Vec<Instance>> {
        let placements = std::mem::take(&mut self.prototypes.placements);
        for PrototypePlacement { key, instance, .. } in &placements {
            let node = self.shared.geometry.by_id.get(key).copied();
            if let (Some(node), None) = (node, self.prototypes.find(*key)) {
                self.convert_shared_prototype(*key, node, instance.object, report)?;
            }
        }
        let mut instances = Vec::with_capacity(placements.len());
        for PrototypePlacement { key, instance, crs } in placements {
            match self.prototypes.find(key) {
                Some(prototype) => {
                    instances.push(Instance { prototype, ..instance });
                    self.instance_crs.push(crs);
                }
                None => {
                    if let Some((reason, href)) = missing.get(&key) {
                        report.warn(*reason, href)?;
                    }
                    report.skip(Reason::ImplicitGeometryWithoutPrototype, || self.objects[instance.object as usize].name.clone())?;
                }
            }
        }
        Ok(instances)
    }
}

fn report_targets(appearances: &Appearances, report: &mut ReportBuilder) -> Result<()> {
    let missing = appearances.surface_data_without_target();
    missing.into_iter().try_for_each(|data| report.warn(Reason::AppearanceTargetMissing, data.kind.describe()))
}

/// Counts the polygons of interiors that are not converted as part of a feature outside.
fn count_interiors(context: &ConversionContext, lods: &[Option<u8>], report: &mut ReportBuilder) {
    let CityObject { features, geometry, implicit_geometries, .. } = &*context.city_object;
    if !features.iter().any(|feature| feature.is_interior) {
        return;
    }
    let mut visits = context.visits.clone();
    let mut count = 0;
    for (feature, lod) in features.iter().zip(lods).filter(|(feature, _)| feature.is_interior) {
        for representation in lod.iter().flat_map(|lod| representations_at(&feature.representations, *lod)) {
            let node = match representation {
                Representation::Surfaces(node) | Representation::RoofEdge(node) => node,
                Representation::Implicit(index) => match implicit_geometries[index as usize].prototype {
                    PrototypeSource::Geometry(node) => node,
                    PrototypeSource::Library(_) => continue,
                },
                Representation::Raster(_) => continue,
            };
            count += collect_polygons(geometry, &mut visits, node, false).polygons.len() as u64;
        }
    }
    report.omit(Reason::PolygonOfInterior, count);
}

/// Returns the finest level of detail at which an object's features are converted.
fn find_object_lod(city_object: &CityObject, lods: &[Option<u8>], object: u32) -> Option<String> {
    let feature_lod = |f: u32| {
        let feature = &city_object.features[f as usize];
        let lod = lods[f as usize].filter(|l| feature.representations.iter().any(|r| r.lod == *l));
        lod.filter(|_| !feature.is_interior && city_object.find_object(f) == object)
    };
    let finest = (object..city_object.features.len() as u32).filter_map(feature_lod).max();
    finest.map(|lod| lod.to_string())
}
