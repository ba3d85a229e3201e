//! Where a base can stand: free cells, free headings, clearance.
//!
//! The floor is a grid. For each of 16 headings, the places at which an outline touches an obstacle
//! are the Minkowski sum of the obstacle and the mirrored outline (Lozano-Pérez, Spatial planning: a
//! configuration space approach, 1983): a convex polygon, filled row by row into a plane of bits. The
//! same is done for the 16 turns from one heading to the next, with an outline around the whole
//! turn. So each cell has its headings exactly, for less than it costs to ask at a few hundred cells.
//!
//! The free headings of a cell fall into *arcs* that the base can turn through on the spot. A cell
//! with an arc is a node of the graph that [`super::flood`] runs through; most cells have one arc with
//! all headings.
//!
//! The clearance of a cell is its distance to the nearest obstacle between the robot's lowest and
//! highest point. Where it is above the circumscribed radius, no shape is looked at.

use nalgebra::{Isometry3, Vector2};

use crate::shape::PosedShape;

use super::convex::{Polygon, heights, placed, turned};
use super::footprint::Footprint;
use super::grid::Grid;
use super::{Blocker, Place, turn_between};

/// Headings that cells are looked at with.
pub const HEADINGS: usize = 16;
/// Radians from one to the next.
pub(super) const STEP_RAD: f64 = std::f64::consts::TAU / HEADINGS as f64;
/// Outlines of a turn are made of steps of this size.
const TURN_STEP_RAD: f64 = STEP_RAD * 0.5;
/// Cost of a cell with room around it.
pub(super) const LEAST_FACTOR: u8 = 16;
/// What the lowest clearance adds to it.
const FACTOR_RANGE: f64 = 32.0;

/// The part of the floor on which the whole robot has to stay. Walls are barriers, no bounds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Room {
    /// Least X and Y.
    pub low: Vector2<f64>,
    /// Greatest X and Y.
    pub high: Vector2<f64>,
}

/// Something that stands around: shapes in the frame of a body, and where that is in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Barrier<'a> {
    /// Of the body in the world.
    pub pose: Isometry3<f64>,
    /// In its frame.
    pub shapes: &'a [PosedShape],
    /// It cannot be put elsewhere, or closed: a wall, a counter.
    pub fixed: bool,
}

/// How a map is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Edge of a cell, metres.
    pub cell_m: f64,
    /// Room that ways leave around the outlines, metres. A half cell makes sure that nothing lies
    /// between two free cells.
    pub margin_m: f64,
    /// Clearance beyond the inscribed circle from which on a cell costs no more than others, metres.
    pub comfort_m: f64,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings { cell_m: 0.05, margin_m: 0.025, comfort_m: 0.3 }
    }
}

/// Where a base can stand.
#[derive(Debug, Clone)]
pub struct Map {
    room: Room,
    grid: Grid,
    settings: Settings,
    footprint: Footprint,
    /// Outlines with the margin around them.
    wide: Vec<Polygon>,
    blocks: Vec<Block>,
    /// Metres from the centre of a cell to the nearest obstacle at least.
    clearance: Vec<f32>,
    /// What a cell costs, [`LEAST_FACTOR`] and more.
    pub(super) factors: Vec<u8>,
    pub(super) nodes: Nodes,
}

/// A shape of a barrier from above.
#[derive(Debug, Clone)]
struct Block {
    barrier: usize,
    fixed: bool,
    outline: Polygon,
    /// The robot's bands that it is as high as.
    bands: u8,
}

/// Cells with their arcs.
#[derive(Debug, Clone, Default)]
pub(super) struct Nodes {
    /// Number of the first node of each cell; one more at the end.
    pub first: Vec<u32>,
    /// Headings of each node, bit `i` for heading `i`.
    pub arcs: Vec<u16>,
    /// The cell of each node.
    pub cells: Vec<u32>,
    /// All free headings of each cell.
    pub free: Vec<u16>,
}

impl Nodes {
    /// The nodes of a cell.
    pub fn of_cell(&self, cell: usize) -> std::ops::Range<usize> {
        self.first[cell] as usize..self.first[cell + 1] as usize
    }
}

impl Map {
    /// The map of a room for a robot with this footprint.
    #[must_use]
    pub fn new(room: Room, barriers: &[Barrier], footprint: Footprint, settings: Settings) -> Map {
        let grid = Grid::over(room.low, room.high, settings.cell_m);
        let wide =
            footprint.bands.iter().map(|band| widened(&band.outline, settings.margin_m)).collect();
        let mut blocks = Vec::new();
        for (place, barrier) in barriers.iter().enumerate() {
            for posed in barrier.shapes {
                let posed = placed(&barrier.pose, posed);
                let (low, high) = heights(&posed);
                let bands = footprint.bands_between(low, high);
                let Some(outline) = (bands != 0).then(|| Polygon::shadow(&posed)).flatten() else { continue };
                blocks.push(Block { barrier: place, fixed: barrier.fixed, outline, bands });
            }
        }
        let mut map = Map {
            room,
            grid,
            settings,
            footprint,
            wide,
            blocks,
            clearance: Vec::new(),
            factors: Vec::new(),
            nodes: Nodes::default(),
        };
        map.clearance = map.clearances();
        map.factors = map.clearance.iter().map(|clearance| map.factor(f64::from(*clearance))).collect();
        map.nodes = map.nodes_among(|_| true);
        map
    }

    /// Where its cells are.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The floor that it covers.
    #[must_use]
    pub fn room(&self) -> &Room {
        &self.room
    }

    /// The robot that it was made for.
    #[must_use]
    pub fn footprint(&self) -> &Footprint {
        &self.footprint
    }

    /// Metres from the centre of a cell to the nearest obstacle at least; too low by a diagonal of a
    /// cell at most. Not positive where an obstacle is.
    #[must_use]
    pub fn clearance_m(&self, cell: usize) -> f64 {
        self.clearance.get(cell).map_or(f64::NEG_INFINITY, |clearance| f64::from(*clearance))
    }

    /// The headings at which a base may stand at the centre of a cell, with the margin: bit `i` for
    /// a yaw of `i` sixteenths of a turn.
    #[must_use]
    pub fn free_headings(&self, cell: usize) -> u16 {
        self.nodes.free.get(cell).copied().unwrap_or(0)
    }

    /// What a base at this place touches, exactly and without a margin; `None` if it is free.
    #[must_use]
    pub fn blocker(&self, place: &Place) -> Option<Blocker> {
        if !place.is_finite() {
            return Some(Blocker::Bounds);
        }
        if self.clearance_at(&place.point()) >= self.footprint.circumscribed_m() {
            return None;
        }
        let turn = libm::sincos(place.yaw);
        let outlines = self.footprint.bands.iter().map(|band| band.outline.moved(turn, place.point()));
        self.blocker_of(&outlines.collect::<Vec<_>>(), self.blocks.iter())
    }

    // -----------------------------------------------------------------------------------------
    // Exact questions

    /// Metres from a point to the nearest obstacle at least.
    pub(super) fn clearance_at(&self, point: &Vector2<f64>) -> f64 {
        let cell = self.grid.cell(point);
        cell.map_or(f64::NEG_INFINITY, |cell| self.clearance_m(cell) - self.grid.half_diagonal())
    }

    /// What a base touches that moves in a straight line at one heading.
    pub(super) fn line_blocker(
        &self,
        (from, to): (Vector2<f64>, Vector2<f64>),
        yaw_rad: f64,
        with_margin: bool,
    ) -> Option<Blocker> {
        let margin = if with_margin { self.settings.margin_m } else { 0.0 };
        if self.is_roomy((from, to), margin) {
            return None;
        }
        let turn = libm::sincos(yaw_rad);
        let swept = |outline: &Polygon| outline.moved(turn, from).along(to - from);
        let outlines: Vec<Polygon> = self.outlines(with_margin).map(swept).collect();
        self.blocker_of(&outlines, self.blocks.iter())
    }

    /// True if the circumscribed circle is free all along a line.
    pub(super) fn is_roomy(&self, (from, to): (Vector2<f64>, Vector2<f64>), margin_m: f64) -> bool {
        /// Steps shorter than this are not worth it, metres.
        const LEAST_STEP: f64 = 0.01;
        let radius = self.footprint.circumscribed_m() + margin_m;
        let length = (to - from).norm();
        let mut done = 0.0;
        loop {
            let point = if done >= length { to } else { from + (to - from) * (done / length) };
            let room = self.clearance_at(&point) - radius;
            if done + room >= length && room >= 0.0 {
                return true;
            }
            // Not so for NaN, too.
            if !(room >= LEAST_STEP) {
                return false;
            }
            done += room;
        }
    }

    /// What a base touches that turns on the spot from one heading by an angle.
    pub(super) fn turn_blocker(&self, at: Vector2<f64>, from_rad: f64, by_rad: f64) -> Option<Blocker> {
        if self.clearance_at(&at) >= self.footprint.circumscribed_m() {
            return None;
        }
        let reach = self.footprint.circumscribed_m();
        let near: Vec<&Block> = self.blocks.iter().filter(|block| block.is_near(&at, reach)).collect();
        let room_around = (0..2).all(|axis| {
            at[axis] - reach >= self.room.low[axis] && at[axis] + reach <= self.room.high[axis]
        });
        if near.is_empty() && room_around {
            return None;
        }
        let steps = libm::ceil(by_rad.abs() / TURN_STEP_RAD).clamp(1.0, 64.0);
        (0..steps as usize).find_map(|step| {
            let from = from_rad + by_rad * step as f64 / steps;
            let outlines: Option<Vec<Polygon>> = self
                .outlines(false)
                .map(|outline| swing(outline, from, by_rad / steps))
                .map(|outline| outline.map(|outline| outline.moved((0.0, 1.0), at)))
                .collect();
            outlines.map_or(Some(Blocker::Bounds), |outlines| self.blocker_of(&outlines, near.iter().copied()))
        })
    }

    /// By how much to turn on the spot to get from one heading to another: the short way, or the
    /// long one if the short one is blocked.
    pub(super) fn turn(&self, at: Vector2<f64>, from_rad: f64, to_rad: f64) -> Result<f64, Blocker> {
        use std::f64::consts::TAU;
        let short = turn_between(from_rad, to_rad);
        let Some(blocker) = self.turn_blocker(at, from_rad, short) else { return Ok(short) };
        let long = if short > 0.0 { short - TAU } else { short + TAU };
        // Both ways begin and end alike; what blocks there need not be asked twice.
        match self.turn_blocker(at, from_rad, long) {
            None => Ok(long),
            Some(_) => Err(blocker),
        }
    }

    /// What touches the base, with the margin, at a place; asked among movable things only first.
    pub(super) fn near_blocker(&self, place: &Place) -> Option<Blocker> {
        let turn = libm::sincos(place.yaw);
        let outlines: Vec<Polygon> = self.wide.iter().map(|outline| outline.moved(turn, place.point())).collect();
        let movable = self.blocks.iter().filter(|block| !block.fixed);
        let movable = self.blocker_of(&outlines, movable).filter(|by| *by != Blocker::Bounds);
        movable.or_else(|| self.blocker_of(&outlines, self.blocks.iter()))
    }

    fn outlines(&self, with_margin: bool) -> impl Iterator<Item = &Polygon> {
        let bands = &self.footprint.bands;
        self.wide.iter().zip(bands).map(move |(wide, band)| if with_margin { wide } else { &band.outline })
    }

    /// The first barrier that one of the outlines touches, each outline in its own band.
    fn blocker_of<'b>(
        &self,
        outlines: &[Polygon],
        mut blocks: impl Iterator<Item = &'b Block>,
    ) -> Option<Blocker> {
        let touches = |block: &&Block| {
            let meets = |place: usize| block.bands >> place & 1 == 1;
            let mut numbered = outlines.iter().enumerate();
            numbered.any(|(place, outline)| meets(place) && outline.touches(&block.outline))
        };
        if let Some(block) = blocks.find(touches) {
            return Some(Blocker::Barrier(block.barrier));
        }
        let inside = |outline: &Polygon| {
            let (low, high) = outline.bounds();
            (0..2).all(|axis| low[axis] >= self.room.low[axis] && high[axis] <= self.room.high[axis])
        };
        (!outlines.iter().all(inside)).then_some(Blocker::Bounds)
    }

    // -----------------------------------------------------------------------------------------
    // Making

    /// Cells that an obstacle or the outside has a part of; then distances. A point of an obstacle is
    /// at most half a diagonal from the centre of its cell, so that much is taken off.
    fn clearances(&self) -> Vec<f32> {
        let mut bits = vec![0; self.grid.words() * self.grid.height];
        let half = Vector2::repeat(self.grid.cell_m * 0.5);
        if let Some(square) = Polygon::rectangle(-half, half) {
            for block in &self.blocks {
                self.grid.fill(&block.outline.plus(&square), &mut bits);
            }
        }
        let inner = half - Vector2::repeat(1e-9);
        self.grid.fill_outside(self.room.low + inner, self.room.high - inner, &mut bits);
        let metres = |squared: u32| f64::from(squared).sqrt() * self.grid.cell_m - self.grid.half_diagonal();
        self.grid.distances(&bits).into_iter().map(|squared| metres(squared) as f32).collect()
    }

    fn factor(&self, clearance_m: f64) -> u8 {
        let spare = (clearance_m - self.footprint.inscribed_m()) / self.settings.comfort_m;
        // NaN, from a comfort of 0, counts as enough.
        let tight = if spare < 1.0 { 1.0 - spare.max(0.0) } else { 0.0 };
        LEAST_FACTOR + libm::round(tight * FACTOR_RANGE) as u8
    }

    /// The nodes that are left if only these blocks stand around.
    fn nodes_among(&self, counts: impl Fn(&Block) -> bool) -> Nodes {
        let counted: Vec<&Block> = self.blocks.iter().filter(|block| counts(block)).collect();
        // What lies within something larger as seen from above, at the same heights, adds nothing:
        // a cup on a counter that is as high as the arms.
        let covers = |a: &Block, b: &Block| a.bands & b.bands == b.bands && a.outline.covers(&b.outline);
        let needed = |place: usize| {
            let block = counted[place];
            !counted.iter().enumerate().any(|(other, larger)| {
                other != place && covers(larger, block) && (other < place || !covers(block, larger))
            })
        };
        let needed: Vec<(&Block, u8)> = (0..counted.len())
            .filter(|place| needed(*place))
            .map(|place| (counted[place], self.widest(counted[place].bands)))
            .collect();
        let mut planes: Vec<Vec<u64>> = Vec::with_capacity(2 * HEADINGS);
        for number in 0..2 * HEADINGS {
            let from = (number % HEADINGS) as f64 * STEP_RAD;
            let by = if number < HEADINGS { 0.0 } else { STEP_RAD };
            planes.push(self.plane(&needed, from, by));
        }
        self.gather(&planes)
    }

    /// Cells at which the base touches something while it turns by this angle.
    fn plane(&self, blocks: &[(&Block, u8)], from_rad: f64, by_rad: f64) -> Vec<u64> {
        let mut bits = vec![0; self.grid.words() * self.grid.height];
        // Also where there is no outline at all, a base stays within the bounds.
        let (mut low, mut high) = (Vector2::zeros(), Vector2::zeros());
        for (place, wide) in self.wide.iter().enumerate() {
            let Some(outline) = swing(wide, from_rad, by_rad) else { continue };
            low = low.inf(&outline.bounds().0);
            high = high.sup(&outline.bounds().1);
            let mirrored = outline.mirrored();
            for (block, _) in blocks.iter().filter(|(_, bands)| bands >> place & 1 == 1) {
                self.grid.fill(&block.outline.plus(&mirrored), &mut bits);
            }
        }
        self.grid.fill_outside(self.room.low - low, self.room.high - high, &mut bits);
        bits
    }

    /// Bands without those that lie within another one: what is as high as both need not be held
    /// against both.
    fn widest(&self, bands: u8) -> u8 {
        let has = |place: usize| bands >> place & 1 == 1;
        let covered = |place: usize| {
            self.wide.iter().enumerate().any(|(other, larger)| {
                other != place
                    && has(other)
                    && larger.covers(&self.wide[place])
                    && (other < place || !self.wide[place].covers(larger))
            })
        };
        (0..self.wide.len()).filter(|place| has(*place) && !covered(*place)).map(|place| 1 << place).sum()
    }

    fn gather(&self, planes: &[Vec<u64>]) -> Nodes {
        let (count, words) = (self.grid.len(), self.grid.words());
        let mut nodes = Nodes {
            first: Vec::with_capacity(count + 1),
            arcs: Vec::with_capacity(count),
            cells: Vec::with_capacity(count),
            free: Vec::with_capacity(count),
        };
        for row in 0..self.grid.height {
            for word in 0..words {
                let place = row * words + word;
                let some = planes.iter().fold(0, |bits, plane| bits | plane[place]);
                let every = planes[..HEADINGS].iter().fold(u64::MAX, |bits, plane| bits & plane[place]);
                let here: [u64; 2 * HEADINGS] = std::array::from_fn(|number| planes[number][place]);
                for bit in 0..(self.grid.width - word * 64).min(64) {
                    let cell = row * self.grid.width + word * 64 + bit;
                    let is = |bits: u64| bits >> bit & 1 == 1;
                    let headings = |from: usize| {
                        (0..HEADINGS).fold(0, |all, number| all | ((here[from + number] >> bit & 1) as u16) << number)
                    };
                    let (free, stops) = match (is(every), is(some)) {
                        (true, _) => (0, 0),
                        (_, false) => (u16::MAX, 0),
                        _ => (!headings(0), headings(HEADINGS)),
                    };
                    nodes.push(cell as u32, free, stops);
                }
            }
        }
        nodes.first.push(nodes.arcs.len() as u32);
        nodes
    }

    /// Free headings of all cells if only fixed things stood around.
    pub(super) fn free_without_movable(&self) -> Vec<u16> {
        self.nodes_among(|block| block.fixed).free
    }
}

impl Block {
    /// False if it is certainly farther than this from a point.
    fn is_near(&self, point: &Vector2<f64>, reach_m: f64) -> bool {
        let (low, high) = self.outline.bounds();
        (0..2).all(|axis| low[axis] <= point[axis] + reach_m && high[axis] >= point[axis] - reach_m)
    }
}

impl Nodes {
    /// The next cell; `stops`: bit `i` if the turn from heading `i` to the next is blocked.
    fn push(&mut self, cell: u32, free: u16, stops: u16) {
        self.first.push(self.arcs.len() as u32);
        self.free.push(free);
        // An arc begins where one cannot come from the heading before.
        let from_before = (free & !stops).rotate_left(1);
        let mut begins = free & !from_before;
        if free != 0 && begins == 0 {
            self.arcs.push(free);
            self.cells.push(cell);
        }
        while begins != 0 {
            let begin = begins.trailing_zeros();
            begins &= begins - 1;
            let mut arc = 0_u16;
            let mut heading = begin;
            loop {
                arc |= 1 << heading;
                let goes_on = stops >> heading & 1 == 0;
                heading = (heading + 1) % HEADINGS as u32;
                if !goes_on || free >> heading & 1 == 0 || heading == begin {
                    break;
                }
            }
            self.arcs.push(arc);
            self.cells.push(cell);
        }
    }
}

/// An outline with room around it.
fn widened(outline: &Polygon, margin_m: f64) -> Polygon {
    use std::f64::consts::{FRAC_PI_4, FRAC_PI_8};
    let outer = margin_m / libm::cos(FRAC_PI_8);
    let around = (0..8).map(|number| {
        let (sin, cos) = libm::sincos(FRAC_PI_8 + FRAC_PI_4 * f64::from(number));
        Vector2::new(outer * cos, outer * sin)
    });
    let octagon = Polygon::around(&around.collect::<Vec<_>>());
    octagon.map_or_else(|| outline.clone(), |octagon| outline.plus(&octagon))
}

/// A polygon around an outline while it turns from one heading by an angle. A corner on its arc stays
/// within the tangents at both ends.
fn swing(outline: &Polygon, from_rad: f64, by_rad: f64) -> Option<Polygon> {
    let begin = libm::sincos(from_rad);
    if by_rad == 0.0 {
        return Some(outline.moved(begin, Vector2::zeros()));
    }
    let middle = libm::sincos(from_rad + by_rad * 0.5);
    let end = libm::sincos(from_rad + by_rad);
    let outer = 1.0 / libm::cos(by_rad * 0.5);
    let mut points = Vec::with_capacity(outline.corners().len() * 3);
    for corner in outline.corners() {
        points.push(turned(corner, begin.0, begin.1));
        points.push(turned(corner, middle.0, middle.1) * outer);
        points.push(turned(corner, end.0, end.1));
    }
    Polygon::around(&points)
}

