//! Elements of SVG, and the frame that all pictures have: title, legend, and the axis on the left.

use std::fmt::Write as _;

use super::axis::Axis;
use vm::show::markup;

/// Classes instead of colours, so that a dark page can have others. A picture may stand in a page with others, so everything
/// is below `.plot`.
const STYLE: &str = "\
.plot{font:11px system-ui,'Helvetica Neue',Arial,'DejaVu Sans',sans-serif;color:#1f1f1f}\
.plot .bg{fill:#fff}.plot text{fill:#1f1f1f}.plot .title{font-size:14px;font-weight:600}.plot .key,.plot .n{fill:#666}.plot .n{font-size:9.5px}\
.plot .mid{text-anchor:middle}.plot .end{text-anchor:end}\
.plot .grid{stroke:#e4e4e4}.plot .split{stroke:#e4e4e4}.plot .axis{stroke:#1f1f1f}\
.plot .s{stroke:currentColor;stroke-width:1.2}.plot .box{fill:currentColor;fill-opacity:.28;stroke:currentColor;stroke-width:1.2}\
.plot .median{stroke:currentColor;stroke-width:2.6}.plot .out{fill:none;stroke:currentColor}\
.plot .mean{fill:#fff;stroke:#1f1f1f}.plot .cross{fill:none;stroke:currentColor;stroke-width:1.6}\
.plot .curve{fill:none;stroke:currentColor;stroke-width:1.8}.plot .dot{fill:currentColor}\
.plot .again .s,.plot .again .box,.plot .again .curve{stroke-dasharray:4 2}\
.plot .c0{color:#0072b2}.plot .c1{color:#e69f00}.plot .c2{color:#009e73}.plot .c3{color:#cc79a7}\
.plot .c4{color:#d55e00}.plot .c5{color:#56b4e9}.plot .c6{color:#1f1f1f}.plot .c7{color:#b8a800}\
@media (prefers-color-scheme:dark){.plot .bg{fill:#18191c}.plot text{fill:#e6e6e6}.plot .key,.plot .n{fill:#a0a0a0}\
.plot .grid,.plot .split{stroke:#36383d}.plot .axis{stroke:#e6e6e6}.plot .mean{fill:#18191c;stroke:#e6e6e6}\
.plot .c0{color:#3d9bd9}.plot .c6{color:#e6e6e6}.plot .c7{color:#f0e442}}";

/// Colours of the palette; further variants have dashed lines.
const COLOURS: usize = 8;

/// A sign at a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mark {
    Dot,
    Square,
    Triangle,
    Diamond,
    Cross,
}

/// Those of curves, in the order of the colours.
const MARKS: [Mark; 4] = [Mark::Dot, Mark::Square, Mark::Triangle, Mark::Diamond];

impl Mark {
    pub fn of_curve(number: usize) -> Mark {
        MARKS[number % MARKS.len()]
    }

    /// Its lines, in sizes of the mark.
    fn lines(self) -> &'static [&'static [(f64, f64)]] {
        match self {
            Mark::Dot => &[],
            Mark::Square => &[&[(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9), (-0.9, -0.9)]],
            Mark::Triangle => &[&[(0.0, -1.2), (1.1, 0.9), (-1.1, 0.9), (0.0, -1.2)]],
            Mark::Diamond => &[&[(0.0, -1.0), (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)]],
            Mark::Cross => &[&[(-1.0, -1.0), (1.0, 1.0)], &[(-1.0, 1.0), (1.0, -1.0)]],
        }
    }
}

const TITLE_PX: f64 = 14.0;
const TEXT_PX: f64 = 11.0;
const LEGEND_LINE_PX: f64 = 18.0;
const MOST_NAME_LETTERS: usize = 32;

/// About the width of a text: there is no font to ask.
pub fn width_of(text: &str, size_px: f64) -> f64 {
    let of_letter = |letter: char| match letter {
        'i' | 'j' | 'l' | 't' | 'f' | 'I' | '.' | ',' | ':' | ';' | '|' | '\'' | ' ' | '(' | ')' => 0.34,
        'm' | 'w' | 'M' | 'W' | '@' | '%' => 0.92,
        'A'..='Z' => 0.7,
        // Letters of East Asia, and signs like them, are squares.
        '\u{1100}'.. => 1.0,
        _ => 0.59,
    };
    text.chars().map(of_letter).sum::<f64>() * size_px
}

/// A text that is not too long to be drawn.
pub fn short(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        None => text.into(),
        Some(_) => text.chars().take(most.saturating_sub(1)).chain(['…']).collect(),
    }
}

/// A coordinate: tenths of a pixel, no sign of zero.
fn n(number: f64) -> String {
    let text = format!("{:.1}", (number * 10.0).round() / 10.0 + 0.0);
    text.trim_end_matches(".0").to_string()
}

/// What a frame is made for.
pub struct Wanted<'a> {
    pub title: &'a str,
    /// What is measured.
    pub axis: &'a str,
    pub scale: &'a Axis,
    /// Variants, in the order of the colours.
    pub names: &'a [&'a str],
    /// Whether variants are boxes, else lines with marks.
    pub boxes: bool,
    /// What the legend says about signs.
    pub key: &'a [&'a str],
    /// Width and height of the data.
    pub inner: (f64, f64),
    /// What stands out to the left of them.
    pub overhang: f64,
}

/// Where things are: the data between `left` and [`Frame::right`], `top` and [`Frame::bottom`].
pub struct Frame {
    title: String,
    axis: String,
    ticks: Vec<(f64, String)>,
    /// Entries of the legend with their places: colour, if it is a variant, and text.
    legend: Vec<(f64, f64, Option<usize>, String)>,
    pub left: f64,
    pub top: f64,
    inner: (f64, f64),
    boxes: bool,
}

impl Frame {
    pub fn new(wanted: &Wanted<'_>) -> Frame {
        let Wanted { title, axis, scale, names, boxes, key, inner, overhang } = *wanted;
        let widest = scale.ticks.iter().map(|(_, label)| width_of(label, TEXT_PX)).fold(0.0, f64::max);
        let left = (widest + 44.0).max(overhang + 10.0);
        let room = left + inner.0;
        let mut legend = Vec::new();
        let (mut x, mut y) = (14.0, 44.0);
        let named =
            names.iter().enumerate().map(|(number, name)| (Some(number), short(name, MOST_NAME_LETTERS)));
        let signs = key.iter().map(|sign| (None, (*sign).to_string()));
        for (colour, text) in named.chain(signs) {
            let width = width_of(&text, TEXT_PX) + if colour.is_some() { 36.0 } else { 16.0 };
            if x + width > room && x > 14.0 {
                (x, y) = (14.0, y + LEGEND_LINE_PX);
            }
            legend.push((x, y, colour, text));
            x += width;
        }
        let letters = (room / (TITLE_PX * 0.58)) as usize;
        // The name of the axis runs along it, upwards.
        let along = (inner.1 / (TEXT_PX * 0.56)) as usize;
        let bottom = inner.1;
        let ticks =
            scale.ticks.iter().map(|(value, label)| (scale.at(*value, bottom, 0.0), label.clone())).collect();
        Frame {
            title: short(title, letters),
            axis: scale.named(&short(axis, along)),
            ticks,
            legend,
            left,
            top: y + 20.0,
            inner,
            boxes,
        }
    }

    pub fn right(&self) -> f64 {
        self.left + self.inner.0
    }

    pub fn bottom(&self) -> f64 {
        self.top + self.inner.1
    }

    /// Of the whole picture.
    pub fn width(&self) -> f64 {
        self.right() + 16.0
    }
}

/// What has been drawn, in the order in which it lies on each other.
pub struct Canvas(String);

impl Canvas {
    /// With the frame drawn.
    pub fn new(frame: &Frame) -> Canvas {
        let mut canvas = Canvas(String::new());
        canvas.text("title", (14.0, 22.0), &frame.title);
        for (x, y, colour, text) in &frame.legend {
            match colour {
                None => canvas.text("key", (*x, *y), text),
                Some(colour) => {
                    canvas.open(*colour, text);
                    if frame.boxes {
                        canvas.rect("box", (*x, y - 9.0), (14.0, 10.0));
                    } else {
                        canvas.line("s", (x - 3.0, y - 4.0), (x + 15.0, y - 4.0));
                        canvas.mark("dot", Mark::of_curve(*colour), (x + 6.0, y - 4.0), 3.6);
                    }
                    canvas.close();
                    canvas.text("", (x + 20.0, *y), text);
                }
            }
        }
        for (y, label) in &frame.ticks {
            let y = frame.top + y;
            canvas.line("grid", (frame.left, y), (frame.right(), y));
            canvas.text("end", (frame.left - 7.0, y + 3.8), label);
        }
        let middle = frame.top + frame.inner.1 / 2.0;
        canvas.line("axis", (frame.left, frame.top), (frame.left, frame.bottom()));
        canvas.line("axis", (frame.left, frame.bottom()), (frame.right(), frame.bottom()));
        let place = format!("transform=\"rotate(-90 18 {0})\" x=\"18\" y=\"{0}\"", n(middle));
        let _ = writeln!(canvas.0, "<text class=\"mid\" {place}>{}</text>", markup(&frame.axis));
        canvas
    }

    /// What follows has a colour, and a text that a viewer shows under the mouse.
    pub fn open(&mut self, colour: usize, told: &str) {
        let again = if colour >= COLOURS { " again" } else { "" };
        let _ = writeln!(self.0, "<g class=\"c{}{again}\"><title>{}</title>", colour % COLOURS, markup(told));
    }

    pub fn close(&mut self) {
        self.0 += "</g>\n";
    }

    pub fn line(&mut self, class: &str, (x1, y1): (f64, f64), (x2, y2): (f64, f64)) {
        let (x1, y1, x2, y2) = (n(x1), n(y1), n(x2), n(y2));
        let _ = writeln!(self.0, "<path class=\"{class}\" d=\"M{x1} {y1}L{x2} {y2}\"/>");
    }

    pub fn way(&mut self, class: &str, points: impl Iterator<Item = (f64, f64)>) {
        let points: Vec<String> = points.map(|(x, y)| format!("{},{}", n(x), n(y))).collect();
        let _ = writeln!(self.0, "<polyline class=\"{class}\" points=\"{}\"/>", points.join(" "));
    }

    pub fn rect(&mut self, class: &str, (x, y): (f64, f64), (width, height): (f64, f64)) {
        let (x, y, width, height) = (n(x), n(y), n(width), n(height));
        let _ = writeln!(
            self.0,
            "<rect class=\"{class}\" x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"/>"
        );
    }

    pub fn circle(&mut self, class: &str, (x, y): (f64, f64), radius: f64) {
        let _ = writeln!(
            self.0,
            "<circle class=\"{class}\" cx=\"{}\" cy=\"{}\" r=\"{}\"/>",
            n(x),
            n(y),
            n(radius)
        );
    }

    pub fn mark(&mut self, class: &str, mark: Mark, (x, y): (f64, f64), size: f64) {
        if mark == Mark::Dot {
            return self.circle(class, (x, y), size);
        }
        let point = |(dx, dy): &(f64, f64)| format!("{} {}", n(x + dx * size), n(y + dy * size));
        let line =
            |line: &&[(f64, f64)]| format!("M{}", line.iter().map(point).collect::<Vec<_>>().join("L"));
        let lines: String = mark.lines().iter().map(line).collect();
        let _ = writeln!(self.0, "<path class=\"{class}\" d=\"{lines}\"/>");
    }

    pub fn text(&mut self, class: &str, (x, y): (f64, f64), text: &str) {
        let class = if class.is_empty() { String::new() } else { format!(" class=\"{class}\"") };
        let _ = writeln!(self.0, "<text{class} x=\"{}\" y=\"{}\">{}</text>", n(x), n(y), markup(text));
    }

    /// A text that ends here and comes from below; `whole` is shown under the mouse.
    pub fn slanted(&mut self, (x, y): (f64, f64), text: &str, whole: &str) {
        let (x, y) = (n(x), n(y));
        let _ = writeln!(
            self.0,
            "<text class=\"end\" transform=\"rotate(-35 {x} {y})\" x=\"{x}\" y=\"{y}\"><title>{}</title>{}</text>",
            markup(whole),
            markup(text)
        );
    }

    /// The picture.
    pub fn finish(self, title: &str, width: f64, height: f64) -> String {
        let (width, height, body) = (n(width.ceil()), n(height.ceil()), self.0);
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"plot\" role=\"img\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\">\n<title>{}</title>\n<style>{STYLE}</style>\n\
             <rect class=\"bg\" width=\"100%\" height=\"100%\"/>\n{body}</svg>\n",
            markup(title)
        )
    }
}

/// A picture that says why it shows nothing.
pub fn nothing(title: &str, why: &str) -> String {
    let mut canvas = Canvas(String::new());
    canvas.text("title", (14.0, 22.0), &short(title, 50));
    canvas.text("key", (14.0, 44.0), why);
    canvas.finish(title, 440.0, 60.0)
}
