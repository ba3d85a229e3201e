//! Stores of runs: killed and resumed, continued with edits, and from the language.

use std::path::Path;
use std::process::{Output, Stdio};
use std::time::Duration;

use crate::folder::Folder;

impl Folder {
    #[track_caller]
    fn run(&self, args: &str) -> Output {
        self.command(args).output().expect("it can be called")
    }
    /// What a command says on stdout; it must succeed.
    #[track_caller]
    fn said(&self, args: &str) -> String {
        let output = self.run(args);
        assert!(output.status.success(), "{args}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8_lossy(&output.stdout).into_owned()
    }
}

/// Reads a file now and then, and grows a tree with failures and parallel branches.
const WORK: &str = include_str!("store/work.plan");

const NO_STORE: &str = "run work.plan --allow read=. --allow write=. --quiet --json";

fn work(name: &str) -> Folder {
    Folder::new(name, &[("work.plan", WORK), ("in.txt", "hello")])
}

/// The nodes of a stored tree.
#[track_caller]
fn stored(folder: &Folder, store: &Path) -> serde_json::Value {
    let said = folder.said(&format!("tree {} run-1 --json", store.display()));
    let json: serde_json::Value = serde_json::from_str(&said).expect("it is JSON");
    json["tree"].clone()
}

#[test]
fn a_stored_tree_is_the_tree_of_the_run() {
    let folder = work("same");
    let said = folder.said(&NO_STORE.replace("--quiet", "--store a.store"));
    let json: serde_json::Value = serde_json::from_str(&said).expect("it is JSON");
    assert!(json["tree"].as_array().is_some_and(|nodes| nodes.len() > 10_000));
    assert!(json["tree"] == stored(&folder, Path::new("a.store")), "the trees differ");
    let again = folder.said("replay a.store 1 --json");
    let again: serde_json::Value = serde_json::from_str(&again).expect("it is JSON");
    assert!(json["tree"] == again["tree"], "the replayed tree differs");
}

/// Kills runs after different times; each is resumed, some are killed again meanwhile.
fn kill(times: u64, clock: &str) {
    let folder = work(&format!("kill-{clock}-{times}"));
    let run = |store: &str| {
        let args =
            format!("run work.plan --allow read=. --allow write=. --quiet --clock {clock} --store {store}");
        let mut command = folder.command(&args);
        command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("it can be called")
    };
    assert!(run("whole.store").wait().expect("it ends").success());
    let whole = stored(&folder, Path::new("whole.store"));
    let begin = std::time::Instant::now();
    assert!(run("time.store").wait().expect("it ends").success());
    let takes = begin.elapsed();
    // How long a run takes depends on the machine: those that had ended, or not begun, before the kill do not count.
    let mut killed = 0;
    for time in 0.. {
        if killed == times {
            break;
        }
        assert!(time < 40 * times, "only {killed} of {time} runs were killed in the middle");
        let store = format!("{time}.store");
        let mut child = run(&store);
        let part = vm::random::mix(time + 1) % 1000;
        std::thread::sleep(takes * part as u32 / 1000);
        child.kill().expect("it can be killed");
        child.wait().expect("it ends");
        if !::store::is_store(&folder.0.join(&store)) {
            continue;
        }
        killed += u64::from(folder.said(&format!("tree {store} --json")).contains("\"running\""));
        if time % 3 == 0 {
            let mut again = folder.command(&format!("resume {store} --quiet"));
            let mut again =
                again.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("it can be called");
            std::thread::sleep(Duration::from_millis(part % 50));
            again.kill().expect("it can be killed");
            again.wait().expect("it ends");
        }
        let check = folder.run(&format!("store check {store}"));
        assert!(check.status.success(), "{}", String::from_utf8_lossy(&check.stdout));
        let output = folder.run(&format!("resume {store} --quiet"));
        let error = String::from_utf8_lossy(&output.stderr);
        let ended = error.contains("have ended") || error.contains("is empty");
        assert!(output.status.success() || ended, "{error}");
        if !error.contains("is empty") {
            let listed = folder.said(&format!("tree {store} --json"));
            if listed.contains("run-1") {
                assert!(stored(&folder, Path::new(&store)) == whole, "kill {time}: the trees differ");
            }
        }
        let _ = std::fs::remove_file(folder.0.join(&store));
    }
}

#[test]
fn a_killed_run_goes_on_to_the_same_tree() {
    kill(6, "virtual");
}

#[test]
#[ignore = "takes minutes"]
fn each_of_200_killed_runs_goes_on_to_the_same_tree() {
    kill(150, "virtual");
    kill(50, "real");
}

/// Parallel branches that wait, fail, are stopped and tried again.
const WAITS: &str = r#"
(def-plan boil (what s) (sleep s) what)
(def-plan serve (n) (sleep 0.5) (if (< n 2) (fail plan-failure :message "spilt") n))
(def-plan cook (s)
  (pursue (boil 'rice s) (seq (boil 'water 1) (boil 'tea 9)))
  (let ((n 0))
    (with-failure-handling ((plan-failure (e) (if (< n 2) (let () (set! n (+ n 1)) (retry)) (return nil)))) (serve n))))
(def-plan main () (par (cook 2) (cook 3.25)) (boil 'all 1))
"#;

#[test]
fn a_tree_at_a_time_is_that_of_a_run_that_is_stopped_then() {
    let folder = Folder::new("at", &[("w.plan", WAITS)]);
    folder.said("run w.plan --store w.store --quiet");
    let tasks = |args: &str| {
        let json: serde_json::Value = serde_json::from_str(&folder.said(args)).expect("it is JSON");
        let nodes = json["tree"].as_array().cloned().unwrap_or_default();
        let task = |node: &serde_json::Value| {
            let ended = !node["end"].is_null();
            let status = if ended { node["status"].to_string() } else { "open".into() };
            format!("{} {status} {} {} {}", node["path"], node["attempt"], node["start"], node["end"])
        };
        nodes.iter().map(task).collect::<Vec<_>>()
    };
    for time in ["0", "0.5", "1", "1.75", "2", "2.5", "2.6", "3", "3.25", "4.2", "5.74"] {
        let stored = tasks(&format!("tree w.store run-1 --at {time} --json"));
        let replayed = tasks(&format!("replay w.store 1 --to {time}s --json"));
        assert!(stored.len() > 5 && stored == replayed, "{time}:\n{stored:#?}\n{replayed:#?}");
    }
}

const EDITED: &str = r#"
(def-plan fetch (what) (print "fetch" what) what)
(def-plan put (what) (print "put" what))
(def-plan main () (dolist (what '(cup plate knife)) (fetch what) (put what)))
(def-plan improve ()
  (let ((tree (run-plan main)))
    (save-tree "t.store" 'kitchen
      (edit-tree tree (list (skip (path main (put :call 2)))
                            (before (path main (fetch :call 3)) '(print "careful"))
                            (defer (path main put) :after (path main (fetch :call 3))))))))
(def-plan look ()
  (let ((tree (load-tree "t.store" 'kitchen)))
    (print (versions "t.store" 'kitchen) (tree-edits tree))
    (print (diff-trees tree (run-plan main :tree tree)))))
"#;

#[test]
fn a_named_tree_goes_on_with_its_edits() {
    let folder = Folder::new("edits", &[("e.plan", EDITED)]);
    folder.said("run e.plan --plan improve --allow write=. --quiet");
    let said = folder.said("run e.plan --store t.store --tree kitchen --quiet");
    assert_eq!(said, "fetch cup\nfetch plate\ncareful\nfetch knife\nput knife\nput cup\n");
    // The next version has them, too; and so has a run that is stopped and resumed.
    let said = folder.said("run e.plan --store t.store --tree kitchen --quiet --stop-at 5");
    assert!(said.len() < 60, "{said}");
    let said = folder.said("resume t.store --quiet");
    assert_eq!(said, "fetch cup\nfetch plate\ncareful\nfetch knife\nput knife\nput cup\n");
    let said = folder.said("replay t.store kitchen@2 --quiet");
    assert_eq!(said, "fetch cup\nfetch plate\ncareful\nfetch knife\nput knife\nput cup\n");
    let said = folder.said("tree t.store --diff kitchen@2 kitchen@3");
    assert_eq!(said, "");
    let said = folder.said("run e.plan --plan look --allow read=. --quiet");
    assert!(said.contains("(1 2 3)") && said.contains("(skip (path main (put :call 2)))"), "{said}");
    folder.said("store check t.store");
}

#[test]
fn edits_that_hold_no_more_are_listed() {
    let folder = Folder::new("orphans", &[("e.plan", EDITED)]);
    folder.said("run e.plan --plan improve --allow write=. --quiet");
    let changed = EDITED.replace("(fetch what) (put what)", "(fetch what)");
    std::fs::write(folder.join("e.plan"), changed).expect("a file can be written");
    let output = folder.run("run e.plan --store t.store --tree kitchen --quiet");
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(
        error.contains("note: an edit of the tree holds no more: (skip (path main (put :call 2)))"),
        "{error}"
    );
    assert!(error.contains("the program does not have this place any more"), "{error}");
    let said = String::from_utf8_lossy(&output.stdout);
    assert_eq!(said, "fetch cup\nfetch plate\ncareful\nfetch knife\n");
    let shown = folder.said("tree t.store kitchen");
    let skip =
        "an edit holds no more: (skip (path main (put :call 2))) by program e.plan: the program does not";
    assert!(shown.contains(skip), "{shown}");
}

/// Texts of the edits of a version, with who made them.
fn changes(folder: &Folder, store: &str, tree: &str) -> Vec<(String, String)> {
    let store = ::store::Store::read(&folder.0.join(store)).expect("it opens");
    let version = store.version(tree, None).expect("it is there");
    store
        .edits(&version)
        .expect("it is whole")
        .into_iter()
        .map(|(edit, _)| (edit.edit, edit.origin))
        .collect()
}

#[test]
fn edits_say_who_made_them() {
    let program = EDITED.to_string()
        + r#"
(def-plan transform ()
  (save-tree "t.store" 'kitchen
    (edit-tree (load-tree "t.store" 'kitchen) (list (before (path main fetch) '(print "go")))
               :origin "transformation hurry")))"#;
    let folder = Folder::new("origins", &[("e.plan", &program)]);
    folder.said("run e.plan --plan improve --allow write=. --quiet");
    assert!(changes(&folder, "t.store", "kitchen").iter().all(|(_, origin)| origin == "program e.plan"));
    folder.said("run e.plan --plan transform --allow write=. --allow read=. --quiet");
    folder.said("run e.plan --store t.store --tree kitchen --quiet");
    let made = changes(&folder, "t.store", "kitchen");
    let origins: Vec<&str> = made.iter().map(|(_, origin)| origin.as_str()).collect();
    let own = "program e.plan";
    assert_eq!(origins, [own, own, own, "transformation hurry"], "{made:?}");
    let json: serde_json::Value =
        serde_json::from_str(&folder.said("tree t.store kitchen --json")).expect("it is JSON");
    assert_eq!(json["edits"][3]["origin"], "transformation hurry");
    let shown = folder.said("tree t.store kitchen");
    assert!(shown.contains("edit (skip (path main (put :call 2))) by program e.plan\n"), "{shown}");
    // They keep it on their way to another store.
    folder.said("store export t.store t.json");
    folder.said("store import u.store t.json");
    assert_eq!(changes(&folder, "u.store", "kitchen"), made);
}

#[test]
fn what_is_exported_can_be_replayed_elsewhere() {
    let folder = work("transfer");
    folder.said("run work.plan --allow read=. --allow write=. --quiet --store a.store");
    std::fs::write(folder.join("e.plan"), EDITED).expect("a file can be written");
    folder.said("run e.plan --plan improve --allow write=. --quiet --store t.store");
    folder.said("run e.plan --store t.store --tree kitchen --quiet");
    for store in ["a", "t"] {
        folder.said(&format!("store export {store}.store {store}.json"));
        folder.said(&format!("store import b.store {store}.json"));
        let again = folder.said(&format!("store import b.store {store}.json"));
        assert!(again.lines().all(|line| line.ends_with("is there already")), "{again}");
    }
    // Where neither the programs nor the files are that they read.
    let elsewhere = Folder::new("transferred", &[]);
    std::fs::rename(folder.join("b.store"), elsewhere.join("b.store")).expect("it can be moved");
    std::fs::remove_file(folder.join("work.plan")).expect("it is there");
    std::fs::remove_file(folder.join("e.plan")).expect("it is there");
    elsewhere.said("store check b.store");
    let tree = |folder: &Folder, args: &str| {
        let json: serde_json::Value = serde_json::from_str(&folder.said(args)).expect("it is JSON");
        json["tree"].to_string()
    };
    let whole = tree(&folder, "tree a.store run-1 --json");
    assert!(whole == tree(&elsewhere, "tree b.store run-1 --json"), "the imported tree differs");
    assert!(whole == tree(&elsewhere, "replay b.store 1 --json"), "the replayed tree differs");
    let kitchen = tree(&folder, "tree t.store kitchen@2 --json");
    assert!(kitchen == tree(&elsewhere, "tree b.store kitchen@2 --json"), "the imported tree differs");
    let said = elsewhere.said("replay b.store kitchen@2 --quiet");
    assert_eq!(said, "fetch cup\nfetch plate\ncareful\nfetch knife\nput knife\nput cup\n");
}

#[test]
fn damaged_exports_are_errors_with_a_place() {
    let folder = Folder::new("exports", &[("e.plan", EDITED)]);
    folder.said("run e.plan --plan improve --allow write=. --quiet --store t.store");
    folder.said("run e.plan --store t.store --tree kitchen --quiet");
    folder.said("store export t.store t.json");
    let text = std::fs::read_to_string(folder.join("t.json")).expect("it was written");
    let import = |text: &str| {
        std::fs::write(folder.join("bad.json"), text).expect("a file can be written");
        let _ = std::fs::remove_file(folder.join("new.store"));
        let output = folder.run("store import new.store bad.json");
        assert!(output.status.code().is_some_and(|code| code <= 2), "{:?}", output.status);
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    // Torn anywhere.
    for part in 1..20 {
        let (code, error) = import(&text[..text.floor_char_boundary(text.len() * part / 20)]);
        assert!(code == Some(2) && error.contains("it is no JSON") && error.contains("line 1"), "{error}");
    }
    // Any value in another place, or one of another kind: an error, or a store that is whole.
    let json: serde_json::Value = serde_json::from_str(&text).expect("it is JSON");
    let mut places = Vec::new();
    paths(&json, String::new(), &mut places);
    for (number, place) in places.iter().enumerate().filter(|(number, _)| number % 7 == 0) {
        let others =
            [serde_json::json!(null), serde_json::json!(-1), serde_json::json!("x"), serde_json::json!([9])];
        let mut changed = json.clone();
        *changed.pointer_mut(place).expect("it is there") = others[number / 7 % 4].clone();
        let (code, error) = import(&changed.to_string());
        if code == Some(0) {
            let check = folder.run("store check new.store");
            assert!(check.status.success(), "{place}: {}", String::from_utf8_lossy(&check.stdout));
            for run in ["run-1", "kitchen"] {
                let code = folder.run(&format!("replay new.store {run} --quiet")).status.code();
                assert!(code.is_some_and(|code| code <= 2), "{place}");
                let code = folder.run(&format!("tree new.store {run} --json")).status.code();
                assert!(code.is_some_and(|code| code <= 2), "{place}");
            }
        } else {
            assert!(error.contains("bad.json"), "{place}: {error}");
        }
    }
}

/// Places of all values in a JSON value.
fn paths(json: &serde_json::Value, at: String, places: &mut Vec<String>) {
    match json {
        serde_json::Value::Object(all) => {
            all.iter().for_each(|(key, value)| {
                paths(value, format!("{at}/{}", key.replace('~', "~0").replace('/', "~1")), places)
            });
        }
        serde_json::Value::Array(all) => {
            all.iter().enumerate().for_each(|(key, value)| paths(value, format!("{at}/{key}"), places));
        }
        _ => {}
    }
    if !at.is_empty() {
        places.push(at);
    }
}

#[test]
fn a_program_may_save_into_the_store_of_its_run() {
    let folder = Folder::new("own", &[("e.plan", EDITED)]);
    folder.said("run e.plan --plan improve --allow write=. --quiet --store t.store");
    let listed = folder.said("tree t.store");
    assert!(listed.contains("run-1@1") && listed.contains("kitchen@1"), "{listed}");
    folder.said("store check t.store");
}
