//! Which places are good to stand at: weights on the cells of a room.
//!
//! A costmap begins with weight 1 everywhere and is multiplied by what is wanted: a ring around the
//! thing, a side of it, room to stand. A cell with weight 0 stays out. Samples come without
//! replacement, likely ones first: the k-th one is a function of the weights, the seed and k
//! (Efraimidis and Spirakis, Weighted random sampling with a reservoir, 2006), so a retry goes on
//! where the last one stopped, also in another process. The idea of costmaps as generators and of
//! validators behind them is that of CRAM (Mösenlechner and Beetz, IROS 2011).

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use nalgebra::Vector2;

use crate::random::unit;

use super::convex::Polygon;
use super::grid::Grid;
use super::map::Map;

/// Weights of the cells of a grid: finite, not negative.
#[derive(Debug, Clone, PartialEq)]
pub struct Costmap {
    grid: Grid,
    weights: Vec<f32>,
}

impl Costmap {
    /// The same weight everywhere.
    #[must_use]
    pub fn new(grid: Grid) -> Costmap {
        Costmap { grid, weights: vec![1.0; grid.len()] }
    }

    /// Where its cells are.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The weight of a cell.
    #[must_use]
    pub fn weight(&self, cell: usize) -> f64 {
        self.weights.get(cell).map_or(0.0, |weight| f64::from(*weight))
    }

    /// Multiplied by a function of the cell and its centre. What is negative or no number counts as 0.
    #[must_use]
    pub fn times(mut self, factor: impl Fn(usize, Vector2<f64>) -> f64) -> Costmap {
        for (cell, weight) in self.weights.iter_mut().enumerate().filter(|(_, weight)| **weight > 0.0) {
            let product = f64::from(*weight) * factor(cell, self.grid.centre(cell)).max(0.0);
            *weight = if product.is_finite() { product as f32 } else { 0.0 };
        }
        self
    }

    /// Only in a ring around a point: what an arm reaches from where.
    #[must_use]
    pub fn range(self, centre: Vector2<f64>, least_m: f64, most_m: f64) -> Costmap {
        self.times(|_, at| {
            let distance = (at - centre).norm();
            f64::from(u8::from(distance >= least_m && distance <= most_m))
        })
    }

    /// Best at a distance from a point, then ever less: a normal distribution with this deviation.
    #[must_use]
    pub fn gaussian(self, centre: Vector2<f64>, best_m: f64, deviation_m: f64) -> Costmap {
        self.times(|_, at| {
            let off = ((at - centre).norm() - best_m) / deviation_m;
            libm::exp(-0.5 * off * off)
        })
    }

    /// Only on one side of a line through a point: where `(at - point) · direction` is not negative.
    #[must_use]
    pub fn side(self, point: Vector2<f64>, direction: Vector2<f64>) -> Costmap {
        self.times(|_, at| f64::from(u8::from((at - point).dot(&direction) >= 0.0)))
    }

    /// Only in a region: on a supporting surface.
    #[must_use]
    pub fn region(self, outline: &Polygon) -> Costmap {
        self.times(|_, at| f64::from(u8::from(outline.contains(&at))))
    }

    /// Only near the edge of a region, inside it and outside: in front of a counter, or on its rim.
    #[must_use]
    pub fn boundary(self, outline: &Polygon, within_m: f64) -> Costmap {
        self.times(|_, at| f64::from(u8::from(outline.depth(&at).abs() <= within_m)))
    }

    /// Only where a base can stand at some heading; the grid is that of the map.
    #[must_use]
    pub fn free(self, map: &Map) -> Costmap {
        self.times(|cell, _| f64::from(u8::from(map.free_headings(cell) != 0)))
    }

    /// Less where obstacles are nearer than this.
    #[must_use]
    pub fn clearance(self, map: &Map, wanted_m: f64) -> Costmap {
        self.times(|cell, _| (map.clearance_m(cell) / wanted_m).clamp(0.0, 1.0))
    }

    /// Multiplied, cell by cell, with another map of the same grid.
    #[must_use]
    pub fn and(self, other: &Costmap) -> Costmap {
        self.times(|cell, _| other.weight(cell))
    }

    /// The samples of a seed.
    #[must_use]
    pub fn samples(&self, seed: u64) -> Samples {
        // An exponential variable with the weight as its rate: the least one comes first.
        let key = |cell: usize, weight: f64| -libm::log(1.0 - unit(seed, cell as u64)) / weight;
        let keys = self.weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0);
        let keys: Vec<_> = keys
            .map(|(cell, weight)| Reverse((key(cell, f64::from(*weight)).to_bits(), cell as u32)))
            .collect();
        Samples { grid: self.grid, rest: BinaryHeap::from(keys) }
    }

    /// Sample number `k` of a seed; `None` if there are no more.
    #[must_use]
    pub fn sample(&self, seed: u64, k: usize) -> Option<Vector2<f64>> {
        self.samples(seed).nth(k)
    }

    /// The first of so many samples that something follows from, with its number.
    pub fn find<T>(
        &self,
        seed: u64,
        tries: usize,
        mut validate: impl FnMut(Vector2<f64>) -> Option<T>,
    ) -> Option<(usize, T)> {
        self.samples(seed).take(tries).enumerate().find_map(|(k, at)| Some((k, validate(at)?)))
    }
}

/// Centres of cells, in the order of sampling.
#[derive(Debug, Clone)]
pub struct Samples {
    grid: Grid,
    /// Keys are never negative, so their bits are ordered like the numbers.
    rest: BinaryHeap<Reverse<(u64, u32)>>,
}

impl Iterator for Samples {
    type Item = Vector2<f64>;

    fn next(&mut self) -> Option<Vector2<f64>> {
        self.rest.pop().map(|Reverse((_, cell))| self.grid.centre(cell as usize))
    }
}
