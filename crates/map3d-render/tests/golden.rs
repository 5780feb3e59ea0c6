//! Golden pictures: tiny scenes are compared to the last bit. After an intended change, `MAP3D_BLESS=1 cargo test -p map3d-render --test all golden` stores the
//! new pictures; check them and give the reason in the commit.
//!
//! `golden/<scene>-<look at>-<pitch>.png` has four quarters of 128 × 128 pixels from the middle of a tile: colours and normals as sent; below them ids
//! (a colour per id) and depths (red in steps of 1/4 m, green of 2^-10 m). `golden/digests.txt` has a checksum of all bits of each G-buffer.
//! `golden/camera-<scene>-<view>.png` shows the same of views that no pyramid has.

mod cameras;
mod pictures;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use self::cameras::CAMERAS;
use self::pictures::PICTURES;
use crate::town::{frame, new_folder};
use map3d_base::file::checksum;
use map3d_base::layers::{COLOR, DEPTH, ID, NORMAL};
use map3d_base::{DEPTH_NOTHING, DEPTH_UNITS_PER_M, Frame, Isa, LayerKind};
use map3d_image::encode::{Deflate, Filter, bytes_from_normals, color_from_linear, decode_png, encode_png};
use map3d_image::{GBuffer, Raster};
use map3d_render::{RenderScene, TileRenderer, ViewImage, ViewPixels};

const SIDE: usize = 128;
const QUARTERS: [&str; 4] = ["colour", "normal", "id", "depth"];

/// Returns the middle of a tile of 256 pixels.
fn middle(g: &GBuffer) -> GBuffer {
    let mut out = GBuffer::empty(SIDE as u32, SIDE as u32);
    for y in 0..SIDE {
        let (from, to) = ((y + 64) * 256 + 64, y * SIDE);
        out[COLOR][to..to + SIDE].copy_from_slice(&g[COLOR][from..from + SIDE]);
        out[NORMAL][to..to + SIDE].copy_from_slice(&g[NORMAL][from..from + SIDE]);
        out[ID][to..to + SIDE].copy_from_slice(&g[ID][from..from + SIDE]);
        out[DEPTH][to..to + SIDE].copy_from_slice(&g[DEPTH][from..from + SIDE]);
    }
    out
}

/// Returns a checksum of all bits.
fn digest(g: &GBuffer) -> String {
    let color = g[COLOR].iter().flatten().flat_map(|v| v.to_le_bytes());
    let normal = g[NORMAL].iter().flatten().flat_map(|v| v.to_le_bytes());
    let numbers = g[ID].iter().chain(&g[DEPTH]).flat_map(|v| v.to_le_bytes());
    format!("{:016x}", checksum(&color.chain(normal).chain(numbers).collect::<Vec<u8>>()))
}

/// Returns a unique colour for an id below 2^24.
fn id_color(id: u32) -> [u8; 4] {
    assert!(id < 1 << 24);
    let [r, g, b, _] = id.wrapping_mul(0x9E_3779).to_le_bytes();
    [r, g, b, 255]
}

fn depth_color(depth: u32) -> [u8; 4] {
    if depth == DEPTH_NOTHING {
        return [0; 4];
    }
    let [low, middle, high, top] = depth.to_le_bytes();
    assert_eq!(top, 0, "a picture's frame starts near its scene");
    [middle, low, high, 255]
}

/// The layers of a picture as they are shown.
struct Shown {
    color: Vec<[u8; 4]>,
    normal: Vec<[u8; 3]>,
    id: Vec<u32>,
    depth: Vec<u32>,
}

impl Shown {
    fn of_tile(g: &GBuffer) -> Self {
        let color = color_from_linear((g.width, g.height), &g[COLOR]).pixels;
        let normal = bytes_from_normals(&g[NORMAL]).as_chunks::<3>().0.to_vec();
        Self { color, normal, id: g[ID].to_vec(), depth: g[DEPTH].to_vec() }
    }

    fn of_view(view: &ViewImage) -> Self {
        let units = |m: &f32| if m.is_nan() { DEPTH_NOTHING } else { (f64::from(*m) * DEPTH_UNITS_PER_M).round() as u32 };
        let (color, normal, id, metres) = layers_of(view);
        Self { color: color.to_vec(), normal: normal.to_vec(), id: id.to_vec(), depth: metres.iter().map(units).collect() }
    }

    fn quarters(&self) -> Raster {
        let pixel = |k: usize| {
            let (x, y) = (k % (2 * SIDE), k / (2 * SIDE));
            let p = y % SIDE * SIDE + x % SIDE;
            match (x / SIDE, y / SIDE) {
                (0, 0) if self.color[p][3] == 0 => [0; 4],
                (0, 0) => self.color[p],
                (_, 0) => [self.normal[p][0], self.normal[p][1], self.normal[p][2], 255],
                (0, _) => id_color(self.id[p]),
                _ => depth_color(self.depth[p]),
            }
        };
        Raster::new(2 * SIDE as u32, 2 * SIDE as u32, (0..4 * SIDE * SIDE).map(pixel).collect())
    }
}

/// Colour, normal, id and depth.
type Layers<'a> = (&'a [[u8; 4]], &'a [[u8; 3]], &'a [u32], &'a [f32]);

fn layers_of(view: &ViewImage) -> Layers<'_> {
    let layers = [LayerKind::Color, LayerKind::Normal, LayerKind::Id, LayerKind::Depth].map(|kind| view.layer(kind));
    match layers {
        [Some(ViewPixels::Color(color)), Some(ViewPixels::Normal(normal)), Some(ViewPixels::Numbers(id)), Some(ViewPixels::Metres(depth))] => {
            (color, normal, id, depth)
        }
        other => panic!("{other:?}"),
    }
}

/// Returns a checksum of all bits.
fn view_digest(view: &ViewImage) -> String {
    let (color, normal, id, depth) = layers_of(view);
    let bytes = color.iter().flatten().chain(normal.iter().flatten()).copied();
    let numbers = id.iter().copied().chain(depth.iter().map(|m| m.to_bits())).flat_map(u32::to_le_bytes);
    format!("{:016x}", checksum(&bytes.chain(numbers).collect::<Vec<u8>>()))
}

/// Returns all pictures by name, with their digests.
fn render_all() -> BTreeMap<String, (Raster, String)> {
    let mut out = BTreeMap::new();
    for picture in PICTURES {
        let (folder, town) = (new_folder(picture.name), (picture.scene)());
        let scene = town.open(&folder);
        for &(look_at, pitch) in picture.views {
            let f = Frame { d0_m: -40.0, ..frame(look_at, pitch, 2.0 * picture.metres, 0) };
            let g = middle(&render_with_all_isas(&scene, &f));
            out.insert(format!("{}-{look_at}-{pitch}", picture.name), (Shown::of_tile(&g).quarters(), digest(&g)));
        }
    }
    for camera in CAMERAS {
        let (folder, town) = (new_folder(camera.name), (camera.scene)());
        let scene = town.open(&folder);
        let view = camera.render(&scene, Isa::Scalar);
        for isa in Isa::available() {
            assert!(view_digest(&camera.render(&scene, isa)) == view_digest(&view), "{}: {isa:?} differs from scalar", camera.name);
        }
        out.insert(format!("camera-{}", camera.name), (Shown::of_view(&view).quarters(), view_digest(&view)));
    }
    out
}

/// Renders tile (0, 0) with all instruction sets of this machine and checks that their bits are equal.
fn render_with_all_isas(scene: &RenderScene, frame: &Frame) -> GBuffer {
    let render = |isa: Isa| TileRenderer::with_isa(scene, frame, isa).expect("a frame").tile(0, 0).expect("renders").expect("has content");
    let scalar = render(Isa::Scalar);
    for isa in Isa::available() {
        assert!(render(isa) == scalar, "{isa:?} differs from scalar");
    }
    scalar
}

fn golden_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden")
}

fn write(path: &Path, image: &Raster) {
    let png = encode_png((image.width, image.height), 4, image.pixels.as_flattened(), Filter::Up, Deflate::Matching);
    std::fs::create_dir_all(path.parent().expect("a folder")).expect("folder");
    std::fs::write(path, png).expect("picture");
}

fn read(path: &Path) -> Option<Raster> {
    let image = decode_png(&std::fs::read(path).ok()?).expect("a PNG");
    assert_eq!(image.channels, 4, "{}", path.display());
    Some(Raster::new(image.width, image.height, image.pixels.as_chunks::<4>().0.to_vec()))
}

fn bless(rendered: &BTreeMap<String, (Raster, String)>) {
    let old = golden_pictures().into_iter().filter(|name| !rendered.contains_key(name));
    old.for_each(|name| std::fs::remove_file(golden_folder().join(name + ".png")).expect("old picture"));
    let mut lines = String::new();
    for (name, (image, digest)) in rendered {
        write(&golden_folder().join(format!("{name}.png")), image);
        lines += &format!("{name} {digest}\n");
    }
    std::fs::write(golden_folder().join("digests.txt"), lines).expect("digests");
}

/// Returns the names of the stored pictures.
fn golden_pictures() -> Vec<String> {
    let entries = std::fs::read_dir(golden_folder()).expect("golden pictures");
    let names = entries.map(|e| e.expect("entry").file_name().into_string().expect("UTF-8"));
    names.filter_map(|n| n.strip_suffix(".png").map(str::to_owned)).collect()
}

/// Describes the differences of each quarter, and writes got, golden and difference as pictures.
fn differences(name: &str, got: &Raster, golden: &Raster) -> String {
    let side = got.width as usize;
    let differ = |k: &usize| got.pixels[*k] != golden.pixels[*k];
    let mut lines = Vec::new();
    for (q, quarter) in QUARTERS.iter().enumerate() {
        let inside = |k: &usize| (*k % side / SIDE, *k / side / SIDE) == (q % 2, q / 2);
        let all: Vec<usize> = (0..side * side).filter(inside).filter(differ).collect();
        if let Some(k) = all.first() {
            let at = (k % side % SIDE, k / side % SIDE);
            lines.push(format!("{quarter}: {} pixels, first {at:?}: {:?}, was {:?}", all.len(), got.pixels[*k], golden.pixels[*k]));
        }
    }
    if lines.is_empty() {
        return "only bits that the pictures do not show".into();
    }
    let mark = |k: usize| if differ(&k) { [255, 255, 255, 255] } else { golden.pixels[k].map(|c| c / 4).map(|c| c.max(1)) };
    let difference = Raster::new(got.width, got.height, (0..side * side).map(mark).collect());
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("golden");
    [("got", got), ("golden", golden), ("difference", &difference)]
        .iter()
        .for_each(|(suffix, i)| write(&folder.join(format!("{name}.{suffix}.png")), i));
    format!("{}\n  pictures: {}/{name}.*.png", lines.join("\n  "), folder.display())
}

#[test]
fn tiny_scenes_match_their_golden_pictures() {
    let rendered = render_all();
    if std::env::var_os("MAP3D_BLESS").is_some_and(|v| v == "1") {
        return bless(&rendered);
    }
    let digests = std::fs::read_to_string(golden_folder().join("digests.txt")).expect("digests");
    let stored: BTreeMap<&str, &str> = digests.lines().filter_map(|l| l.split_once(' ')).collect();
    let mut failures = Vec::new();
    for (name, (image, digest)) in &rendered {
        match read(&golden_folder().join(format!("{name}.png"))) {
            None => failures.push(format!("{name}: the golden picture is missing")),
            Some(golden) if *image != golden || stored.get(&name[..]) != Some(&&digest[..]) => {
                failures.push(format!("{name}\n  {}", differences(name, image, &golden)));
            }
            Some(_) => {}
        }
    }
    failures.extend(golden_pictures().into_iter().filter(|n| !rendered.contains_key(n)).map(|n| format!("{n}: golden picture without a scene")));
    assert!(
        failures.is_empty(),
        "\n{}\nIf the change is intended: MAP3D_BLESS=1 cargo test -p map3d-render --test all golden, then check the pictures.",
        failures.join("\n")
    );
}
