//! The runs of an experiment on disk: a folder that can be gone on with, merged, and read by other programs.
//!
//! - `evaluation.json`: what was evaluated, with the edits of each variant
//! - `runs.csv`: a line for each run, written when it is done; sorted when all are done
//! - `evaluation.lock`: whoever writes holds it
//! - `variants.store`: the trees with the edits, for `pleach tree` and `pleach run --store … --tree …`
//!
//! Runs are keyed by case, variant and seed. A line that was cut off by the end of a process is dropped, for its run gives
//! the same again.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde_json::{Value as Json, json};
use store::{Store, StoreError, Writer};
use vm::persist::SavedTree;

use super::{Edits, Experiment, Run, Stop, list};
use crate::files::cannot_write;

/// The version of the files.
const FORMAT: u64 = 1;

/// What was evaluated.
pub const HEAD: &str = "evaluation.json";
/// The runs.
pub const RUNS: &str = "runs.csv";
/// Whom the folder belongs to.
const LOCK: &str = "evaluation.lock";
/// The trees.
const TREES: &str = "variants.store";

/// What was evaluated, and with which edits.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Head {
    /// The experiment.
    pub experiment: Experiment,
    /// Stands for the texts of the program and the library.
    pub program: String,
    /// The name of the plan file, for people.
    pub file: String,
    /// For each cell its edits, once it has been rehearsed.
    pub edits: Vec<Option<Edits>>,
    /// Which shard of how many this is.
    pub shard: Option<(u64, u64)>,
}

/// The runs of an experiment, by case, seed and variant.
pub type Runs = BTreeMap<(usize, u64, usize), Run>;

/// A folder that is written.
pub struct Folder {
    path: PathBuf,
    head: Head,
    runs: File,
    /// Nobody else writes while this is open.
    _lock: File,
}

impl Head {
    fn to_json(&self) -> Json {
        let mut json = json!({"format": FORMAT, "file": self.file, "program": self.program});
        if let Some((shard, of)) = self.shard {
            json["shard"] = json!(format!("{shard}/{of}"));
        }
        for (key, value) in self.experiment.to_json().as_object().into_iter().flatten() {
            json[key] = value.clone();
        }
        json["runs"] = json!(self.experiment.runs);
        json["edits"] = self.edits.iter().map(|it| it.as_ref().map_or(Json::Null, Edits::to_json)).collect();
        json
    }

    fn from_json(json: &Json) -> Option<Head> {
        let experiment =
            Experiment::from_json(json, json["runs"].as_u64()?).filter(|it| it.trouble().is_none())?;
        let edits = list(&json["edits"])?.iter().map(|it| match it {
            Json::Null => Some(None),
            it => Edits::from_json(it).map(Some),
        });
        let edits: Vec<Option<Edits>> = edits.collect::<Option<_>>()?;
        let shard = match json["shard"].as_str() {
            None => None,
            Some(text) => Some(shard(text).ok()?),
        };
        let fits = edits.len() == experiment.cells();
        let text = |key: &str| json[key].as_str().map(str::to_string);
        Some(Head { program: text("program")?, file: text("file")?, experiment, edits, shard })
            .filter(|_| fits)
    }

    /// Why two evaluations are not of the same thing.
    fn differs(&self, other: &Head) -> Option<&'static str> {
        let (one, two) = (self.experiment.to_json(), other.experiment.to_json());
        let what = [
            "experiment",
            "plan",
            "args",
            "factors",
            "cases",
            "variants",
            "measures",
            "seed",
            "accept",
            "seeds",
        ];
        let named = what.into_iter().find(|key| one[*key] != two[*key]);
        let named = named.map(|key| if key == "args" { "arguments" } else { key });
        named.or((self.program != other.program).then_some("program, or in the library"))
    }

    /// What is wanted, before anything of it is done.
    #[must_use]
    pub fn new(experiment: Experiment, program: String, file: String, shard: Option<(u64, u64)>) -> Head {
        Head { program, file, edits: vec![None; experiment.cells()], experiment, shard }
    }

    /// The cells that have not been rehearsed.
    #[must_use]
    pub fn unknown(&self) -> Vec<usize> {
        (0..self.edits.len()).filter(|cell| self.edits[*cell].is_none()).collect()
    }

    /// Is this seed one of the shard?
    #[must_use]
    pub fn is_mine(&self, seed: u64) -> bool {
        self.shard.is_none_or(|(shard, of)| (seed - self.experiment.seed) % of == shard - 1)
    }

    /// The variant that runs alike, for nothing was kept of this one's edits.
    #[must_use]
    pub fn stands_for(&self, case: usize, variant: usize) -> Option<usize> {
        let it = &self.experiment;
        let edits = self.edits[it.cell(case, variant)].as_ref()?;
        let as_written = |other: usize| {
            let theirs = self.edits[it.cell(case, other)].as_ref();
            it.variants[other].plan == it.variants[variant].plan && theirs.is_some_and(|it| !it.rehearsed)
        };
        // Plans of their own are not compared: they may differ in their arguments.
        let void = edits.is_void() && it.variants[variant].plan.is_none();
        (0..it.variants.len()).filter(|other| void && *other != variant).find(|other| as_written(*other))
    }

    /// The runs that are wanted: a seed with all its variants after the other, so that what is done when it is stopped is
    /// pairs. Variants that have nothing to run are left out.
    #[must_use]
    pub fn wanted(&self) -> Vec<(usize, usize, u64)> {
        let it = &self.experiment;
        let seeds = (it.seed..it.seed.saturating_add(it.runs)).filter(|seed| self.is_mine(*seed));
        let cells = (0..it.cases.len()).flat_map(|case| (0..it.variants.len()).map(move |at| (case, at)));
        let runs = |(case, variant)| {
            let edits = self.edits[it.cell(case, variant)].as_ref();
            edits.is_some_and(|it| it.why.is_none()) && self.stands_for(case, variant).is_none()
        };
        let cells: Vec<_> = cells.filter(|cell| runs(*cell)).collect();
        seeds.flat_map(|seed| cells.iter().map(move |(case, variant)| (*case, *variant, seed))).collect()
    }

    fn tree_of(&self, cell: usize) -> String {
        let variants = self.experiment.variants.len();
        self.tree_name(cell / variants, cell % variants)
    }

    /// The name of the tree of a cell in the store.
    #[must_use]
    pub fn tree_name(&self, case: usize, variant: usize) -> String {
        let (name, case) = (&self.experiment.variants[variant].name, self.experiment.case_text(case));
        let name = if case.is_empty() { name.clone() } else { format!("{name}, {case}") };
        name.replace('@', " ")
    }
}

/// `i/n`, the i-th of n parts.
///
/// # Errors
/// It is not.
pub fn shard(text: &str) -> Result<(u64, u64), String> {
    let numbers = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
    numbers
        .filter(|(i, n): &(u64, u64)| 1 <= *i && i <= n)
        .ok_or_else(|| format!("`{text}` is no shard: i/n, the i-th of n, as in 2/4"))
}

/// Reads what is in a folder; nothing if there is no evaluation in it.
///
/// # Errors
/// It cannot be read, or is damaged.
pub fn read(path: &Path) -> Result<Option<(Head, Runs)>, String> {
    let head_path = path.join(HEAD);
    if !head_path.exists() {
        return Ok(None);
    }
    let text = crate::files::read_text(&head_path)?;
    let json: Json = serde_json::from_str(&text)
        .map_err(|error| format!("{} is no JSON: {error}", head_path.display()))?;
    if json["format"] != FORMAT {
        return Err(format!(
            "{} is of format {}, and this version of pleach knows {FORMAT}: evaluate again into another folder",
            head_path.display(),
            json["format"]
        ));
    }
    let head = Head::from_json(&json).ok_or_else(|| format!("{} is damaged", head_path.display()))?;
    let runs_path = path.join(RUNS);
    let runs = match runs_path.exists() {
        true => {
            let text = crate::files::read_text(&runs_path)?;
            runs_of(&head, whole_lines(&text)).map_err(|why| format!("{}: {why}", runs_path.display()))?
        }
        false => Runs::new(),
    };
    Ok(Some((head, runs)))
}

/// What of a text ends with the end of a line.
fn whole_lines(text: &str) -> &str {
    &text[..text.rfind('\n').map_or(0, |at| at + 1)]
}

/// The names of the columns of `runs.csv`.
#[must_use]
pub fn columns(it: &Experiment) -> Vec<String> {
    let words = |words: &[&str]| words.iter().map(|it| (*it).to_string()).collect::<Vec<_>>();
    [
        words(&["experiment"]),
        it.factors.clone(),
        words(&["variant", "seed", "status", "success", "why"]),
        it.measures.clone(),
    ]
    .concat()
}

/// The first line of `runs.csv`.
fn names(it: &Experiment) -> Vec<String> {
    columns(it).iter().map(|name| harmless(name)).collect()
}

/// A run as the cells of its line.
fn cells(it: &Experiment, run: &Run) -> Vec<String> {
    let number = |number: &Option<f64>| number.map_or(String::new(), |it| json!(it).to_string());
    let mut cells = vec![it.name.clone()];
    cells.extend(it.cases[run.case].iter().cloned());
    cells.extend([
        it.variants[run.variant].name.clone(),
        run.seed.to_string(),
        run.status.clone(),
        run.success.to_string(),
        run.why.clone(),
    ]);
    cells.iter_mut().for_each(|cell| *cell = harmless(cell));
    cells.extend(run.numbers.iter().map(number));
    cells
}

/// Programs for tables take a text that begins like a formula for one: it gets a `'` before it.
fn harmless(cell: &str) -> String {
    let is_formula = cell.starts_with(['=', '+', '-', '@', '\t', '\'']) && cell.parse::<f64>().is_err();
    if is_formula { format!("'{cell}") } else { cell.to_string() }
}

/// The text as it was.
fn plain(cell: &str) -> &str {
    cell.strip_prefix('\'').unwrap_or(cell)
}

fn line(cells: &[String]) -> Result<Vec<u8>, String> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(cells).map_err(|error| error.to_string())?;
    writer.into_inner().map_err(|error| error.to_string())
}

fn runs_of(head: &Head, text: &str) -> Result<Runs, String> {
    let it = &head.experiment;
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let names = reader.headers().map_err(|error| error.to_string())?;
    if !text.is_empty() && !names.iter().eq(self::names(it).iter()) {
        return Err("its columns are not those of the experiment".into());
    }
    let mut runs = Runs::new();
    for (row, record) in reader.records().enumerate() {
        let record = record.map_err(|error| error.to_string())?;
        let cells: Vec<&str> = record.iter().collect();
        let run =
            run_of(it, &cells).ok_or_else(|| format!("line {} is no run of the experiment", row + 2))?;
        runs.insert((run.case, run.seed, run.variant), run);
    }
    Ok(runs)
}

fn run_of(it: &Experiment, cells: &[&str]) -> Option<Run> {
    let (values, rest) = cells.get(1..)?.split_at_checked(it.factors.len())?;
    let [variant, seed, status, success, why, numbers @ ..] = rest else { return None };
    let number = |cell: &&str| if cell.is_empty() { Some(None) } else { cell.parse().ok().map(Some) };
    let same = |case: &Vec<String>| case.iter().zip(values).all(|(value, cell)| value == plain(cell));
    let is_wanted = |seed: &u64| seed.checked_sub(it.seed).is_some_and(|at| at < it.runs);
    Some(Run {
        case: it.cases.iter().position(same)?,
        variant: it.variants.iter().position(|it| it.name == plain(variant))?,
        seed: seed.parse().ok().filter(is_wanted)?,
        status: plain(status).to_string(),
        success: success.parse().ok()?,
        why: plain(why).to_string(),
        numbers: numbers.iter().map(number).collect::<Option<_>>()?,
    })
}

/// Writes a file beside its place, and puts it there when it is whole.
///
/// # Errors
/// It cannot be written.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), String> {
    let beside = path.with_extension("part");
    let write = || {
        let mut file = File::create(&beside)?;
        file.write_all(bytes)?;
        file.sync_all()?;
        std::fs::rename(&beside, path)
    };
    write().map_err(|error| cannot_write(path, &error))
}

impl Folder {
    /// Opens a folder to write the runs of an experiment, and gives those that it has. `head` says what is wanted; edits
    /// that are known are taken from the folder.
    ///
    /// # Errors
    /// It cannot be written, is damaged, or holds the runs of something else.
    pub fn open(path: &Path, mut head: Head) -> Result<(Folder, Runs), String> {
        let cannot = |error| cannot_write(path, &error);
        std::fs::create_dir_all(path).map_err(cannot)?;
        let lock = File::create(path.join(LOCK)).map_err(cannot)?;
        if store::lock_file(&lock).is_err() {
            return Err(format!("another evaluation is writing into {}", path.display()));
        }
        let mut runs = Runs::new();
        if let Some((old, done)) = read(path)? {
            if let Some(what) = old.differs(&head) {
                return Err(format!(
                    "{} holds runs of something else, which differs in its {what}; name another folder, or remove this one",
                    path.display()
                ));
            }
            if old.shard != head.shard {
                return Err(format!(
                    "{} holds the runs of another shard; give each shard a folder of its own",
                    path.display()
                ));
            }
            head.experiment.runs = head.experiment.runs.max(old.experiment.runs);
            head.edits = old.edits;
            runs = done;
        }
        let runs_path = path.join(RUNS);
        let mut file = OpenOptions::new().create(true).append(true).open(&runs_path).map_err(cannot)?;
        let text = crate::files::read_text(&runs_path)?;
        file.set_len(whole_lines(&text).len() as u64).map_err(cannot)?;
        if whole_lines(&text).is_empty() {
            file.write_all(&line(&names(&head.experiment))?).map_err(cannot)?;
        }
        let folder = Folder { path: path.to_path_buf(), head, runs: file, _lock: lock };
        folder.write_head()?;
        Ok((folder, runs))
    }

    /// What is evaluated.
    #[must_use]
    pub fn head(&self) -> &Head {
        &self.head
    }

    fn write_head(&self) -> Result<(), String> {
        let text = serde_json::to_string_pretty(&self.head.to_json()).map_err(|error| error.to_string())?;
        write_whole(&self.path.join(HEAD), format!("{text}\n").as_bytes())
    }

    /// Keeps the edits of a cell, with the tree that carries them.
    ///
    /// # Errors
    /// They cannot be written.
    pub fn set_edits(&mut self, cell: usize, edits: Edits, tree: Option<&SavedTree>) -> Result<(), String> {
        let path = self.path.join(TREES);
        let said = |error: StoreError| error.to_string();
        let name = self.head.tree_of(cell);
        if let Some(tree) = tree
            && Store::read(&path).and_then(|store| store.version(&name, Some(1))).is_err()
        {
            Writer::put(Store::write(&path).map_err(said)?, &name, None, tree, "evaluate").map_err(said)?;
        }
        self.head.edits[cell] = Some(edits);
        self.write_head()
    }

    /// The trees of all cells that have one. Who takes the numbers with them may leave the trees behind: such cells are to be
    /// rehearsed again.
    pub fn trees(&mut self) -> Vec<Option<SavedTree>> {
        let mut trees = Vec::new();
        for cell in 0..self.head.edits.len() {
            let tree = self.tree(cell);
            if tree.is_err() {
                self.head.edits[cell] = None;
            }
            trees.push(tree.ok().flatten());
        }
        trees
    }

    fn tree(&self, cell: usize) -> Result<Option<SavedTree>, StoreError> {
        if self.head.edits[cell].as_ref().is_none_or(|it| it.kept.is_empty()) {
            return Ok(None);
        }
        let store = Store::read(&self.path.join(TREES))?;
        // Who has run such a tree by hand has made more versions of it.
        store.tree(&store.version(&self.head.tree_of(cell), Some(1))?).map(Some)
    }

    /// Keeps a run.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn add(&mut self, run: &Run) -> Result<(), Stop> {
        let bytes = line(&cells(&self.head.experiment, run))?;
        let cannot = |error| Stop::Because(cannot_write(&self.path.join(RUNS), &error));
        self.runs.write_all(&bytes).map_err(cannot)
    }

    /// All runs in their order instead of that of the clock.
    ///
    /// # Errors
    /// They cannot be written.
    pub fn finish(&mut self, runs: &Runs) -> Result<(), String> {
        let path = self.path.join(RUNS);
        write_whole(&path, &csv(&self.head.experiment, runs)?)?;
        let file = OpenOptions::new().append(true).open(&path);
        self.runs = file.map_err(|error| cannot_write(&path, &error))?;
        Ok(())
    }
}

/// The runs as a table of text.
///
/// # Errors
/// None that can be thought of.
pub fn csv(it: &Experiment, runs: &Runs) -> Result<Vec<u8>, String> {
    let mut bytes = line(&names(it))?;
    for run in runs.values() {
        bytes.extend(line(&cells(it, run))?);
    }
    Ok(bytes)
}

/// Brings folders of one experiment together into another one, which may be there already. Runs that are there more than
/// once have to be the same.
///
/// # Errors
/// A folder cannot be read or written, or they are of different things.
pub fn merge(from: &[(PathBuf, Head, Runs)], into: &Path) -> Result<(Head, Runs), String> {
    let (first, head, _) = from.first().ok_or("there is nothing to merge")?;
    let mut head = Head { shard: None, ..head.clone() };
    let (mut all, mut whence) = (Runs::new(), BTreeMap::new());
    let there = read(into)?.map(|(head, runs)| (into.to_path_buf(), head, runs));
    for (path, other, runs) in there.iter().chain(from) {
        let what = head.differs(other).or((head.edits != other.edits).then_some("list of edits"));
        if let Some(what) = what {
            return Err(format!(
                "{} and {} are of different things, which differ in their {what}",
                first.display(),
                path.display()
            ));
        }
        head.experiment.runs = head.experiment.runs.max(other.experiment.runs);
        for (key, run) in runs {
            let from = whence.entry(*key).or_insert(path);
            if all.entry(*key).or_insert_with(|| run.clone()) != run {
                return Err(format!(
                    "{} and {} have different numbers for {} under seed {}: one of them was changed by hand, or made by another program",
                    from.display(),
                    path.display(),
                    head.tree_name(run.case, run.variant),
                    run.seed
                ));
            }
        }
    }
    let (mut folder, _) = Folder::open(into, head)?;
    let trees = first.join(TREES);
    if trees.exists() && !into.join(TREES).exists() {
        std::fs::copy(&trees, into.join(TREES))
            .map_err(|error| format!("cannot copy {}: {}", trees.display(), crate::files::why(&error)))?;
    }
    folder.finish(&all)?;
    Ok((folder.head, all))
}
