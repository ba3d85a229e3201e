//! A way to drive: straight legs and turns on the spot.
//!
//! The way through the cells is pulled tight: from each point to the farthest later one that can be
//! driven to in a straight line with the margin, and that costs no more than the way through the
//! cells, so that a way with room around it is not given up for a shorter one along a wall.
//!
//! On long ways a base looks where it drives, if it has the room to; on short ones an
//! omnidirectional base keeps its heading, or turns while it drives ([`Speeds::look_ahead_m`]). A
//! differential base drives forward and backward only.
//!
//! Each leg is checked exactly: the outline's whole sweep, no samples.

use nalgebra::Vector2;

use crate::robot::chain::DriveKind;

use super::flood::{Flood, Link, headings_beside};
use super::map::{HEADINGS, LEAST_FACTOR, Map, STEP_RAD};
use super::{Blocker, NoWay, Place, turn_between};

/// Line and grid are compared with this much grace, as both are sampled.
const GRACE: f64 = 1.02;
/// Headings that are tried for a shortcut, apart from that of the line.
const SHORTCUT_HEADINGS: usize = 4;

/// How fast a base is. Speeds change at once: what a base takes to speed up is in them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Speeds {
    /// Metres per second.
    pub linear: f64,
    /// Radians per second.
    pub angular: f64,
    /// Ways shorter than this are driven without a look ahead, metres.
    pub look_ahead_m: f64,
}

impl Default for Speeds {
    /// Careful indoor driving of a PR2.
    fn default() -> Speeds {
        Speeds { linear: 0.5, angular: 0.8, look_ahead_m: 1.0 }
    }
}

/// A way that can be driven.
#[derive(Debug, Clone, PartialEq)]
pub struct Drive {
    /// From the start to the goal. From one to the next the base turns on the spot, or drives in a
    /// straight line; both at once only where there is room all around. It turns by the
    /// difference of the two yaws, which may be beyond π on purpose: the short turn is not always
    /// free. So yaws here are not brought back between -π and π.
    pub places: Vec<Place>,
    /// Metres along the way.
    pub length_m: f64,
    /// Metres from start to goal as the crow flies.
    pub straight_m: f64,
    /// Radians turned, left and right turns added up.
    pub turned_rad: f64,
    /// How often it turns.
    pub turns: usize,
}

/// A point of the way.
struct Point {
    at: Vector2<f64>,
    /// Headings that lead on from here; all at a point that is no cell.
    arc: u16,
    is_cell: bool,
    /// What the way costs up to here.
    cost: f64,
}

impl Flood {
    /// The way to a place.
    ///
    /// # Errors
    /// Why there is none.
    pub fn drive(&self, map: &Map, goal: Place, speeds: &Speeds) -> Result<Drive, NoWay> {
        let (reach, links) = self.reach_by_link(map, goal)?;
        let (nodes, first) = self.nodes_to(reach.node);
        let points = self.points(map, goal, &nodes, (&self.links[first], &links[reach.link]));
        let straight_m = (goal.point() - self.start.point()).norm();
        if self.drive_kind_is_free() && straight_m < speeds.look_ahead_m {
            let line = (self.start.point(), goal.point());
            if map.is_roomy(line, 0.0) {
                let by = turn_between(self.start.yaw, goal.yaw);
                return Ok(Drive::new(vec![self.start, Place { yaw: self.start.yaw + by, ..goal }]));
            }
        }
        let ahead = reach.length_m >= speeds.look_ahead_m || !self.drive_kind_is_free();
        Puller { map, points, goal, ahead, drive: self.drive }.pull(self.start)
    }

    fn drive_kind_is_free(&self) -> bool {
        self.drive == DriveKind::Omnidirectional
    }

    fn points(&self, map: &Map, goal: Place, nodes: &[usize], (first, last): (&Link, &Link)) -> Vec<Point> {
        let bare = |at: Vector2<f64>| Point { at, arc: u16::MAX, is_cell: false, cost: 0.0 };
        let mut points = vec![bare(self.start.point())];
        points.extend(first.via.map(bare));
        points.extend(nodes.iter().map(|node| Point {
            at: map.grid().centre(map.nodes.cell(*node)),
            arc: map.nodes.arcs[*node],
            is_cell: true,
            cost: 0.0,
        }));
        points.extend(last.via.map(bare));
        points.push(bare(goal.point()));
        let mut cost = 0.0;
        for place in 1..points.len() {
            cost += line_cost(map, points[place - 1].at, points[place].at);
            points[place].cost = cost;
        }
        points
    }
}

/// Pulls a way tight.
struct Puller<'m> {
    map: &'m Map,
    points: Vec<Point>,
    goal: Place,
    ahead: bool,
    drive: DriveKind,
}

impl Puller<'_> {
    fn pull(&self, start: Place) -> Result<Drive, NoWay> {
        let last = self.points.len() - 1;
        let mut places = vec![start];
        let (mut at, mut yaw) = (0, start.yaw);
        while at < last {
            let (next, turn) = self.farthest(at, yaw)?;
            push_turn(&mut places, turn);
            yaw += turn;
            at = next;
            let point = self.points[at].at;
            places.push(Place::new(point.x, point.y, yaw));
        }
        let turn =
            self.map.turn(self.goal.point(), yaw, self.goal.yaw).map_err(|by| blocked(by, self.goal))?;
        push_turn(&mut places, turn);
        Ok(Drive::new(places))
    }

    /// The farthest point that a straight leg leads to, and the turn before it. Steps double as long
    /// as they succeed, then halve: lines of sight are found in a few questions.
    fn farthest(&self, at: usize, yaw: f64) -> Result<(usize, f64), NoWay> {
        let last = self.points.len() - 1;
        if let Ok(turn) = self.leg(at, yaw, last) {
            return Ok((last, turn));
        }
        let mut best = (
            at + 1,
            self.leg(at, yaw, at + 1).map_err(|by| {
                let point = self.points[at].at;
                blocked(by, Place::new(point.x, point.y, yaw))
            })?,
        );
        let mut step = 1;
        while best.0 + step < last {
            match self.leg(at, yaw, best.0 + step) {
                Ok(turn) => best = (best.0 + step, turn),
                Err(_) => break,
            }
            step *= 2;
        }
        while step > 1 {
            step /= 2;
            if best.0 + step < last
                && let Ok(turn) = self.leg(at, yaw, best.0 + step)
            {
                best = (best.0 + step, turn);
            }
        }
        Ok(best)
    }

    /// The turn before a straight leg from one point to another.
    fn leg(&self, from: usize, yaw: f64, to: usize) -> Result<f64, Blocker> {
        let (a, b) = (&self.points[from], &self.points[to]);
        let shortcut = to > from + 1;
        // Not a blocker, but no reason to go on.
        let mut blocker = Blocker::Bounds;
        if shortcut && line_cost(self.map, a.at, b.at) > (b.cost - a.cost) * GRACE {
            return Err(blocker);
        }
        for heading in self.headings(from, yaw, to, shortcut) {
            match self.leg_at(from, yaw, to, heading) {
                Ok(turn) => return Ok(turn),
                Err(by) => blocker = by,
            }
        }
        Err(blocker)
    }

    fn leg_at(&self, from: usize, yaw: f64, to: usize, heading: f64) -> Result<f64, Blocker> {
        let (a, b) = (&self.points[from], &self.points[to]);
        let with_margin = to > from + 1;
        if let Some(by) = self.map.line_blocker((a.at, b.at), heading, with_margin) {
            return Err(by);
        }
        let turn = self.map.turn(a.at, yaw, heading)?;
        self.leads_on(to, heading)?;
        Ok(turn)
    }

    /// Asks whether the way goes on from a point that is reached at this heading.
    fn leads_on(&self, at: usize, heading: f64) -> Result<(), Blocker> {
        let point = &self.points[at];
        if at + 1 == self.points.len() {
            return self.map.turn(point.at, heading, self.goal.yaw).map(|_| ());
        }
        if point.is_cell {
            let leads = |number: &u32| {
                let by = turn_between(heading, f64::from(*number) * STEP_RAD);
                point.arc >> number & 1 == 1 && self.map.turn_blocker(point.at, heading, by).is_none()
            };
            return headings_beside(heading).iter().any(leads).then_some(()).ok_or(Blocker::Bounds);
        }
        // Where a differential base turns between the start, or the goal, and a cell.
        let next = self.points[at + 1].at - point.at;
        let ways = if at + 2 == self.points.len() { [self.goal.yaw; 2] } else { both_ways(next) };
        let turn = |yaw: f64| self.map.turn(point.at, heading, yaw).map(|_| ());
        turn(ways[0]).or_else(|_| turn(ways[1]))
    }

    /// Headings to try on a leg, the best first.
    fn headings(&self, from: usize, yaw: f64, to: usize, shortcut: bool) -> Vec<f64> {
        let (a, b) = (&self.points[from], &self.points[to]);
        let along = b.at - a.at;
        if along.norm() < 1e-9 {
            return vec![yaw];
        }
        let [forward, backward] = both_ways(along);
        if self.drive == DriveKind::Differential {
            // At the ends of the way the base may have to back off.
            let back_first = turn_between(yaw, backward).abs() < 0.1;
            return if back_first { vec![backward, forward] } else { vec![forward, backward] };
        }
        let mut headings =
            if self.ahead { vec![forward, yaw, self.goal.yaw] } else { vec![yaw, self.goal.yaw, forward] };
        let best = headings[0];
        let both = a.arc & b.arc;
        let mut sampled: Vec<(f64, f64)> = (0..HEADINGS)
            .filter(|number| both != u16::MAX && both >> number & 1 == 1)
            .map(|number| number as f64 * STEP_RAD)
            .map(|heading| (turn_between(best, heading).abs(), heading))
            .collect();
        sampled.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        if shortcut {
            sampled.truncate(SHORTCUT_HEADINGS);
        }
        headings.extend(sampled.into_iter().map(|(_, heading)| heading));
        headings
    }
}

/// The headings of driving somewhere forward and backward.
fn both_ways(along: Vector2<f64>) -> [f64; 2] {
    [libm::atan2(along.y, along.x), libm::atan2(-along.y, -along.x)]
}

fn blocked(by: Blocker, at: Place) -> NoWay {
    NoWay::Blocked { by, at }
}

fn push_turn(places: &mut Vec<Place>, by_rad: f64) {
    if let (true, Some(last)) = (by_rad != 0.0, places.last().copied()) {
        places.push(Place { yaw: last.yaw + by_rad, ..last });
    }
}

/// Metres of a line, those near obstacles counting more.
fn line_cost(map: &Map, from: Vector2<f64>, to: Vector2<f64>) -> f64 {
    let length = (to - from).norm();
    let steps = libm::ceil(length / (0.5 * map.grid().cell_m)).clamp(1.0, 1e5);
    let factor = |step: usize| {
        let point = from + (to - from) * ((step as f64 + 0.5) / steps);
        let cell = map.grid().cell(&point);
        f64::from(cell.map_or(u8::MAX, |cell| map.factors[cell])) / f64::from(LEAST_FACTOR)
    };
    (0..steps as usize).map(factor).sum::<f64>() * length / steps
}

impl Drive {
    fn new(places: Vec<Place>) -> Drive {
        let legs = || places.windows(2).map(|pair| (pair[0], pair[1]));
        let turn = |(from, to): (Place, Place)| (to.yaw - from.yaw).abs();
        let straight_m = match (places.first(), places.last()) {
            (Some(first), Some(last)) => (last.point() - first.point()).norm(),
            _ => 0.0,
        };
        Drive {
            length_m: legs().map(|(from, to)| (to.point() - from.point()).norm()).sum(),
            straight_m,
            turned_rad: legs().map(turn).sum(),
            turns: legs().filter(|leg| turn(*leg) > 1e-6).count(),
            places,
        }
    }

    /// Seconds for the whole way.
    #[must_use]
    pub fn duration_s(&self, speeds: &Speeds) -> f64 {
        self.places.windows(2).map(|pair| leg_s(&pair[0], &pair[1], speeds)).sum()
    }

    /// Where the base is after this time, its yaw between -π and π: how it stands when it is stopped
    /// half way. Before the start it is at the start, after the end at the goal.
    #[must_use]
    pub fn place_at(&self, time_s: f64, speeds: &Speeds) -> Place {
        let mut left = time_s;
        for pair in self.places.windows(2) {
            let (from, to) = (pair[0], pair[1]);
            let takes = leg_s(&from, &to, speeds);
            if left < takes {
                let share = (left / takes).max(0.0);
                let at = from.point() + (to.point() - from.point()) * share;
                return Place::new(at.x, at.y, super::normal_angle(from.yaw + (to.yaw - from.yaw) * share));
            }
            left -= takes;
        }
        let end = self.places.last().copied().unwrap_or_default();
        Place { yaw: super::normal_angle(end.yaw), ..end }
    }
}

/// Seconds from one place to the next. A speed that is not above 0 takes no time: who has no model
/// of time gets none.
fn leg_s(from: &Place, to: &Place, speeds: &Speeds) -> f64 {
    let takes = |amount: f64, speed: f64| if speed > 0.0 { amount / speed } else { 0.0 };
    let drives = takes((to.point() - from.point()).norm(), speeds.linear);
    drives.max(takes((to.yaw - from.yaw).abs(), speeds.angular))
}
