//! A tree as one page for a browser, which needs nothing from elsewhere.
//!
//! The nodes stand in the page as JSON; the script makes elements of those that somebody looks at, so a large tree opens at
//! once. Names and values come from programs and files: in the JSON no `<` is left that could end it, the script puts
//! all of them into the page as text, and the policy of the page runs no script but its own and fetches nothing.

use serde_json::{Value as Json, json};
use vm::show::markup;

/// The page: what stands between `{{` and `}}` is filled in.
const PAGE: &str = include_str!("tree.html");

/// The page. `about`: a line below the title; `edits`: lines that stand below the tree.
pub fn page(title: &str, about: &str, nodes: &[Json], edits: &[String]) -> String {
    let data = json!({"about": about, "edits": edits, "nodes": nodes, "title": title});
    let (head, rest) = PAGE.split_once("{{title}}").expect("the page has a title");
    let (middle, end) = rest.split_once("{{data}}").expect("the page has a place for its data");
    format!("{head}{}{middle}{}{end}", markup(title), in_script(&data))
}

/// As the content of a script that is only data: letters that mean something to HTML are written by their numbers, which
/// JSON takes for the same.
fn in_script(json: &Json) -> String {
    let text = json.to_string();
    text.replace('<', "\\u003c")
        .replace('>', "\\u003e")
        .replace('&', "\\u0026")
        .replace('\u{2028}', "\\u2028")
        .replace('\u{2029}', "\\u2029")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_values_stay_text() {
        let evil = "</script><img src=x onerror=alert(1)><!--<script>\u{2028}&quot;\"'";
        let nodes = [json!({"name": evil, "params": {evil: evil}, "value": evil, "status": "succeeded"})];
        let page = page(evil, evil, &nodes, &[evil.into()]);
        let empty = super::page("", "", &[], &[]);
        assert_eq!(page.matches('<').count(), empty.matches('<').count());
        assert_eq!(page.matches("<script").count(), 2);
        let (_, rest) = page.split_once("type=\"application/json\">").expect("there are data");
        let (data, _) = rest.split_once("</script>").expect("they end");
        let data: Json = serde_json::from_str(data).expect("it is JSON");
        assert_eq!((&data["nodes"][0], &data["title"]), (&nodes[0], &json!(evil)));
    }
}
