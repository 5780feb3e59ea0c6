//! `instances.m3i`: placements of prototypes (spec/scene.md).

use std::path::Path;

use map3d_base::file::{self, HEADER_BYTES, header_start};
use map3d_base::{Box3, Error, Result, Vec3};

use crate::records::{INSTANCES_MAGIC, InstanceRecord, VERSION};

/// The whole file: header and records, which the caller has sorted.
pub fn encode(records: &[InstanceRecord]) -> Vec<u8> {
    let body: &[u8] = bytemuck::cast_slice(records);
    let mut out = Vec::with_capacity(HEADER_BYTES + body.len());
    out.extend_from_slice(&header_start(INSTANCES_MAGIC, VERSION, file::checksum(body)));
    out.extend_from_slice(&(records.len() as u64).to_le_bytes());
    out.resize(HEADER_BYTES, 0);
    out.extend_from_slice(body);
    out
}

/// Reads and checks all records; `prototypes` is the number of prototypes that they may name.
pub fn read(path: &Path, prototypes: usize) -> Result<Vec<InstanceRecord>> {
    let map = file::map(path)?;
    file::check_header(path, &map, INSTANCES_MAGIC, VERSION, true)?;
    let count = u64::from_le_bytes(map[16..24].try_into().expect("8 bytes"));
    let records: &[InstanceRecord] = file::section(path, &map, HEADER_BYTES, usize::try_from(count).unwrap_or(usize::MAX))?;
    let sound = |r: &InstanceRecord| (r.prototype as usize) < prototypes && r.object_id != 0 && r.transform.iter().all(|v| v.is_finite());
    match records.iter().position(|r| !sound(r)) {
        Some(i) => Err(Error::format(path, format!("instance {i}: prototype, object id or transform out of range"))),
        None => Ok(records.to_vec()),
    }
}

/// A point of the prototype's frame in local coordinates.
#[inline(always)]
pub fn place(transform: &[f64; 12], p: Vec3) -> Vec3 {
    let row = |k: usize| transform[k] * p[0] + transform[k + 1] * p[1] + transform[k + 2] * p[2] + transform[k + 3];
    [row(0), row(4), row(8)]
}

/// Local box of a placed box, with room for rounding.
pub fn placed_box(transform: &[f64; 12], bounds: &Box3) -> Box3 {
    let mut out = Box3::EMPTY;
    for corner in 0..8 {
        let pick = |k: usize| if corner >> k & 1 == 0 { bounds.lo[k] } else { bounds.hi[k] };
        out.add_point(place(transform, [pick(0), pick(1), pick(2)]));
    }
    for k in 0..3 {
        let room = (out.lo[k].abs() + out.hi[k].abs()) * 1e-12 + 1e-9;
        out.lo[k] -= room;
        out.hi[k] += room;
    }
    out
}
