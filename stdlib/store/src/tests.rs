//! Stores that are whole, damaged, hostile, full.

use std::path::PathBuf;

use rusqlite::Connection;
use vm::code::Program;
use vm::log::{Entry, Event, Question};
use vm::persist::{Outline, SavedEdit, SavedRecord, SavedSlot, SavedTree};
use vm::tree::Tree;

use crate::schema::FORMAT;
use crate::{Begin, Fault, Store, StoreError, Writer};

/// A folder of its own, which goes with the test.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Folder {
        let path = std::env::temp_dir().join(format!("pleach-store-{}-{name}", std::process::id()));
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).expect("a folder can be made");
        Folder(path)
    }
    fn file(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// A tree in which `main` has called something so many times.
fn tree(calls: u32, word: &str) -> SavedTree {
    let slot = |slot, parent, name: &str| SavedSlot {
        slot,
        parent,
        name: name.into(),
        site: u64::from(slot) << 40,
        steps: String::new(),
        place: slot,
    };
    let record = |record: u32, parent| SavedRecord {
        record,
        slot: record,
        parent,
        attempt: 1,
        kind: "plan".into(),
        status: "succeeded".into(),
        why: "".into(),
        start_ns: u64::from(record) * 1_000_000,
        end_ns: Some(u64::from(record) * 2_000_000),
        params: format!("{{\"n\":\"{record}\"}}"),
        value: Some(format!("\"{word} {record}\"")),
        failure: None,
        more: None,
    };
    let mut tree = SavedTree {
        slots: vec![slot(1, 0, "top-level"), slot(2, 1, "main")],
        records: vec![record(1, 0), record(2, 1)],
        edits: Vec::new(),
    };
    for at in 3..3 + calls {
        tree.slots.push(slot(at, 2, "fetching"));
        tree.records.push(record(at, 2));
    }
    tree.edits.push(SavedEdit {
        number: 1,
        slot: 3,
        edit: "(skip (path main fetching))".into(),
        callee: "fetching".into(),
        after: String::new(),
        origin: "program wash.plan".into(),
    });
    tree
}

fn entry(at: u64) -> Entry {
    let question = Question { slot: 1, attempt: 1, number: at as u32, request: "clock".into() };
    Entry { round: at, step: 10 * at, clock: at, events: vec![Event { question, answer: Ok(at.into()) }] }
}

/// Such a folder with [`make`]'s store in it.
fn made(name: &str) -> (Folder, PathBuf, Vec<SavedTree>) {
    let folder = Folder::new(name);
    let path = folder.file("a.store");
    let trees = make(&path);
    (folder, path, trees)
}

/// A store with two versions of a tree and a run with a log.
fn make(path: &std::path::Path) -> Vec<SavedTree> {
    let trees = vec![tree(1500, "milk"), tree(1100, "cup")];
    for tree in &trees {
        Writer::put(Store::write(path).expect("it opens"), "kitchen", None, tree, "program")
            .expect("it is written");
    }
    let begin = Begin { file: "a.plan".into(), head: "{}".into(), ..Begin::default() };
    let mut writer = Writer::begin(Store::write(path).expect("it opens"), begin).expect("it begins");
    (1..50).for_each(|at| writer.logged(&entry(at)));
    writer.write_log().expect("it is written");
    trees
}

#[test]
fn what_is_written_is_read() {
    let (_folder, path, trees) = made("round");
    let store = Store::read(&path).expect("it opens");
    let versions = store.versions().expect("they are listed");
    let names: Vec<_> = versions.iter().map(|it| format!("{}@{}", it.tree, it.version)).collect();
    assert_eq!(names, ["kitchen@1", "kitchen@2", "run-3@1"]);
    for (version, tree) in versions.iter().zip(&trees) {
        assert_eq!(&store.tree(version).expect("it is whole"), tree);
        let tasks = store.outline(version).expect("it is whole").expect("it is there");
        assert_eq!(tasks.len(), tree.records.len());
        assert_eq!((tasks[2].parent, tasks[2].name.as_str()), (1, "fetching"));
        assert_eq!(SavedTree::from_rows(&tree.rows()).as_ref(), Ok(tree));
    }
    let log = store.log(&versions[2]).expect("it is whole");
    assert_eq!(log.entries, (1..50).map(entry).collect::<Vec<_>>());
    assert!(store.check_pages().is_none());
    assert!(store.check().expect("it is read").iter().all(|it| it.trouble.is_none()));
}

#[test]
fn others_see_plain_tables() {
    let (_folder, path, trees) = made("views");
    let db = Connection::open(&path).expect("it opens");
    let texts = |select: &str| -> Vec<String> {
        let mut statement = db.prepare(select).unwrap_or_else(|error| panic!("{select}: {error}"));
        let rows = statement.query_map([], |row| row.get(0)).expect("it is asked");
        rows.map(|row| row.expect("it is a text")).collect()
    };
    let count = |select: &str| db.query_row(select, [], |row| row.get::<_, usize>(0));
    assert_eq!(count("SELECT count(*) FROM records WHERE id = 1"), Ok(trees[0].records.len()));
    assert_eq!(count("SELECT count(DISTINCT slot) FROM slots WHERE id = 2"), Ok(trees[1].slots.len()));
    let tasks = texts(
        "SELECT concat_ws(' ', record, slot, parent, name, kind, status, why, attempt, start_s, end_s, seconds, params, value, failure)
         FROM tasks WHERE tree = 'kitchen' AND version = 2 AND record IN (1, 2, 1030) ORDER BY record",
    );
    assert_eq!(
        tasks,
        [
            "1 1 0 top-level plan succeeded  1 0.001 0.002 0.001 {\"n\":\"1\"} \"cup 1\"",
            "2 2 1 main plan succeeded  1 0.002 0.004 0.002 {\"n\":\"2\"} \"cup 2\"",
            "1030 1030 2 fetching plan succeeded  1 1.03 2.06 1.03 {\"n\":\"1030\"} \"cup 1030\""
        ]
    );
    let slots = "SELECT concat_ws(' ', slot, parent, name, site, steps, place) FROM slots WHERE id = 1 AND slot = 1025";
    assert_eq!(texts(slots), ["1025 2 fetching 0004010000000000 1025"]);
    assert_eq!(texts("SELECT concat_ws(' ', tree, name, edit) FROM changes WHERE version = 1").len(), 1);
    assert_eq!(texts("SELECT name FROM changes"), ["fetching", "fetching"]);
    assert_eq!(texts("SELECT tree FROM history"), ["kitchen", "kitchen", "run-3"]);
}

/// A small generator of numbers, the same in each run.
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, most: usize) -> usize {
        self.0 = vm::random::mix(self.0.wrapping_add(0x9e37_79b9_7f4a_7c15));
        (self.0 % most as u64) as usize
    }
}

/// Everything in a damaged file is an error or what was written.
fn look_at(path: &std::path::Path, trees: &[SavedTree]) -> bool {
    let Ok(store) = Store::read(path) else { return false };
    let mut all_well = true;
    for version in 1..=trees.len() as i64 {
        let read = store.version("kitchen", Some(version)).and_then(|row| store.tree(&row));
        match read {
            Ok(tree) => assert_eq!(tree, trees[version as usize - 1]),
            Err(error) => {
                all_well = false;
                assert!(!error.to_string().is_empty());
            }
        }
    }
    for (version, tree) in (1..).zip(trees) {
        let read = store.version("kitchen", Some(version)).and_then(|row| store.outline(&row));
        if let Ok(Some(tasks)) = read {
            let outline = Outline::of_saved(tree).expect("it has one");
            assert_eq!(Some(tasks), Outline::read(&outline.words, &outline.tasks));
        }
    }
    if let Ok(version) = store.version("run-3", None)
        && let Ok(log) = store.log(&version)
    {
        assert_eq!(log.entries, (1..50).map(entry).collect::<Vec<_>>());
    }
    let _ = store.check();
    all_well
}

/// Damages a file in so many ways; how many of them were seen.
fn damage(times: usize, seed: u64) -> usize {
    let (folder, path, trees) = made(&format!("damage-{seed}"));
    let whole = std::fs::read(&path).expect("it is there");
    let (mut numbers, mut seen) = (Numbers(seed), 0);
    let bad = folder.file("bad.store");
    for time in 0..times {
        let mut bytes = whole.clone();
        match time % 10 {
            0 => bytes.truncate(numbers.below(whole.len())),
            1 => {
                const PAGE: usize = 4096;
                let pages = whole.len() / PAGE;
                let (one, other) = (numbers.below(pages) * PAGE, numbers.below(pages) * PAGE);
                bytes[one..one + PAGE].copy_from_slice(&whole[other..other + PAGE]);
                bytes[other..other + PAGE].copy_from_slice(&whole[one..one + PAGE]);
            }
            _ => {
                let bit = numbers.below(8 * whole.len());
                bytes[bit / 8] ^= 1 << (bit % 8);
            }
        }
        std::fs::write(&bad, bytes).expect("it can be written");
        seen += usize::from(!look_at(&bad, &trees));
    }
    seen
}

#[test]
fn damage_is_an_error_or_changes_nothing() {
    assert!(damage(150, 1) > 30);
}

#[test]
#[ignore = "takes a minute"]
fn damage_of_2000_kinds_is_an_error_or_changes_nothing() {
    assert!(damage(2000, 2) > 400);
}

#[test]
fn an_error_names_tree_version_and_batch() {
    let (_folder, path, trees) = made("names");
    let db = Connection::open(&path).expect("it opens");
    let change = "UPDATE chunks SET content = replace(content, 'cup 77', 'cup 78') WHERE id = 2";
    assert_eq!(db.execute(change, []), Ok(4), "all chunks of the version");
    db.execute("DELETE FROM chunks WHERE id = 1 AND what = 'slots'", []).expect("it is changed");
    drop(db);
    let store = Store::read(&path).expect("it opens");
    let read = |version| store.version("kitchen", Some(version)).and_then(|row| store.tree(&row));
    let words = |version| {
        read(version).expect_err("it is damaged").to_string().replace(&path.display().to_string(), "F")
    };
    assert_eq!(
        words(2),
        "the store F is damaged: tree kitchen, version 2, batch 1: rows of `records` from 1 on are not what was written"
    );
    assert_eq!(
        words(1),
        "the store F is damaged: tree kitchen, version 1, batch 1: rows of `slots` from 1 on are not there"
    );
    let bad = store.check().expect("it is read").iter().filter(|it| it.trouble.is_some()).count();
    assert_eq!((bad, trees.len()), (2, 2));
}

#[test]
fn each_call_may_fail() {
    let folder = Folder::new("fails");
    for (fault, why) in [
        (Fault::Full, "the disk is full"),
        (Fault::Broken, "input or output failed"),
        (Fault::Locked, "holds it"),
    ] {
        let mut at = 1;
        while fail_at(&folder.file(&format!("{fault:?}-{at}.store")), at, fault, why) {
            at += 1;
        }
        assert!(at > 20);
    }
}

/// A run whose call of this number fails. False if there were not so many calls.
fn fail_at(path: &std::path::Path, at: u64, fault: Fault, why: &str) -> bool {
    let mut writer =
        Writer::begin(Store::write(path).expect("it opens"), Begin::default()).expect("it begins");
    writer.fails_at = Some((writer.calls() + at, fault));
    let mut failed = false;
    for batch in 0..4 {
        (1..4).for_each(|it| writer.logged(&entry(10 * batch + it)));
        if let Err(error) = writer.write_log() {
            assert!(matches!(error, StoreError::Cannot { write: true, .. }), "{error}");
            assert!(error.to_string().contains(why), "{error}");
            failed = true;
            break;
        }
    }
    drop(writer);
    let store = Store::read(path).expect("it opens");
    let findings = store.check().expect("it is read");
    assert_eq!(findings.len(), 1);
    assert_eq!(findings[0].trouble, None);
    assert_eq!(findings[0].version.entries % 3, 0, "batches are whole");
    failed
}

#[test]
fn one_writes_others_read() {
    let folder = Folder::new("two");
    let path = folder.file("a.store");
    make(&path);
    let one = Store::write(&path).expect("it opens");
    assert_eq!(Store::write(&path).err(), Some(StoreError::Busy { path: path.clone() }));
    assert!(Store::read(&path).is_ok_and(|store| store.versions().is_ok()));
    drop(one);
    assert!(Store::write(&path).is_ok());
}

#[test]
fn nothing_in_a_file_runs() {
    let hostile = [
        "CREATE TRIGGER t AFTER INSERT ON log BEGIN DELETE FROM chunks; END",
        "DROP TABLE edits; CREATE VIEW edits AS SELECT * FROM log",
        "DROP TABLE log; CREATE TABLE log (id INTEGER, entry INTEGER CHECK (abs(entry) > 0))",
        "CREATE INDEX i ON chunks (abs(first))",
        "DROP TABLE chunks; CREATE VIEW chunks AS SELECT 1 AS id, 'slots' AS what",
        "DROP VIEW records; CREATE VIEW records AS SELECT 1 AS id;
         CREATE TRIGGER t INSTEAD OF INSERT ON records BEGIN DELETE FROM log; END",
        "DROP TABLE edits; CREATE TABLE edits (id INTEGER, number INTEGER AS (abs(id)))",
        "ALTER TABLE batches ADD COLUMN more TEXT AS (hex(steps))",
    ];
    for text in hostile {
        let folder = Folder::new("hostile");
        let path = folder.file("a.store");
        make(&path);
        Connection::open(&path).and_then(|db| db.execute_batch(text)).expect("it is planted");
        for opened in [Store::read(&path), Store::write(&path)] {
            match opened.err() {
                Some(StoreError::Foreign { .. }) => {}
                other => panic!("{text}: {other:?}"),
            }
        }
    }
    let folder = Folder::new("harmless");
    let path = folder.file("a.store");
    make(&path);
    // What is only looked at by others is nothing to us, whatever it calls itself.
    let mine = "DROP VIEW tasks; CREATE VIEW tasks AS SELECT load_extension('x') AS name;
        CREATE VIEW mine AS SELECT count(*) FROM tasks; CREATE TABLE notes (text TEXT)";
    Connection::open(&path).and_then(|db| db.execute_batch(mine)).expect("it is added");
    let store = Store::read(&path).expect("it opens");
    assert!(store.check().expect("it is read").iter().all(|it| it.trouble.is_none()));
}

#[test]
fn other_files_are_refused() {
    let folder = Folder::new("other");
    let path = folder.file("a.store");
    std::fs::write(&path, "(def-plan main ())").expect("it can be written");
    assert!(matches!(Store::write(&path).err(), Some(StoreError::Foreign { .. })));
    assert!(matches!(Store::read(&path).err(), Some(StoreError::Foreign { .. })));
    let other = folder.file("other.db");
    Connection::open(&other).and_then(|db| db.execute_batch("CREATE TABLE t (x)")).expect("it is made");
    assert!(matches!(Store::write(&other).err(), Some(StoreError::Foreign { .. })));
    assert!(matches!(Store::read(&folder.file("none")).err(), Some(StoreError::Cannot { .. })));
    assert!(matches!(Store::write(&folder.file("no/none")).err(), Some(StoreError::Cannot { .. })));
}

#[test]
fn other_formats_are_refused_with_what_to_do() {
    let (_folder, path, _) = made("formats");
    for (format, help) in [(1, "pleach store export"), (FORMAT + 1, "a newer one")] {
        let set = |db: Connection| db.pragma_update(None, "user_version", format);
        Connection::open(&path).and_then(set).expect("it is changed");
        for opened in [Store::read(&path), Store::write(&path)] {
            let error = opened.err().expect("it is refused");
            let words = format!("is a store of format {format}; this pleach reads format {FORMAT}");
            assert!(error.to_string().ends_with(&words), "{error}");
            assert!(error.help().is_some_and(|it| it.contains(help)), "{:?}", error.help());
        }
    }
}

#[test]
fn a_folder_in_which_nothing_can_be_made() {
    let (folder, path, trees) = made("closed");
    // Whoever runs the test may be above permissions; nobody is above these.
    for closed in [path.join("below-a-file.store"), PathBuf::from("/proc/self/a.store")] {
        for opened in [Store::read(&closed), Store::write(&closed)] {
            match opened.err() {
                Some(error @ StoreError::Cannot { .. }) => assert!(error.to_string().contains("store")),
                other => panic!("{}: {other:?}", closed.display()),
            }
        }
    }
    let set = |mode: u32| {
        use std::os::unix::fs::PermissionsExt as _;
        std::fs::set_permissions(&folder.0, std::fs::Permissions::from_mode(mode)).expect("it is set");
    };
    set(0o555);
    let may_write = std::fs::write(folder.file("try"), "").is_ok();
    let (read, write) = (Store::read(&path), Store::write(&folder.file("new.store")));
    set(0o755);
    let tree = read.and_then(|store| store.version("kitchen", None).and_then(|row| store.tree(&row)));
    assert_eq!(tree.as_ref(), Ok(&trees[1]));
    match write.err() {
        Some(StoreError::Cannot { why, .. }) => assert_eq!(why, "there is no permission"),
        other => assert!(may_write, "{other:?}"),
    }
}

#[test]
fn a_reader_that_takes_long_does_not_stop_the_writer() {
    let (_folder, path, _) = made("long");
    let reader = Connection::open(&path).expect("it opens");
    reader.execute_batch("BEGIN").expect("it begins");
    let count = || reader.query_row("SELECT count(*) FROM log", [], |row| row.get::<_, i64>(0));
    let before = count();
    let mut writer =
        Writer::begin(Store::write(&path).expect("it opens"), Begin::default()).expect("it begins");
    for at in 1..200 {
        writer.logged(&entry(at));
        assert_eq!(writer.write_log(), Ok(()));
    }
    drop(writer);
    assert_eq!(count(), before, "a reader sees one moment");
    drop(reader);
    let store = Store::read(&path).expect("it opens");
    assert_eq!(store.last().map(|it| it.entries), Ok(199));
}

#[test]
fn an_outline_of_an_earlier_moment_is_not_used() {
    let folder = Folder::new("outline");
    let path = folder.file("a.store");
    let mut writer =
        Writer::begin(Store::write(&path).expect("it opens"), Begin::default()).expect("it begins");
    let tasks = || {
        let store = Store::read(&path).expect("it opens");
        let version = store.last().expect("it is there");
        store.outline(&version).expect("it is whole").map(|tasks| tasks.len())
    };
    assert_eq!(tasks(), None);
    let (program, tree) = (Program::default(), Tree::default());
    writer.end(&program, &tree, 1, 0, "stopped", None).expect("it is written");
    assert_eq!(tasks(), Some(1));
    writer.logged(&entry(1));
    writer.write_log().expect("it is written");
    assert_eq!(tasks(), None);
    drop(writer);
    let empty =
        Writer::put(Store::write(&path).expect("it opens"), "empty", None, &SavedTree::default(), "import");
    drop(empty.expect("it is written"));
    assert_eq!(tasks(), None);
}

#[test]
fn forgotten_versions_are_gone() {
    let (_folder, path, trees) = made("forget");
    Store::write(&path).and_then(|mut store| store.forget(&[1])).expect("it is forgotten");
    let store = Store::read(&path).expect("it opens");
    assert_eq!(store.versions().map(|it| it.len()), Ok(2));
    let last = store.version("kitchen", None).and_then(|row| store.tree(&row));
    assert_eq!(last.as_ref(), Ok(&trees[1]));
}
