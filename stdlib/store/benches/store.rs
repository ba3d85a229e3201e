//! What it costs to put a tree into a store and to get it back, per node: DESIGN's budget is 300 ns and 400 ns. And how
//! long it takes until the first answer about a tree of 10^6 nodes is there.
//!
//! `cargo bench -p pleach-store`

use std::path::{Path, PathBuf};
use std::time::Instant;

use cpu_time::ProcessTime;
use store::{Store, Writer};
use vm::failure::FailureTypes;
use vm::persist::chunk::Packer;
use vm::persist::{SavedRecord, SavedSlot, SavedTree};
use vm::rules::view::{Attr, TreeView};
use vm::value::Value;

fn tree(nodes: u32) -> SavedTree {
    let mut tree = SavedTree::default();
    for at in 1..=nodes {
        let parent = if at == 1 { 0 } else { (at - 1).min(2) };
        let name = if at < 3 { "main" } else { "fetching" };
        let steps = if at < 3 { String::new() } else { format!("[[\"int\",{at},0]]") };
        tree.slots.push(SavedSlot { slot: at, parent, name: name.into(), site: 7, steps, place: at });
        tree.records.push(SavedRecord {
            record: at,
            slot: at,
            parent,
            attempt: 1,
            kind: "plan".into(),
            status: "succeeded".into(),
            why: "".into(),
            start_ns: 0,
            end_ns: Some(1),
            params: format!("{{\"i\":\"{at}\"}}"),
            value: Some("nil".into()),
            failure: None,
            more: None,
        });
    }
    tree
}

fn file() -> PathBuf {
    std::env::temp_dir().join(format!("pleach-bench-{}.store", std::process::id()))
}

fn remove(path: &Path) {
    for ending in ["", "-writer", "-wal", "-shm"] {
        let _ = std::fs::remove_file(format!("{}{ending}", path.display()));
    }
}

fn main() {
    save_and_load(200_000);
    first_answer(1_000_000);
}

fn save_and_load(nodes: u32) {
    let (saved, path) = (tree(nodes), file());
    let per_node = |begin: ProcessTime| begin.elapsed().as_nanos() / u128::from(nodes);
    let mut packer = Packer::default();
    let begin = ProcessTime::now();
    for rows in saved.records.chunks(1024) {
        rows.iter().for_each(|row| packer.saved_record(row, saved.slots[row.slot as usize - 1].name));
        packer.end(|chunk| std::hint::black_box(chunk.rows.len()));
    }
    for rows in saved.slots.chunks(1024) {
        rows.iter().for_each(|row| packer.saved_slot(row));
        packer.end(|chunk| std::hint::black_box(chunk.rows.len()));
    }
    let pack = per_node(begin);
    let begin = ProcessTime::now();
    let writer = Writer::put(Store::write(&path).expect("it opens"), "tree", None, &saved, "program");
    drop(writer.expect("it is written"));
    let save = per_node(begin);
    let begin = ProcessTime::now();
    let store = Store::read(&path).expect("it opens");
    let read = store.version("tree", None).and_then(|row| store.tree(&row)).expect("it is whole");
    let load = per_node(begin);
    assert!(read == saved, "what is read is what was written");
    let bytes = std::fs::metadata(&path).map_or(0, |it| it.len()) / u64::from(nodes);
    println!(
        "save {save} ns, of it rows as text {pack} ns; load {load} ns; {bytes} bytes per node (slot and record)"
    );
    remove(&path);
}

fn first_answer(nodes: u32) {
    let path = file();
    let put = Writer::put(Store::write(&path).expect("it opens"), "tree", None, &tree(nodes), "program");
    drop(put.expect("it is written"));
    let (wall, begin) = (Instant::now(), ProcessTime::now());
    let since = || begin.elapsed().as_millis();
    let store = Store::read(&path).expect("it opens");
    let version = store.version("tree", None).expect("it is there");
    let tasks = store.outline(&version).expect("it is whole").expect("it is there");
    let read = since();
    let rest = move || {
        let saved = store.tree(&version).map_err(|it| it.to_string())?;
        TreeView::of_saved(&FailureTypes::default(), &saved, &|text| Value::str(text))
    };
    let view = TreeView::of_outline(tasks, rest);
    let table = since();
    let column = view.column(Attr::Status);
    let found = column.with(view.number(&Value::symbol("succeeded"))).last();
    let path = found.map(|task| view.path(task));
    assert!(path.is_some());
    let (first, first_wall) = (since(), wall.elapsed().as_millis());
    assert!(view.params(nodes - 1).len() == 1 && view.trouble().is_none());
    println!(
        "{nodes} nodes: outline read after {read} ms, table after {table} ms, path of the last task after {first} ms of CPU \
         ({first_wall} ms on the wall), its parameters after {} ms",
        since()
    );
    remove(&file());
}
