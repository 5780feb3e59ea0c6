//! The 16 sample positions of a pixel (spec/pyramid.md §4).

/// Offsets from the pixel's top left corner in 1/16 pixel: right, down. Sample 0 is the centre.
pub const SAMPLES: [(u8, u8); 16] =
    [(8, 8), (2, 3), (7, 0), (11, 2), (14, 1), (1, 6), (6, 4), (10, 5), (13, 7), (0, 10), (4, 9), (12, 11), (3, 15), (5, 12), (9, 13), (15, 14)];

#[cfg(test)]
mod tests {
    use super::SAMPLES;

    #[test]
    fn one_sample_in_each_cell_column_and_row() {
        let mut cells = [0; 16];
        let mut columns = [0; 16];
        let mut rows = [0; 16];
        for (x, y) in SAMPLES {
            cells[(y / 4 * 4 + x / 4) as usize] += 1;
            columns[x as usize] += 1;
            rows[y as usize] += 1;
        }
        assert_eq!((cells, columns, rows), ([1; 16], [1; 16], [1; 16]));
    }
}
