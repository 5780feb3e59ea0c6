//! Reads documents and prints their contents and the CPU time: `cargo run --release -p map3d-read --example read_bench -- FILE…`

use std::path::Path;
use std::time::{Duration, Instant};

use map3d_read::{ReadOptions, detect_format, open};

fn main() {
    for name in std::env::args().skip(1) {
        if let Err(e) = bench(Path::new(&name)) {
            println!("{name}: {e}");
        }
    }
}

fn bench(path: &Path) -> map3d_base::Result<()> {
    let format = detect_format(path)?;
    let (wall, start) = (Instant::now(), read_cpu_time());
    let mut reader = open(path, format, &ReadOptions::default())?;
    let (mut triangles, mut vertices) = (0, 0);
    while let Some(batch) = reader.next_batch()? {
        triangles += batch.triangles.len();
        vertices += batch.positions.len();
    }
    let seconds = read_cpu_time().checked_sub(start).filter(|d| !d.is_zero()).unwrap_or_else(|| wall.elapsed()).as_secs_f64();
    let megabytes = std::fs::metadata(path).map_or(0, |m| m.len()) as f64 / 1e6;
    let image_bytes: u64 = reader.textures().iter().filter_map(|t| std::fs::metadata(&t.path).ok()).map(|m| m.len()).sum();
    println!(
        "{}: {} objects, {triangles} triangles, {vertices} vertices, {} materials, {} images, {} instances; CRS {:?}",
        path.display(),
        reader.objects().len(),
        reader.materials().len(),
        reader.textures().len(),
        reader.instances().len(),
        reader.srs_name(),
    );
    println!(
        "    {megabytes:.1} MB and {:.1} MB of images in {seconds:.3} s: {:.1} MB/s, {:.0} triangles/s",
        image_bytes as f64 / 1e6,
        megabytes / seconds,
        f64::from(triangles as u32) / seconds
    );
    let report = reader.report();
    report.skipped.iter().for_each(|(reason, count)| println!("    skipped {count}: {reason}"));
    report.warnings.iter().for_each(|w| println!("    {} x {}: {}", w.count, w.reason, w.example));
    Ok(())
}

/// Returns the CPU time of this thread, or zero if the system does not report it.
fn read_cpu_time() -> Duration {
    let stat = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    Duration::from_nanos(stat.split_whitespace().next().and_then(|n| n.parse().ok()).unwrap_or(0))
}
