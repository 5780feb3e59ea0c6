//! Reads documents and prints what is in them and how fast: `cargo run --release --example read_bench -- FILE…`

use std::path::Path;
use std::time::Instant;

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
    let start = Instant::now();
    let mut reader = open(path, format, &ReadOptions::default())?;
    let (mut triangles, mut vertices) = (0, 0);
    while let Some(batch) = reader.next_batch()? {
        triangles += batch.triangles.len();
        vertices += batch.positions.len();
    }
    let seconds = start.elapsed().as_secs_f64();
    let megabytes = std::fs::metadata(path).map_or(0, |m| m.len()) as f64 / 1e6;
    println!(
        "{}: {} objects, {triangles} triangles, {vertices} vertices, {} materials, {} images, {} instances; CRS {:?}",
        path.display(),
        reader.objects().len(),
        reader.materials().len(),
        reader.textures().len(),
        reader.instances().len(),
        reader.srs_name(),
    );
    println!("    {megabytes:.1} MB in {seconds:.3} s: {:.1} MB/s, {:.0} triangles/s", megabytes / seconds, triangles as f64 / seconds);
    let report = reader.report();
    report.skipped.iter().for_each(|(reason, count)| println!("    skipped {count}: {reason}"));
    report.warnings.iter().for_each(|w| println!("    {} x {}: {}", w.count, w.reason, w.example));
    Ok(())
}
