//! Groups of content that lie far from each other, and the extent of those that stay.

use std::collections::BTreeMap;
use std::path::Path;

use map3d_base::kept_space::{KeptSpace, Region, diagonal_m, gap_m};
use map3d_base::{Box3, Error, Result, Vec3};
use serde::Serialize;

use super::cells::{CellKey, ContentCell, ContentCells};
use super::measure::read_or_measure;

/// Groups closer than this are one; few triangles of few objects form a group of their own from the second distance on.
const APART_M: f64 = 10_000.0;
const FEW_APART_M: f64 = 2_000.0;
/// More than any terrain rises without anything in between.
const APART_IN_HEIGHT_M: f64 = 3_000.0;
/// Groups are one if the gap between them is less than this many times the diagonal of their largest piece without gaps, but no more than
/// `MOST_APART_M`, or this many usual triangles. Towns do not join by way of others.
const APART_DIAGONALS: f64 = 3.0;
const MOST_APART_M: f64 = 50_000.0;
const APART_SIZES: f64 = 4.0;
/// A triangle of more than this many usual ones is large: it belongs to a group if it lies in its reach.
const LARGE_SIZES: f64 = 16.0;
const LARGE_M: f64 = 2048.0;
/// Few: one of this many triangles, and of this many objects, at most.
const FEW: u64 = 200;
/// The grid becomes coarser until there are at most this many groups to compare.
const MAX_GROUPS: usize = 512;

/// Content that belongs together.
#[derive(Clone, Copy, Debug)]
struct Group {
    cell: ContentCell,
    /// Diagonal of the largest piece whose cells touch.
    piece_m: f64,
}

/// A group of content far from the others.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Cluster {
    #[serde(rename = "box")]
    pub bounds: [Vec3; 2],
    pub triangles: u64,
    pub objects: u64,
}

/// Which clusters a scene consists of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Choice {
    /// The one with most content.
    #[default]
    Largest,
    /// By number, counted from 1, largest first.
    Number(u32),
    All,
}

/// The content of one or more assets.
#[derive(Clone, Debug, Default)]
pub struct Content {
    cells: ContentCells,
}

impl Content {
    /// Reads the cells of assets, and measures those that have none.
    pub fn of_assets<'a>(folders: impl Iterator<Item = &'a Path>) -> Result<Self> {
        let mut cells = ContentCells::default();
        for folder in folders {
            cells.merge(&read_or_measure(folder)?);
        }
        Ok(Self { cells })
    }

    /// Returns the groups, largest first.
    pub fn clusters(&self) -> Vec<Cluster> {
        self.groups().iter().map(|g| Cluster { bounds: [g.bounds.lo, g.bounds.hi], triangles: g.triangles, objects: g.objects }).collect()
    }

    /// Returns what stays; `None` when nothing is far from the rest, so that everything does.
    pub fn extent(&self, choice: Choice, origin: Vec3) -> Result<Option<KeptSpace>> {
        let groups = self.groups();
        let number = match choice {
            Choice::Number(n) if n == 0 || n as usize > groups.len() => {
                return Err(Error::argument(format!("cluster {n}: the scene has {} clusters; count from 1", groups.len())));
            }
            Choice::Number(n) => n as usize - 1,
            Choice::Largest | Choice::All => 0,
        };
        let size_m = self.cells.usual_size_m();
        let region = |g: &ContentCell| Region { bounds: g.bounds, reach_m: [apart_m(size_m, g).max(APART_M), apart_in_height_m(size_m, g)] };
        let kept = if choice == Choice::All { &groups[..] } else { &groups[number.min(groups.len())..groups.len().min(number + 1)] };
        let regions: Vec<Region> = kept.iter().map(region).collect();
        let extent = KeptSpace { regions, large_m: self.large_m(), all_around: (choice == Choice::All).then_some(origin) };
        let largest = KeptSpace { regions: groups.iter().take(1).map(region).collect(), all_around: None, ..extent.clone() };
        Ok((groups.len() > 1 || self.has_far_large(&largest)).then_some(extent))
    }

    /// Whether some content of this asset is not certain to stay.
    pub fn reaches_outside(&self, extent: &KeptSpace) -> bool {
        let leaves = |class: u8, c: &ContentCell| {
            if is_large(class, extent.large_m) { c.zeros > 0 || !extent.keeps(spanning(c)) } else { !in_region(extent, c) }
        };
        self.cells.cells.iter().any(|((class, _), c)| leaves(*class, c))
    }

    /// Returns about how many triangles are added when edges longer than `edge_m` are split.
    pub fn added_by_splitting(&self, extent: Option<&KeptSpace>, edge_m: f64) -> f64 {
        let pieces = |class: u8| (f64::exp2(f64::from(class)) / edge_m).max(1.0).powi(2) - 1.0;
        self.kept(extent).map(|((class, _), c)| c.triangles as f64 * pieces(*class)).sum()
    }

    /// Returns the boxes of the cells whose content stays.
    pub fn boxes<'a>(&'a self, extent: Option<&'a KeptSpace>) -> impl Iterator<Item = Box3> + 'a {
        self.kept(extent).map(|(_, c)| c.bounds)
    }

    fn kept<'a>(&'a self, extent: Option<&'a KeptSpace>) -> impl Iterator<Item = (&'a CellKey, &'a ContentCell)> + 'a {
        self.cells.cells.iter().filter(move |(_, c)| extent.is_none_or(|e| in_region(e, c) || e.keeps(spanning(c))))
    }

    fn has_far_large(&self, extent: &KeptSpace) -> bool {
        let mut large = self.cells.cells.iter().filter(|((class, _), _)| is_large(*class, extent.large_m));
        large.any(|(_, c)| c.zeros > 0 || !extent.keeps(spanning(c)))
    }

    fn large_m(&self) -> f64 {
        (LARGE_SIZES * self.cells.usual_size_m()).max(LARGE_M)
    }

    /// Returns the groups of small triangles, largest first; of large ones when there is nothing else.
    fn groups(&self) -> Vec<ContentCell> {
        let large_m = self.large_m();
        let mut cells = ContentCells { sizes: BTreeMap::new(), ..self.cells.clone() };
        let all = std::mem::take(&mut cells.cells);
        let small = all.into_iter().filter(|((class, _), _)| !is_large(*class, large_m));
        for ((_, at), cell) in small {
            cells.cells.entry((0, at)).and_modify(|c| c.merge(&cell)).or_insert(cell);
        }
        let mut groups = neighbours(&cells);
        while groups.len() > MAX_GROUPS && cells.scale < 63 {
            cells.coarsen();
            groups = neighbours(&cells);
        }
        let groups = self.joined(groups);
        let mut groups: Vec<ContentCell> = groups.into_iter().map(|g| g.cell).collect();
        let (triangles, objects) = totals(&groups);
        let share = |g: &ContentCell| g.triangles as f64 / triangles.max(1) as f64 + g.objects as f64 / objects.max(1) as f64;
        let place = |g: &ContentCell| [g.bounds.lo, g.bounds.hi].map(|p| p.map(|v| v + 0.0));
        groups.sort_by(|a, b| share(b).total_cmp(&share(a)).then_with(|| place(a).partial_cmp(&place(b)).unwrap_or(std::cmp::Ordering::Equal)));
        groups
    }

    /// Joins groups until all are far from each other. Joined groups only become larger, so that the order does not matter.
    fn joined(&self, cells: Vec<ContentCell>) -> Vec<Group> {
        let (size_m, totals) = (self.cells.usual_size_m(), totals(&cells));
        let mut groups: Vec<Group> = cells.into_iter().map(|cell| Group { cell, piece_m: diagonal_m(&cell.bounds) }).collect();
        let mut k = 0;
        while k < groups.len() {
            match (k + 1..groups.len()).find(|other| are_one(&groups[k], &groups[*other], size_m, totals)) {
                Some(other) => {
                    let joined = groups.swap_remove(other);
                    groups[k].cell.merge(&joined.cell);
                    groups[k].piece_m = groups[k].piece_m.max(joined.piece_m);
                    k = 0;
                }
                None => k += 1,
            }
        }
        groups
    }
}

fn totals(groups: &[ContentCell]) -> (u64, u64) {
    (groups.iter().map(|g| g.triangles).sum(), groups.iter().map(|g| g.objects).sum())
}

/// Returns how far large triangles of a group may reach beyond it, except for the least distance of all.
fn apart_m(size_m: f64, group: &ContentCell) -> f64 {
    (APART_SIZES * size_m).max(APART_DIAGONALS * diagonal_m(&group.bounds))
}

fn apart_in_height_m(size_m: f64, group: &ContentCell) -> f64 {
    (APART_SIZES * size_m).max(APART_IN_HEIGHT_M).max(group.bounds.hi[2] - group.bounds.lo[2])
}

fn are_one(a: &Group, b: &Group, size_m: f64, (triangles, objects): (u64, u64)) -> bool {
    let is_few = |g: &Group| g.cell.triangles * FEW <= triangles && g.cell.objects * FEW <= objects;
    let (distance_m, height_m) = gap_m(&a.cell.bounds, &b.cell.bounds);
    let least_m = if is_few(a) || is_few(b) { FEW_APART_M } else { APART_M }.max(APART_SIZES * size_m);
    let apart_m = [a, b].map(|g| (APART_DIAGONALS * g.piece_m).min(MOST_APART_M)).into_iter().fold(least_m, f64::max);
    let apart_in_height_m = [a, b].map(|g| apart_in_height_m(size_m, &g.cell)).into_iter().fold(0.0, f64::max);
    distance_m <= apart_m && height_m <= apart_in_height_m
}

fn is_large(class: u8, large_m: f64) -> bool {
    class > 0 && f64::exp2(f64::from(class)) >= large_m
}

/// Returns three points that span the box of a cell.
fn spanning(cell: &ContentCell) -> [Vec3; 3] {
    [cell.bounds.lo, cell.bounds.center(), cell.bounds.hi]
}

fn in_region(extent: &KeptSpace, cell: &ContentCell) -> bool {
    let inside = |r: &Region| (0..3).all(|k| cell.bounds.lo[k] >= r.bounds.lo[k] && cell.bounds.hi[k] <= r.bounds.hi[k]);
    extent.all_around.is_some() || extent.regions.iter().any(inside)
}

/// Joins cells that touch each other.
fn neighbours(cells: &ContentCells) -> Vec<ContentCell> {
    let mut left = cells.cells.clone();
    let mut out = Vec::new();
    while let Some((first, cell)) = left.pop_first() {
        let (mut group, mut stack) = (cell, vec![first]);
        while let Some((class, at)) = stack.pop() {
            for key in around(class, at) {
                if let Some(cell) = left.remove(&key) {
                    group.merge(&cell);
                    stack.push(key);
                }
            }
        }
        out.push(group);
    }
    out
}

fn around(class: u8, [x, y, z]: [i64; 3]) -> impl Iterator<Item = CellKey> {
    let steps = || -1..=1_i64;
    steps().flat_map(move |dx| {
        steps().flat_map(move |dy| steps().map(move |dz| (class, [x.saturating_add(dx), y.saturating_add(dy), z.saturating_add(dz)])))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOWN: Vec3 = [690_000.0, 5_336_000.0, 500.0];

    /// Adds `count` small triangles of one object, `step_m` apart along x.
    fn row(cells: &mut ContentCells, from: Vec3, count: u32, step_m: f64) {
        for k in 0..count {
            let p = [from[0] + f64::from(k) * step_m, from[1], from[2]];
            let key = cells.add([p, [p[0] + 8.0, p[1], p[2]], [p[0], p[1] + 8.0, p[2] + 6.0]]);
            cells.add_object(key);
        }
    }

    fn content(add: impl Fn(&mut ContentCells)) -> Content {
        let mut cells = ContentCells::default();
        add(&mut cells);
        Content { cells }
    }

    fn extent(content: &Content, choice: Choice) -> Option<KeptSpace> {
        content.extent(choice, TOWN).expect("an extent")
    }

    #[test]
    fn a_town_is_one_cluster_and_everything_stays() {
        let town = content(|c| row(c, TOWN, 400, 10.0));
        assert_eq!((town.clusters().len(), extent(&town, Choice::Largest)), (1, None));
        assert_eq!(extent(&town, Choice::All), None);
        assert_eq!(extent(&Content::default(), Choice::Largest), None);
    }

    #[test]
    fn villages_a_few_kilometres_apart_are_one_cluster() {
        let content = content(|c| (0..5).for_each(|k| row(c, [TOWN[0], TOWN[1] + 7000.0 * f64::from(k), 500.0], 60, 20.0)));
        assert_eq!((content.clusters().len(), extent(&content, Choice::Largest)), (1, None));
    }

    #[test]
    fn towns_do_not_join_by_way_of_others() {
        let at_km = [0.0, 9.0, 35.0, 140.0, 560.0];
        let content = content(|c| at_km.iter().for_each(|x| row(c, [TOWN[0] + 1000.0 * x, TOWN[1], 500.0], 60, 20.0)));
        assert_eq!(content.clusters().iter().map(|c| c.objects).collect::<Vec<_>>(), [120, 60, 60, 60]);
        assert!(extent(&content, Choice::Largest).is_some());
    }

    #[test]
    fn parts_of_a_region_are_one_cluster_and_regions_far_apart_are_not() {
        let regions = |gap_m: f64| {
            let grid = |c: &mut ContentCells, x: f64| (0..40).for_each(|k| row(c, [x, TOWN[1] + 900.0 * f64::from(k), 500.0], 40, 900.0));
            let content = content(|c| [TOWN[0], TOWN[0] + 36_000.0 + gap_m].iter().for_each(|x| grid(c, *x)));
            content.clusters().len()
        };
        assert_eq!((regions(45_000.0), regions(100_000.0)), (1, 2));
    }

    #[test]
    fn a_few_triangles_far_away_are_an_outlier() {
        let content = content(|c| {
            row(c, [0.0; 3], 1, 1.0);
            row(c, TOWN, 400, 10.0);
        });
        let extent = extent(&content, Choice::Largest).expect("an outlier");
        assert_eq!(content.clusters().iter().map(|c| c.triangles).collect::<Vec<_>>(), [400, 1]);
        assert!(content.reaches_outside(&extent));
        assert!(!extent.keeps([[0.0; 3], [8.0, 0.0, 0.0], [0.0, 8.0, 6.0]]) && extent.keeps_point(TOWN));
    }

    #[test]
    fn a_large_triangle_that_reaches_far_away_is_an_outlier_and_a_large_ground_is_not() {
        let stray = content(|c| {
            row(c, TOWN, 400, 10.0);
            c.add([TOWN, [TOWN[0] + 5.0, TOWN[1], 500.0], [0.0; 3]]);
        });
        assert_eq!(stray.clusters().len(), 1);
        let kept = extent(&stray, Choice::Largest).expect("an outlier");
        assert!(!kept.keeps([TOWN, [TOWN[0] + 5.0, TOWN[1], 500.0], [0.0; 3]]) && kept.keeps_point(TOWN));
        let ground = content(|c| {
            row(c, TOWN, 400, 10.0);
            let [x, y, _] = TOWN;
            c.add([[x - 5000.0, y - 5000.0, 490.0], [x + 9000.0, y - 5000.0, 490.0], [x, y + 9000.0, 490.0]]);
        });
        assert_eq!(extent(&ground, Choice::Largest), None);
    }

    #[test]
    fn nodata_heights_are_outliers() {
        let content = content(|c| {
            row(c, TOWN, 400, 100.0);
            row(c, [TOWN[0] + 200.0, TOWN[1], -9999.0], 2, 10.0);
        });
        assert_eq!(content.clusters().iter().map(|c| c.triangles).collect::<Vec<_>>(), [400, 2]);
    }

    #[test]
    fn far_files_are_clusters_of_which_one_or_all_stay() {
        let content = content(|c| (0..3).for_each(|k| row(c, [TOWN[0] + 1e5 * f64::from(k), TOWN[1], 500.0], 50 + 10 * k, 10.0)));
        assert_eq!(content.clusters().iter().map(|c| c.objects).collect::<Vec<_>>(), [70, 60, 50]);
        let third = extent(&content, Choice::Number(3)).expect("clusters");
        assert!(third.keeps_point(TOWN) && third.regions.len() == 1);
        let all = extent(&content, Choice::All).expect("clusters");
        assert!(!content.reaches_outside(&all) && all.regions.len() == 3);
        assert!(content.extent(Choice::Number(4), TOWN).is_err() && content.extent(Choice::Number(0), TOWN).is_err());
    }

    #[test]
    fn a_coarse_model_of_a_continent_and_one_in_millimetres_are_one_cluster() {
        let continent = content(|c| {
            for k in 0..4000 {
                let p = [f64::from(k % 80) * 50_000.0, f64::from(k / 80) * 50_000.0, 0.0];
                c.add([p, [p[0] + 50_000.0, p[1], 800.0], [p[0], p[1] + 50_000.0, 0.0]]);
            }
        });
        assert_eq!((continent.clusters().len(), extent(&continent, Choice::Largest)), (1, None));
        let house = content(|c| {
            for k in 0..40 {
                let p = [f64::from(k % 2) * 20_000.0, f64::from(k / 20) * 30_000.0, f64::from(k % 20) * 3000.0];
                c.add([p, [p[0], p[1] + 4000.0, p[2]], [p[0], p[1], p[2] + 3000.0]]);
            }
        });
        assert_eq!(extent(&house, Choice::Largest), None);
    }

    #[test]
    fn scattered_content_is_compared_in_bounded_time() {
        let scattered = content(|c| (0..30_000_i32).for_each(|k| row(c, [f64::from(k % 173) * 1.7e5, f64::from(k / 173) * 2.3e5, 0.0], 1, 1.0)));
        assert!(scattered.clusters().len() <= MAX_GROUPS);
    }
}
