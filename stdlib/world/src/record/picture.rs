//! A recording as a picture from above: `pleach run … --picture FILE.svg`.
//!
//! One panel for each episode: the room with its furniture, doors and drawers as they are in the end, the ways
//! that the base drove in the colours of time, things that were moved with arrows, and beside it
//! what it came to in words. North is up.

use nalgebra::{Isometry3, Vector2};

use crate::nav::convex::Polygon;
use crate::scene::{ContainerId, ObjectId, Scene};
use crate::shape::PosedShape;
use crate::state::{State, Support};

use super::svg::{Drawing, escaped, n, short};
use super::{Done, End, Episode, Recording, Seen, json, seconds};

/// Width of the drawn room at most, pixels.
const ROOM_PX: f64 = 760.0;
/// Pixels of a metre at most.
const METRE_PX: f64 = 130.0;
const MARGIN_PX: f64 = 24.0;
const LEGEND_PX: f64 = 300.0;
const LINE_PX: f64 = 18.0;
/// Episodes that are drawn.
const MOST_PANELS: usize = 6;
/// Lines of one kind in the legend.
const MOST_LINES: usize = 12;
/// Places at which the base stood are one if they are nearer than this, metres.
const SAME_PLACE_M: f64 = 0.15;
/// A container is shut below this position, radians or metres.
const SHUT: f64 = 1e-6;
/// An object has been moved if it is farther away than this.
const MOVED_M: f64 = 0.02;
/// Colours of time, from the beginning to the end: blue, green, orange, red, so that neighbours differ for all eyes.
const TIME: [[f64; 3]; 5] = [
    [43.0, 76.0, 174.0],
    [26.0, 140.0, 180.0],
    [58.0, 160.0, 90.0],
    [226.0, 150.0, 20.0],
    [200.0, 40.0, 45.0],
];

const STYLE: &str = "text{font-family:'DejaVu Sans',Verdana,sans-serif;font-size:11px;fill:#3b3833}\
.h{font-size:15px;font-weight:bold}.f{fill:#857a66}.s{fill:#9c9180;font-size:9px}.o{fill:#8b8578;font-size:8.5px}\
.m{fill:#6a1b7a;font-weight:bold;paint-order:stroke;stroke:#fff;stroke-width:3px}\
.c{fill:#0c6b63;paint-order:stroke;stroke:#fff;stroke-width:3px}.e{fill:#b3261e}\
.p{fill:#fff;font-size:9px;font-weight:bold}";

impl Recording {
    /// As an SVG file. `title`: what was run; `end_ns`: when the run ended.
    #[must_use]
    pub fn picture(&self, title: &str, end_ns: u64) -> String {
        let all: Vec<&Episode> = self.episodes().collect();
        let shown: Vec<&Episode> = all.iter().copied().skip(all.len().saturating_sub(MOST_PANELS)).collect();
        let mut body = String::new();
        let (mut width, mut height) = (2.0 * MARGIN_PX + LEGEND_PX, MARGIN_PX);
        for (number, episode) in shown.iter().enumerate() {
            let number = all.len() - shown.len() + number;
            let ended_ns = all.get(number + 1).map_or(end_ns, |next| next.began_ns);
            let name = if all.len() > 1 {
                format!("{title} ({} of {})", number + 1, all.len())
            } else {
                title.into()
            };
            let panel = Panel::new(episode, seconds(ended_ns));
            let (drawn, size) = panel.draw(&name);
            body += &format!("<g transform=\"translate(0 {})\">\n{drawn}</g>\n", n(height));
            height += size.y + MARGIN_PX;
            width = width.max(size.x);
        }
        if shown.is_empty() {
            let mut drawing = Drawing::default();
            drawing.text(Vector2::new(MARGIN_PX, 20.0), "class=\"h\"", &short(title, 40));
            drawing.text(Vector2::new(MARGIN_PX, 42.0), "", "this run has no world: there is nothing to see");
            body = drawing.0;
            height = 64.0;
        }
        let (width, height) = (n(width), n(height));
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\">\n\
             <title>{}</title>\n<style>{STYLE}</style>\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n{body}</svg>\n",
            escaped(title)
        )
    }
}

struct Panel<'a> {
    episode: &'a Episode,
    motions: Vec<(&'a Done, u64)>,
    moves: Vec<Move>,
    /// The room, metres.
    low: Vector2<f64>,
    high: Vector2<f64>,
    scale: f64,
    begin_s: f64,
    end_s: f64,
}

/// A thing that was somewhere, and then somewhere else.
struct Move {
    name: String,
    /// Where it rested, from the first place to the last; what carried it there.
    rests: Vec<(Vector2<f64>, String)>,
}

fn flat(pose: &Isometry3<f64>) -> Vector2<f64> {
    pose.translation.vector.xy()
}

fn shadows(pose: &Isometry3<f64>, shapes: &[PosedShape]) -> Vec<(f64, Polygon)> {
    let of = |it: &PosedShape| {
        let posed = PosedShape { pose: pose * it.pose, shape: it.shape };
        Some((posed.bounds().1.z, Polygon::shadow(&posed)?))
    };
    shapes.iter().filter_map(of).collect()
}

impl<'a> Panel<'a> {
    fn new(episode: &'a Episode, end_s: f64) -> Panel<'a> {
        let scene = &episode.start.setting.scene;
        let motions = episode.motions();
        let mut points: Vec<Vector2<f64>> = Vec::new();
        for fixture in &scene.fixtures {
            for (_, shadow) in shadows(&fixture.pose, &fixture.shapes) {
                points.extend([shadow.bounds().0, shadow.bounds().1]);
            }
        }
        let objects = episode.objects();
        points.extend(objects.iter().flat_map(|(_, track)| track.iter().map(|seen| flat(&seen.pose))));
        let bases = motions.iter().flat_map(|(done, _)| done.track.keys.iter().filter_map(|key| key.base));
        let robot = episode.start.machine().map(|_| episode.start.base);
        for base in bases.chain(robot) {
            points.extend([flat(&base).add_scalar(-0.5), flat(&base).add_scalar(0.5)]);
        }
        let (mut low, mut high) = (Vector2::repeat(f64::INFINITY), Vector2::repeat(f64::NEG_INFINITY));
        for point in points.iter().filter(|it| it.x.is_finite() && it.y.is_finite()) {
            (low, high) = (low.inf(point), high.sup(point));
        }
        if low.x > high.x {
            (low, high) = (Vector2::zeros(), Vector2::repeat(1.0));
        }
        let scale = (ROOM_PX / (high.x - low.x).max(high.y - low.y).max(0.1)).min(METRE_PX);
        let begin_s = seconds(episode.began_ns);
        let moves =
            objects.iter().filter_map(|(object, track)| Move::of(&episode.start, *object, track)).collect();
        Panel { episode, motions, moves, low, high, scale, begin_s, end_s: end_s.max(begin_s) }
    }

    /// A point of the room in pixels.
    fn at(&self, point: Vector2<f64>) -> Vector2<f64> {
        Vector2::new(point.x - self.low.x, self.high.y - point.y) * self.scale + Vector2::new(MARGIN_PX, 30.0)
    }

    fn corners(&self, polygon: &Polygon) -> Vec<Vector2<f64>> {
        polygon.corners().iter().map(|it| self.at(*it)).collect()
    }

    /// The elements, and the size in pixels.
    fn draw(&self, title: &str) -> (String, Vector2<f64>) {
        let mut drawing = Drawing::default();
        drawing.text(Vector2::new(MARGIN_PX, 16.0), "class=\"h\"", &short(title, 40));
        let (top_left, size) =
            (self.at(Vector2::new(self.low.x, self.high.y)), (self.high - self.low) * self.scale);
        drawing.shape(
            "rect",
            &format!(
                "x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"#faf8f4\"",
                n(top_left.x),
                n(top_left.y),
                n(size.x),
                n(size.y)
            ),
        );
        self.furniture(&mut drawing);
        self.containers(&mut drawing);
        self.things(&mut drawing);
        let stops = self.ways(&mut drawing);
        self.robots(&mut drawing);
        self.carries(&mut drawing);
        self.stops(&mut drawing, &stops);
        self.failures(&mut drawing);
        let left = top_left.x + size.x + 24.0;
        let below = self.legend(&mut drawing, Vector2::new(left, top_left.y + 6.0));
        let height = below.max(top_left.y + size.y + 6.0);
        (drawing.0, Vector2::new(left + LEGEND_PX, height))
    }

    // -------------------------------------------------------------- the room

    fn furniture(&self, drawing: &mut Drawing) {
        let scene = &self.episode.start.setting.scene;
        let setting = &self.episode.start.setting;
        let mut shapes: Vec<(f64, Polygon, &str)> = Vec::new();
        // What is shut at the end is a part of the furniture, perhaps below a worktop.
        for (number, container) in scene.containers.iter().enumerate() {
            let id = ContainerId(number);
            if self.episode.end().opening(id) <= SHUT {
                let shut = shadows(&setting.container_pose(id, 0.0), &container.shapes);
                shapes.extend(shut.into_iter().map(|(top, it)| (top, it, container.name.as_str())));
            }
        }
        for fixture in &scene.fixtures {
            shapes.extend(
                shadows(&fixture.pose, &fixture.shapes)
                    .into_iter()
                    .map(|(top, it)| (top, it, fixture.name.as_str())),
            );
        }
        shapes.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (top, shadow, name) in &shapes {
            let style = match is_wall(scene, name) {
                true => "fill=\"#5f5a52\"".to_string(),
                // What is higher is a little darker.
                false => format!(
                    "fill=\"{}\" stroke=\"#b8aa90\" stroke-width=\"0.8\"",
                    mix(&[[245.0, 239.0, 226.0], [222.0, 208.0, 182.0]], top / 1.8)
                ),
            };
            drawing.polygon(&self.corners(shadow), &style, Some(name));
        }
        for (number, surface) in
            scene.surfaces.iter().enumerate().filter(|(_, it)| it.inside.is_none() && it.moves_with.is_none())
        {
            let pose = self.episode.start.surface_pose(crate::scene::SurfaceId(number));
            let [x, y] = surface.size.map(|it| it * 0.5);
            let corners = [[-x, -y], [x, -y], [x, y], [-x, y]]
                .map(|[x, y]| self.at((pose * nalgebra::Point3::new(x, y, 0.0)).coords.xy()));
            drawing.polygon(
                &corners,
                "fill=\"none\" stroke=\"#c9bda6\" stroke-dasharray=\"2 3\"",
                Some(&surface.name),
            );
        }
        for fixture in scene.fixtures.iter().filter(|it| !is_wall(scene, &it.name)) {
            let corners: Vec<Vector2<f64>> = shadows(&fixture.pose, &fixture.shapes)
                .iter()
                .flat_map(|(_, it)| it.corners().to_vec())
                .collect();
            let Some(all) = Polygon::around(&corners) else { continue };
            let (low, high) = all.bounds();
            let (wide, high_px) = ((high.x - low.x) * self.scale, (high.y - low.y) * self.scale);
            // Text goes along the longer side, and near the edge, where few things stand.
            let middle = self.at((low + high) * 0.5);
            let name = short(&fixture.name, 28);
            if high_px > wide * 1.3 {
                let at = Vector2::new(self.at(low).x + 12.0, middle.y);
                let turn = format!(
                    "class=\"f\" text-anchor=\"middle\" transform=\"rotate(-90 {} {})\"",
                    n(at.x),
                    n(at.y)
                );
                drawing.text(at, &turn, &name);
            } else {
                let at = Vector2::new(middle.x, self.at(high).y + 13.0);
                drawing.text(at, "class=\"f\" text-anchor=\"middle\"", &name);
            }
        }
    }

    fn containers(&self, drawing: &mut Drawing) {
        let (start, end) = (&self.episode.start, self.episode.end());
        let scene = &start.setting.scene;
        for (number, container) in scene.containers.iter().enumerate() {
            let id = ContainerId(number);
            let (first, last) = (start.opening(id), end.opening(id));
            let widest = self.widest(id).max(first).max(last);
            let mut at = |position: f64, style: &str| {
                for (_, shadow) in shadows(&start.setting.container_pose(id, position), &container.shapes) {
                    drawing.polygon(&self.corners(&shadow), style, Some(&container.name));
                }
            };
            if widest <= SHUT {
                continue;
            }
            if widest > last + SHUT {
                at(
                    widest,
                    "fill=\"#1a9a8f\" fill-opacity=\"0.12\" stroke=\"#1a9a8f\" stroke-dasharray=\"4 3\"",
                );
            }
            if last > SHUT {
                at(last, "fill=\"#1a9a8f\" fill-opacity=\"0.8\" stroke=\"#0c6b63\"");
            }
            let pose = start.setting.container_pose(id, if last > SHUT { last } else { widest });
            let place = self.at(flat(&(pose * container.handle.tool)));
            let word = if last > SHUT { "open" } else { "was open" };
            let text = format!("{} ({word})", short(&container.name, 24));
            drawing.text(place + Vector2::new(8.0, 4.0), "class=\"c\"", &text);
        }
    }

    /// How wide a container has been open.
    fn widest(&self, id: ContainerId) -> f64 {
        let of_steps = self.episode.steps.iter().map(|step| step.after.opening(id));
        of_steps.fold(0.0, f64::max)
    }

    // -------------------------------------------------------------- things

    fn things(&self, drawing: &mut Drawing) {
        let end = self.episode.end();
        let mut labels: Vec<Vector2<f64>> = Vec::new();
        let scene = &end.setting.scene;
        for object in end.objects.keys() {
            let name = &scene.objects[object.0].name;
            let moved = self.moves.iter().any(|it| it.name == *name);
            let hidden = end.container_of(*object).is_some_and(|it| end.opening(it) <= SHUT);
            let style = match (moved, hidden) {
                (true, _) => "fill=\"#c9a3d4\" stroke=\"#6a1b7a\"",
                (_, true) => "fill=\"none\" stroke=\"#8b8578\" stroke-width=\"0.6\" stroke-dasharray=\"2 2\"",
                _ => "fill=\"#e9e6df\" stroke=\"#8b8578\" stroke-width=\"0.8\"",
            };
            let shapes = shadows(&end.object_pose(*object), &scene.kind_of(*object).shapes);
            let corners: Vec<Vector2<f64>> =
                shapes.iter().flat_map(|(_, shadow)| self.corners(shadow)).collect();
            for (_, shadow) in &shapes {
                drawing.polygon(&self.corners(shadow), style, Some(name));
            }
            if !moved && !hidden {
                self.label(drawing, &mut labels, name, &corners);
            }
        }
    }

    /// The name of a thing: in it if there is room, else beside it and below its neighbour's name.
    fn label(
        &self,
        drawing: &mut Drawing,
        labels: &mut Vec<Vector2<f64>>,
        name: &str,
        corners: &[Vector2<f64>],
    ) {
        let Some(all) = Polygon::around(corners) else { return };
        let ((low, high), name) = (all.bounds(), short(name, 20));
        let middle = (low + high) * 0.5 + Vector2::new(0.0, 3.0);
        let wide = name.chars().count() as f64 * 5.0;
        let (mut at, anchor) = match high.x - low.x > wide {
            true => (middle, "middle"),
            false => (Vector2::new(high.x + 3.0, middle.y), "start"),
        };
        for _ in 0..4 {
            if labels.iter().any(|other| (other.x - at.x).abs() < wide && (other.y - at.y).abs() < 9.0) {
                at.y += 9.0;
            }
        }
        labels.push(at);
        drawing.text(at, &format!("class=\"o\" text-anchor=\"{anchor}\""), &name);
    }

    fn carries(&self, drawing: &mut Drawing) {
        for each in &self.moves {
            for pair in each.rests.windows(2) {
                let (from, to) = (self.at(pair[0].0), self.at(pair[1].0));
                let way = to - from;
                let length = way.norm();
                drawing.circle(from, 4.0, "fill=\"#fff\" stroke=\"#6a1b7a\" stroke-width=\"1.5\"");
                if length < 1.0 {
                    continue;
                }
                let along = way / length;
                // A little bent: ways there and back do not lie on each other.
                let bend = (from + to) * 0.5 + Vector2::new(along.y, -along.x) * (length * 0.12);
                let into = (to - bend).normalize();
                let across = Vector2::new(-into.y, into.x);
                drawing.shape(
                    "path",
                    &format!(
                        "d=\"M{} {} Q{} {} {} {}\" fill=\"none\" stroke=\"#6a1b7a\" stroke-width=\"1.6\" stroke-dasharray=\"6 4\"",
                        n(from.x), n(from.y), n(bend.x), n(bend.y), n(to.x), n(to.y)
                    ),
                );
                drawing.polygon(
                    &[to, to - into * 9.0 + across * 4.0, to - into * 9.0 - across * 4.0],
                    "fill=\"#6a1b7a\"",
                    None,
                );
            }
            if let (Some(first), Some(last)) = (each.rests.first(), each.rests.last()) {
                let name = short(&each.name, 24);
                drawing.text(
                    self.at(first.0) + Vector2::new(7.0, -6.0),
                    "class=\"m\" opacity=\"0.6\"",
                    &name,
                );
                drawing.text(self.at(last.0) + Vector2::new(9.0, -7.0), "class=\"m\"", &name);
            }
        }
    }

    // -------------------------------------------------------------- the robot

    fn colour(&self, at_s: f64) -> String {
        mix(&TIME, (at_s - self.begin_s) / (self.end_s - self.begin_s).max(1e-9))
    }

    /// Draws the driven ways; the places where the base stood, with when it came there.
    fn ways(&self, drawing: &mut Drawing) -> Vec<(Vector2<f64>, f64)> {
        let mut stops = Vec::new();
        if self.episode.start.machine().is_some() {
            stops.push((flat(&self.episode.start.base), self.begin_s));
        }
        for (done, end_ns) in &self.motions {
            let (begin_s, lasted_s) = (seconds(done.began_ns), seconds(end_ns - done.began_ns));
            let keys = done.track.until(lasted_s);
            let ways: Vec<(f64, Vector2<f64>)> =
                keys.iter().filter_map(|key| Some((begin_s + key.at_s, flat(&key.base?)))).collect();
            for pair in ways.windows(2).filter(|pair| (pair[0].1 - pair[1].1).norm() > 1e-4) {
                let style = format!(
                    "stroke=\"{}\" stroke-width=\"3.5\" stroke-linecap=\"round\" stroke-opacity=\"0.85\"",
                    self.colour((pair[0].0 + pair[1].0) * 0.5)
                );
                drawing.line(&[self.at(pair[0].1), self.at(pair[1].1)], &style);
            }
            self.arrow(drawing, &ways);
            stops.extend(ways.last().map(|(at_s, place)| (*place, *at_s)));
        }
        stops
    }

    /// Which way it went, drawn in the middle of a way.
    fn arrow(&self, drawing: &mut Drawing, way: &[(f64, Vector2<f64>)]) {
        let lengths: Vec<f64> = way.windows(2).map(|pair| (pair[1].1 - pair[0].1).norm()).collect();
        let half = lengths.iter().sum::<f64>() * 0.5;
        let mut passed = 0.0;
        for (number, length) in lengths.iter().enumerate() {
            passed += length;
            if passed >= half && half * self.scale > 15.0 {
                let (from, to) = (self.at(way[number].1), self.at(way[number + 1].1));
                let Some(along) = (to - from).try_normalize(1e-9) else { return };
                let (tip, across) = (to + along * 5.0, Vector2::new(-along.y, along.x));
                let corners = [tip, tip - along * 11.0 + across * 6.0, tip - along * 11.0 - across * 6.0];
                drawing.polygon(
                    &corners,
                    &format!("fill=\"{}\" stroke=\"#fff\"", self.colour(way[number].0)),
                    None,
                );
                return;
            }
        }
    }

    /// Numbers at the places where the base stood.
    fn stops(&self, drawing: &mut Drawing, stops: &[(Vector2<f64>, f64)]) {
        let mut places: Vec<(Vector2<f64>, f64, String)> = Vec::new();
        for (number, (place, at_s)) in stops.iter().enumerate() {
            match places.iter_mut().find(|(other, ..)| (other - place).norm() < SAME_PLACE_M) {
                Some((.., numbers)) => *numbers += &format!(",{number}"),
                None => places.push((*place, *at_s, number.to_string())),
            }
        }
        for (place, at_s, numbers) in &places {
            let at = self.at(*place);
            let half = (numbers.len() as f64 * 3.0 + 5.0).max(8.0);
            drawing.shape(
                "rect",
                &format!(
                    "x=\"{}\" y=\"{}\" width=\"{}\" height=\"16\" rx=\"8\" fill=\"{}\" stroke=\"#fff\"",
                    n(at.x - half),
                    n(at.y - 8.0),
                    n(2.0 * half),
                    self.colour(*at_s)
                ),
            );
            drawing.text(at + Vector2::new(0.0, 3.5), "class=\"p\" text-anchor=\"middle\"", numbers);
        }
    }

    /// The robot as it was at first, and as it is in the end.
    fn robots(&self, drawing: &mut Drawing) {
        let last = self.episode.end();
        for (state, style, at_s) in [
            (
                &self.episode.start,
                "fill=\"#6d7fae\" fill-opacity=\"0.10\" stroke=\"#2b4cae\" stroke-opacity=\"0.35\" stroke-width=\"0.7\"",
                self.begin_s,
            ),
            (
                last,
                "fill=\"#b7656a\" fill-opacity=\"0.16\" stroke=\"#c8282d\" stroke-opacity=\"0.45\" stroke-width=\"0.7\"",
                self.end_s,
            ),
        ] {
            let Some(machine) = state.machine() else { return };
            for (link, pose) in machine.robot.links().iter().zip(state.links()) {
                for (_, shadow) in shadows(&pose, &link.shapes) {
                    drawing.polygon(&self.corners(&shadow), style, Some(&machine.robot.name));
                }
            }
            let ahead = state.base * nalgebra::Point3::new(0.34, 0.0, 0.0);
            let line = [self.at(flat(&state.base)), self.at(ahead.coords.xy())];
            drawing.line(&line, &format!("stroke=\"{}\" stroke-width=\"2\"", self.colour(at_s)));
        }
    }

    /// A cross where the robot stood when something failed.
    fn failures(&self, drawing: &mut Drawing) {
        let mut last = self.episode.start.base;
        let mut places: Vec<Vector2<f64>> = Vec::new();
        for step in &self.episode.steps {
            if let Some(End::Failed(_)) = step.done.as_ref().map(|done| &done.end) {
                let at = flat(&last);
                if !places.iter().any(|it| (it - at).norm() < 0.1) {
                    places.push(at);
                    let middle = self.at(at) + Vector2::new(0.0, 16.0);
                    for across in [Vector2::new(5.0, 5.0), Vector2::new(5.0, -5.0)] {
                        drawing.line(
                            &[middle - across, middle + across],
                            "stroke=\"#b3261e\" stroke-width=\"2.5\"",
                        );
                    }
                }
            }
            last = step.after.base;
        }
    }

    // -------------------------------------------------------------- in words

    fn legend(&self, drawing: &mut Drawing, from: Vector2<f64>) -> f64 {
        let mut at = from;
        let costs = self.episode.costs();
        let failed: Vec<(&Done, u64)> =
            self.motions.iter().filter(|(done, _)| matches!(done.end, End::Failed(_))).copied().collect();
        let robot = self.episode.start.machine().map_or("no robot", |it| it.robot.name.as_str());
        let mut say = |style: &str, text: &str| {
            at.y += LINE_PX;
            drawing.text(at, style, text);
        };
        say("class=\"h\"", &short(robot, 30));
        say("", &format!("{:.1} m driven, {:.1} s", costs.path_m, self.end_s - self.begin_s));
        let leaps = match costs.leaps {
            0 => String::new(),
            1 => ", 1 leap".into(),
            leaps => format!(", {leaps} leaps"),
        };
        say("", &format!("{} motions, {} failed{leaps}", self.motions.len(), failed.len()));
        at.y += 10.0;
        self.time_bar(drawing, at);
        at.y += 28.0;
        let mut list = |head: &str, style: &str, lines: Vec<String>| {
            if lines.is_empty() {
                return;
            }
            at.y += LINE_PX + 4.0;
            drawing.text(at, "font-weight=\"bold\"", head);
            for line in lines.iter().take(MOST_LINES) {
                at.y += LINE_PX - 2.0;
                drawing.text(at, style, &line.clone());
            }
            if lines.len() > MOST_LINES {
                at.y += LINE_PX - 2.0;
                drawing.text(at, "class=\"f\"", &format!("and {} more", lines.len() - MOST_LINES));
            }
        };
        let moved = self.moves.iter().map(|it| {
            let places: Vec<String> = it.rests.iter().map(|(_, on)| short(on, 18)).collect();
            short(&format!("{}: {}", short(&it.name, 18), places.join(" → ")), 46)
        });
        list("moved", "fill=\"#6a1b7a\"", moved.collect());
        let what = |(done, end_ns): &(&Done, u64)| {
            let End::Failed(trouble) = &done.end else { return String::new() };
            short(&format!("{:.1} s  {}: {}", seconds(*end_ns), json::name(&done.motion), trouble.kind), 46)
        };
        list("failed", "class=\"e\"", failed.iter().map(what).collect());
        let seen = self
            .motions
            .iter()
            .filter(|(done, _)| matches!(done.end, End::Stopped))
            .map(|(done, end_ns)| format!("{:.1} s  {}", seconds(*end_ns), json::name(&done.motion)));
        list("stopped", "class=\"f\"", seen.collect());
        at.y + 10.0
    }

    fn time_bar(&self, drawing: &mut Drawing, at: Vector2<f64>) {
        const PARTS: usize = 40;
        const WIDE: f64 = 200.0;
        for part in 0..PARTS {
            let share = part as f64 / PARTS as f64;
            drawing.shape(
                "rect",
                &format!(
                    "x=\"{}\" y=\"{}\" width=\"{}\" height=\"7\" fill=\"{}\"",
                    n(at.x + WIDE * share),
                    n(at.y),
                    n(WIDE / PARTS as f64 + 0.3),
                    mix(&TIME, share)
                ),
            );
        }
        drawing.text(at + Vector2::new(0.0, 19.0), "class=\"f\"", &format!("{:.0} s", self.begin_s));
        drawing.text(
            at + Vector2::new(WIDE, 19.0),
            "class=\"f\" text-anchor=\"end\"",
            &format!("{:.0} s", self.end_s),
        );
        // Something to measure by.
        let metres = [1.0, 0.5, 0.2, 0.1].into_iter().find(|it| it * self.scale < 75.0).unwrap_or(0.05);
        let from = at + Vector2::new(WIDE + 20.0, 6.0);
        drawing.line(
            &[from, from + Vector2::new(metres * self.scale, 0.0)],
            "stroke=\"#3b3833\" stroke-width=\"2\"",
        );
        drawing.text(from + Vector2::new(0.0, 13.0), "class=\"f\"", &format!("{metres} m"));
    }
}

impl Move {
    /// What has become of an object; none if it is where it was.
    fn of(start: &State, object: ObjectId, track: &[Seen]) -> Option<Move> {
        let resting = |seen: &&Seen| !matches!(seen.place.on, Support::Hand(_));
        let mut rests: Vec<(Vector2<f64>, String)> = Vec::new();
        let last = track.last()?;
        for (number, seen) in track.iter().enumerate().filter(|(_, seen)| resting(seen)) {
            // Where it stands longest: what carries it may move with it.
            let stays =
                track.get(number + 1).is_none_or(|next| next.place.on != seen.place.on) || number == 0;
            let at = flat(&seen.pose);
            if stays && rests.last().is_none_or(|(other, _)| (other - at).norm() > MOVED_M) {
                rests.push((at, start.support_name(seen.place.on)));
            }
        }
        if !resting(&last) {
            rests.push((flat(&last.pose), format!("in {}", start.support_name(last.place.on))));
        }
        let name = start.setting.scene.objects[object.0].name.clone();
        (rests.len() > 1).then_some(Move { name, rests })
    }
}

/// Walls carry nothing, have one shape, and are as high as a person.
fn is_wall(scene: &Scene, name: &str) -> bool {
    const AS_HIGH_M: f64 = 1.9;
    let Some(number) = scene.fixtures.iter().position(|it| it.name == name) else { return false };
    let fixture = &scene.fixtures[number];
    let used = scene.surfaces.iter().any(|it| it.owner.0 == number)
        || scene.containers.iter().any(|it| it.owner.0 == number);
    !used
        && fixture.shapes.len() == 1
        && shadows(&fixture.pose, &fixture.shapes).iter().all(|(top, _)| *top > AS_HIGH_M)
}

/// A colour between these; `share` from 0 to 1.
fn mix(colours: &[[f64; 3]], share: f64) -> String {
    let share = if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 };
    let place = share * (colours.len() - 1) as f64;
    let first = (place as usize).min(colours.len() - 2);
    let rest = place - first as f64;
    let part = |at: usize| (colours[first][at] + (colours[first + 1][at] - colours[first][at]) * rest) as u8;
    format!("#{:02x}{:02x}{:02x}", part(0), part(1), part(2))
}
