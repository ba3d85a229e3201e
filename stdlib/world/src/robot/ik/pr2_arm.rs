//! Closed form for arms like those of the PR2: pan, lift, roll, elbow, roll, wrist, roll.
//!
//! The axes at zero are Z, Y, X, Y, X, Y, X. Pan and lift are `a` apart, the upper arm is `l1` and
//! the forearm `l2` long, and the last three axes meet in the wrist:
//!
//! ```text
//! T = Rz(q1) Tx(a) Ry(q2) Rx(q3) Tx(l1) Ry(q4) Rx(q5) Tx(l2) Ry(q6) Rx(q7)
//! ```
//!
//! Seven joints for six numbers leave one free. We choose q1 and scan it, since all others follow
//! from it in closed form. With p the wrist as seen from the lift joint after the turn q1:
//!
//! - the law of cosines, |p|² = l1² + l2² + 2 l1 l2 cos q4, gives q4, with two signs;
//! - with u = l1 + l2 cos q4 and v = −l2 sin q4 the wrist is Ry(q2) (u, −v sin q3, v cos q3), so
//!   sin q3 = −p_y / v, which leaves two values of q3, and then q2 from p_x and p_z;
//! - what remains of the rotation is Rx(q5) Ry(q6) Rx(q7): Euler angles, q6 with two signs.
//!
//! Eight branches; the limits of the PR2 leave two, as elbow and wrist bend in one direction only.
//! Whether a branch keeps to the limits is decided on sines and cosines ([`Arc`]); angles are
//! computed only for those that do, as arcus tangens costs more than all the rest.
//!
//! The feasible values of q1 are intervals, and some are narrow. So there are three passes: a
//! coarse scan from the seed outwards, which nearly always succeeds; a fine one; and in that one a
//! search for the maximum of the *slack*, the least distance of a branch to what forbids it,
//! wherever the slack has a peak between three samples.
//!
//! The same geometry is solved with other formulas in the package `pr2_arm_kinematics` (Sachin
//! Chitta, Willow Garage, 2008), whose idea of scanning pan or roll this is.

use nalgebra::{Isometry3, Matrix3, Unit, UnitQuaternion, Vector3};

use crate::robot::chain::{Chain, Segment};
use crate::robot::model::JointKind;

use super::{Unreachable, Values, distance_squared, unwound};

/// Step of the coarse scan.
const COARSE_RAD: f64 = 0.1;
/// Step of the fine scan.
const FINE_RAD: f64 = 0.0125;
/// Steps to either side in the table: a whole turn.
const STEPS: usize = 63;
/// A peak of the slack below this is not worth a search: between two samples it rises by less.
const HOPELESS: f64 = -0.05;
/// Halvings of a step around a peak; they end at 1e-9 rad.
const PEAK_STEPS: usize = 32;
/// The slack of what is exactly at a limit, less what rounding takes.
const AT_LIMIT: f64 = -1e-12;
/// A squared sine may be less than 0 by this: 3e-8 m at the wrist.
const ROUNDING: f64 = 1e-14;
/// Sines below this make the last two rolls one.
const SINGULAR: f64 = 1e-9;
/// Signs of elbow, roll and wrist.
const BRANCHES: usize = 8;

/// An arm like the PR2's.
#[derive(Debug, Clone)]
pub(super) struct Pr2Arm {
    /// From the frame of the chain's base to that of the pan joint at 0.
    mount: UnitQuaternion<f64>,
    mount_at: Vector3<f64>,
    /// From the wrist to the tip, turned round.
    tool_inverse: Isometry3<f64>,
    a: f64,
    l1: f64,
    l2: f64,
    limits: [Option<(f64, f64)>; 7],
    arcs: [Arc; 7],
    /// Sine and cosine of whole numbers of coarse steps.
    coarse: Vec<(f64, f64)>,
}

/// Which angles are within limits, asked of their sine and cosine: those whose distance to the
/// middle has a large enough cosine.
#[derive(Debug, Clone, Copy)]
struct Arc {
    middle: SinCos,
    cos_half: f64,
}

/// An angle.
#[derive(Debug, Clone, Copy, Default)]
struct SinCos {
    sin: f64,
    cos: f64,
}

impl SinCos {
    fn of(angle: f64) -> SinCos {
        let (sin, cos) = libm::sincos(angle);
        SinCos { sin, cos }
    }

    #[inline]
    fn angle(self) -> f64 {
        libm::atan2(self.sin, self.cos)
    }

    #[inline]
    fn plus(self, other: SinCos) -> SinCos {
        SinCos {
            sin: self.sin * other.cos + self.cos * other.sin,
            cos: self.cos * other.cos - self.sin * other.sin,
        }
    }
}

impl Arc {
    fn of(limits: Option<(f64, f64)>) -> Arc {
        match limits {
            Some((low, high)) if high - low < std::f64::consts::TAU => {
                Arc { middle: SinCos::of((low + high) * 0.5), cos_half: libm::cos((high - low) * 0.5) }
            }
            _ => Arc { middle: SinCos { sin: 0.0, cos: 1.0 }, cos_half: -2.0 },
        }
    }

    /// Positive inside, and greater the further from the ends.
    #[inline]
    fn slack(&self, angle: SinCos) -> f64 {
        self.middle.cos * angle.cos + self.middle.sin * angle.sin - self.cos_half
    }
}

/// Pose of the wrist after the last roll, seen from the pan joint's frame at 0.
struct Wrist {
    at: Vector3<f64>,
    axes: Matrix3<f64>,
}

/// One choice of signs for one value of the pan joint.
#[derive(Debug, Clone, Copy, Default)]
struct Branch {
    number: usize,
    /// Least distance to what forbids the branch, in no unit; at least [`AT_LIMIT`] if it is allowed.
    slack: f64,
    lift: SinCos,
    roll: SinCos,
    elbow: SinCos,
    flex: SinCos,
    /// The forearm's direction and its Y axis, after the pan joint.
    forearm: Vector3<f64>,
    side: Vector3<f64>,
}

/// What is kept of a search.
struct Best {
    seed: Values,
    cost: f64,
    values: Option<Values>,
}

impl Best {
    fn offer(&mut self, values: &Values) {
        let cost = distance_squared(values, &self.seed);
        if cost < self.cost {
            self.cost = cost;
            self.values = Some(*values);
        }
    }
}

impl Pr2Arm {
    /// The closed form of a chain, if it is built like an arm of the PR2.
    pub(super) fn of(chain: &Chain) -> Option<Pr2Arm> {
        let [pan, lift, roll, elbow, forearm, wrist, hand] = &chain.segments[..] else { return None };
        let (x, y, z) = (Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis());
        let parts = [(pan, z), (lift, y), (roll, x), (elbow, y), (forearm, x), (wrist, y), (hand, x)];
        let fits =
            parts.iter().enumerate().all(|(column, (segment, axis))| turns_about(segment, axis, column));
        let shifts = [lift, roll, elbow, forearm, wrist, hand].map(shift_along_x);
        let [Some(a), Some(roll), Some(l1), Some(forearm), Some(l2), Some(hand)] = shifts else {
            return None;
        };
        // The axes of shoulder, elbow and wrist must meet, and the arm must have a length.
        if !fits
            || [roll, forearm, hand].iter().any(|shift| *shift != 0.0)
            || l1 <= 0.0
            || l2 <= 0.0
            || a < 0.0
        {
            return None;
        }
        let mut limits = [None; 7];
        for (place, limit) in limits.iter_mut().zip(chain.limits()) {
            *place = *limit;
        }
        let coarse = (0..=STEPS).map(|step| libm::sincos(step as f64 * COARSE_RAD)).collect();
        Some(Pr2Arm {
            mount: pan.origin.rotation,
            mount_at: pan.origin.translation.vector,
            tool_inverse: chain.tool.inverse(),
            a,
            l1,
            l2,
            limits,
            arcs: limits.map(Arc::of),
            coarse,
        })
    }

    /// The solution nearest to the seed.
    pub(super) fn nearest(&self, target: &Isometry3<f64>, seed: &Values) -> Result<Values, Unreachable> {
        let wrist = self.wrist(target);
        let mut best = Best { seed: *seed, cost: f64::INFINITY, values: None };
        self.scan(seed, |pan, angle, away| {
            self.offer(&wrist, angle, pan, &mut |values| best.offer(values), seed);
            // What is further away in this joint alone cannot be nearer.
            away * away < best.cost
        });
        if best.values.is_none() {
            self.scan_finely(&wrist, seed, &mut |values| best.offer(values));
        }
        best.values.ok_or_else(|| self.why_not(&wrist))
    }

    /// A solution of each branch for each value of the scan.
    pub(super) fn all(&self, target: &Isometry3<f64>, seed: &Values) -> Vec<Values> {
        let wrist = self.wrist(target);
        let mut found = Vec::new();
        self.scan(seed, |pan, angle, _| {
            self.offer(&wrist, angle, pan, &mut |values| found.push(*values), seed);
            true
        });
        if found.is_empty() {
            self.scan_finely(&wrist, seed, &mut |values| found.push(*values));
        }
        found
    }

    fn wrist(&self, target: &Isometry3<f64>) -> Wrist {
        let tip = target * self.tool_inverse;
        let rotation = self.mount.inverse() * tip.rotation;
        Wrist {
            at: self.mount.inverse_transform_vector(&(tip.translation.vector - self.mount_at)),
            axes: rotation.to_rotation_matrix().into_inner(),
        }
    }

    fn why_not(&self, wrist: &Wrist) -> Unreachable {
        let (distance_m, reach_m) = (wrist.at.norm(), self.a + self.l1 + self.l2);
        match distance_m > reach_m {
            true => Unreachable::TooFar { distance_m, reach_m },
            false => Unreachable::OutsideLimits,
        }
    }

    /// The range of the pan joint.
    fn pan_range(&self, seed: &Values) -> (f64, f64) {
        use std::f64::consts::PI;
        self.limits[0].unwrap_or((seed[0] - PI, seed[0] + PI))
    }

    /// Values of the pan joint from the seed outwards: the value, the angle, how far it is away.
    /// The ends of the range are among them. Goes on while `visit` says so.
    fn scan(&self, seed: &Values, mut visit: impl FnMut(f64, SinCos, f64) -> bool) {
        let (low, high) = self.pan_range(seed);
        let start = SinCos::of(seed[0]);
        if !visit(seed[0], start, 0.0) {
            return;
        }
        for (step, (sin, cos)) in self.coarse.iter().enumerate().skip(1) {
            let away = step as f64 * COARSE_RAD;
            let (up, down) = (seed[0] + away, seed[0] - away);
            for (value, sin, end) in [(up, *sin, high), (down, -sin, low)] {
                let beyond = if end == high { value - end } else { end - value };
                let go_on = match () {
                    () if beyond <= 0.0 => visit(value, start.plus(SinCos { sin, cos: *cos }), away),
                    // The end of the range lies between this step and the last.
                    () if beyond < COARSE_RAD => visit(end, SinCos::of(end), away - beyond),
                    () => true,
                };
                if !go_on {
                    return;
                }
            }
            if up > high && down < low {
                return;
            }
        }
    }

    /// All values from the lower end to the upper one in small steps, and the peaks between them.
    fn scan_finely(&self, wrist: &Wrist, seed: &Values, found: &mut dyn FnMut(&Values)) {
        let (low, high) = self.pan_range(seed);
        let steps = libm::ceil((high - low) / FINE_RAD).max(1.0);
        let width = (high - low) / steps;
        let mut before = [[f64::NEG_INFINITY; 2]; BRANCHES];
        // One step more than there are values, so that a peak at the upper end is seen.
        for step in 0..=(steps as usize + 1) {
            let pan = (low + step as f64 * width).min(high);
            let mut now = [f64::NEG_INFINITY; BRANCHES];
            if step <= steps as usize {
                self.branches(wrist, SinCos::of(pan), |branch| now[branch.number] = branch.slack);
            }
            if now.iter().any(|slack| *slack >= AT_LIMIT) {
                self.offer(wrist, SinCos::of(pan), pan, found, seed);
            }
            for (number, slack) in now.iter().enumerate() {
                let [first, second] = before[number];
                let peak = second > HOPELESS && second < AT_LIMIT && second >= first && second >= *slack;
                if peak && step > 0 {
                    let middle = low + (step - 1) as f64 * width;
                    self.climb(wrist, number, (middle, width), (low, high), found, seed);
                }
                before[number] = [second, *slack];
            }
        }
    }

    /// Looks for a value near `middle` where branch `number` is allowed.
    fn climb(
        &self,
        wrist: &Wrist,
        number: usize,
        (mut middle, mut width): (f64, f64),
        (low, high): (f64, f64),
        found: &mut dyn FnMut(&Values),
        seed: &Values,
    ) {
        let slack_at = |pan: f64| {
            let mut slack = f64::NEG_INFINITY;
            self.branches(wrist, SinCos::of(pan), |branch| {
                if branch.number == number {
                    slack = branch.slack;
                }
            });
            slack
        };
        let mut best = slack_at(middle);
        for _ in 0..PEAK_STEPS {
            width *= 0.5;
            for pan in [middle - width, middle + width] {
                let pan = pan.clamp(low, high);
                let slack = slack_at(pan);
                if slack > best {
                    (best, middle) = (slack, pan);
                    break;
                }
            }
            if best >= AT_LIMIT {
                return self.offer(wrist, SinCos::of(middle), middle, found, seed);
            }
        }
    }

    /// Hands on the solutions for one value of the pan joint.
    #[inline]
    fn offer(&self, wrist: &Wrist, angle: SinCos, pan: f64, found: &mut dyn FnMut(&Values), seed: &Values) {
        self.branches(wrist, angle, |branch| {
            if branch.slack >= AT_LIMIT
                && let Some(values) = self.angles(wrist, angle, pan, branch, seed)
            {
                found(&values);
            }
        });
    }

    /// The branches for one value of the pan joint.
    #[inline]
    fn branches(&self, wrist: &Wrist, pan: SinCos, mut visit: impl FnMut(&Branch)) {
        let after_pan = |v: &Vector3<f64>| {
            Vector3::new(pan.cos * v.x + pan.sin * v.y, pan.cos * v.y - pan.sin * v.x, v.z)
        };
        let mut p = after_pan(&wrist.at);
        p.x -= self.a;
        let cos = (p.norm_squared() - self.l1 * self.l1 - self.l2 * self.l2) / (2.0 * self.l1 * self.l2);
        // sin² q4, and the share of it that the roll leaves for p_z: (v² − p_y²) / l2².
        let bend = 1.0 - cos * cos;
        let side = p.y / self.l2;
        let room = bend - side * side;
        if room < HOPELESS {
            return;
        }
        let exists = if room > -ROUNDING { f64::INFINITY } else { room.min(2.0 * AT_LIMIT) };
        // Stretched or folded arms differ from possible ones by rounding.
        let sin = bend.max(0.0).sqrt();
        let (sin_roll, cos_roll) = match sin > SINGULAR {
            true => ((side / sin).clamp(-1.0, 1.0), room.max(0.0).sqrt() / sin),
            // A stretched arm does not care how it rolls.
            false => (0.0, 1.0),
        };
        let hand = after_pan(&wrist.axes.column(0).into_owned());
        for (number, sign) in [(0, -1.0), (4, 1.0)] {
            let elbow = SinCos { sin: sign * sin, cos };
            let slack = exists.min(self.arcs[3].slack(elbow));
            if slack < HOPELESS || (sign > 0.0 && sin == 0.0) {
                continue;
            }
            // v has the sign of −sin q4, and sin q3 = −p_y / v.
            let roll = SinCos { sin: sign * sin_roll, cos: cos_roll };
            self.rolls(&p, &hand, Branch { number, slack, elbow, roll, ..Branch::default() }, &mut visit);
        }
    }

    /// The two rolls of the upper arm that bring the wrist to `p`.
    #[inline]
    fn rolls(&self, p: &Vector3<f64>, hand: &Vector3<f64>, branch: Branch, visit: &mut impl FnMut(&Branch)) {
        let elbow = branch.elbow;
        let (u, v) = (self.l1 + self.l2 * elbow.cos, -self.l2 * elbow.sin);
        let sin = branch.roll.sin;
        for (number, cos) in [(0, branch.roll.cos), (2, -branch.roll.cos)] {
            let roll = SinCos { sin, cos };
            let w = v * cos;
            let scale = 1.0 / (u * u + w * w).max(f64::MIN_POSITIVE);
            let lift = SinCos { sin: (p.x * w - p.z * u) * scale, cos: (p.x * u + p.z * w) * scale };
            let slack = branch.slack.min(self.arcs[2].slack(roll)).min(self.arcs[1].slack(lift));
            if slack < HOPELESS {
                continue;
            }
            let (x, y, z) = (elbow.cos, elbow.sin * sin, -elbow.sin * cos);
            let forearm = Vector3::new(lift.cos * x + lift.sin * z, y, lift.cos * z - lift.sin * x);
            let side = Vector3::new(lift.sin * sin, cos, lift.cos * sin);
            let cos_flex = forearm.dot(hand);
            let sin_flex = (1.0 - cos_flex * cos_flex).max(0.0).sqrt();
            for (sign_number, sign) in [(0, -1.0), (1, 1.0)] {
                let flex = SinCos { sin: sign * sin_flex, cos: cos_flex };
                let slack = slack.min(self.arcs[5].slack(flex));
                let number = branch.number + number + sign_number;
                visit(&Branch { number, slack, lift, roll, flex, forearm, side, ..branch });
            }
        }
    }

    /// The angles of an allowed branch. `None` if one is outside of its limits after all, which for
    /// the PR2 only rounding can bring about, but on other arms limits of the last two rolls.
    fn angles(
        &self,
        wrist: &Wrist,
        angle: SinCos,
        pan: f64,
        branch: &Branch,
        seed: &Values,
    ) -> Option<Values> {
        let mut values = Values::default();
        let mut set = |joint: usize, angle: f64| {
            values[joint] = unwound(angle, self.limits[joint], seed[joint])?;
            Some(values[joint])
        };
        set(0, pan)?;
        set(1, branch.lift.angle())?;
        set(2, branch.roll.angle())?;
        set(3, branch.elbow.angle())?;
        set(5, branch.flex.angle())?;
        let after_pan = |v: Vector3<f64>| {
            Vector3::new(angle.cos * v.x + angle.sin * v.y, angle.cos * v.y - angle.sin * v.x, v.z)
        };
        let [x, y, z] = [0, 1, 2].map(|column| after_pan(wrist.axes.column(column).into_owned()));
        let up = branch.forearm.cross(&branch.side);
        let flex = branch.flex.sin;
        if flex.abs() > SINGULAR {
            let sign = flex.signum();
            set(4, libm::atan2(branch.side.dot(&x) * sign, -up.dot(&x) * sign))?;
            set(6, libm::atan2(branch.forearm.dot(&y) * sign, branch.forearm.dot(&z) * sign))?;
        } else {
            // Forearm and hand are in line: only the sum of the rolls matters, or their difference.
            let roll = set(4, seed[4])?;
            let sum = libm::atan2(-branch.side.dot(&z), branch.side.dot(&y));
            set(6, sum - roll * branch.flex.cos.signum())?;
        }
        Some(values)
    }
}

/// True if a joint turns about this axis of its frame, moved by variable `column` alone.
fn turns_about(segment: &Segment, axis: &Unit<Vector3<f64>>, column: usize) -> bool {
    let kind = matches!(segment.kind, JointKind::Revolute | JointKind::Continuous);
    let own = segment.column == column && segment.multiplier == 1.0 && segment.offset == 0.0;
    kind && own && (segment.axis.into_inner() - axis.into_inner()).norm() < 1e-12
}

/// How far a joint is from the one before, if it is that along X and not turned.
fn shift_along_x(segment: &Segment) -> Option<f64> {
    let (at, turned) = (segment.origin.translation.vector, segment.origin.rotation.coords.xyz().norm());
    (at.y.abs() < 1e-12 && at.z.abs() < 1e-12 && turned < 1e-12).then_some(if at.x.abs() < 1e-12 {
        0.0
    } else {
        at.x
    })
}
