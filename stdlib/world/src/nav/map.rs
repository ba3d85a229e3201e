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
//!
//! Walls and counters are most of the work, and stay: a [`Ground`] has done it once for each outline of
//! the robot, and a [`Map`] adds what stands around in one version of the world.

use std::sync::Arc;

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

/// By how much outlines with a margin may be larger than they need, for fewer corners, metres.
const SIMPLER_M: f64 = 0.005;

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

/// What does not change when things are put elsewhere: a room with its walls and counters, and a robot
/// of one outline in it.
#[derive(Debug, Clone)]
pub struct Ground {
    room: Room,
    grid: Grid,
    settings: Settings,
    footprint: Footprint,
    /// Outlines with the margin around them, one for each band.
    wide: Vec<Polygon>,
    /// The same around a turn from heading 0 to the next.
    swung: Vec<Polygon>,
    blocks: Vec<Block>,
    /// Cells that a block has a part of.
    occupied: Vec<u64>,
    /// Cells where the base touches something: for each heading, then for each turn to the next.
    planes: Vec<Vec<u64>>,
}

/// Where a base can stand in one version of the world.
#[derive(Debug, Clone)]
pub struct Map {
    ground: Arc<Ground>,
    blocks: Vec<Block>,
    /// Metres from the centre of a cell to the nearest obstacle at least.
    clearance: Vec<f32>,
    /// What a cell costs, [`LEAST_FACTOR`] and more.
    pub(super) factors: Vec<u8>,
    pub(super) nodes: Nodes,
}

/// A shape of a barrier from above.
#[derive(Debug, Clone, PartialEq)]
struct Block {
    barrier: usize,
    outline: Polygon,
    /// The robot's bands that it is as high as.
    bands: u8,
}

/// Cells with their arcs. The first arc of a cell is the node of the same number; the few others
/// come after all cells.
#[derive(Debug, Clone, Default)]
pub(super) struct Nodes {
    /// Headings of each node, bit `i` for heading `i`; 0 is no node.
    pub arcs: Vec<u16>,
    /// All free headings of each cell.
    pub free: Vec<u16>,
    /// The cells of the nodes beyond the first ones, rising.
    more: Vec<u32>,
    /// For each cell: how many of `more` come before its own.
    before: Vec<u32>,
}

impl Nodes {
    /// The nodes of a cell.
    pub fn of_cell(&self, cell: usize) -> impl Iterator<Item = usize> + use<'_> {
        let first = usize::from(self.arcs[cell] != 0);
        (cell..cell + first).chain(self.others(cell))
    }

    /// The nodes of a cell without the first one.
    pub fn others(&self, cell: usize) -> impl Iterator<Item = usize> + use<'_> {
        let from = self.before[cell] as usize;
        let count = self.more[from..].iter().take_while(move |other| **other as usize == cell).count();
        self.free.len() + from..self.free.len() + from + count
    }

    /// The cell of a node.
    #[inline]
    pub fn cell(&self, node: usize) -> usize {
        if node < self.free.len() { node } else { self.more[node - self.free.len()] as usize }
    }
}

impl Ground {
    /// A room with what cannot be put elsewhere, for a robot with this footprint. Of the `barriers` the
    /// fixed ones count.
    #[must_use]
    pub fn new(room: Room, barriers: &[Barrier], footprint: Footprint, settings: Settings) -> Ground {
        let grid = Grid::over(room.low, room.high, settings.cell_m);
        let wide: Vec<Polygon> =
            footprint.bands.iter().map(|band| widened(&band.outline, settings.margin_m)).collect();
        let swing = |outline: &Polygon| swing(outline, 0.0, STEP_RAD).unwrap_or_else(|| outline.clone());
        let mut ground = Ground {
            room,
            grid,
            settings,
            swung: wide.iter().map(|outline| swing(outline).simpler(SIMPLER_M)).collect(),
            wide,
            blocks: blocks(barriers, true, &footprint),
            footprint,
            occupied: vec![0; grid.words() * grid.height],
            planes: vec![vec![0; grid.words() * grid.height]; 2 * HEADINGS],
        };
        let mut occupied = std::mem::take(&mut ground.occupied);
        ground.occupy(&ground.blocks, &mut occupied);
        let inner = Vector2::repeat(grid.cell_m * 0.5 - 1e-9);
        grid.fill_outside(room.low + inner, room.high - inner, &mut occupied);
        ground.occupied = occupied;
        let mut planes = std::mem::take(&mut ground.planes);
        ground.block(&ground.blocks, &mut planes);
        for (number, plane) in planes.iter_mut().enumerate() {
            // Also where there is no outline at all, a base stays within the bounds.
            let (mut low, mut high) = (Vector2::zeros(), Vector2::zeros());
            for outline in ground.outlines_at(number) {
                low = low.inf(&outline.bounds().0);
                high = high.sup(&outline.bounds().1);
            }
            grid.fill_outside(room.low - low, room.high - high, plane);
        }
        ground.planes = planes;
        ground
    }

    /// The robot that it was made for.
    #[must_use]
    pub fn footprint(&self) -> &Footprint {
        &self.footprint
    }

    /// Marks all cells that a block has a part of.
    fn occupy(&self, blocks: &[Block], bits: &mut [u64]) {
        let half = Vector2::repeat(self.grid.cell_m * 0.5);
        if let Some(square) = Polygon::rectangle(-half, half) {
            for block in blocks {
                self.grid.fill(&block.outline.plus(&square), bits);
            }
        }
    }

    /// Marks where the base touches these blocks, in each plane.
    fn block(&self, blocks: &[Block], planes: &mut [Vec<u64>]) {
        // What lies within something larger as seen from above, at the same heights, adds nothing:
        // a cup on a counter that is as high as the arms.
        let covers = |a: &Block, b: &Block| a.bands & b.bands == b.bands && a.outline.covers(&b.outline);
        let adds = |(place, block): &(usize, &Block)| {
            let fixed = std::ptr::eq(blocks, self.blocks.as_slice());
            let earlier = if fixed { &[] } else { self.blocks.as_slice() };
            !earlier.iter().any(|larger| covers(larger, block))
                && !blocks.iter().enumerate().any(|(other, larger)| {
                    other != *place && covers(larger, block) && (other < *place || !covers(block, larger))
                })
        };
        let blocks: Vec<(&Block, u8)> = blocks
            .iter()
            .enumerate()
            .filter(adds)
            .map(|(_, block)| (block, self.widest(block.bands)))
            .collect();
        for (number, plane) in planes.iter_mut().enumerate() {
            for (place, outline) in self.outlines_at(number).enumerate() {
                let mirrored = outline.mirrored();
                for (block, _) in blocks.iter().filter(|(_, bands)| bands >> place & 1 == 1) {
                    self.grid.fill(&block.outline.plus(&mirrored), plane);
                }
            }
        }
    }

    /// The outlines that a plane is made with.
    fn outlines_at(&self, plane: usize) -> impl Iterator<Item = Polygon> {
        let outlines = if plane < HEADINGS { &self.wide } else { &self.swung };
        let turn = libm::sincos((plane % HEADINGS) as f64 * STEP_RAD);
        outlines.iter().map(move |outline| outline.moved(turn, Vector2::zeros()))
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
            arcs: Vec::with_capacity(count),
            free: Vec::with_capacity(count),
            before: Vec::with_capacity(count),
            more: Vec::new(),
        };
        let mut others = Vec::new();
        for row in 0..self.grid.height {
            for word in 0..words {
                let place = row * words + word;
                let here: [u64; 2 * HEADINGS] = std::array::from_fn(|number| planes[number][place]);
                let some = here.iter().fold(0, |bits, plane| bits | plane);
                let every = here[..HEADINGS].iter().fold(u64::MAX, |bits, plane| bits & plane);
                for bit in 0..(self.grid.width - word * 64).min(64) {
                    let is = |bits: u64| bits >> bit & 1 == 1;
                    let headings = |from: usize| {
                        let bit_of = |number: usize| ((here[from + number] >> bit & 1) as u16) << number;
                        (0..HEADINGS).fold(0, |all, number| all | bit_of(number))
                    };
                    match (is(every), is(some)) {
                        (true, _) => nodes.push(0, 0, &mut others),
                        (_, false) => nodes.push(u16::MAX, 0, &mut others),
                        _ => nodes.push(!headings(0), headings(HEADINGS), &mut others),
                    }
                }
            }
        }
        nodes.arcs.extend(others);
        nodes
    }
}

/// The shadows of all barriers that are fixed, or of all others.
fn blocks(barriers: &[Barrier], fixed: bool, footprint: &Footprint) -> Vec<Block> {
    let mut blocks = Vec::new();
    for (place, barrier) in barriers.iter().enumerate().filter(|(_, barrier)| barrier.fixed == fixed) {
        for posed in barrier.shapes {
            let posed = placed(&barrier.pose, posed);
            let (low, high) = heights(&posed);
            let bands = footprint.bands_between(low, high);
            if let Some(outline) = (bands != 0).then(|| Polygon::shadow(&posed)).flatten() {
                blocks.push(Block { barrier: place, outline, bands });
            }
        }
    }
    blocks
}

/// What a base with this outline touches at a place, exactly: the same as [`Map::blocker`], but for the edge of the
/// room, for one question about one state.
#[must_use]
pub fn blocker_at(barriers: &[Barrier], footprint: &Footprint, place: &Place) -> Option<Blocker> {
    let turn = libm::sincos(place.yaw);
    let outlines: Vec<Polygon> =
        footprint.bands.iter().map(|band| band.outline.moved(turn, place.point())).collect();
    let touches = |block: &Block| {
        let mut numbered = outlines.iter().enumerate();
        numbered.any(|(band, outline)| block.bands >> band & 1 == 1 && outline.touches(&block.outline))
    };
    [true, false]
        .into_iter()
        .flat_map(|fixed| blocks(barriers, fixed, footprint))
        .find(touches)
        .map(|block| Blocker::Barrier(block.barrier))
}

impl Map {
    /// The map of a room with all that stands around in it.
    #[must_use]
    pub fn new(room: Room, barriers: &[Barrier], footprint: Footprint, settings: Settings) -> Map {
        Map::on(Arc::new(Ground::new(room, barriers, footprint, settings)), barriers)
    }

    /// The same as [`Map::new`], sooner if this map has the same ground: room, footprint, and fixed
    /// barriers are equal.
    #[must_use]
    pub fn again(&self, room: Room, barriers: &[Barrier], footprint: Footprint) -> Map {
        let ground = &self.ground;
        let same = ground.room == room
            && ground.footprint == footprint
            && ground.blocks == blocks(barriers, true, &footprint);
        if same {
            Map::on(Arc::clone(ground), barriers)
        } else {
            Map::new(room, barriers, footprint, ground.settings)
        }
    }

    /// The map of a ground with what can be put elsewhere. `barriers`: the list that the ground was made
    /// with, as far as its fixed ones go; the others count here.
    #[must_use]
    pub fn on(ground: Arc<Ground>, barriers: &[Barrier]) -> Map {
        let blocks = blocks(barriers, false, &ground.footprint);
        let mut occupied = ground.occupied.clone();
        ground.occupy(&blocks, &mut occupied);
        // A point of an obstacle is at most half a diagonal from the centre of its cell.
        let grid = &ground.grid;
        let metres = |squared: u32| f64::from(squared).sqrt() * grid.cell_m - grid.half_diagonal();
        let clearance: Vec<f32> =
            grid.distances(&occupied).into_iter().map(|squared| metres(squared) as f32).collect();
        let mut planes = ground.planes.clone();
        ground.block(&blocks, &mut planes);
        let nodes = ground.gather(&planes);
        let mut map = Map { ground, blocks, clearance, factors: Vec::new(), nodes };
        map.factors = map.clearance.iter().map(|clearance| map.factor(f64::from(*clearance))).collect();
        map
    }

    /// Where its cells are.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.ground.grid
    }

    /// The floor that it covers.
    #[must_use]
    pub fn room(&self) -> &Room {
        &self.ground.room
    }

    /// The robot that it was made for.
    #[must_use]
    pub fn footprint(&self) -> &Footprint {
        &self.ground.footprint
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
        if self.clearance_at(&place.point()) >= self.ground.footprint.circumscribed_m() {
            return None;
        }
        let turn = libm::sincos(place.yaw);
        let outlines = self.ground.footprint.bands.iter().map(|band| band.outline.moved(turn, place.point()));
        self.blocker_of(&outlines.collect::<Vec<_>>(), self.all())
    }

    // -----------------------------------------------------------------------------------------
    // Exact questions

    /// Metres from a point to the nearest obstacle at least.
    pub(super) fn clearance_at(&self, point: &Vector2<f64>) -> f64 {
        let cell = self.ground.grid.cell(point);
        cell.map_or(f64::NEG_INFINITY, |cell| self.clearance_m(cell) - self.ground.grid.half_diagonal())
    }

    /// What a base touches that moves in a straight line at one heading.
    pub(super) fn line_blocker(
        &self,
        (from, to): (Vector2<f64>, Vector2<f64>),
        yaw_rad: f64,
        with_margin: bool,
    ) -> Option<Blocker> {
        let margin = if with_margin { self.ground.settings.margin_m } else { 0.0 };
        if self.is_roomy((from, to), margin) {
            return None;
        }
        let turn = libm::sincos(yaw_rad);
        let swept = |outline: &Polygon| outline.moved(turn, from).along(to - from);
        let outlines: Vec<Polygon> = self.outlines(with_margin).map(swept).collect();
        self.blocker_of(&outlines, self.all())
    }

    /// True if the circumscribed circle is free all along a line.
    pub(super) fn is_roomy(&self, (from, to): (Vector2<f64>, Vector2<f64>), margin_m: f64) -> bool {
        /// Steps shorter than this are not worth it, metres.
        const LEAST_STEP: f64 = 0.01;
        let radius = self.ground.footprint.circumscribed_m() + margin_m;
        let length = (to - from).norm();
        let mut done = 0.0;
        loop {
            let point = if done >= length { to } else { from + (to - from) * (done / length) };
            let room = self.clearance_at(&point) - radius;
            if done + room >= length && room >= 0.0 {
                return true;
            }
            if room < LEAST_STEP || room.is_nan() {
                return false;
            }
            done += room;
        }
    }

    /// What a base touches that turns on the spot from one heading by an angle.
    pub(super) fn turn_blocker(&self, at: Vector2<f64>, from_rad: f64, by_rad: f64) -> Option<Blocker> {
        if self.clearance_at(&at) >= self.ground.footprint.circumscribed_m() {
            return None;
        }
        let reach = self.ground.footprint.circumscribed_m();
        let near: Vec<&Block> = self.all().filter(|block| block.is_near(&at, reach)).collect();
        let room_around = (0..2).all(|axis| {
            at[axis] - reach >= self.ground.room.low[axis] && at[axis] + reach <= self.ground.room.high[axis]
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
            outlines
                .map_or(Some(Blocker::Bounds), |outlines| self.blocker_of(&outlines, near.iter().copied()))
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

    /// What touches the base, with the margin, at a place; movable things are asked first.
    pub(super) fn near_blocker(&self, place: &Place) -> Option<Blocker> {
        let turn = libm::sincos(place.yaw);
        let outlines: Vec<Polygon> =
            self.ground.wide.iter().map(|outline| outline.moved(turn, place.point())).collect();
        let movable = self.blocker_of(&outlines, self.blocks.iter()).filter(|by| *by != Blocker::Bounds);
        movable.or_else(|| self.blocker_of(&outlines, self.all()))
    }

    /// Fixed things first.
    fn all(&self) -> impl Iterator<Item = &Block> {
        self.ground.blocks.iter().chain(&self.blocks)
    }

    fn outlines(&self, with_margin: bool) -> impl Iterator<Item = &Polygon> {
        let bands = &self.ground.footprint.bands;
        self.ground
            .wide
            .iter()
            .zip(bands)
            .map(move |(wide, band)| if with_margin { wide } else { &band.outline })
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
            (0..2).all(|axis| {
                low[axis] >= self.ground.room.low[axis] && high[axis] <= self.ground.room.high[axis]
            })
        };
        (!outlines.iter().all(inside)).then_some(Blocker::Bounds)
    }

    fn factor(&self, clearance_m: f64) -> u8 {
        let spare = (clearance_m - self.ground.footprint.inscribed_m()) / self.ground.settings.comfort_m;
        // NaN, from a comfort of 0, counts as enough.
        let tight = if spare < 1.0 { 1.0 - spare.max(0.0) } else { 0.0 };
        LEAST_FACTOR + libm::round(tight * FACTOR_RANGE) as u8
    }

    /// Free headings of all cells if only fixed things stood around.
    pub(super) fn free_without_movable(&self) -> Vec<u16> {
        self.ground.gather(&self.ground.planes).free
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
    /// The next cell; `stops`: bit `i` if the turn from heading `i` to the next is blocked. Arcs
    /// beyond the first go to `others`.
    #[inline]
    fn push(&mut self, free: u16, stops: u16, others: &mut Vec<u16>) {
        let cell = self.free.len() as u32;
        self.free.push(free);
        self.before.push(self.more.len() as u32);
        // An arc begins where one cannot come from the heading before.
        let from_before = (free & !stops).rotate_left(1);
        let mut begins = free & !from_before;
        if begins == 0 {
            self.arcs.push(free);
            return;
        }
        self.arcs.push(arc_from(begins.trailing_zeros(), free, stops));
        begins &= begins - 1;
        while begins != 0 {
            others.push(arc_from(begins.trailing_zeros(), free, stops));
            self.more.push(cell);
            begins &= begins - 1;
        }
    }
}

/// The headings that can be turned to, to the left, from the one where an arc begins.
fn arc_from(begin: u32, free: u16, stops: u16) -> u16 {
    let (mut arc, mut heading) = (0, begin);
    loop {
        arc |= 1 << heading;
        let goes_on = stops >> heading & 1 == 0;
        heading = (heading + 1) % HEADINGS as u32;
        if !goes_on || free >> heading & 1 == 0 || heading == begin {
            return arc;
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
    octagon.map_or_else(|| outline.clone(), |octagon| outline.plus(&octagon).simpler(SIMPLER_M))
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
