//! Renders a view as image tiles of a sub-tile each, by one or several threads. A tile depends on nothing but the request, so the bytes are the same for
//! any number of threads.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use map3d_base::{Error, Isa, Result};
use map3d_image::Arrays;
use map3d_trace::SUBTILE_PX;

use super::image::{TileRows, ViewImage};
use super::request::{Region, SceneCamera, ViewRequest};
use super::times::ViewTimes;
use crate::clock::CpuClock;
use crate::light::SubtilePosition;
use crate::scene::RenderScene;
use crate::subtile::{StageTimes, SubtileRenderer};

const SIDE: u32 = SUBTILE_PX as u32;

impl RenderScene {
    /// Renders a view. `must_continue` is asked between image tiles, on this thread; if it returns false, the call fails with `Error::Interrupted`.
    pub fn render_view(&self, request: &ViewRequest, must_continue: &mut dyn FnMut() -> bool) -> Result<ViewImage> {
        self.render_view_with(request, Isa::best(), must_continue)
    }

    /// Uses another instruction set than the best; the results are the same.
    pub fn render_view_with(&self, request: &ViewRequest, isa: Isa, must_continue: &mut dyn FnMut() -> bool) -> Result<ViewImage> {
        request.check()?;
        let region = request.region()?;
        let layers = image_layers(request);
        let image = ViewImage::empty(region.width as usize, region.height as usize, layers);
        let bounds = self.store().bounds();
        if bounds.is_empty() {
            return Ok(image);
        }
        let camera = SceneCamera::new(&request.camera, &bounds, request.cut.as_ref(), request.sorted_objects());
        let shared =
            SharedView { scene: self, request, isa, camera, region, start: Instant::now(), next: AtomicUsize::new(0), image: Mutex::new(image) };
        shared.render(must_continue)?;
        Ok(shared.image.into_inner().unwrap_or_else(PoisonError::into_inner))
    }
}

/// Returns the layers that were asked for.
fn image_layers(request: &ViewRequest) -> Arrays {
    match request.layers.is_empty() {
        true => Arrays::STANDARD,
        false => request.layers.iter().fold(Arrays::NONE, |all, l| all.and(l.kind)),
    }
}

/// A view that threads render together.
struct SharedView<'a> {
    scene: &'a RenderScene,
    request: &'a ViewRequest,
    isa: Isa,
    camera: SceneCamera,
    region: Region,
    start: Instant,
    /// Number of the next image tile.
    next: AtomicUsize,
    image: Mutex<ViewImage>,
}

impl SharedView<'_> {
    /// Renders on this thread and the others that the request allows.
    fn render(&self, must_continue: &mut dyn FnMut() -> bool) -> Result<()> {
        let others = self.request.threads.min(self.tile_count()).saturating_sub(1);
        std::thread::scope(|scope| {
            let workers: Vec<_> = (0..others).map(|_| scope.spawn(|| self.render_tiles(&mut || true))).collect();
            let own = self.render_tiles(must_continue);
            let all = workers.into_iter().map(|w| w.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
            all.fold(own, |result, other| result.and(other))
        })
    }

    /// Renders image tiles until none are left. A failure stops the other threads.
    fn render_tiles(&self, must_continue: &mut dyn FnMut() -> bool) -> Result<()> {
        let mut renderer = ImageTileRenderer::new(self)?;
        let done = self.render_tiles_with(&mut renderer, must_continue);
        self.scene.add_view_times(&renderer.times());
        done
    }

    fn render_tiles_with(&self, renderer: &mut ImageTileRenderer, must_continue: &mut dyn FnMut() -> bool) -> Result<()> {
        loop {
            let number = self.next.fetch_add(1, Ordering::Relaxed);
            if number >= self.tile_count() {
                return Ok(());
            }
            let done = self.check_time(number).and_then(|()| if must_continue() { renderer.render(self, number) } else { Err(Error::Interrupted) });
            if done.is_err() {
                self.next.store(self.tile_count(), Ordering::Relaxed);
                return done;
            }
        }
    }

    fn check_time(&self, done: usize) -> Result<()> {
        match self.request.deadline_s.filter(|limit_s| self.start.elapsed().as_secs_f64() > *limit_s) {
            Some(limit_s) => Err(Error::Deadline { what: "image tiles", done, total: self.tile_count(), limit_s }),
            None => Ok(()),
        }
    }

    /// Returns the first column and row of image tiles, and the numbers of columns and rows that the region overlaps.
    fn grid(&self) -> ([u32; 2], [u32; 2]) {
        let Region { x, y, width, height } = self.region;
        let (first, end) = ([x / SIDE, y / SIDE], [(x + width).div_ceil(SIDE), (y + height).div_ceil(SIDE)]);
        (first, [end[0] - first[0], end[1] - first[1]])
    }

    fn tile_count(&self) -> usize {
        let (_, [columns, rows]) = self.grid();
        columns as usize * rows as usize
    }

    /// Returns the image's pixel in the top left corner of an image tile.
    fn tile_corner(&self, number: usize) -> [u32; 2] {
        let ([column, row], [columns, _]) = self.grid();
        [(column + number as u32 % columns) * SIDE, (row + number as u32 / columns) * SIDE]
    }

    /// Returns the part of an image tile that is inside the region.
    fn rows_of(&self, corner: [u32; 2]) -> TileRows {
        let Region { x, y, width, height } = self.region;
        let first = [corner[0].max(x), corner[1].max(y)];
        let end = [(corner[0] + SIDE).min(x + width), (corner[1] + SIDE).min(y + height)];
        TileRows {
            from: [0, 1].map(|k| (first[k] - corner[k]) as usize),
            to: [(first[0] - x) as usize, (first[1] - y) as usize],
            width: (end[0] - first[0]) as usize,
            height: (end[1] - first[1]) as usize,
        }
    }

    fn lock_image(&self) -> MutexGuard<'_, ViewImage> {
        self.image.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Renders the image tiles of one thread.
struct ImageTileRenderer<'s> {
    subtiles: SubtileRenderer<'s>,
    convert_s: f64,
}

impl<'s> ImageTileRenderer<'s> {
    fn new(shared: &SharedView<'s>) -> Result<Self> {
        let SharedView { scene, request, isa, camera, .. } = shared;
        let subtiles = SubtileRenderer::new(scene, camera.view, Some(camera.clip.clone()), &request.layers, request.sample_set()?, *isa)?;
        Ok(Self { subtiles, convert_s: 0.0 })
    }

    /// Renders an image tile and copies it into the image.
    fn render(&mut self, shared: &SharedView, number: usize) -> Result<()> {
        let corner = shared.tile_corner(number);
        let mut g = None;
        self.subtiles.render(SubtilePosition { in_tile: (0, 0), in_view: corner.map(u64::from) }, SIDE, &mut g)?;
        let Some(g) = g else { return Ok(()) };
        self.subtiles.check_textures()?;
        let mut clock = CpuClock::start();
        shared.lock_image().put(&g, shared.rows_of(corner), |units| shared.camera.depth_m(units));
        self.convert_s += clock.lap_s();
        Ok(())
    }

    fn times(&self) -> ViewTimes {
        let StageTimes { visibility_s, shade_s, light_s } = self.subtiles.times();
        ViewTimes { visibility_s, shade_s, light_s, convert_s: self.convert_s }
    }
}
