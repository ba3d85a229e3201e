//! The report of an evaluation: one page for a browser or a printer, which needs nothing from elsewhere and runs no script.

use std::fmt::Write as _;

use vm::show::markup;

/// A part of a report.
#[derive(Debug, Clone, Default)]
pub struct Section {
    /// Its heading.
    pub heading: String,
    /// Paragraphs.
    pub text: Vec<String>,
    /// What the text speaks of, in numbers.
    pub tables: Vec<Table>,
    /// SVG elements as [`super::plot`] makes them. They are put into the page as they are: nobody else may write them.
    pub pictures: Vec<String>,
}

/// A table. Columns in which all rows begin with a number, or are empty, stand on the right.
#[derive(Debug, Clone, Default)]
pub struct Table {
    /// What it shows.
    pub caption: String,
    /// The names of the columns.
    pub head: Vec<String>,
    /// Its rows; missing cells are empty.
    pub rows: Vec<Vec<String>>,
}

const STYLE: &str = "
:root { color-scheme: light dark; --ink: #1f1f1f; --paper: #fff; --faint: #666; --line: #ddd; --shade: #f6f6f4; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e6e6; --paper: #18191c; --faint: #a0a0a0; --line: #36383d; --shade: #202226; } }
body { font: 15px/1.55 system-ui, 'Helvetica Neue', Arial, 'DejaVu Sans', sans-serif; color: var(--ink); background: var(--paper); max-width: 62rem; margin: 0 auto; padding: 1.5rem 1.25rem 4rem; }
h1 { font-size: 1.55rem; line-height: 1.25; margin: .5rem 0; }
h2 { font-size: 1.15rem; margin: 2.4rem 0 .5rem; border-top: 1px solid var(--line); padding-top: 1rem; }
h1, h2, p, caption { overflow-wrap: anywhere; }
p { max-width: 46rem; margin: .5rem 0; }
.lead { color: var(--faint); }
nav { font-size: .92em; } nav a { margin-right: 1.2em; color: inherit; }
.wide { overflow-x: auto; margin: 1rem 0; }
table { border-collapse: collapse; font-size: .92em; font-variant-numeric: tabular-nums; }
caption { text-align: left; color: var(--faint); padding-bottom: .35rem; }
th, td { padding: .22rem .8rem .22rem 0; text-align: left; vertical-align: top; }
th { font-weight: 600; border-bottom: 1px solid var(--ink); }
thead tr { border-top: 2px solid var(--ink); } tbody tr:last-child td { border-bottom: 2px solid var(--ink); }
tbody tr:nth-child(even) { background: var(--shade); }
.r { text-align: right; padding: .22rem 0 .22rem .8rem; }
th:first-child, td:first-child { padding-left: .4rem; } th:last-child, td:last-child { padding-right: .4rem; }
figure { margin: 1.2rem 0; overflow-x: auto; }
@media print {
  body { max-width: none; padding: 0; font-size: 10pt; } nav { display: none; }
  .wide, figure { overflow: visible; break-inside: avoid; } figure svg { max-width: 100%; height: auto; }
  h2 { break-after: avoid; } tr { break-inside: avoid; } thead { display: table-header-group; }
}
";

/// The page. `lead`: what stands below the title. All texts may be from anywhere; only pictures are markup.
#[must_use]
pub fn page(title: &str, lead: &str, sections: &[Section]) -> String {
    let mut body = format!("<h1>{}</h1>\n", markup(title));
    if !lead.is_empty() {
        let _ = writeln!(body, "<p class=\"lead\">{}</p>", markup(lead));
    }
    if sections.len() > 2 {
        let links = sections.iter().enumerate();
        let links: String =
            links.map(|(at, it)| format!("<a href=\"#s{at}\">{}</a> ", markup(&it.heading))).collect();
        let _ = writeln!(body, "<nav>{}</nav>", links.trim_end());
    }
    for (at, section) in sections.iter().enumerate() {
        write_section(&mut body, at, section);
    }
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'\">\n\
         <meta name=\"viewport\" content=\"width=device-width\">\n<title>{}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n{body}</body>\n</html>\n",
        markup(title)
    )
}

fn write_section(body: &mut String, at: usize, section: &Section) {
    let _ = writeln!(body, "<section id=\"s{at}\">\n<h2>{}</h2>", markup(&section.heading));
    for paragraph in &section.text {
        let _ = writeln!(body, "<p>{}</p>", markup(paragraph));
    }
    for table in &section.tables {
        write_table(body, table);
    }
    for picture in &section.pictures {
        let _ = writeln!(body, "<figure>\n{picture}</figure>");
    }
    *body += "</section>\n";
}

fn write_table(body: &mut String, table: &Table) {
    let columns = table.rows.iter().map(Vec::len).chain([table.head.len()]).max().unwrap_or(0);
    let right: Vec<bool> = (0..columns).map(|column| is_numeric(table, column)).collect();
    let cell = |tag: &str, column: usize, row: &[String]| {
        let class = if right[column] { " class=\"r\"" } else { "" };
        let text = row.get(column).map_or(String::new(), |text| markup(text));
        format!("<{tag}{class}>{text}</{}>", tag.split(' ').next().unwrap_or_default())
    };
    let line =
        |tag: &str, row: &[String]| (0..columns).map(|column| cell(tag, column, row)).collect::<String>();
    *body += "<div class=\"wide\"><table>\n";
    if !table.caption.is_empty() {
        let _ = writeln!(body, "<caption>{}</caption>", markup(&table.caption));
    }
    let _ = writeln!(body, "<thead><tr>{}</tr></thead>\n<tbody>", line("th scope=\"col\"", &table.head));
    for row in &table.rows {
        let _ = writeln!(body, "<tr>{}</tr>", line("td", row));
    }
    *body += "</tbody>\n</table></div>\n";
}

/// "12.3 s", "−4 %", "< 0.001" and "–" are numbers here, "2nd" is not.
fn is_numeric(table: &Table, column: usize) -> bool {
    let mut cells = table.rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.trim());
    let is_number = |cell: &str| {
        let digits = cell.trim_start_matches(['+', '-', '−', '<', '>', '≤', '≥', '±', '.', ' ']);
        let rest =
            digits.trim_start_matches(|letter: char| letter.is_ascii_digit() || ".,eE".contains(letter));
        digits.starts_with(|letter: char| letter.is_ascii_digit()) && !rest.starts_with(char::is_alphanumeric)
    };
    let empty = |cell: &str| matches!(cell, "" | "–" | "—" | "-");
    cells.clone().any(is_number) && cells.all(|cell| empty(cell) || is_number(cell))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::plot;

    fn texts(all: &[&str]) -> Vec<String> {
        all.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn texts_stay_texts() {
        let evil = "</td><script>alert('1')</script>\"&\u{7}";
        let section = |text: &str| Section {
            heading: text.into(),
            text: texts(&[text]),
            tables: vec![Table {
                caption: text.into(),
                head: texts(&[text]),
                rows: vec![texts(&[text, text])],
            }],
            pictures: vec![plot::boxes(text, text, &[])],
        };
        let (page, plain) = (page(evil, evil, &[section(evil)]), page("x", "x", &[section("x")]));
        assert_eq!(page.matches('<').count(), plain.matches('<').count());
        assert_eq!(page.matches('"').count(), plain.matches('"').count());
        assert!(!page.contains("<script"));
    }

    #[test]
    fn numbers_stand_on_the_right() {
        let rows =
            vec![texts(&["none", "12.3 s", "< 0.001", "2nd", ""]), texts(&["tray", "−4e-3", "–", "1", ""])];
        let table = Table { caption: String::new(), head: texts(&["plan"]), rows };
        let right: Vec<bool> = (0..5).map(|column| is_numeric(&table, column)).collect();
        assert_eq!(right, [false, true, true, false, false]);
        let page = page("report", "", &[Section { tables: vec![table], ..Section::default() }]);
        assert!(page.contains("<tr><td>none</td><td class=\"r\">12.3 s</td><td class=\"r\">&lt; 0.001</td><td>2nd</td><td></td></tr>"));
        assert!(page.contains("<th scope=\"col\">plan</th><th scope=\"col\" class=\"r\"></th>"));
    }
}
