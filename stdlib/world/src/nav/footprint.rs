//! What a robot looks like from above, in bands of height.
//!
//! A base may go under a table that its torso would hit, and arms may be above a counter in front of
//! which the base stands. So shapes are cut at some heights ([`CUTS_M`]), and each band has a convex
//! outline of its own. A band meets obstacles of its own heights only.

use nalgebra::{Isometry3, Vector2};

use crate::robot::collision::SLACK_M;
use crate::robot::{LinkId, Robot};
use crate::shape::PosedShape;

use super::convex::{Polygon, ROUNDING_M, heights, shadow_points};

/// Heights at which shapes are cut, metres: above bases and what they go under, above worktops with
/// what stands on them.
pub const CUTS_M: [f64; 2] = [0.4, 1.2];

/// Bands at most; more cuts than that are not looked at.
const MAX_BANDS: usize = 8;

/// The outlines of a robot with what it carries, in the frame of its root.
#[derive(Debug, Clone, PartialEq)]
pub struct Footprint {
    pub(super) bands: Vec<Band>,
    inscribed_m: f64,
    circumscribed_m: f64,
}

/// A slice of the robot.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Band {
    pub outline: Polygon,
    /// Metres above the floor.
    pub low: f64,
    pub high: f64,
}

impl Footprint {
    /// The outlines of shapes in the frame of the root, which stands on the floor. Like everything
    /// that moves they are taken a millimetre smaller ([`SLACK_M`]).
    ///
    /// `cuts_m`: heights, rising. Shapes below the floor's height, and no shapes at all, leave a
    /// point of the size of that slack.
    #[must_use]
    pub fn new(shapes: &[PosedShape], cuts_m: &[f64]) -> Footprint {
        let cuts = &cuts_m[..cuts_m.len().min(MAX_BANDS - 1)];
        let lower = std::iter::once(f64::NEG_INFINITY).chain(cuts.iter().copied());
        let upper = cuts.iter().copied().chain(std::iter::once(f64::INFINITY));
        let shrunk: Vec<PosedShape> =
            shapes.iter().map(|posed| PosedShape { shape: posed.shape.shrunk(SLACK_M), ..*posed }).collect();
        let bands: Vec<Band> = lower.zip(upper).filter_map(|cut| Band::new(&shrunk, cut)).collect();
        let circumscribed_m = bands.iter().map(|band| band.outline.reach()).fold(0.0, f64::max);
        let depth = |band: &Band| band.outline.depth(&Vector2::zeros());
        let inscribed_m = bands.iter().map(depth).fold(0.0, f64::max);
        Footprint { bands, inscribed_m, circumscribed_m }
    }

    /// The outlines of a robot with these joint positions; `carried`: shapes of what it carries, each
    /// with the link that it moves with, in that link's frame.
    #[must_use]
    pub fn of_robot(robot: &Robot, configuration: &[f64], carried: &[(LinkId, PosedShape)]) -> Footprint {
        let mut poses = Vec::new();
        robot.forward(&Isometry3::identity(), configuration, &mut poses);
        let at = |link: LinkId, posed: &PosedShape| {
            let link_pose = poses.get(link.index()).copied().unwrap_or_default();
            PosedShape { pose: link_pose * posed.pose, ..*posed }
        };
        let mut shapes: Vec<PosedShape> = Vec::new();
        for (id, link) in robot.link_ids().zip(robot.links()) {
            shapes.extend(link.shapes.iter().map(|posed| at(id, posed)));
        }
        shapes.extend(carried.iter().map(|(link, posed)| at(*link, posed)));
        Footprint::new(&shapes, &CUTS_M)
    }

    /// Radius of the largest circle around the root that is in the outline of some band.
    #[must_use]
    pub fn inscribed_m(&self) -> f64 {
        self.inscribed_m
    }

    /// Radius of the smallest circle around the root that holds all outlines.
    #[must_use]
    pub fn circumscribed_m(&self) -> f64 {
        self.circumscribed_m
    }

    /// Outlines with their heights, from below.
    pub fn outlines(&self) -> impl Iterator<Item = (&Polygon, (f64, f64))> {
        self.bands.iter().map(|band| (&band.outline, (band.low, band.high)))
    }

    /// The bands that something between these heights can touch, as bits.
    pub(super) fn bands_between(&self, low: f64, high: f64) -> u8 {
        let meets = |band: &Band| band.low < high && band.high > low;
        self.bands.iter().enumerate().map(|(place, band)| u8::from(meets(band)) << place).sum()
    }
}

impl Band {
    fn new(shapes: &[PosedShape], (cut_low, cut_high): (f64, f64)) -> Option<Band> {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut points = Vec::new();
        for posed in shapes {
            let (from, to) = heights(posed);
            let (from, to) = (from.max(cut_low), to.min(cut_high));
            if from < to {
                low = low.min(from);
                high = high.max(to);
                shadow_points(posed, &mut points);
            }
        }
        Polygon::around(&points).map(|outline| Band { outline: outline.simpler(ROUNDING_M), low, high })
    }
}
