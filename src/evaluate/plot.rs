//! Pictures of evaluations as SVG: box plots of variants, and curves with intervals.
//!
//! A picture is text that depends on nothing but its data: the same bits on every machine, no fonts, no script. Coordinates are
//! tenths of a pixel. Colours are those of Okabe and Ito, which nearly all eyes tell apart, and never the only difference: boxes
//! stand in the order of the legend, curves have markers. Viewers that know about dark backgrounds are given other ink.
//!
//! Why no crate draws them: plotters, the one that was tried, builds quickly, but draws whiskers to where outliers would begin
//! instead of to the last value, has neither outliers nor means, whole pixels, and colours without classes, so that a picture
//! cannot turn dark; what it would do for us is only the axes.

mod axis;
mod canvas;

use stdlib::statistics::Summary;

use axis::{Axis, shown};
use canvas::{Canvas, Frame, Mark, Wanted, short, width_of};

/// One variant: a value for each run, and whether this run failed.
#[derive(Debug, Clone, Copy)]
pub struct Series<'a> {
    /// What the legend calls it.
    pub name: &'a str,
    /// A value per run; what is not finite is left out.
    pub values: &'a [f64],
    /// Whether the run of the same place failed; runs without a place here did not.
    pub failed: &'a [bool],
}

/// Variants that stand side by side: one case of a sweep, or one measure.
#[derive(Debug, Clone)]
pub struct Group<'a> {
    /// What stands below.
    pub label: &'a str,
    /// Its variants.
    pub series: Vec<Series<'a>>,
}

/// A line through means, with their intervals.
#[derive(Debug, Clone)]
pub struct Curve {
    /// What the legend calls it.
    pub name: String,
    /// x, mean, lower and upper end of the interval. Points whose x or mean is not finite are left out, and so are bars without
    /// finite ends.
    pub points: Vec<(f64, f64, f64, f64)>,
}

/// Values beyond this are no measurements, and the squares of their differences would be infinite.
const LARGEST: f64 = 1e150;

fn can_be_drawn(value: f64) -> bool {
    value.abs() <= LARGEST
}

// ---------------------------------------------------------------------------------------------
// Box plots

/// Pixels of a box with the room around it: that of few boxes, and that of many.
const SLOT_PX: (f64, f64) = (56.0, 28.0);
const GROUP_GAP_PX: f64 = 26.0;
const LEAST_WIDTH_PX: f64 = 420.0;
const BOX_HEIGHT_PX: f64 = 300.0;

/// Box plots (Tukey 1977): the box from the first to the third quartile (type 7) with a line at the median, whiskers to the last values
/// within 1.5 heights of the box, dots for those beyond, and a diamond at the mean.
///
/// Boxes are of the runs that succeeded, since a plan that fails early would look fast. A failed run is a cross beside the box,
/// at its value. Below each box stands how many runs it is of, and after a cross how many failed.
/// `title` and `axis`, what is measured and its unit, may be any text.
#[must_use]
pub fn boxes(title: &str, axis: &str, groups: &[Group<'_>]) -> String {
    let mut names: Vec<&str> = Vec::new();
    for series in groups.iter().flat_map(|group| &group.series) {
        if !names.contains(&series.name) {
            names.push(series.name);
        }
    }
    let all = groups.iter().flat_map(|group| &group.series).flat_map(|series| series.values).copied();
    let Some(scale) = Axis::of(all.filter(|value| can_be_drawn(*value))) else {
        return canvas::nothing(title, "no runs");
    };
    let count: usize = groups.iter().map(|group| group.series.len().max(1)).sum();
    let slot = (LEAST_WIDTH_PX * 1.6 / count as f64).clamp(SLOT_PX.1, SLOT_PX.0);
    let widths: Vec<f64> =
        groups.iter().map(|group| group.series.len().max(1) as f64 * slot + GROUP_GAP_PX).collect();
    let inner = widths.iter().sum::<f64>().max(LEAST_WIDTH_PX);
    let stretch = inner / widths.iter().sum::<f64>();
    let labels = Labels::of(groups, &widths);
    let fails = groups.iter().flat_map(|group| &group.series).any(|series| Drawn::of(series).failures > 0);
    let mut key = vec!["◇ mean", "○ beyond 1.5 IQR"];
    if fails {
        key.push("× failed run");
    }
    let counts = if fails { COUNTS_PX[1] } else { COUNTS_PX[0] } + 10.0;
    let frame = Frame::new(&Wanted {
        title,
        axis,
        scale: &scale,
        names: &names,
        boxes: true,
        key: &key,
        inner: (inner, BOX_HEIGHT_PX),
        overhang: labels.overhang(widths[0] * stretch),
    });
    let mut canvas = Canvas::new(&frame);
    for (line, name) in COUNTS_PX.iter().zip(if fails { &["runs", "failed"][..] } else { &["runs"] }) {
        canvas.text("n end", (frame.left - 7.0, frame.bottom() + line), name);
    }
    let mut left = frame.left;
    for (at, group) in groups.iter().enumerate() {
        let width = widths[at] * stretch;
        if at > 0 {
            canvas.line("split", (left, frame.top), (left, frame.bottom()));
        }
        let middle = left + width / 2.0;
        for (number, series) in group.series.iter().enumerate() {
            let x = middle + (number as f64 - (group.series.len() as f64 - 1.0) / 2.0) * slot;
            let colour = names.iter().position(|name| *name == series.name).unwrap_or_default();
            draw_box(&mut canvas, &frame, &scale, (x, slot), colour, (group.label, series));
        }
        labels.draw(&mut canvas, at, group.label, (middle, frame.bottom() + counts));
        left += width;
    }
    canvas.finish(title, frame.width(), frame.bottom() + counts + labels.height() + 10.0)
}

/// Lines of the numbers of runs, and of failed ones, between the axis and the labels.
const COUNTS_PX: [f64; 2] = [14.0, 26.0];

/// The runs of a series, as they are drawn.
struct Drawn {
    good: Vec<f64>,
    /// Values of failed runs that have one.
    bad: Vec<f64>,
    failures: usize,
}

impl Drawn {
    fn of(series: &Series<'_>) -> Drawn {
        let failed = |at: usize| series.failed.get(at).copied().unwrap_or(false);
        let which = |wanted: bool| {
            let runs = series.values.iter().enumerate().filter(move |(at, _)| failed(*at) == wanted);
            runs.map(|(_, value)| *value).filter(|value| can_be_drawn(*value)).collect()
        };
        let failures = (0..series.values.len()).filter(|at| failed(*at)).count();
        Drawn { good: which(false), bad: which(true), failures }
    }
}

/// `place`: the middle of the box and the width of its slot. `what`: label of the group, and the series.
fn draw_box(
    canvas: &mut Canvas,
    frame: &Frame,
    scale: &Axis,
    (x, slot): (f64, f64),
    colour: usize,
    (label, series): (&str, &Series<'_>),
) {
    let drawn = Drawn::of(series);
    let y = |value: f64| scale.at(value, frame.bottom(), frame.top);
    let half = slot * 0.29;
    let summary = Summary::of(&drawn.good);
    canvas.open(colour, &told(label, series.name, summary.as_ref(), drawn.failures));
    if let Some(it) = &summary {
        let fence = 1.5 * (it.q3 - it.q1);
        let within = |value: &&f64| **value >= it.q1 - fence && **value <= it.q3 + fence;
        // In tiny samples the last value within may be inside of the box.
        let low = drawn.good.iter().filter(within).fold(it.q1, |low, value| low.min(*value));
        let high = drawn.good.iter().filter(within).fold(it.q3, |high, value| high.max(*value));
        for (inner, outer) in [(it.q1, low), (it.q3, high)] {
            if inner != outer {
                canvas.line("s", (x, y(inner)), (x, y(outer)));
                canvas.line("s", (x - half / 2.0, y(outer)), (x + half / 2.0, y(outer)));
            }
        }
        canvas.rect("box", (x - half, y(it.q3)), (2.0 * half, y(it.q1) - y(it.q3)));
        canvas.line("median", (x - half, y(it.median)), (x + half, y(it.median)));
        for value in drawn.good.iter().filter(|value| !within(value)) {
            canvas.circle("out", (x, y(*value)), 2.4);
        }
        canvas.mark("mean", Mark::Diamond, (x, y(it.mean)), 3.8);
    }
    for value in &drawn.bad {
        canvas.mark("cross", Mark::Cross, (x + half + 6.5, y(*value)), 3.4);
    }
    canvas.close();
    canvas.text("n mid", (x, frame.bottom() + COUNTS_PX[0]), &drawn.good.len().to_string());
    if drawn.failures > 0 {
        canvas.text("n mid", (x, frame.bottom() + COUNTS_PX[1]), &format!("×{}", drawn.failures));
    }
}

/// What a viewer shows under the mouse.
fn told(label: &str, name: &str, summary: Option<&Summary>, failures: usize) -> String {
    let mut text = format!("{label}, {name}: ");
    match summary {
        None => text += "no run",
        Some(it) => {
            let [median, q1, q3, mean] = [it.median, it.q1, it.q3, it.mean].map(shown);
            text += &format!("{} runs, median {median}, quartiles {q1} and {q3}, mean {mean}", it.n);
        }
    }
    if failures > 0 {
        text += &format!(", {failures} failed");
    }
    text
}

/// The labels of the groups: in lines below, or aslant if a word is wider than its group.
struct Labels {
    lines: Vec<Vec<String>>,
    aslant: bool,
}

const LABEL_PX: f64 = 11.0;
const LINE_PX: f64 = 14.0;
const MOST_LABEL_LETTERS: usize = 26;
/// Sine and cosine of 35°.
const SLANT: (f64, f64) = (0.5736, 0.8192);

impl Labels {
    fn of(groups: &[Group<'_>], widths: &[f64]) -> Labels {
        let lines: Vec<Vec<String>> = (groups.iter().zip(widths))
            .map(|(group, width)| wrapped(&short(group.label, 3 * MOST_LABEL_LETTERS), width - 8.0))
            .collect();
        let fits = |lines: &Vec<String>, width: f64| {
            lines.len() <= 3 && lines.iter().all(|line| width_of(line, LABEL_PX) <= width - 4.0)
        };
        let aslant = !lines.iter().zip(widths).all(|(lines, width)| fits(lines, *width));
        let of_group = |group: &Group<'_>| vec![short(group.label, MOST_LABEL_LETTERS)];
        Labels { lines: if aslant { groups.iter().map(of_group).collect() } else { lines }, aslant }
    }

    fn longest(&self) -> f64 {
        self.lines.iter().flatten().map(|line| width_of(line, LABEL_PX)).fold(0.0, f64::max)
    }

    fn height(&self) -> f64 {
        match self.aslant {
            true => self.longest() * SLANT.0 + LINE_PX,
            false => self.lines.iter().map(Vec::len).max().unwrap_or(0) as f64 * LINE_PX,
        }
    }

    /// How far the first label may stand out to the left of the first group.
    fn overhang(&self, first_width: f64) -> f64 {
        let first =
            self.lines.first().and_then(|lines| lines.first()).map_or(0.0, |line| width_of(line, LABEL_PX));
        if self.aslant { first * SLANT.1 - first_width / 2.0 } else { 0.0 }
    }

    fn draw(&self, canvas: &mut Canvas, group: usize, whole: &str, (x, y): (f64, f64)) {
        for (number, line) in self.lines[group].iter().enumerate() {
            let at = (x, y + number as f64 * LINE_PX + 8.0);
            match self.aslant {
                true => canvas.slanted(at, line, whole),
                false => canvas.text("mid", at, line),
            }
        }
    }
}

/// Words in lines of at most this width.
fn wrapped(text: &str, width: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if width_of(line, LABEL_PX) + width_of(word, LABEL_PX) + 4.0 <= width => {
                *line += " ";
                *line += word;
            }
            _ => lines.push(word.into()),
        }
    }
    lines
}

// ---------------------------------------------------------------------------------------------
// Curves

const CURVES_PX: (f64, f64) = (520.0, 300.0);
/// Curves are moved apart by this, so that their bars do not hide each other.
const APART_PX: f64 = 3.0;

/// Lines through means with their intervals as bars, for what is measured over something that varies.
#[must_use]
pub fn curves(title: &str, x_axis: &str, y_axis: &str, curves: &[Curve]) -> String {
    let drawn: Vec<Vec<(f64, f64, f64, f64)>> = curves.iter().map(points_of).collect();
    let points = || drawn.iter().flatten();
    let ends = points().flat_map(|(_, mean, low, high)| [*mean, *low, *high]);
    let xs = Axis::of(points().map(|point| point.0));
    let ys = Axis::of(ends.filter(|value| can_be_drawn(*value)));
    let (Some(xs), Some(ys)) = (xs, ys) else { return canvas::nothing(title, "no runs") };
    let names: Vec<&str> = curves.iter().map(|curve| curve.name.as_str()).collect();
    let frame = Frame::new(&Wanted {
        title,
        axis: y_axis,
        scale: &ys,
        names: &names,
        boxes: false,
        key: &["bars: 95 % intervals"],
        inner: CURVES_PX,
        overhang: 0.0,
    });
    let mut canvas = Canvas::new(&frame);
    let x_of = |value: f64| xs.at(value, frame.left + 14.0, frame.right() - 14.0);
    let y_of = |value: f64| ys.at(value, frame.bottom(), frame.top);
    for (value, label) in &xs.ticks {
        canvas.line("axis", (x_of(*value), frame.bottom()), (x_of(*value), frame.bottom() + 4.0));
        canvas.text("mid", (x_of(*value), frame.bottom() + 17.0), label);
    }
    let middle = (frame.left + frame.right()) / 2.0;
    canvas.text("mid", (middle, frame.bottom() + 36.0), &xs.named(&short(x_axis, 70)));
    for (number, points) in drawn.iter().enumerate() {
        let apart = (number as f64 - (drawn.len() as f64 - 1.0) / 2.0) * APART_PX;
        let place = |x: f64, y: f64| (x_of(x) + apart, y_of(y));
        canvas.open(number, names[number]);
        canvas.way("curve", points.iter().map(|(x, mean, ..)| place(*x, *mean)));
        for (x, mean, low, high) in points {
            if can_be_drawn(*low) && can_be_drawn(*high) {
                let (top, bottom) = (place(*x, *high), place(*x, *low));
                canvas.line("s", top, bottom);
                for end in [top, bottom] {
                    canvas.line("s", (end.0 - 3.0, end.1), (end.0 + 3.0, end.1));
                }
            }
            canvas.mark("dot", Mark::of_curve(number), place(*x, *mean), 3.6);
        }
        canvas.close();
    }
    canvas.finish(title, frame.width(), frame.bottom() + 48.0)
}

/// Those that can be drawn, from left to right.
fn points_of(curve: &Curve) -> Vec<(f64, f64, f64, f64)> {
    let drawn = |point: &&(f64, f64, f64, f64)| can_be_drawn(point.0) && can_be_drawn(point.1);
    let mut points: Vec<_> = curve.points.iter().filter(drawn).copied().collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    points
}

#[cfg(test)]
mod tests;
