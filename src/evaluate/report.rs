//! The results of an experiment as files: statistics, runs in more formats, pictures, and one page with all of it.

use std::path::Path;

use super::export::{self, Format};
use super::folder::{Runs, write_whole};
use super::page::{self, Section};
use super::plot::{self, Curve, Group, Series};
use super::summary::{Column, Comparison, Scope, Table};
use super::text::{difference, heading, number, p, places_of, signed};
use super::{Edits, file_name};

/// The page with everything.
pub const PAGE: &str = "report.html";
/// All statistics.
const SUMMARY: &str = "summary.json";

/// Writes all of it into a folder.
///
/// # Errors
/// It cannot be written.
pub fn write(folder: &Path, table: &Table, runs: &Runs, formats: &[Format]) -> Result<(), String> {
    let it = &table.experiment;
    let summary = serde_json::to_string_pretty(&table.to_json()).map_err(|error| error.to_string())?;
    write_whole(&folder.join(SUMMARY), format!("{summary}\n").as_bytes())?;
    for format in formats {
        match format {
            Format::Csv => {}
            Format::Json => write_whole(&folder.join("runs.json"), export::json(it, runs).as_bytes())?,
            Format::Parquet => write_whole(&folder.join("runs.parquet"), &export::parquet(it, runs)?)?,
        }
    }
    for (name, svg) in pictures(table) {
        write_whole(&folder.join(format!("{name}.svg")), svg.as_bytes())?;
    }
    write_whole(&folder.join(PAGE), html(table).as_bytes())
}

/// A picture of each number: boxes, and lines over a factor where there is one and it is a number.
fn pictures(table: &Table) -> Vec<(String, String)> {
    let it = &table.experiment;
    let mut all = Vec::new();
    for (at, measure) in it.measures.iter().enumerate() {
        let name = file_name(measure);
        if let Some(svg) = boxes(table, at) {
            all.push((name.clone(), svg));
        }
        if let Some(svg) = curves(table, at) {
            all.push((format!("{name}-by-{}", file_name(&it.factors[0])), svg));
        }
    }
    all
}

/// What a number is measured in.
fn unit(measure: &str) -> String {
    match measure {
        "seconds" => "seconds of the task clock".into(),
        "driven" => "metres driven".into(),
        "straight" => "metres between places, in straight lines".into(),
        "hands" => "metres of the hands".into(),
        other => other.into(),
    }
}

fn boxes(table: &Table, at: usize) -> Option<String> {
    let it = &table.experiment;
    let groups: Vec<Group<'_>> = table
        .cases
        .iter()
        .map(|case| Group {
            label: &case.text,
            series: case
                .variants
                .iter()
                .filter(|column| column.runs > 0)
                .map(|column| {
                    let Scope { values, failed, .. } = &column.measures[at].all;
                    Series { name: &column.name, values, failed }
                })
                .collect(),
        })
        .collect();
    (!table.is_void(at)).then(|| plot::boxes(&it.name, &unit(&it.measures[at]), &groups))
}

fn curves(table: &Table, at: usize) -> Option<String> {
    let it = &table.experiment;
    let [factor] = it.factors.as_slice() else { return None };
    let xs = it.numbers(0)?;
    if xs.len() < 2 || table.is_void(at) {
        return None;
    }
    let curve = |variant: usize| {
        let point = |(x, case): (&f64, &super::summary::Case)| {
            let summary = case.variants[variant].measures[at].all.summary?;
            let (low, high) = (summary.low.unwrap_or(summary.mean), summary.high.unwrap_or(summary.mean));
            Some((*x, summary.mean, low, high))
        };
        Curve {
            name: it.variants[variant].name.clone(),
            points: xs.iter().zip(&table.cases).filter_map(point).collect(),
        }
    };
    let curves: Vec<Curve> =
        (0..it.variants.len()).map(curve).filter(|curve| !curve.points.is_empty()).collect();
    Some(plot::curves(&it.name, factor, &unit(&it.measures[at]), &curves))
}

/// The page.
fn html(table: &Table) -> String {
    let it = &table.experiment;
    let mut sections = vec![success(table)];
    for (at, name) in it.measures.iter().enumerate().filter(|(at, _)| !table.is_void(*at)) {
        let pictures = [boxes(table, at), curves(table, at)];
        sections.push(Section {
            heading: name.clone(),
            text: Vec::new(),
            tables: vec![
                numbers(table, at, "All runs", |column| &column.measures[at].all),
                numbers(table, at, "Runs that succeeded, compared where both of a pair did", |column| {
                    &column.measures[at].succeeded
                }),
            ],
            pictures: pictures.into_iter().flatten().collect(),
        });
    }
    sections.push(edits(table));
    let lead = heading(table);
    let (_, lead) = lead.split_once('\n').unwrap_or(("", &lead));
    let doc = it.doc.split_whitespace().collect::<Vec<_>>().join(" ");
    page::page(&it.name, format!("{doc} {lead}").trim(), &sections)
}

/// A case and a variant as the first cells of a row.
fn rows<'t>(table: &'t Table, cells: impl Fn(&'t Column) -> Vec<String>) -> Vec<Vec<String>> {
    let row = |case: &'t super::summary::Case, column: &'t Column| {
        let first = (table.cases.len() > 1).then(|| case.text.clone());
        first.into_iter().chain([column.name.clone()]).chain(cells(column)).collect()
    };
    table.cases.iter().flat_map(|case| case.variants.iter().map(move |column| row(case, column))).collect()
}

fn head(table: &Table, names: &[&str]) -> Vec<String> {
    let first = if table.cases.len() > 1 { &["case", "variant"][..] } else { &["variant"] };
    first.iter().chain(names).map(|it| (*it).to_string()).collect()
}

fn success(table: &Table) -> Section {
    let percent = |it: f64| format!("{:.1} %", 100.0 * it);
    let cells = |column: &Column| {
        let mut cells = vec![column.runs.to_string(), column.succeeded.to_string()];
        if column.runs == 0 {
            return cells;
        }
        cells.push(percent(column.succeeded as f64 / column.runs as f64));
        cells.push(
            column.rate.map_or(String::new(), |it| format!("{} – {}", percent(it.low), percent(it.high))),
        );
        if let Some(it) = column.against {
            cells.push(it.difference.map_or(String::new(), |it| {
                format!(
                    "{} ({} – {})",
                    signed(100.0 * it.difference, 1),
                    signed(100.0 * it.low, 1),
                    signed(100.0 * it.high, 1)
                )
            }));
            cells.extend([it.lost.to_string(), it.won.to_string()]);
            cells.extend([it.mcnemar, it.fisher].map(|it| it.map_or(String::new(), p)));
        }
        cells
    };
    let names = [
        "runs",
        "succeeded",
        "rate",
        "95 % (Wilson)",
        "points more (Newcombe)",
        "lost",
        "won",
        "p (McNemar)",
        "p (Fisher)",
    ];
    let whys = table.cases.iter().flat_map(|case| {
        case.variants.iter().flat_map(move |column| {
            column.whys.iter().map(move |(why, n)| {
                let case = if case.text.is_empty() { String::new() } else { format!(", {}", case.text) };
                format!("{}{case}: {n} × {why}", column.name)
            })
        })
    });
    Section {
        heading: "Success".into(),
        text: whys.collect(),
        tables: vec![page::Table {
            caption: "All runs".into(),
            head: head(table, &names),
            rows: rows(table, cells),
        }],
        pictures: Vec::new(),
    }
}

fn numbers<'t>(
    table: &'t Table,
    at: usize,
    caption: &str,
    scope: impl Fn(&'t Column) -> &'t Scope,
) -> page::Table {
    let places = places_of(table.cases.iter().flat_map(|case| &case.variants), at);
    let number = |it: f64| number(it, places);
    let within = |low: Option<f64>, high: Option<f64>| match (low, high) {
        (Some(low), Some(high)) => format!("{} – {}", number(low), number(high)),
        _ => String::new(),
    };
    let compared = |it: &Comparison| {
        let (difference, interval) = difference(it, places);
        let maybe = |it: Option<f64>| it.map_or(String::new(), p);
        let effect = |it: Option<f64>| it.map_or(String::new(), |it| signed(it, 2));
        let [d, _, dz, delta] = it.effects;
        vec![
            it.pairs.to_string(),
            difference,
            interval,
            p(it.paired.p),
            maybe(it.corrected),
            maybe(it.wilcoxon),
            maybe(it.welch.as_ref().map(|it| it.p)),
            effect(d),
            effect(dz),
            effect(delta),
        ]
    };
    let cells = |column: &'t Column| {
        let scope = scope(column);
        let Some(it) = scope.summary else { return vec!["0".into()] };
        let mut cells = vec![
            it.n.to_string(),
            number(it.mean),
            within(it.low, it.high),
            number(it.median),
            within(scope.median.map(|it| it.low), scope.median.map(|it| it.high)),
            it.sd.map_or(String::new(), number),
        ];
        cells.extend(scope.against.as_ref().map_or(Vec::new(), compared));
        cells
    };
    let names = [
        "n",
        "mean",
        "95 %",
        "median",
        "95 %",
        "sd",
        "pairs",
        "difference",
        "95 %",
        "p (paired t)",
        "p (Holm)",
        "p (Wilcoxon)",
        "p (Welch)",
        "d",
        "d_z",
        "δ",
    ];
    page::Table { caption: caption.into(), head: head(table, &names), rows: rows(table, cells) }
}

fn edits(table: &Table) -> Section {
    let all = table.cases.iter().flat_map(|case| case.variants.iter().map(move |column| (case, column)));
    let said = all.flat_map(|(case, column)| {
        let Edits { kept, refused, why, .. } = &column.edits;
        let name = if case.text.is_empty() {
            column.name.clone()
        } else {
            format!("{}, {}", column.name, case.text)
        };
        let kept = kept.iter().map(|edit| format!("{name}: {edit}"));
        let refused =
            refused.iter().map(|[by, check, why]| format!("{name}: refused ({check}), {by}: {why}"));
        let why = why.iter().map(|why| format!("{name}: not run, {why}"));
        kept.chain(refused).chain(why).collect::<Vec<_>>()
    });
    Section { heading: "Edits".into(), text: said.collect(), tables: Vec::new(), pictures: Vec::new() }
}
