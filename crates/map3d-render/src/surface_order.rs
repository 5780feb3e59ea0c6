//! Numbers of things on surfaces, surface by surface. Sorted by counting: the order within a surface stays.

#[derive(Default)]
pub struct SurfaceOrder {
    /// By surface: the end of its numbers.
    ends: Vec<u32>,
    numbers: Vec<u32>,
}

impl SurfaceOrder {
    /// `surface_of`: the surface of each thing, below `surfaces`.
    pub fn sort(&mut self, surfaces: usize, surface_of: impl ExactSizeIterator<Item = u32> + Clone) {
        self.ends.clear();
        self.ends.resize(surfaces, 0);
        surface_of.clone().for_each(|surface| self.ends[surface as usize] += 1);
        let mut first = 0;
        for end in &mut self.ends {
            (*end, first) = (first, first + *end);
        }
        self.numbers.resize(surface_of.len(), 0);
        for (number, surface) in surface_of.enumerate() {
            let place = &mut self.ends[surface as usize];
            self.numbers[*place as usize] = number as u32;
            *place += 1;
        }
    }

    /// Returns the numbers of the things on a surface.
    pub fn of(&self, surface: usize) -> &[u32] {
        let first = if surface == 0 { 0 } else { self.ends[surface - 1] };
        &self.numbers[first as usize..self.ends[surface] as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_surface_has_its_numbers_in_order() {
        let mut order = SurfaceOrder::default();
        for surface_of in [vec![2, 0, 2, 4, 0, 2], vec![], vec![1]] {
            order.sort(5, surface_of.iter().copied());
            for surface in 0..5 {
                let expected: Vec<u32> = (0..surface_of.len() as u32).filter(|k| surface_of[*k as usize] == surface).collect();
                assert_eq!(order.of(surface as usize), expected);
            }
        }
    }
}
