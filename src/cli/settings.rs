//! The options that say what a run may use and do.

use clap::{Args, ValueEnum as _};
use pleach::Options;
use pleach::render::Style;
use serde_json::{Value as Json, json};
use vm::limits::{Grants, Limits};
use world::world::Mode;

use super::Trouble;

/// Seed, limits and grants.
#[derive(Debug, Clone, Args)]
pub struct Settings {
    /// Key of all random draws
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = count)]
    pub seed: u64,
    /// Key of the order in which ready tasks have their turns; 0 is the order of the source
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = count)]
    pub schedule: u64,
    /// What time is
    #[arg(long, value_name = "KIND", default_value = "virtual")]
    pub clock: Clock,
    /// How the robot of the world moves
    #[arg(long, value_name = "KIND", default_value = "projected")]
    pub robot: Robot,
    /// Most calls and backward jumps
    #[arg(long, value_name = "N", value_parser = count, help_heading = "Limits")]
    pub fuel: Option<u64>,
    /// Most nested calls
    #[arg(long, value_name = "N", value_parser = count, help_heading = "Limits")]
    pub depth: Option<u64>,
    /// Most memory for values, frames and tree: 512M, 2G
    #[arg(long, value_name = "BYTES", value_parser = bytes, help_heading = "Limits")]
    pub memory: Option<u64>,
    /// Most nodes of the tree
    #[arg(long, value_name = "N", value_parser = count, help_heading = "Limits")]
    pub nodes: Option<u64>,
    /// Most bytes that the program may print
    #[arg(long, value_name = "BYTES", value_parser = bytes, help_heading = "Limits")]
    pub output_limit: Option<u64>,
    /// Let the program read files (`read=DIR`), write them (`write=DIR`) or read the `clock`;
    /// without, it can only compute. May be given several times
    #[arg(long, value_name = "GRANT")]
    pub allow: Vec<String>,
}

/// What time is for a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Clock {
    /// It passes at once, when all tasks wait.
    Virtual,
    /// It passes as on the wall.
    Real,
}

/// How the robot of the world moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Robot {
    /// As it should.
    Projected,
    /// As it does when things have mass and friction.
    Simulated,
}

impl Robot {
    /// The same for the world.
    pub fn mode(self) -> Mode {
        match self {
            Robot::Projected => Mode::Projected,
            Robot::Simulated => Mode::Simulated,
        }
    }
}

impl Settings {
    /// As options of a session.
    pub fn options(&self, style: Style) -> Result<Options, Trouble> {
        self.check_grants()?;
        self.options_of_replay(style)
    }

    /// The same where nothing outside is asked: folders that were granted may be gone.
    pub fn options_of_replay(&self, style: Style) -> Result<Options, Trouble> {
        Ok(Options {
            limits: self.limits(),
            grants: self.grants()?,
            seed: self.seed,
            schedule: self.schedule,
            robot: self.robot.mode(),
            real_time: self.clock == Clock::Real,
            style,
            ..Options::default()
        })
    }

    fn limits(&self) -> Limits {
        let default = Limits::default();
        let size = |given: Option<u64>, default: usize| {
            given.map_or(default, |it| usize::try_from(it).unwrap_or(usize::MAX))
        };
        Limits {
            fuel: self.fuel.unwrap_or(default.fuel),
            depth: size(self.depth, default.depth),
            memory: size(self.memory, default.memory),
            nodes: size(self.nodes, default.nodes),
            output: size(self.output_limit, default.output),
        }
    }

    fn grants(&self) -> Result<Grants, Trouble> {
        let mut grants = Grants::default();
        for text in &self.allow {
            grants.allow(text).map_err(|why| {
                Trouble::new(format!("--allow {text}: {why}"), "for example: --allow read=data")
            })?;
        }
        Ok(grants)
    }

    fn check_grants(&self) -> Result<(), Trouble> {
        self.grants()?;
        for text in &self.allow {
            if let Some((_, path)) = text.split_once('=')
                && !std::path::Path::new(path).exists()
            {
                let help = "create the folder first, or name one that is there";
                return Err(Trouble::new(format!("--allow {text}: there is no {path}"), help));
            }
        }
        Ok(())
    }

    /// For the head of a log: all that was given or is the default.
    pub fn to_json(&self) -> Json {
        let Limits { fuel, depth, memory, nodes, output } = self.limits();
        let limits =
            json!({"fuel": fuel, "depth": depth, "memory": memory, "nodes": nodes, "output": output});
        let clock = self.clock.to_possible_value().map(|it| it.get_name().to_string());
        json!({"seed": self.seed, "schedule": self.schedule, "clock": clock, "robot": self.robot.mode().name(), "limits": limits, "allow": self.allow})
    }

    /// From the head of a log.
    pub fn from_json(json: &Json) -> Option<Settings> {
        let limit = |name: &str| json["limits"][name].as_u64();
        let allow = json["allow"].as_array()?.iter().map(|it| it.as_str().map(str::to_string));
        Some(Settings {
            seed: json["seed"].as_u64()?,
            schedule: json["schedule"].as_u64()?,
            clock: Clock::from_str(json["clock"].as_str()?, false).ok()?,
            // Logs of older versions do not say it.
            robot: json["robot"]
                .as_str()
                .map_or(Some(Robot::Projected), |it| Robot::from_str(it, false).ok())?,
            fuel: Some(limit("fuel")?),
            depth: Some(limit("depth")?),
            memory: Some(limit("memory")?),
            nodes: Some(limit("nodes")?),
            output_limit: Some(limit("output")?),
            allow: allow.collect::<Option<_>>()?,
        })
    }
}

/// A number, perhaps with `_` between its digits.
pub fn count(text: &str) -> Result<u64, String> {
    text.replace('_', "").parse().map_err(|_| format!("`{text}` is no number from 0 to {}", u64::MAX))
}

/// Seconds of the task clock, `12.5` or `12.5s`, as nanoseconds.
pub fn time(text: &str) -> Result<u64, String> {
    let wrong = || format!("`{text}` is no time: seconds of the task clock, as in 12.5 or 12.5s");
    let number = text.strip_suffix('s').unwrap_or(text).trim();
    let (whole, part) = number.split_once('.').unwrap_or((number, "0"));
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    if !digits(whole) || !digits(part) {
        return Err(wrong());
    }
    // Nobody can tell times apart by more digits than the clock has.
    let part = format!("{part:0<9}");
    let seconds: u64 = whole.parse().map_err(|_| wrong())?;
    let ns: u64 = part[..9].parse().map_err(|_| wrong())?;
    seconds.checked_mul(1_000_000_000).and_then(|it| it.checked_add(ns)).ok_or_else(wrong)
}

/// A number of bytes: `1000`, `64K`, `512M`, `2G`; by powers of 1024.
fn bytes(text: &str) -> Result<u64, String> {
    let unit = text.trim_end_matches(['B', 'b']);
    let unit = unit.strip_suffix(['i']).unwrap_or(unit);
    let shift = match unit.chars().last() {
        Some('k' | 'K') => 10,
        Some('m' | 'M') => 20,
        Some('g' | 'G') => 30,
        _ => 0,
    };
    let digits = if shift > 0 { &unit[..unit.len() - 1] } else { text };
    let number =
        count(digits).map_err(|_| format!("`{text}` is no number of bytes, as in 1000, 64K, 512M, 2G"))?;
    number.checked_mul(1 << shift).ok_or_else(|| format!("`{text}` is too large"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_seconds() {
        assert_eq!(time("12.5s"), Ok(12_500_000_000));
        assert_eq!(time("0"), Ok(0));
        assert_eq!(time("1.000000001"), Ok(1_000_000_001));
        assert_eq!(time("1.0000000019"), Ok(1_000_000_001));
        for wrong in ["", "s", "-1", "1.", ".5", "1e3", "nan", "99999999999999", "12 ms"] {
            assert!(time(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn bytes_have_units() {
        assert_eq!(bytes("1_000"), Ok(1000));
        assert_eq!(bytes("512M"), Ok(512 << 20));
        assert_eq!(bytes("2GiB"), Ok(2 << 30));
        assert_eq!(bytes("64kB"), Ok(64 << 10));
        for wrong in ["", "M", "-1", "1.5G", "12 K", "99999999999G"] {
            assert!(bytes(wrong).is_err(), "{wrong}");
        }
    }
}
