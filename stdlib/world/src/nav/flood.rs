//! How far everything is from where the base stands: one search answers for all places.
//!
//! Nodes are cells with an arc of headings ([`super::map`]). A step leads to one of eight
//! neighbours, at a heading that both arcs have; a diagonal one needs the two cells beside it free at
//! that heading, too. So a way through the graph is one that the base can really drive, turning on the
//! spot where an arc allows it. A differential base steps only along its heading, forward or
//! backward.
//!
//! Costs are whole numbers: length times what a cell costs. The queue is a ring of buckets as wide as
//! the cheapest step (Dial 1969; Denardo and Fox 1979), so the search is linear in the nodes.
//!
//! Where the base stands, and where it shall stand, need not be the centre of a cell, nor free with a
//! margin. Such a place is linked to cells around it by straight, exactly checked moves
//! ([`LINK_M`] at most).

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use nalgebra::Vector2;

use crate::robot::chain::DriveKind;

use super::map::{HEADINGS, LEAST_FACTOR, Map, STEP_RAD};
use super::{Blocker, NoWay, Place};

/// How far a place may be from the cells that it is linked to, metres.
pub const LINK_M: f64 = 0.6;

/// Cost of a step: this, times what the two cells cost together.
const STRAIGHT: u32 = 100;
const DIAGONAL: u32 = 141;
/// The cheapest step.
const BUCKET: u32 = STRAIGHT * 2 * LEAST_FACTOR as u32;
const UNREACHED: u32 = u32::MAX;
/// Parents from here on are links of the start.
const LINKS: u32 = 1 << 31;

/// All ways from one place.
#[derive(Debug, Clone)]
pub struct Flood {
    pub(super) start: Place,
    pub(super) drive: DriveKind,
    pub(super) links: Vec<Link>,
    costs: Vec<u32>,
    parents: Vec<u32>,
}

/// From a place to a node, or back.
#[derive(Debug, Clone)]
pub(super) struct Link {
    pub node: usize,
    /// Between the place and the centre of the cell: where the base stops.
    pub via: Option<Vector2<f64>>,
    pub length_m: f64,
}

/// How a place is reached.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reach {
    /// Metres through cells: a smooth way is up to a tenth shorter.
    pub length_m: f64,
    /// Metres, those near obstacles counting up to three times.
    pub cost_m: f64,
    pub(super) node: usize,
    pub(super) link: usize,
}

/// Directions of steps, as columns and rows, against the clock from X: number `k` is heading `2 k`.
const STEPS: [(isize, isize); 8] = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)];

impl Flood {
    /// Searches the room from where the base stands.
    ///
    /// # Errors
    /// The start is outside of the room, or touches something.
    pub fn new(map: &Map, start: Place, drive: DriveKind) -> Result<Flood, NoWay> {
        check_inside(map, start)?;
        if let Some(by) = map.blocker(&start) {
            return Err(NoWay::StartBlocked { by });
        }
        let count = map.nodes.arcs.len();
        let mut flood = Flood {
            start,
            drive,
            links: links(map, start, drive),
            costs: Vec::new(),
            parents: vec![0; count],
        };
        flood.run(map);
        Ok(flood)
    }

    /// Where it begins.
    #[must_use]
    pub fn start(&self) -> Place {
        self.start
    }

    /// How the base moves.
    #[must_use]
    pub fn drive_kind(&self) -> DriveKind {
        self.drive
    }

    /// How a place is reached. `map`: the one that the search ran through.
    ///
    /// # Errors
    /// Why it is not.
    pub fn reach(&self, map: &Map, goal: Place) -> Result<Reach, NoWay> {
        self.reach_by_link(map, goal).map(|(reach, _)| reach)
    }

    pub(super) fn reach_by_link(&self, map: &Map, goal: Place) -> Result<(Reach, Vec<Link>), NoWay> {
        check_inside(map, goal)?;
        if let Some(by) = map.blocker(&goal) {
            return Err(NoWay::GoalBlocked { by });
        }
        let links = links(map, goal, self.drive);
        let cost_of = |link: &Link| {
            let cost = *self.costs.get(link.node)?;
            (cost != UNREACHED).then(|| cost.saturating_add(link_cost(map, link)))
        };
        let reached = links.iter().enumerate().filter_map(|(place, link)| Some((cost_of(link)?, place)));
        let Some((cost, link)) = reached.min() else {
            let (by, at) = self.blame(map, goal);
            return Err(NoWay::Blocked { by, at });
        };
        let node = links[link].node;
        let cost_m = f64::from(cost) / f64::from(BUCKET) * map.grid().cell_m;
        let length_m = self.length_m(map, node) + links[link].length_m;
        Ok((Reach { length_m, cost_m, node, link }, links))
    }

    /// What the way to a place costs, metres; `None` if it is not reached. Nobody is to blame, which
    /// would take long to find out.
    #[must_use]
    pub fn cost_m(&self, map: &Map, goal: Place) -> Option<f64> {
        if check_inside(map, goal).is_err() || map.blocker(&goal).is_some() {
            return None;
        }
        let links = links(map, goal, self.drive);
        let cost = links.iter().filter_map(|link| Some((*self.costs.get(link.node)?, link_cost(map, link))));
        let cost = cost
            .filter(|(cost, _)| *cost != UNREACHED)
            .map(|(cost, link)| cost.saturating_add(link))
            .min()?;
        Some(f64::from(cost) / f64::from(BUCKET) * map.grid().cell_m)
    }

    /// True if a base at some heading gets to the centre of a cell.
    #[must_use]
    pub fn reaches_cell(&self, map: &Map, cell: usize) -> bool {
        cell < map.grid().len() && map.nodes.of_cell(cell).any(|node| self.is_reached(node))
    }

    /// What the way to the middle of a cell costs, metres, at the heading that is reached most easily.
    #[must_use]
    pub fn cell_cost_m(&self, map: &Map, cell: usize) -> Option<f64> {
        if cell >= map.grid().len() {
            return None;
        }
        let costs = map.nodes.of_cell(cell).map(|node| self.costs[node]).filter(|cost| *cost != UNREACHED);
        Some(f64::from(costs.min()?) / f64::from(BUCKET) * map.grid().cell_m)
    }

    /// The reached place nearest to a point in a straight line: the centre of a cell.
    #[must_use]
    pub fn nearest(&self, map: &Map, point: Vector2<f64>) -> Option<Vector2<f64>> {
        let reached = (0..map.nodes.arcs.len()).filter(|node| self.is_reached(*node));
        let centres = reached.map(|node| map.grid().centre(map.nodes.cell(node)));
        centres.min_by(|a, b| (a - point).norm_squared().total_cmp(&(b - point).norm_squared()))
    }

    /// Nodes from the start to this one, and the link that leads from the start to the first.
    pub(super) fn nodes_to(&self, node: usize) -> (Vec<usize>, usize) {
        let mut nodes = vec![node];
        let mut at = node;
        while self.parents[at] < LINKS {
            at = self.parents[at] as usize;
            nodes.push(at);
        }
        nodes.reverse();
        (nodes, (self.parents[at] - LINKS) as usize)
    }

    fn is_reached(&self, node: usize) -> bool {
        self.costs.get(node).is_some_and(|cost| *cost != UNREACHED)
    }

    fn length_m(&self, map: &Map, node: usize) -> f64 {
        let cell = |node: usize| map.nodes.cell(node);
        let width = map.grid().width;
        let (mut straight, mut diagonal, mut at) = (0_u32, 0_u32, node);
        while self.parents[at] < LINKS {
            let before = self.parents[at] as usize;
            let apart = cell(at).abs_diff(cell(before));
            if apart == 1 || apart == width {
                straight += 1
            } else {
                diagonal += 1
            }
            at = before;
        }
        let cells = f64::from(straight) + f64::from(diagonal) * std::f64::consts::SQRT_2;
        cells * map.grid().cell_m + self.links[(self.parents[at] - LINKS) as usize].length_m
    }

    fn run(&mut self, map: &Map) {
        let nodes = &map.nodes;
        let parents = &mut self.parents[..];
        let steps = steps(self.drive, map.grid().width);
        let mut here = marks(map);
        let most = self.links.iter().map(|link| link_cost(map, link)).max().unwrap_or(0);
        // A power of two: the place in the ring is a mask.
        let ring = (most / BUCKET + 8).next_power_of_two() as usize;
        let mut buckets: Vec<Vec<u32>> = vec![Vec::new(); ring];
        let mut waiting = 0;
        for (place, link) in self.links.iter().enumerate() {
            let cost = link_cost(map, link);
            if cost < here[link.node].cost {
                here[link.node].cost = cost;
                parents[link.node] = LINKS + place as u32;
                buckets[(cost / BUCKET) as usize & (ring - 1)].push(link.node as u32);
                waiting += 1;
            }
        }
        let mut level = 0;
        let mut now = Vec::new();
        while waiting > 0 {
            std::mem::swap(&mut now, &mut buckets[level & (ring - 1)]);
            waiting -= now.len();
            for node in now.drain(..) {
                let at = node as usize;
                // No step costs less than a bucket is wide, so what is in one is final when its turn
                // comes. What is there twice was found by a cheaper step after the first.
                if std::mem::replace(&mut here[at].done, true) {
                    continue;
                }
                let cell = nodes.cell(at);
                let Mark { cost, arc, .. } = here[at];
                let factor = u32::from(here[cell].factor);
                for step in &steps {
                    let next_cell = cell.wrapping_add_signed(step.to);
                    let there = here[next_cell];
                    let next_cost = cost + step.length * (factor + u32::from(there.factor));
                    let has_others = there.arc != there.free;
                    if next_cost >= there.cost && !has_others {
                        continue;
                    }
                    let [left, right] = step.beside.map(|beside| here[cell.wrapping_add_signed(beside)].free);
                    let headings = arc & step.headings & left & right;
                    let mut arrive = |next: usize| {
                        if next_cost < here[next].cost && here[next].arc & headings != 0 {
                            here[next].cost = next_cost;
                            parents[next] = node;
                            buckets[(next_cost / BUCKET) as usize & (ring - 1)].push(next as u32);
                            waiting += 1;
                        }
                    };
                    arrive(next_cell);
                    if has_others && headings != 0 {
                        nodes.others(next_cell).for_each(arrive);
                    }
                }
            }
            level += 1;
        }
        self.costs = here.into_iter().map(|mark| mark.cost).collect();
    }

    /// What is in the way to a place that is free and not reached: a search from all reached cells
    /// that goes through movable things at a price, and through fixed ones at a higher one.
    fn blame(&self, map: &Map, goal: Place) -> (Blocker, Place) {
        const MOVABLE: u32 = 50;
        const FIXED: u32 = 2000;
        let grid = map.grid();
        let fixed = map.free_without_movable();
        let reached: Vec<bool> = (0..grid.len()).map(|cell| self.reaches_cell(map, cell)).collect();
        let price = |cell: usize| match (map.nodes.free[cell], fixed[cell]) {
            (1.., _) => 1,
            (_, 1..) => MOVABLE,
            _ => FIXED,
        };
        let (mut costs, mut parents) = (vec![UNREACHED; grid.len()], vec![usize::MAX; grid.len()]);
        let mut queue = BinaryHeap::new();
        let begin = grid.cell(&goal.point()).unwrap_or(0);
        costs[begin] = 0;
        queue.push(Reverse((0, begin)));
        let here = grid.cell(&self.start.point());
        let mut end = None;
        while let Some(Reverse((cost, cell))) = queue.pop() {
            if reached[cell] || Some(cell) == here {
                end = Some(cell);
                break;
            }
            if cost > costs[cell] {
                continue;
            }
            let (row, column) = (cell / grid.width, cell % grid.width);
            if row == 0 || column == 0 || row + 1 == grid.height || column + 1 == grid.width {
                continue;
            }
            for next in [cell - 1, cell + 1, cell - grid.width, cell + grid.width] {
                let next_cost = cost + price(next);
                if next_cost < costs[next] {
                    costs[next] = next_cost;
                    parents[next] = cell;
                    queue.push(Reverse((next_cost, next)));
                }
            }
        }
        // From the reached side towards the goal.
        let way: Vec<usize> =
            std::iter::successors(end, |cell| Some(parents[*cell]).filter(|parent| *parent != usize::MAX))
                .collect();
        let place = |at: usize| {
            let (centre, ahead) = (grid.centre(way[at]), grid.centre(way[(at + 4).min(way.len() - 1)]));
            let towards = if way.len() > at + 1 { ahead - centre } else { goal.point() - centre };
            Place::new(centre.x, centre.y, libm::atan2(towards.y, towards.x))
        };
        let no_heading = (0..way.len()).filter(|at| map.nodes.free[way[*at]] == 0);
        let any = 0..way.len();
        for at in no_heading.chain(any) {
            if let Some(by) = map.near_blocker(&place(at)) {
                return (by, place(at));
            }
        }
        (map.near_blocker(&goal).unwrap_or(Blocker::Bounds), goal)
    }
}

fn check_inside(map: &Map, at: Place) -> Result<(), NoWay> {
    let inside = at.is_finite() && map.grid().cell(&at.point()).is_some();
    if inside { Ok(()) } else { Err(NoWay::OutsideRoom { at }) }
}

/// What the search asks of a node, side by side in memory: most of its time goes into fetching it.
#[derive(Clone, Copy)]
struct Mark {
    cost: u32,
    arc: u16,
    /// Of the cell; not used of nodes beyond the first ones.
    free: u16,
    factor: u8,
    done: bool,
}

fn marks(map: &Map) -> Vec<Mark> {
    let nodes = &map.nodes;
    let mark = |arc: u16, free: u16, factor: u8| Mark { cost: UNREACHED, arc, free, factor, done: false };
    let cells = nodes.arcs.iter().zip(&nodes.free).zip(&map.factors);
    let mut marks: Vec<Mark> = Vec::with_capacity(nodes.arcs.len());
    marks.extend(cells.map(|((arc, free), factor)| mark(*arc, *free, *factor)));
    marks.extend(nodes.arcs[nodes.free.len()..].iter().map(|arc| mark(*arc, *arc, 0)));
    marks
}

/// To a neighbour.
struct Step {
    /// From one cell to the next, by number.
    to: isize,
    /// Cells that have to be free, too: those beside a diagonal step; a straight one has the goal twice.
    beside: [isize; 2],
    length: u32,
    /// Headings at which a base can take it.
    headings: u16,
}

fn steps(drive: DriveKind, width: usize) -> [Step; 8] {
    let offset = |step: usize| {
        let (column, row) = STEPS[step % 8];
        row * width as isize + column
    };
    std::array::from_fn(|step| {
        let ahead = 1_u16 << (2 * step);
        let diagonal = step % 2 == 1;
        Step {
            to: offset(step),
            beside: if diagonal { [offset(step + 1), offset(step + 7)] } else { [offset(step); 2] },
            length: if diagonal { DIAGONAL } else { STRAIGHT },
            headings: match drive {
                DriveKind::Fixed => 0,
                DriveKind::Differential => ahead | ahead.rotate_left(HEADINGS as u32 / 2),
                DriveKind::Omnidirectional => u16::MAX,
            },
        }
    })
}

fn link_cost(map: &Map, link: &Link) -> u32 {
    let factor = f64::from(map.factors[map.nodes.cell(link.node)]) / f64::from(LEAST_FACTOR);
    (link.length_m / map.grid().cell_m * factor * f64::from(BUCKET)) as u32
}

// ---------------------------------------------------------------------------------------------
// Links

/// Nodes that a place is linked to: those in the nearest ring of cells that has one, and in the next.
fn links(map: &Map, place: Place, drive: DriveKind) -> Vec<Link> {
    let grid = map.grid();
    let Some(cell) = grid.cell(&place.point()) else { return Vec::new() };
    let (row, column) = ((cell / grid.width) as isize, (cell % grid.width) as isize);
    let rings = libm::ceil(LINK_M / grid.cell_m) as isize;
    let mut found: Vec<Link> = Vec::new();
    let mut last = rings;
    let mut ring = 0;
    while ring <= last {
        for (row, column) in ring_cells(row, column, ring) {
            if row > 0 && column > 0 && row < grid.height as isize - 1 && column < grid.width as isize - 1 {
                let cell = row as usize * grid.width + column as usize;
                link_cell(map, place, drive, cell, &mut found);
            }
        }
        if !found.is_empty() {
            last = last.min(ring + 1);
            // Amid open space one is as good as all.
            if ring == 0 && map.free_headings(cell) == u16::MAX {
                break;
            }
        }
        ring += 1;
    }
    found
}

/// Cells at this distance, row by row.
fn ring_cells(row: isize, column: isize, ring: isize) -> impl Iterator<Item = (isize, isize)> {
    (-ring..=ring).flat_map(move |up| {
        let step = if up.abs() == ring { 1 } else { (2 * ring).max(1) };
        (-ring..=ring).step_by(step as usize).map(move |right| (row + up, column + right))
    })
}

fn link_cell(map: &Map, place: Place, drive: DriveKind, cell: usize, found: &mut Vec<Link>) {
    if map.free_headings(cell) == 0 {
        return;
    }
    let (point, centre) = (place.point(), map.grid().centre(cell));
    match drive {
        DriveKind::Omnidirectional => {
            if map.line_blocker((point, centre), place.yaw, false).is_none() {
                link_arcs(map, cell, place.yaw, (None, (centre - point).norm()), found);
            }
        }
        DriveKind::Differential => {
            let (sin, cos) = libm::sincos(place.yaw);
            let ahead = Vector2::new(cos, sin);
            // Along the heading to the point abreast of the cell, then over to its centre.
            let via = point + ahead * ahead.dot(&(centre - point));
            if map.line_blocker((point, via), place.yaw, false).is_some() {
                return;
            }
            let over = centre - via;
            let length_m = (via - point).norm() + over.norm();
            if over.norm() < 1e-6 {
                link_arcs(map, cell, place.yaw, (Some(via), length_m), found);
                return;
            }
            for direction in [over, -over] {
                let yaw = libm::atan2(direction.y, direction.x);
                if map.turn(via, place.yaw, yaw).is_ok()
                    && map.line_blocker((via, centre), yaw, false).is_none()
                {
                    link_arcs(map, cell, yaw, (Some(via), length_m), found);
                    return;
                }
            }
        }
        DriveKind::Fixed => {}
    }
}

/// Links with the arcs of a cell that a base at its centre can turn into from a heading.
fn link_arcs(
    map: &Map,
    cell: usize,
    yaw: f64,
    (via, length_m): (Option<Vector2<f64>>, f64),
    found: &mut Vec<Link>,
) {
    for heading in headings_beside(yaw) {
        let arc = map.nodes.of_cell(cell).find(|node: &usize| map.nodes.arcs[*node] >> heading & 1 == 1);
        let Some(node) = arc.filter(|node| found.iter().all(|link| link.node != *node)) else { continue };
        let by = super::turn_between(yaw, f64::from(heading) * STEP_RAD);
        if map.turn_blocker(map.grid().centre(cell), yaw, by).is_none() {
            found.push(Link { node, via, length_m });
        }
    }
}

/// The two headings of the map between which an angle lies, the nearer one first.
pub(super) fn headings_beside(yaw_rad: f64) -> [u32; 2] {
    let place = yaw_rad / STEP_RAD;
    let nearest = libm::round(place);
    let other = if place < nearest { nearest - 1.0 } else { nearest + 1.0 };
    let number = |place: f64| (place - 16.0 * libm::floor(place / 16.0)) as u32 % HEADINGS as u32;
    [number(nearest), number(other)]
}
