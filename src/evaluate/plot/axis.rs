//! An axis: where its ticks are, how they are called, and where a value lies.
//!
//! Powers of ten come from text, which is exact, so nothing here depends on logarithms of the machine.

/// From the first tick to the last.
pub struct Axis {
    low: f64,
    high: f64,
    /// Values with their labels, from low to high.
    pub ticks: Vec<(f64, String)>,
    /// Labels are in units of ten to this power; 0 for numbers of usual size.
    pub power: i32,
}

/// About so many steps.
const STEPS: f64 = 6.0;

impl Axis {
    /// The axis on which all these values lie, none if there are none. It begins at 0 unless the values are far from it. All are
    /// finite, and so are their differences.
    pub fn of(values: impl Iterator<Item = f64>) -> Option<Axis> {
        let ends = values.fold(None, |ends: Option<(f64, f64)>, value| {
            Some(ends.map_or((value, value), |(low, high)| (low.min(value), high.max(value))))
        });
        let (mut low, mut high) = ends?;
        let size = low.abs().max(high.abs());
        // Too near to each other to be told apart by labels: as if they were equal.
        if high - low <= size * 1e-9 || high - low < 1e-290 {
            let room = if size < 1e-280 { 1.0 } else { size * 0.1 };
            (low, high) = (low - room, high + room);
        }
        if low > 0.0 && low < 0.6 * high {
            low = 0.0;
        } else if high < 0.0 && high > 0.6 * low {
            high = 0.0;
        }
        let raw = (high - low) / STEPS;
        let mut exponent = exponent_of(raw);
        let mut factor = [1.0, 2.0, 5.0].into_iter().find(|factor| factor * ten_to(exponent) >= raw);
        if factor.is_none() {
            exponent += 1;
            factor = Some(1.0);
        }
        let step = factor? * ten_to(exponent);
        let (first, last) = ((low / step).floor(), (high / step).ceil());
        let power = exponent_of((first * step).abs().max((last * step).abs()));
        let power = if (-3..6).contains(&power) { 0 } else { power };
        let decimals = usize::try_from(power - exponent).unwrap_or(0);
        let count = (last - first) as u32;
        let ticks = (0..=count).map(|i| {
            // The step is divided, not the tick, since ten to the power may be larger than any float is exact.
            let tick = first + f64::from(i);
            let label =
                format!("{:.decimals$}", tick * factor.unwrap_or(1.0) * ten_to(exponent - power) + 0.0);
            (tick * step, label.replace('-', "−"))
        });
        Some(Axis { low: first * step, high: last * step, ticks: ticks.collect(), power })
    }

    /// Where a value lies between the places of the ends.
    pub fn at(&self, value: f64, low_px: f64, high_px: f64) -> f64 {
        low_px + (value - self.low) / (self.high - self.low) * (high_px - low_px)
    }

    /// The name of the axis, with the power of ten of its labels.
    pub fn named(&self, name: &str) -> String {
        let superscript = |letter: char| match letter {
            '-' => '⁻',
            '1' => '¹',
            '2' => '²',
            '3' => '³',
            digit => char::from_u32('⁰' as u32 + digit.to_digit(10).unwrap_or(0)).unwrap_or(digit),
        };
        match self.power {
            0 => name.into(),
            power => format!("{name} × 10{}", power.to_string().chars().map(superscript).collect::<String>()),
        }
    }
}

/// The power of ten of the first digit.
fn exponent_of(value: f64) -> i32 {
    let text = format!("{value:e}");
    text.split_once('e').and_then(|(_, exponent)| exponent.parse().ok()).unwrap_or(0)
}

fn ten_to(exponent: i32) -> f64 {
    format!("1e{exponent}").parse().unwrap_or(1.0)
}

/// A number with four digits that count.
pub fn shown(value: f64) -> String {
    let text = format!("{value:.3e}");
    match exponent_of(value) {
        -4..7 => text.parse::<f64>().map_or(text, |rounded| format!("{}", rounded + 0.0)),
        _ => text,
    }
}
