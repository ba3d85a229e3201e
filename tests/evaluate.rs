//! Evaluations: the same numbers however they are made, gone on with after any stop, and merged from any parts.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};

use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::record::RowAccessor as _;
use pleach::evaluate::export::Format;
use pleach::evaluate::folder::{self, Head, RUNS, Runs};
use pleach::evaluate::report;
use pleach::evaluate::summary::Table;
use pleach::evaluate::work::{Watch, evaluate};
use pleach::evaluate::worker::{Program, Worker};
use pleach::evaluate::{Experiment, Stop};

use crate::dice::Dice;
use crate::folder::Folder;

/// A plan with waste, luck, and a way to fail.
const NAPS: &str = "tests/evaluate/naps.plan";

/// Says no when it has been asked so often.
struct Patience(AtomicUsize);

impl Patience {
    fn of(n: usize) -> Patience {
        Patience(AtomicUsize::new(n))
    }
    fn endless() -> Patience {
        Patience::of(usize::MAX)
    }
}

impl Watch for Patience {
    fn begins(&self, _what: &str, _done: usize, _of: usize) {}
    fn did(&self) {}
    fn goes_on(&self) -> bool {
        self.0.fetch_update(Ordering::SeqCst, Ordering::SeqCst, |left| left.checked_sub(1)).is_ok()
    }
}

fn program(file: &str) -> Program {
    Program { file: file.into(), ..Program::default() }
}

/// The one experiment of a program, and what it is evaluated as.
fn head(program: &Program, runs: u64) -> Head {
    let mut worker = Worker::new(program, &|| true).expect("it can be loaded");
    let experiment = worker.experiments().expect("they are right").remove(0);
    let experiment = Experiment { runs, ..experiment };
    let fingerprint = worker.fingerprint();
    Head::new(experiment, fingerprint, "naps.plan".into(), None)
}

/// Evaluates it, and gives the bytes of its runs.
fn done(program: &Program, head: &Head, threads: usize, folder: &Path) -> Vec<u8> {
    let patience = Patience::endless();
    let all = evaluate(program, (0, head.clone()), threads, Some(folder), &patience).expect("it works");
    assert!(!all.stopped);
    report::write(folder, &Table::of(&all.head, &all.runs), &all.runs, &[]).expect("it can be written");
    std::fs::read(folder.join(RUNS)).expect("they are there")
}

/// What is made of the runs at the end, without the trees.
const FILES: [&str; 6] =
    [RUNS, "evaluation.json", "summary.json", "report.html", "seconds.svg", "seconds-by-n.svg"];

#[track_caller]
fn assert_same(one: &Path, other: &Path) {
    for name in FILES {
        let read = |folder: &Path| {
            String::from_utf8_lossy(&std::fs::read(folder.join(name)).expect(name)).into_owned()
        };
        assert!(read(one) == read(other), "{name} of {} and {} differ", one.display(), other.display());
    }
}

#[test]
fn the_same_numbers_on_any_number_of_threads() {
    let folder = Folder::new("evaluate-threads", &[]);
    let program = program(NAPS);
    let head = head(&program, 12);
    done(&program, &head, 1, &folder.join("one"));
    done(&program, &head, 3, &folder.join("three"));
    assert_same(&folder.join("one"), &folder.join("three"));
}

/// Stopped a little later each time, with the end of the last line cut off now and then.
#[test]
fn a_stopped_evaluation_goes_on_where_it_was() {
    let folder = Folder::new("evaluate-stopped", &[]);
    let program = program(NAPS);
    let head = head(&program, 5);
    done(&program, &head, 1, &folder.join("whole"));
    let mut dice = Dice::new(7);
    for stop in [3, 10, 25, 40] {
        let path = folder.join(&format!("stopped-{stop}"));
        let mut stops = 0;
        loop {
            let all = evaluate(&program, (0, head.clone()), 2, Some(&path), &Patience::of(stop + 5 * stops))
                .expect("it can be gone on with");
            if !all.stopped {
                break;
            }
            stops += 1;
            assert!(stops < 1000, "it comes to no end");
            let runs = path.join(RUNS);
            let text = std::fs::read_to_string(&runs).expect("it is there");
            let cut = dice.below(12).min(text.len());
            if text.is_char_boundary(text.len() - cut) {
                std::fs::write(&runs, &text[..text.len() - cut]).expect("it can be written");
            }
        }
        assert!(stops > 0, "it was not stopped");
        done(&program, &head, 1, &path);
        assert_same(&folder.join("whole"), &path);
    }
}

#[test]
fn more_runs_go_on_with_those_that_there_are() {
    let folder = Folder::new("evaluate-more", &[]);
    let program = program(NAPS);
    done(&program, &head(&program, 4), 1, &folder.join("more"));
    done(&program, &head(&program, 9), 1, &folder.join("more"));
    done(&program, &head(&program, 9), 1, &folder.join("whole"));
    assert_same(&folder.join("whole"), &folder.join("more"));
}

#[test]
fn trees_that_were_left_behind_are_found_again() {
    let folder = Folder::new("evaluate-trees", &[]);
    let program = program(NAPS);
    let path = folder.join("one");
    done(&program, &head(&program, 3), 1, &path);
    for name in ["variants.store", "variants.store-writer"] {
        std::fs::remove_file(path.join(name)).expect("it is there");
    }
    done(&program, &head(&program, 6), 1, &path);
    done(&program, &head(&program, 6), 1, &folder.join("whole"));
    assert_same(&folder.join("whole"), &path);
    assert!(path.join("variants.store").exists());
}

#[test]
fn shards_are_merged_in_any_order_and_merging_again_changes_nothing() {
    let folder = Folder::new("evaluate-shards", &[]);
    let program = program(NAPS);
    let head = head(&program, 11);
    done(&program, &head, 2, &folder.join("whole"));
    let mut parts = Vec::new();
    for shard in [3, 1, 2] {
        let path = folder.join(&format!("part-{shard}"));
        done(&program, &Head { shard: Some((shard, 3)), ..head.clone() }, 1, &path);
        let (head, runs) = folder::read(&path).expect("it is whole").expect("it is there");
        parts.push((path, head, runs));
    }
    let merged = folder.join("merged");
    for parts in [&parts[..2], &parts[1..], &parts[..], &parts[2..]] {
        folder::merge(parts, &merged).expect("they belong together");
    }
    let (head, runs) = folder::read(&merged).expect("it is whole").expect("it is there");
    report::write(&merged, &Table::of(&head, &runs), &runs, &[]).expect("it can be written");
    assert_same(&folder.join("whole"), &merged);
}

#[test]
fn what_does_not_belong_together_is_not_mixed() {
    let folder = Folder::new("evaluate-mixed", &[]);
    let program = program(NAPS);
    let head = head(&program, 3);
    let path = folder.join("one");
    done(&program, &head, 1, &path);
    let patience = Patience::endless();
    let mut other = head.clone();
    other.experiment.args = vec!["4".into()];
    let args = other;
    let mut other = head.clone();
    other.experiment.seed = 2;
    let refused = |head: Head| match evaluate(&program, (0, head), 1, Some(&path), &patience) {
        Err(Stop::Because(why)) => why,
        _ => panic!("it is another one"),
    };
    assert!(refused(other).contains("differs in its seed"));
    assert!(refused(args).contains("differs in its arguments"));
    assert!(refused(Head { program: "0".into(), ..head.clone() }).contains("program"));
    assert!(refused(Head { shard: Some((1, 2)), ..head.clone() }).contains("another shard"));
    // Numbers that were changed by hand.
    let (head, mut runs) = folder::read(&path).expect("it is whole").expect("it is there");
    let before = runs.clone();
    if let Some(run) = runs.values_mut().next() {
        run.numbers[0] = Some(1e6);
    }
    let parts = [(path.clone(), head.clone(), before), (folder.join("other"), head, runs)];
    let why = folder::merge(&parts, &folder.join("merged")).expect_err("they differ");
    assert!(why.contains("different numbers"), "{why}");
}

/// What is wrong is said alike however many threads there are, and not as if somebody had stopped it.
#[test]
fn the_first_error_is_said() {
    let folder = Folder::new("evaluate-errors", &[]);
    let file = folder.join("wrong.plan");
    let text = r#"
        (use experiment)
        (def-plan p () (sleep (random 9)))
        (def-experiment wrong "A measure that is none." :plan (p) :runs 40
          :measures ((mood (if (< (tree-end tree) 3) "bad" 1))))"#;
    std::fs::write(&file, text).expect("it can be written");
    let program = Program { file, ..Program::default() };
    let why = |threads: usize, seed: u64| {
        let program = Program { seed: Some(seed), ..program.clone() };
        let head = head(&program, 40);
        match evaluate(&program, (0, head), threads, None, &Patience::endless()) {
            Err(Stop::Because(why)) => why,
            Err(Stop::Asked) => panic!("nobody has asked"),
            Ok(_) => panic!("a measure is no number"),
        }
    };
    for seed in 1..8 {
        assert_eq!(why(1, seed), why(3, seed));
    }
}

/// Nothing is left out that would not run as another variant does.
#[test]
fn only_what_runs_as_another_variant_is_left_out() {
    let folder = Folder::new("evaluate-void", &[]);
    let file = folder.join("void.plan");
    let text = r#"
        (use experiment)
        (use transformation)
        (def-plan yawn () (sleep 1))
        (def-plan p () (yawn))
        (def-plan q () (sleep 20))
        (def-transformation lively "No yawns." :applicable (task-name ?yawn yawn) :rewrite (list (skip ?yawn)))
        (def-transformation never "Nothing." :applicable (task-name ?snore snore) :rewrite (list (skip ?snore)))
        (def-experiment void "Which of them run?" :plan (p) :runs 3
          :variants (never lively (other :only (never) :plan (q)) (again :only (never))))"#;
    std::fs::write(&file, text).expect("it can be written");
    let runs = |variants: &[&str]| -> Vec<usize> {
        let variants: Vec<String> = variants.iter().map(|it| (*it).to_string()).collect();
        let program = Program { file: file.clone(), variants, ..Program::default() };
        let head = head(&program, 3);
        let all = evaluate(&program, (0, head), 1, None, &Patience::endless()).expect("it works");
        let of = |variant| all.runs.values().filter(|run| run.variant == variant).count();
        (0..all.head.experiment.variants.len()).map(of).collect()
    };
    assert_eq!(runs(&[]), [3, 3, 3, 3]);
    assert_eq!(runs(&["none", "never", "lively", "other"]), [3, 0, 3, 3]);
    assert_eq!(runs(&["lively", "never"]), [3, 3]);
    assert_eq!(runs(&["never", "none"]), [0, 3]);
}

/// A run of an evaluation is what `pleach run` gives under its seed.
#[test]
fn a_run_can_be_done_by_itself() {
    let program = program(NAPS);
    let head = head(&program, 4);
    let all = evaluate(&program, (0, head), 1, None, &Patience::endless()).expect("it works");
    for run in all.runs.values().filter(|run| run.variant == 0) {
        let n = &all.head.experiment.cases[run.case][0];
        let said = Command::new(env!("CARGO_BIN_EXE_pleach"))
            .args(["run", NAPS, "--json", "--plan", "rest-well", "--arg", n, "--seed", &run.seed.to_string()])
            .stderr(Stdio::null())
            .output()
            .expect("it can be called");
        let json: serde_json::Value = serde_json::from_slice(&said.stdout).expect("it is JSON");
        assert_eq!((json["outcome"].as_str(), json["clock"].as_f64()), (Some(&*run.status), run.numbers[0]));
    }
}

/// Bytes are changed and cut off: it is read, or said what is wrong with it.
#[test]
fn damaged_folders_are_said_to_be() {
    let folder = Folder::new("evaluate-damaged", &[]);
    let program = program(NAPS);
    let path = folder.join("one");
    done(&program, &head(&program, 3), 1, &path);
    let mut dice = Dice::new(1);
    for name in [RUNS, folder::HEAD] {
        let whole = std::fs::read(path.join(name)).expect("it is there");
        for _ in 0..300 {
            let mut bytes = whole.clone();
            for _ in 0..1 + dice.below(3) {
                let at = dice.below(bytes.len());
                let new = b"\",\n\\{}[]=-0aZ\xff\x00";
                bytes[at] = new[dice.below(new.len())];
            }
            bytes.truncate(if dice.chance(30) { dice.below(bytes.len()) } else { bytes.len() });
            std::fs::write(path.join(name), bytes).expect("it can be written");
            if let Ok(Some((head, runs))) = folder::read(&path) {
                let _ = Table::of(&head, &runs).to_json();
            }
        }
        std::fs::write(path.join(name), whole).expect("it can be written");
    }
}

#[test]
fn other_programs_read_the_runs() {
    let folder = Folder::new("evaluate-formats", &[]);
    let program = program(NAPS);
    let path = folder.join("one");
    done(&program, &head(&program, 6), 1, &path);
    let (head, runs) = folder::read(&path).expect("it is whole").expect("it is there");
    let table = Table::of(&head, &runs);
    report::write(&path, &table, &runs, &[Format::Csv, Format::Json, Format::Parquet])
        .expect("it can be written");
    let text = std::fs::read_to_string(path.join("runs.json")).expect("it is there");
    let json: Vec<serde_json::Value> = serde_json::from_str(&text).expect("it is JSON");
    assert_eq!(json.len(), runs.len());
    let file = std::fs::File::open(path.join("runs.parquet")).expect("it is there");
    let reader = SerializedFileReader::new(file).expect("it is Parquet");
    let names = folder::columns(&head.experiment);
    let at = |name: &str| names.iter().position(|it| it == name).expect("there is such a column");
    for ((row, run), object) in reader.get_row_iter(None).expect("it has rows").zip(runs.values()).zip(&json)
    {
        let row = row.expect("it is a row");
        assert_eq!(row.get_long(at("seed")).ok(), Some(run.seed as i64));
        assert_eq!(row.get_bool(at("success")).ok(), Some(run.success));
        assert_eq!(row.get_string(at("variant")).ok(), Some(&head.experiment.variants[run.variant].name));
        let measures = &head.experiment.measures;
        for (name, number) in measures.iter().zip(&run.numbers) {
            assert_eq!(row.get_double(at(name)).ok(), *number, "{name}");
            assert_eq!(object[name.as_str()].as_f64(), *number, "{name}");
        }
    }
}

/// Texts that a table would take for formulas, and texts with its own signs in them.
#[test]
fn texts_stay_texts() {
    let folder = Folder::new("evaluate-texts", &[]);
    let file = folder.join("evil.plan");
    let text = r#"
        (use experiment)
        (def-failure =cmd)
        (def-plan p (how)
          (fail =cmd :message "=1+2, \"quoted\"\nand <b>more</b>\r\n"))
        (def-experiment evil "<script>alert(1)</script>" :plan (p how) :factors ((how "=x" "-y,z" "+\"")) :runs 2)"#;
    std::fs::write(&file, text).expect("it can be written");
    let program = Program { file, ..Program::default() };
    let path = folder.join("one");
    let bytes = done(&program, &head(&program, 2), 1, &path);
    let mut reader = csv::Reader::from_reader(bytes.as_slice());
    let rows: Vec<csv::StringRecord> = reader.records().collect::<Result<_, _>>().expect("it is a table");
    assert_eq!(rows.len(), 6);
    assert!(rows.iter().flatten().all(|cell| !cell.starts_with(['=', '+', '-', '@'])));
    let (head, runs): (Head, Runs) = folder::read(&path).expect("it is whole").expect("it is there");
    assert_eq!(runs.len(), 6);
    // What is read back is what was measured.
    let fresh = evaluate(&program, (0, head), 1, None, &Patience::endless()).expect("it works");
    assert_eq!(fresh.runs, runs);
    let page = std::fs::read_to_string(path.join(report::PAGE)).expect("it is there");
    assert!(!page.contains("<script>alert") && !page.contains("<b>more"));
}

/// The recipe of the documents for GNU parallel.
#[test]
fn gnu_parallel_does_the_shards() {
    let there = Command::new("parallel").arg("--version").output();
    if !there.is_ok_and(|it| String::from_utf8_lossy(&it.stdout).contains("GNU")) {
        return println!("GNU parallel is not installed: `.ci/install-parallel` does it");
    }
    let folder = Folder::new("evaluate-parallel", &[]);
    let recipe = include_str!("../stdlib/plans/EXPERIMENTS.md");
    let (_, recipe) = recipe.split_once("<!-- GNU parallel -->\n```sh\n").expect("there is a recipe");
    let (recipe, _) = recipe.split_once("```").expect("it ends");
    std::fs::copy(NAPS, folder.join("kitchen.plan")).expect("it can be copied");
    let output = folder.shell(&format!("set -e\n{recipe}"));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let program = program(NAPS);
    done(&program, &head(&program, 200), 2, &folder.join("whole"));
    // The name of the file stands in what was evaluated.
    for name in [RUNS, "summary.json"] {
        let read = |path: PathBuf| std::fs::read_to_string(path).expect("it is there");
        assert!(
            read(folder.join("results/naps").join(name)) == read(folder.join("whole").join(name)),
            "{name}"
        );
    }
}
