//! What it costs to put a tree into a store and to get it back, per node: DESIGN's budget is 300 ns and 400 ns.
//!
//! `cargo bench -p pleach-store`

use cpu_time::ProcessTime;
use store::{Store, Writer};
use vm::persist::{SavedRecord, SavedSlot, SavedTree};

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

fn main() {
    let nodes: u32 = 200_000;
    let saved = tree(nodes);
    let path = std::env::temp_dir().join(format!("pleach-bench-{}.store", std::process::id()));
    let per_node = |begin: ProcessTime| begin.elapsed().as_nanos() / u128::from(nodes);
    let begin = ProcessTime::now();
    let mut packer = vm::persist::chunk::Packer::default();
    let mut n = 0;
    for rows in saved.slots.chunks(1024) {
        rows.iter().for_each(|row| packer.saved_slot(row));
        n += packer.end(|it| it.rows.len());
    }
    for rows in saved.records.chunks(1024) {
        rows.iter().for_each(|row| packer.saved_record(row, "main".into()));
        n += packer.end(|it| it.rows.len());
    }
    println!("pack {} {}", per_node(begin), n / nodes as usize);
    let begin = ProcessTime::now();
    let writer = Writer::put(Store::write(&path).expect("it opens"), "tree", None, &saved, "program");
    println!("before close {}", per_node(begin));
    drop(writer.expect("it is written"));
    let save = per_node(begin);
    let begin = ProcessTime::now();
    let store = Store::read(&path).expect("it opens");
    let read = store.version("tree", None).and_then(|row| store.tree(&row)).expect("it is whole");
    let load = per_node(begin);
    assert!(read == saved, "what is read is what was written");
    let bytes = std::fs::metadata(&path).map_or(0, |it| it.len()) / u64::from(nodes);
    println!("save {save} ns, load {load} ns, {bytes} bytes per node (slot and record)");
    for ending in ["", "-writer", "-wal", "-shm"] {
        let _ = std::fs::remove_file(format!("{}{ending}", path.display()));
    }
}
