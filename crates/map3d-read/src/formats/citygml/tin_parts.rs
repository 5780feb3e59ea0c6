//! The control points, break lines and stop lines of a `gml:Tin`, as read and as prepared for its triangulation.

use map3d_base::Vec3;

use super::positions::PositionsRead;
use crate::city_model::crs_table::TOO_MANY;
use crate::triangulation::tin::{TinError, TinSource};

/// What a Tin says besides its triangles, in source coordinates.
#[derive(Default)]
pub struct TinParts {
    pub control_points: Vec<Vec3>,
    pub break_lines: Vec<Vec<Vec3>>,
    pub stop_lines: Vec<Vec<Vec3>>,
    pub max_length: Option<f64>,
    pub read: PositionsRead,
}

impl TinParts {
    pub fn byte_count(&self) -> u64 {
        let lines = || self.break_lines.iter().chain(&self.stop_lines);
        let points = self.control_points.len() + lines().map(Vec::len).sum::<usize>();
        (points * size_of::<Vec3>() + lines().count() * size_of::<Vec<Vec3>>()) as u64
    }

    /// Returns why no triangulation is tried.
    pub fn fault(&self) -> Option<TinError> {
        match self.read {
            PositionsRead { valid: false, .. } => Some(TinError::Unreadable),
            PositionsRead { is_mixed: true, .. } => Some(TinError::MixedCrs),
            PositionsRead { crs: Some(TOO_MANY), .. } => Some(TinError::TooManyCrs),
            _ if self.control_points.is_empty() => Some(TinError::TooFewPoints),
            _ => None,
        }
    }
}

/// Control points and vertices of break lines, in source coordinates and in metres from the first.
pub struct PreparedTin {
    pub points: Vec<Vec3>,
    pub source: TinSource,
    /// Points left out.
    pub not_finite: u64,
}

impl PreparedTin {
    pub fn new(tin: &TinParts, scale: Vec3) -> Self {
        let mut prepared = Self { points: Vec::new(), source: TinSource { max_length: tin.max_length, ..TinSource::default() }, not_finite: 0 };
        tin.control_points.iter().for_each(|point| _ = prepared.add_point(*point));
        for line in &tin.break_lines {
            let numbers: Vec<Option<u32>> = line.iter().map(|point| prepared.add_point(*point)).collect();
            let edges = numbers.windows(2).filter_map(|pair| Some([pair[0]?, pair[1]?]));
            prepared.source.break_edges.extend(edges);
        }
        let origin = prepared.points.first().copied().unwrap_or_default();
        let local = |p: &Vec3| std::array::from_fn(|k| (p[k] - origin[k]) * scale[k]);
        prepared.source.points = prepared.points.iter().map(local).collect();
        for line in &tin.stop_lines {
            prepared.not_finite += line.iter().filter(|p| !is_finite(p)).count() as u64;
            let parts = line.split(|p| !is_finite(p)).map(|part| part.iter().map(local).collect());
            prepared.source.stop_lines.extend(parts);
        }
        prepared
    }

    /// Returns the number of the point; `None` if it is left out.
    fn add_point(&mut self, point: Vec3) -> Option<u32> {
        if !is_finite(&point) {
            self.not_finite += 1;
            return None;
        }
        self.points.push(point);
        Some(self.points.len() as u32 - 1)
    }
}

fn is_finite(point: &Vec3) -> bool {
    point.iter().all(|v| v.is_finite())
}
