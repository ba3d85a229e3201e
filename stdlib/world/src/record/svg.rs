//! Text of an SVG file, with names from elsewhere made harmless.

use std::fmt::Write as _;

use nalgebra::Vector2;

/// A name, or another text that somebody else has written, in one line of a picture.
pub fn escaped(text: &str) -> String {
    let shown = |letter: char| match letter {
        '\n' | '\t' => ' ',
        letter if letter.is_control() => '\u{FFFD}',
        letter => letter,
    };
    vm::show::markup(&text.chars().map(shown).collect::<String>())
}

/// A text that is not too long to be drawn.
pub fn short(text: &str, most: usize) -> String {
    if text.chars().count() <= most {
        return text.into();
    }
    text.chars().take(most.saturating_sub(1)).chain(['…']).collect()
}

/// A number of a picture: two digits, no sign of zero.
pub fn n(number: f64) -> String {
    let text = format!("{:.2}", libm::round(number * 100.0) / 100.0 + 0.0);
    text.trim_end_matches('0').trim_end_matches('.').to_string()
}

/// Drawn elements, in the order in which they lie on each other.
#[derive(Default)]
pub struct Drawing(pub String);

impl Drawing {
    /// An element without content. `style`: further attributes.
    pub fn shape(&mut self, element: &str, style: &str) {
        let _ = writeln!(self.0, "<{element} {style}/>");
    }

    /// A polygon; `title` is shown by a viewer under the mouse.
    pub fn polygon(&mut self, corners: &[Vector2<f64>], style: &str, title: Option<&str>) {
        let title = title.map_or(String::new(), |it| format!("<title>{}</title>", escaped(it)));
        let _ = writeln!(self.0, "<polygon points=\"{}\" {style}>{title}</polygon>", points(corners));
    }

    /// A line through points.
    pub fn line(&mut self, through: &[Vector2<f64>], style: &str) {
        let _ = writeln!(self.0, "<polyline points=\"{}\" fill=\"none\" {style}/>", points(through));
    }

    pub fn circle(&mut self, at: Vector2<f64>, radius: f64, style: &str) {
        let _ =
            writeln!(self.0, "<circle cx=\"{}\" cy=\"{}\" r=\"{}\" {style}/>", n(at.x), n(at.y), n(radius));
    }

    /// `style`: a class, an anchor.
    pub fn text(&mut self, at: Vector2<f64>, style: &str, text: &str) {
        let _ =
            writeln!(self.0, "<text x=\"{}\" y=\"{}\" {style}>{}</text>", n(at.x), n(at.y), escaped(text));
    }
}

fn points(all: &[Vector2<f64>]) -> String {
    all.iter().map(|it| format!("{},{}", n(it.x), n(it.y))).collect::<Vec<_>>().join(" ")
}
