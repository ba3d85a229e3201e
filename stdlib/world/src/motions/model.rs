//! How fast robots are, and how wrong they are: the only place with numbers of this kind.
//!
//! They are the same for all examples. `use-noise` multiplies the noise of a world. It is small and not zero: what plans do about small errors
//! is what rehearsals are for. Speeds are those of careful service robots; speeds change at once, what
//! starting and stopping take is in them.

use crate::nav::Speeds;
use crate::sight::Camera;

/// Speeds, times and noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Model {
    // ---- speeds
    /// Of the base.
    pub drive: Speeds,
    /// Share of the greatest speed of a joint that turns; those that slide, as torsos do, are slow anyway and use
    /// all of it.
    pub joint_share: f64,
    /// Greatest speed of joints whose file names none, rad/s or m/s.
    pub joint_limit: f64,
    /// Of a tool along straight lines, m/s.
    pub tool_m_s: f64,
    /// Of a tool that turns, rad/s.
    pub tool_rad_s: f64,
    /// Of a door that is pulled, rad/s.
    pub door_rad_s: f64,
    /// Of a drawer that is pulled, m/s.
    pub drawer_m_s: f64,
    // ---- times
    /// For the fingers to close, or to open.
    pub grip_s: f64,
    /// To look at an image.
    pub detect_s: f64,
    /// To find out that something is not possible.
    pub refusal_s: f64,
    // ---- strength
    /// With which fingers press, newtons.
    pub grip_n: f64,
    // ---- noise: standard deviations
    /// Of a seen position, along each axis.
    pub seen_m: f64,
    /// Of a seen turn about the vertical.
    pub seen_rad: f64,
    /// Of the place at which the base comes to stand, along X and Y.
    pub drive_m: f64,
    /// Of its heading.
    pub drive_rad: f64,
    /// Of friction, as a share of it.
    pub friction_share: f64,
    /// Of the place at which joints of arms stop, radians; of simulated robots only.
    pub joint_rad: f64,
    // ---- tolerances
    /// A hand holds what is this near to where a grasp has it.
    pub grasp_m: f64,
    /// The same for the turn.
    pub grasp_rad: f64,
    /// What a simulated hand holds may turn so far in it before it is lost.
    pub hold_rad: f64,
    /// What is put down may slide so far.
    pub slide_m: f64,
    /// It may fall so far.
    pub fall_m: f64,
    /// It may tilt so far.
    pub tilt_rad: f64,
    // ---- camera
    /// What it takes in.
    pub camera: Camera,
    /// The share of an object that has to be visible.
    pub visible_share: f64,
}

/// The model that all motions use.
pub const MODEL: Model = Model {
    drive: Speeds { linear: 0.5, angular: 0.8, look_ahead_m: 1.0 },
    joint_share: 0.4,
    joint_limit: 2.0,
    tool_m_s: 0.2,
    tool_rad_s: 1.0,
    door_rad_s: 0.5,
    drawer_m_s: 0.15,
    grip_s: 1.0,
    detect_s: 1.0,
    refusal_s: 0.5,
    grip_n: 40.0,
    seen_m: 0.002,
    seen_rad: 0.01,
    drive_m: 0.003,
    drive_rad: 0.003,
    friction_share: 0.05,
    joint_rad: 0.0005,
    grasp_m: 0.025,
    grasp_rad: 0.3,
    hold_rad: 0.6,
    slide_m: 0.03,
    fall_m: 0.05,
    tilt_rad: 0.2,
    camera: Camera { width_rad: 1.57, height_rad: 1.2, near_m: 0.1, far_m: 3.5 },
    visible_share: 0.3,
};
