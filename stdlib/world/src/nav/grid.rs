//! Cells of a floor, rows of bits, and distances between cells.
//!
//! A grid covers the room's bounds and one more cell on each side, so that each cell within the
//! bounds has eight neighbours. Cells are numbered row by row from the lowest corner.

use nalgebra::Vector2;

use super::convex::Polygon;

/// Cells at most along one side: rooms larger than this get larger cells.
const MAX_SIDE: f64 = 1000.0;

/// Where the cells are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    /// Centre of cell 0.
    pub origin: Vector2<f64>,
    /// Edge of a cell, metres.
    pub cell_m: f64,
    /// Cells in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

impl Grid {
    /// Cells of (about) this size over a rectangle, and one more at each side. A rectangle that
    /// cannot be one gives a grid of one cell and its neighbours.
    #[must_use]
    pub fn over(low: Vector2<f64>, high: Vector2<f64>, cell_m: f64) -> Grid {
        let size = high - low;
        let sound = size.x.is_finite() && size.y.is_finite() && size.x > 0.0 && size.y > 0.0;
        let size = if sound { size } else { Vector2::repeat(1.0) };
        let low = if sound { low } else { Vector2::zeros() };
        let least = size.x.max(size.y) / MAX_SIDE;
        let cell_m = if cell_m.is_finite() { cell_m.max(least).max(1e-3) } else { size.x.max(size.y) };
        let count = |length: f64| libm::ceil(length / cell_m - 1e-9).max(1.0) as usize + 2;
        let origin = low - Vector2::repeat(0.5 * cell_m);
        Grid { origin, cell_m, width: count(size.x), height: count(size.y) }
    }

    /// Number of cells.
    #[must_use]
    pub fn len(&self) -> usize {
        self.width * self.height
    }

    /// Never: a grid has at least nine cells.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The centre of a cell.
    #[must_use]
    pub fn centre(&self, cell: usize) -> Vector2<f64> {
        let (row, column) = (cell / self.width, cell % self.width);
        self.origin + Vector2::new(column as f64, row as f64) * self.cell_m
    }

    /// The cell of a point; `None` on the outermost ring, and beyond.
    #[must_use]
    pub fn cell(&self, point: &Vector2<f64>) -> Option<usize> {
        let place = (point - self.origin) / self.cell_m;
        let (column, row) = (libm::floor(place.x + 0.5), libm::floor(place.y + 0.5));
        let inside = |number: f64, count: usize| number >= 1.0 && number <= (count - 2) as f64;
        (inside(column, self.width) && inside(row, self.height))
            .then(|| row as usize * self.width + column as usize)
    }

    /// Half the diagonal of a cell: how far a point may be from the centre of its cell.
    #[must_use]
    pub fn half_diagonal(&self) -> f64 {
        self.cell_m * std::f64::consts::FRAC_1_SQRT_2
    }

    /// Words of 64 bits that a row of bits takes.
    pub(super) fn words(&self) -> usize {
        self.width.div_ceil(64)
    }

    /// Sets the bits of all cells whose centre is in the polygon.
    pub(crate) fn fill(&self, polygon: &Polygon, bits: &mut [u64]) {
        let (low, high) = polygon.bounds();
        let per_metre = 1.0 / self.cell_m;
        let first = up((low.y - self.origin.y) * per_metre).max(0);
        let last = down((high.y - self.origin.y) * per_metre).min(self.height as i64 - 1);
        if first > last {
            return;
        }
        // The two sides of the polygon, from its lowest corner up.
        let mut right = Side::new(polygon.corners(), true);
        let mut left = Side::new(polygon.corners(), false);
        let words = self.words();
        for row in first as usize..=last as usize {
            let y = self.origin.y + row as f64 * self.cell_m;
            let from = up((left.at(y) - self.origin.x) * per_metre).max(0);
            let to = down((right.at(y) - self.origin.x) * per_metre).min(self.width as i64 - 1);
            if from <= to {
                set(&mut bits[row * words..(row + 1) * words], from as usize, to as usize);
            }
        }
    }

    /// Sets the bits of all cells whose centre is outside of a rectangle.
    pub(super) fn fill_outside(&self, low: Vector2<f64>, high: Vector2<f64>, bits: &mut [u64]) {
        let words = self.words();
        let column = |x: f64| (x - self.origin.x) / self.cell_m;
        let last = (self.width - 1) as f64;
        let left = libm::ceil(column(low.x)) - 1.0;
        let right = libm::floor(column(high.x)) + 1.0;
        for row in 0..self.height {
            let y = self.origin.y + row as f64 * self.cell_m;
            let line = &mut bits[row * words..(row + 1) * words];
            if !(y >= low.y && y <= high.y && left + 1.0 <= right - 1.0) {
                set(line, 0, self.width - 1);
                continue;
            }
            if left >= 0.0 {
                set(line, 0, left.min(last) as usize);
            }
            if right <= last {
                set(line, right.max(0.0) as usize, self.width - 1);
            }
        }
    }

    /// For each cell the square of its distance to the nearest cell whose bit is set, in cells.
    ///
    /// Exact. The lower envelope of parabolas (Felzenszwalb and Huttenlocher, Distance transforms of
    /// sampled functions, 2012) along rows, in whole numbers (as Meijster, Roerdink, Hesselink,
    /// 2000); along columns two sweeps do, as there are only zeros and ones.
    pub(crate) fn distances(&self, bits: &[u64]) -> Vec<u32> {
        let (width, height) = (self.width, self.height);
        // Farther than any cell is from any other.
        let far = (width + height) as i32;
        let mut down = vec![far; self.len()];
        let words = self.words();
        for row in 0..height {
            let line = &bits[row * words..(row + 1) * words];
            for column in 0..width {
                let cell = row * width + column;
                let below = if row == 0 { far } else { (down[cell - width] + 1).min(far) };
                down[cell] = if line[column / 64] >> (column % 64) & 1 == 1 { 0 } else { below };
            }
        }
        for cell in (0..self.len() - width).rev() {
            down[cell] = down[cell].min(down[cell + width] + 1);
        }
        let mut out = vec![0; self.len()];
        // Parabolas of the envelope: their columns, and where each begins.
        let (mut tops, mut begins) = (vec![0_i32; width], vec![0_i32; width]);
        for row in 0..height {
            let line = &down[row * width..(row + 1) * width];
            envelope(line, &mut tops, &mut begins, &mut out[row * width..(row + 1) * width]);
        }
        out
    }
}

/// One row: `line` holds distances along columns.
fn envelope(line: &[i32], tops: &mut [i32], begins: &mut [i32], out: &mut [u32]) {
    let value = |at: i32, top: i32| (at - top) * (at - top) + line[top as usize] * line[top as usize];
    // The last column up to which the parabola of `a` is below that of `b`, for a < b.
    let meet = |a: i32, b: i32| {
        let (at_a, at_b) = (line[a as usize], line[b as usize]);
        (b * b - a * a + at_b * at_b - at_a * at_a).div_euclid(2 * (b - a))
    };
    let width = line.len() as i32;
    let mut count = 1;
    (tops[0], begins[0]) = (0, 0);
    for column in 1..width {
        while count > 0 && value(begins[count - 1], tops[count - 1]) > value(begins[count - 1], column) {
            count -= 1;
        }
        let begin = if count == 0 { 0 } else { meet(tops[count - 1], column) + 1 };
        if begin < width {
            (tops[count], begins[count]) = (column, begin.max(0));
            count += 1;
        }
    }
    for column in (0..width).rev() {
        out[column as usize] = value(column, tops[count - 1]) as u32;
        if count > 1 && column == begins[count - 1] {
            count -= 1;
        }
    }
}

/// One side of a polygon, walked upwards.
struct Side<'a> {
    corners: &'a [Vector2<f64>],
    right: bool,
    /// Number of the corner at the upper end of this edge, counted from the lowest one.
    next: usize,
    from: Vector2<f64>,
    /// Y of the corner at the upper end.
    to_y: f64,
    slope: f64,
}

impl<'a> Side<'a> {
    fn new(corners: &'a [Vector2<f64>], right: bool) -> Side<'a> {
        let mut side = Side { corners, right, next: 0, from: corners[0], to_y: corners[0].y, slope: 0.0 };
        side.advance();
        // A flat edge at the bottom is no part of a side.
        while side.next < corners.len() && side.to_y <= side.from.y {
            side.advance();
        }
        side
    }

    fn corner(&self, number: usize) -> Vector2<f64> {
        let count = self.corners.len();
        let place = number % count;
        self.corners[if self.right || place == 0 { place } else { count - place }]
    }

    fn advance(&mut self) {
        self.from = self.corner(self.next);
        self.next += 1;
        let to = self.corner(self.next);
        self.to_y = to.y;
        let rise = to.y - self.from.y;
        self.slope = if rise > 0.0 { (to.x - self.from.x) / rise } else { 0.0 };
    }

    /// X of this side at a height not below those asked before.
    #[inline]
    fn at(&mut self, y: f64) -> f64 {
        while self.to_y < y && self.next < self.corners.len() {
            self.advance();
        }
        self.from.x + (y - self.from.y) * self.slope
    }
}

/// The next whole number above, or the number itself. A conversion is faster than `libm::ceil`; numbers
/// that do not fit are far outside of any grid on the right side.
#[inline]
fn up(number: f64) -> i64 {
    let whole = number as i64;
    whole.saturating_add(i64::from(whole as f64 != number && number > 0.0))
}

/// The next whole number below, or the number itself.
#[inline]
fn down(number: f64) -> i64 {
    let whole = number as i64;
    whole.saturating_sub(i64::from(whole as f64 != number && number < 0.0))
}

/// Sets bits `from` to `to`, both included.
#[inline]
fn set(bits: &mut [u64], from: usize, to: usize) {
    let (first, last) = (from / 64, to / 64);
    let above = u64::MAX << (from % 64);
    let below = u64::MAX >> (63 - to % 64);
    if first == last {
        bits[first] |= above & below;
        return;
    }
    bits[first] |= above;
    bits[first + 1..last].fill(u64::MAX);
    bits[last] |= below;
}
