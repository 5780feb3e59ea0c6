//! The table of `map3d_base::layers` is that of `spec/layers.json`.

use map3d_base::layers::LAYERS;
use serde_json::Value;

#[test]
fn layers_are_those_of_the_specification() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../spec/layers.json");
    let specified: Value = serde_json::from_str(&std::fs::read_to_string(path).expect("the file is in the repository")).expect("JSON");
    assert_eq!(serde_json::to_value(LAYERS).expect("plain values"), specified);
}

#[test]
fn codes_number_the_kinds() {
    let mut codes = LAYERS.map(|row| row.code);
    codes.sort_unstable();
    assert!(codes.iter().zip(0..).all(|(code, k)| *code == k), "{codes:?}");
    assert!(LAYERS.iter().all(|row| row.code == row.kind as u8 && row.kind.row() == row));
}
