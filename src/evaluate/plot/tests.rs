use super::*;

/// Each element is closed, by itself or by its own end, and there is nothing in a text that could begin one.
#[track_caller]
fn well_formed(svg: &str) {
    let mut open: Vec<&str> = Vec::new();
    for part in svg.split('<').skip(1) {
        let (tag, text) = part.split_once('>').expect("a tag ends");
        assert!(!text.contains('>') && !text.contains('\u{0}'), "{part}");
        assert_eq!(tag.matches('"').count() % 2, 0, "{tag}");
        match tag.strip_prefix('/') {
            Some(name) => assert_eq!(open.pop(), Some(name)),
            None if tag.ends_with('/') => {}
            None => open.push(tag.split(' ').next().expect("a tag has a name")),
        }
    }
    assert!(open.is_empty() && svg.ends_with("</svg>\n"), "{open:?} is open");
    for wrong in ["NaN", "inf", "-0 ", "\"-0\""] {
        let (_, drawn) = svg.split_once("</style>").expect("there is a style");
        assert!(!drawn.contains(wrong), "{wrong} in {svg}");
    }
}

/// How many elements have this class.
fn count(svg: &str, class: &str) -> usize {
    svg.matches(&format!("class=\"{class}\"")).count()
}

fn one<'a>(name: &'a str, values: &'a [f64], failed: &'a [bool]) -> Vec<Group<'a>> {
    vec![Group { label: "kitchen", series: vec![Series { name, values, failed }] }]
}

#[test]
fn a_box_has_all_that_tukey_wants() {
    let values = [10.0, 11.0, 12.0, 13.0, 14.0, 15.0, 16.0, 40.0, 99.0, 5.0];
    let failed = [false, false, false, false, false, false, false, false, true, true];
    let svg = boxes("Time", "seconds", &one("tray", &values, &failed));
    well_formed(&svg);
    assert_eq!(svg, boxes("Time", "seconds", &one("tray", &values, &failed)));
    // One box here, one in the legend; two whiskers with their ends; one value far out; two failed.
    assert_eq!([count(&svg, "box"), count(&svg, "median"), count(&svg, "s")], [2, 1, 4]);
    assert_eq!([count(&svg, "out"), count(&svg, "mean"), count(&svg, "cross")], [1, 1, 2]);
    assert!(svg.contains(
        "<title>kitchen, tray: 8 runs, median 13.5, quartiles 11.75 and 15.25, mean 16.38, 2 failed</title>"
    ));
    assert!(svg.contains(">×2</text>") && svg.contains(">8</text>"));
}

#[test]
fn nothing_to_draw() {
    for groups in [vec![], one("a", &[], &[]), one("a", &[f64::NAN, f64::INFINITY], &[false, true])] {
        let svg = boxes("Time", "s", &groups);
        well_formed(&svg);
        assert!(svg.contains(">no runs</text>"));
    }
    let empty =
        Curve { name: "a".into(), points: vec![(f64::NAN, 1.0, 0.0, 2.0), (1.0, f64::NAN, 0.0, 2.0)] };
    for svg in [curves("Time", "x", "s", &[]), curves("Time", "x", "s", &[empty])] {
        well_formed(&svg);
        assert!(svg.contains(">no runs</text>"));
    }
}

#[test]
fn values_of_all_sizes() {
    let sets: [&[f64]; 10] = [
        &[7.0],
        &[7.0, 7.0, 7.0],
        &[0.0],
        &[1e12, 3e12, f64::NAN],
        &[1e-9, 4e-9],
        &[f64::MAX, -f64::MAX, 1.0],
        &[1e150, -1e150],
        &[f64::MIN_POSITIVE, 5e-324],
        &[-3.0, -2.0, -1.0],
        &[1e9, 1e9 + 1.0],
    ];
    for values in sets {
        let svg = boxes("Time", "s", &one("a", values, &[]));
        well_formed(&svg);
        assert_eq!(count(&svg, "mean"), 1, "of {values:?}");
        assert!(count(&svg, "grid") <= 12, "of {values:?}");
        let points = values.iter().map(|it| (*it, *it, it - 1.0, it + 1.0)).collect();
        well_formed(&curves("Time", "m", "s", &[Curve { name: "a".into(), points }]));
    }
}

#[test]
fn ticks_are_round_numbers() {
    let labels = |values: &[f64]| {
        let axis = Axis::of(values.iter().copied()).expect("there are values");
        (axis.ticks.into_iter().map(|(_, label)| label).collect::<Vec<_>>().join(" "), axis.power)
    };
    let labels = |values: &[f64]| match labels(values) {
        (text, 0) => text,
        (text, power) => format!("{text} e{power}"),
    };
    assert_eq!(labels(&[0.0, 57.0]), "0 10 20 30 40 50 60");
    assert_eq!(labels(&[90.0, 97.0]), "90 92 94 96 98");
    assert_eq!(labels(&[-0.3, 0.8]), "−0.4 −0.2 0.0 0.2 0.4 0.6 0.8");
    assert_eq!(labels(&[2.0e9, 5.5e9]), "0 1 2 3 4 5 6 e9");
    assert_eq!(labels(&[0.00001, 0.00005]), "0 1 2 3 4 5 e-5");
    assert_eq!(labels(&[3.0]), "2.7 2.8 2.9 3.0 3.1 3.2 3.3");
}

#[test]
fn names_stay_text() {
    let evil = "</text><script>alert('1')</script>\"&\u{1}\u{FFFE}]]>";
    let groups = |name| {
        vec![Group { label: name, series: vec![Series { name, values: &[1.0, 2.0], failed: &[true] }] }]
    };
    let curve = |name: &str| Curve { name: name.into(), points: vec![(1.0, 2.0, 1.0, 3.0)] };
    for (svg, plain) in [
        (boxes(evil, evil, &groups(evil)), boxes("x", "x", &groups("x"))),
        (curves(evil, evil, evil, &[curve(evil)]), curves("x", "x", "x", &[curve("x")])),
    ] {
        well_formed(&svg);
        // A label may have more lines, or stand aslant with what it is called in full.
        assert_eq!(svg.matches("<script").count(), 0);
        assert_eq!(svg.matches("<path").count(), plain.matches("<path").count());
    }
}

#[test]
fn many_groups_make_a_wide_picture() {
    let labels: Vec<String> = (0..30).map(|at| format!("a long name of the case {at}")).collect();
    let series = |name| Series { name, values: &[1.0, 2.0, 4.0], failed: &[] };
    let groups: Vec<Group<'_>> = (labels.iter())
        .map(|label| Group { label, series: ["none", "both-hands", "tray", "all"].map(series).to_vec() })
        .collect();
    let svg = boxes("Time", "s", &groups);
    well_formed(&svg);
    assert_eq!(count(&svg, "mean"), 120);
    let (_, width) = svg.split_once("width=\"").expect("it has a width");
    let width: f64 = width.split('"').next().and_then(|it| it.parse().ok()).expect("it is a number");
    assert!((4000.0..5000.0).contains(&width), "{width}");
}

#[test]
fn labels_stand_aslant_when_they_are_too_wide() {
    let group =
        |label| Group { label, series: vec![Series { name: "tray", values: &[1.0, 2.0], failed: &[] }] };
    let labels = ["kitchen", "household-with-a-fridge", "a-name-that-nobody-would-ever-want-to-read"];
    let svg = boxes("Time", "s", &labels.repeat(4).into_iter().map(group).collect::<Vec<_>>());
    well_formed(&svg);
    assert_eq!(svg.matches("rotate(-35").count(), 12);
    assert!(svg.contains(
        "<title>a-name-that-nobody-would-ever-want-to-read</title>a-name-that-nobody-would-…</text>"
    ));
    let svg = boxes("Time", "s", &labels[..1].iter().map(|label| group(label)).collect::<Vec<_>>());
    assert!(!svg.contains("rotate(-35"));
}

#[test]
fn variants_keep_their_colours() {
    let series = |name| Series { name, values: &[1.0, 2.0], failed: &[] };
    let groups = [
        Group { label: "a", series: vec![series("none"), series("tray")] },
        Group { label: "b", series: vec![series("tray")] },
    ];
    let svg = boxes("Time", "s", &groups);
    for drawn in [
        "<g class=\"c1\"><title>a, tray:",
        "<g class=\"c1\"><title>b, tray:",
        "<g class=\"c0\"><title>a, none:",
    ] {
        assert!(svg.contains(drawn), "{drawn}");
    }
}

#[test]
fn curves_are_drawn_from_left_to_right() {
    let curve = Curve {
        name: "tray".into(),
        points: vec![(4.0, 8.0, 7.0, 9.0), (1.0, 2.0, 1.5, 2.5), (2.0, 4.0, f64::NAN, f64::NAN)],
    };
    let svg = curves("Time", "metres", "seconds", &[curve]);
    well_formed(&svg);
    // Two bars of three lines, and one in the legend; three points, and one in the legend.
    assert_eq!([count(&svg, "s"), count(&svg, "dot"), count(&svg, "curve")], [7, 4, 1]);
    let (_, points) = svg.split_once("points=\"").expect("there is a line");
    let (points, _) = points.split_once('"').expect("it ends");
    let xs: Vec<f64> = points.split(' ').filter_map(|it| it.split_once(',')?.0.parse().ok()).collect();
    assert!(xs.len() == 3 && xs.is_sorted(), "{points}");
}

proptest::proptest! {
    #[test]
    fn whatever_the_values(
        values in proptest::collection::vec(proptest::num::f64::ANY, 0..12),
        failed in proptest::collection::vec(proptest::bool::ANY, 0..12),
        name in ".*",
    ) {
        well_formed(&boxes(&name, &name, &one(&name, &values, &failed)));
        let points = values.windows(4).map(|it| (it[0], it[1], it[2], it[3])).collect();
        well_formed(&curves(&name, &name, &name, &[Curve { name: name.clone(), points }]));
    }
}

/// Draws what people should look at when they change the pictures: `PICTURES=folder cargo test --lib pictures`.
#[test]
fn pictures_to_look_at() {
    let Some(folder) = std::env::var_os("PICTURES") else { return };
    let folder = std::path::Path::new(&folder);
    let noise = |seed: usize, at: usize| (((seed * 7919 + at * 104_729) % 1009) as f64 / 1009.0 - 0.5) * 2.0;
    let names = ["none", "both-hands", "tray", "all"];
    let drawn: Vec<Vec<Vec<f64>>> = (0..3)
        .map(|case| {
            let runs = |variant: usize| {
                let run = |at: usize| {
                    let value = noise(case * 10 + variant, at);
                    300.0 + 60.0 * case as f64 - 45.0 * variant as f64
                        + 60.0 * value * value * value
                        + if at % 13 == 5 { 70.0 } else { 0.0 }
                };
                (0..24).map(run).collect()
            };
            (0..4).map(runs).collect()
        })
        .collect();
    let failed: Vec<bool> = (0..24).map(|at| at % 11 == 7).collect();
    let groups: Vec<Group<'_>> =
        (["set the table", "clean up", "breakfast in another kitchen"].iter().enumerate())
            .map(|(case, label)| Group {
                label,
                series: (0..4)
                    .map(|at| Series {
                        name: names[at],
                        values: &drawn[case][at],
                        failed: if at == 2 { &failed } else { &[] },
                    })
                    .collect(),
            })
            .collect();
    let lines: Vec<Curve> = (names.iter().enumerate())
        .map(|(variant, name)| Curve {
            name: (*name).into(),
            points: (1..8)
                .map(|x| {
                    let mean = 100.0 + (40.0 - 7.0 * variant as f64) * f64::from(x);
                    (f64::from(x), mean, mean - 12.0, mean + 12.0)
                })
                .collect(),
        })
        .collect();
    let long: Vec<String> = (0..30).map(|at| format!("scene number {at} with a long name")).collect();
    let many: Vec<Group<'_>> = (long.iter().enumerate())
        .map(|(at, label)| Group { label, series: groups[at % 3].series.clone() })
        .collect();
    let single: Vec<Group<'_>> = (long.iter().enumerate().take(14))
        .map(|(at, label)| Group { label, series: vec![groups[at % 3].series[at % 4]] })
        .collect();
    let small = one("none", &[3.25e-7], &[]);
    let section = |heading: &str, pictures: Vec<String>| super::super::page::Section {
        heading: heading.into(),
        text: vec!["Runs under the same seeds are pairs; what is said about them is in the table.".into()],
        tables: vec![super::super::page::Table {
            caption: "Seconds of simulated time".into(),
            head: ["plan", "runs", "mean", "95 % interval", "p (Holm)"].map(String::from).to_vec(),
            rows: vec![
                ["none", "24", "312.4", "301.2 to 323.6", "–"].map(String::from).to_vec(),
                ["tray", "22", "221.0", "214.5 to 227.5", "< 0.001"].map(String::from).to_vec(),
            ],
        }],
        pictures,
    };
    let first = boxes("Execution time of plan variants", "time [s]", &groups);
    let second = curves("Time over the length of the way", "way [m]", "time [s]", &lines);
    let page = super::super::page::page(
        "Evaluation of plan variants",
        "24 runs of each variant under the same seeds.",
        &[
            section("Time", vec![first.clone()]),
            section("Ways", vec![second.clone()]),
            section("Many", vec![boxes("Many cases", "time [s]", &many)]),
        ],
    );
    for (name, text) in [
        ("boxes.svg", first),
        ("curves.svg", second),
        ("many.svg", boxes("Many cases", "time [s]", &many)),
        ("slant.svg", boxes("Single variants", "way [m]", &single)),
        ("small.svg", boxes("One run", "force [N]", &small)),
        ("page.html", page),
    ] {
        std::fs::write(folder.join(name), text).expect("the folder is there");
    }
}
