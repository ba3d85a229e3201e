//! The summary of an experiment as a table of text.

use stdlib::statistics::Interval;
use vm::show::safe;

use super::summary::{Case, Column, Comparison, Success, Table};

/// Reasons that are shown for each variant.
const MOST_WHYS: usize = 3;
/// Longer reasons are cut, in characters.
const LONGEST_WHY: usize = 100;

/// Larger numbers are written with a power of ten.
const HUGE: f64 = 1e9;

/// What stands above the columns.
const HEAD: [&str; 8] = ["", "mean", "95 %", "median", "against", "95 %", "p", "where both succeed"];

/// The summary, for people.
#[must_use]
pub fn text(table: &Table) -> String {
    let mut out = format!("{}\n", heading(table));
    for case in &table.cases {
        if !case.text.is_empty() {
            out += &format!("\n{}\n", safe(&case.text));
        }
        out += &of_case(case, table);
    }
    out += "\np: Student's paired test; of success McNemar's exact one. --json and the report have Welch's, Wilcoxon's and Fisher's tests,\n";
    out += "corrections for many tests, and effect sizes.\n";
    out
}

/// What was done, in a line or two.
#[must_use]
pub fn heading(table: &Table) -> String {
    let it = &table.experiment;
    let doc = it.doc.lines().map(str::trim).collect::<Vec<_>>().join(" ");
    let title = if doc.is_empty() { it.name.clone() } else { format!("{}: {doc}", it.name) };
    let last = it.seed.saturating_add(it.runs.max(1) - 1);
    let runs = match (it.runs, it.variants.len()) {
        (1, 1) => format!("one run, seed {}", it.seed),
        (n, _) => format!("{n} runs of each variant, seeds {} to {last}", it.seed),
    };
    let partial = match table.done < table.wanted {
        true => format!(" · only {} of {} runs are done", table.done, table.wanted),
        false => String::new(),
    };
    format!("{}\nplan {} · {runs}{partial}", safe(&title), safe(&it.plan))
}

fn of_case(case: &Case, table: &Table) -> String {
    let it = &table.experiment;
    let first = case.variants.first().map_or("", |it| it.name.as_str());
    let mut rows = vec![HEAD.map(str::to_string).to_vec()];
    match case.variants.len() {
        1 => rows[0].truncate(4),
        _ => rows[0][4] = format!("against {}", safe(first)),
    }
    rows.push(vec!["success".into()]);
    rows.extend(case.variants.iter().filter(|it| it.runs > 0).map(success));
    for (at, name) in it.measures.iter().enumerate() {
        if table.is_void(at) {
            continue;
        }
        rows.push(vec![safe(name)]);
        let places = places_of(&case.variants, at);
        rows.extend(case.variants.iter().filter(|it| it.runs > 0).map(|column| measure(column, at, places)));
    }
    let mut out = aligned(&rows);
    for column in &case.variants {
        out += &remarks(column);
    }
    out
}

fn success(column: &Column) -> Vec<String> {
    let percent = |it: f64| format!("{:.1}", 100.0 * it);
    let within = |it: &Interval| format!("{} – {}", percent(it.low), percent(it.high));
    let mut cells = vec![
        format!("  {}", safe(&column.name)),
        format!("{} %", percent(column.succeeded as f64 / column.runs.max(1) as f64)),
        column.rate.as_ref().map_or(String::new(), within),
        format!("{} of {}", column.succeeded, column.runs),
    ];
    if let Some(Success { difference: Some(it), mcnemar, .. }) = column.against {
        cells.push(format!("{} points", signed(100.0 * it.difference, 1)));
        cells.push(format!("{} – {}", signed(100.0 * it.low, 1), signed(100.0 * it.high, 1)));
        cells.push(mcnemar.map_or(String::new(), p));
    }
    cells
}

fn measure(column: &Column, at: usize, places: usize) -> Vec<String> {
    let mut cells = vec![format!("  {}", safe(&column.name))];
    let Some(it) = column.measures.get(at) else { return cells };
    let Some(summary) = it.all.summary else {
        cells.push("–".into());
        return cells;
    };
    let number = |it: f64| number(it, places);
    cells.push(number(summary.mean));
    cells.push(match (summary.low, summary.high) {
        (Some(low), Some(high)) => format!("{} – {}", number(low), number(high)),
        _ => String::new(),
    });
    cells.push(number(summary.median));
    if let Some(against) = &it.all.against {
        let (difference, within) = difference(against, places);
        cells.extend([difference, within, p(against.paired.p)]);
        cells.push(
            it.succeeded.against.as_ref().map_or(String::new(), |it| {
                format!("{} of {} pairs", self::difference(it, places).0, it.pairs)
            }),
        );
    }
    cells
}

/// A difference and its interval: in per cent where that can be said.
#[must_use]
pub fn difference(it: &Comparison, places: usize) -> (String, String) {
    match &it.percent {
        Some((percent, within)) => (
            format!("{} %", signed(*percent, 1)),
            format!("{} – {}", signed(within.low, 1), signed(within.high, 1)),
        ),
        None => (
            signed(it.paired.difference, places),
            format!("{} – {}", signed(it.paired.low, places), signed(it.paired.high, places)),
        ),
    }
}

/// With so many digits after the point; with a power of ten if it is huge.
#[must_use]
pub fn number(it: f64, places: usize) -> String {
    let text = if it.abs() < HUGE { format!("{it:.places$}") } else { format!("{it:.3e}") };
    text.replace('-', "−")
}

/// With a sign that is as wide as the other one.
#[must_use]
pub fn signed(it: f64, places: usize) -> String {
    let text = number(it.abs(), places);
    let is_zero = !text.chars().any(|c| ('1'..='9').contains(&c));
    match (is_zero, it < 0.0) {
        (true, _) => text,
        (false, true) => format!("−{text}"),
        (false, false) => format!("+{text}"),
    }
}

/// Digits after the point for a number of these variants: as many as the largest needs.
#[must_use]
pub fn places_of<'c>(columns: impl IntoIterator<Item = &'c Column>, at: usize) -> usize {
    let summaries = columns.into_iter().filter_map(|it| it.measures.get(at)?.all.summary);
    match summaries.map(|it| it.max.abs().max(it.min.abs())).fold(0.0, f64::max) {
        it if it >= 1000.0 => 0,
        it if it >= 100.0 => 1,
        _ => 2,
    }
}

/// A probability as papers write it.
#[must_use]
pub fn p(it: f64) -> String {
    if it < 0.001 { "<0.001".into() } else { format!("{it:.3}") }
}

/// What stands below the table: what was not run, and why runs failed.
fn remarks(column: &Column) -> String {
    let name = safe(&column.name);
    let mut out = String::new();
    if let Some(why) = &column.edits.why {
        out += &format!("  {name} was not run: {}\n", safe(why));
    } else if let Some(other) = &column.alike {
        let why = column.edits.refused.first();
        let why = why.map_or("no transformation applies".into(), |[name, check, why]| {
            format!("{} was refused ({}): {}", safe(name), safe(check), safe(&cut(why)))
        });
        out += &format!("  {name} runs as {}: {why}\n", safe(other));
    }
    for (why, n) in column.whys.iter().take(MOST_WHYS) {
        let why = if why.is_empty() { "it says nothing".into() } else { safe(&cut(why)) };
        out += &format!(
            "  {name} failed {}: {why}\n",
            if *n == 1 { "once".into() } else { format!("{n} times") }
        );
    }
    let more: u64 = column.whys.iter().skip(MOST_WHYS).map(|(_, n)| n).sum();
    if more > 0 {
        out += &format!("  {name} failed {more} times for other reasons\n");
    }
    out
}

fn cut(text: &str) -> String {
    match text.char_indices().nth(LONGEST_WHY) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_string(),
    }
}

/// Columns below one another: the first to the left, the others to the right.
fn aligned(rows: &[Vec<String>]) -> String {
    let width = |column: usize| {
        rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count()).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..HEAD.len()).map(width).collect();
    let mut out = String::new();
    for row in rows {
        let mut line = String::new();
        for (at, (cell, width)) in row.iter().zip(&widths).enumerate() {
            let gap = width.saturating_sub(cell.chars().count());
            match at {
                0 => line += &format!("{cell}{}", " ".repeat(gap)),
                _ => line += &format!("  {}{cell}", " ".repeat(gap)),
            }
        }
        out += line.trim_end();
        out += "\n";
    }
    out
}
