//! `pleach check`: all that is wrong with files, without running them.

use std::collections::BTreeSet;
use std::path::Path;

use clap::Args;
use compiler::{Loaded, Report};
use pleach::{Options, Session};
use serde_json::{Value as Json, json};
use vm::code::{FnId, Pc};
use vm::native::Effect;
use vm::op::Operand;
use vm::value::{Imm, Value};

use super::{Answer, ERRORS, Paths, count, files, json, term};

pub const HELP: &str = "\
Examples:
  pleach check kitchen.plan
  pleach check plans/ --json
  pleach check kitchen.plan --code       the instructions that the compiler made
  pleach check stranger.plan --grants    what it must be allowed: `read: read-file at FILE:LINE:COLUMN`

--grants looks at all functions of the files and all that they call; code that edits of trees bring
in while the program runs is not seen.

--json prints one object: {errors: N, warnings: N, reports: [{severity, code, message, help, file,
line, column, end-line, end-column, labels: [{text, file, line, column, …}]}]}, with --grants also
grants: [{effect, native, file, line, column}].
Exit codes: 0 no errors · 2 errors.";

/// `pleach check`
#[derive(Args)]
pub struct Check {
    #[command(flatten)]
    paths: Paths,
    /// Print the instructions of each function
    #[arg(long)]
    code: bool,
    /// List what the program must be allowed with --allow
    #[arg(long)]
    grants: bool,
    /// Print the reports as JSON
    #[arg(long)]
    json: bool,
}

/// What has been found in all files.
#[derive(Default)]
struct Findings {
    errors: usize,
    warnings: usize,
    reports: Vec<Json>,
    grants: Vec<Json>,
    /// What has been shown: modules that several files use are shown once.
    shown: BTreeSet<String>,
}

/// Checks files.
pub fn run(it: &Check) -> Answer {
    let mut findings = Findings::default();
    let paths = files::plans(&it.paths.paths)?;
    for path in &paths {
        check_file(it, path, &mut findings);
    }
    let Findings { errors, warnings, reports, grants, .. } = findings;
    if it.json {
        let mut json = json!({"errors": errors, "warnings": warnings, "reports": reports});
        if it.grants {
            json["grants"] = json!(grants);
        }
        term::say(&format!("{json}\n"));
    } else if errors + warnings > 0 {
        term::complain(&format!("{}, {}\n", count(errors, "error"), count(warnings, "warning")));
    }
    Ok(if errors > 0 { ERRORS } else { 0 })
}

/// Checks one file, as a program of its own.
fn check_file(it: &Check, path: &Path, findings: &mut Findings) {
    let mut session = Session::new(Options { style: term::error_style(), ..Options::default() });
    let loaded = match session.load_file(path) {
        Ok(loaded) => loaded,
        Err(why) => {
            findings.errors += 1;
            let trouble = files::unreadable(path, why);
            match it.json {
                true => findings.reports.push(json!({"severity": "error", "code": null, "message": trouble.what, "help": trouble.help, "file": path})),
                false => term::complain(&term::trouble(&trouble)),
            }
            return;
        }
    };
    loaded.reports.iter().for_each(|report| add(it, &session, report, findings));
    if !loaded.reports.iter().all(Report::is_warning) {
        return;
    }
    if it.code {
        term::say(&code(&session, path));
    }
    if it.grants {
        grants(it, &session, &loaded, findings);
    }
}

fn add(it: &Check, session: &Session, report: &Report, findings: &mut Findings) {
    let text = session.report(report);
    if !findings.shown.insert(text.clone()) {
        return;
    }
    match report.is_warning() {
        true => findings.warnings += 1,
        false => findings.errors += 1,
    }
    match it.json {
        true => findings.reports.push(json::report(&session.files, report)),
        false => term::complain(&text),
    }
}

/// The instructions of all functions of a file, in the order of the source.
fn code(session: &Session, path: &Path) -> String {
    let program = &session.machine.program;
    let name = path.display().to_string();
    let of_file = |place: vm::Place| {
        session.files.get(grammar::FileId(place.file)).is_some_and(|file| file.name == name)
    };
    let mut functions: Vec<FnId> = (0..program.functions.len() as u32).map(FnId).collect();
    functions.retain(|id| program.functions[id.at()].end > program.functions[id.at()].entry);
    functions.retain(|id| of_file(program.functions[id.at()].place));
    functions.sort_by_key(|id| program.functions[id.at()].place.start);
    functions.iter().map(|id| vm::disasm::function(program, *id) + "\n").collect()
}

/// Lists natives with effects that the program can reach, each with where it is mentioned.
fn grants(it: &Check, session: &Session, loaded: &Loaded, findings: &mut Findings) {
    for (effect, name, pc) in effects(session, &loaded.init) {
        let place = session.machine.program.places.get(pc.at()).copied().unwrap_or_default();
        let line = format!("{}: {name} at {}\n", effect.name(), session.files.show(place));
        if !findings.shown.insert(line.clone()) {
            continue;
        }
        if it.json {
            let mut json = json!({"effect": effect.name(), "native": name});
            if let (Json::Object(json), Json::Object(place)) = (&mut json, json::place(&session.files, place))
            {
                json.extend(place);
            }
            findings.grants.push(json);
        } else {
            term::say(&line);
        }
    }
}

/// The natives with effects that instructions mention, in functions of the program, in what runs
/// when it is loaded, and in all that these mention.
fn effects(session: &Session, init: &[FnId]) -> Vec<(Effect, &'static str, Pc)> {
    let program = &session.machine.program;
    let own = session.front.modules.get(session.module).names.values();
    let own = own.filter_map(|definition| match definition.meaning {
        compiler::module::Meaning::Function(id, _) | compiler::module::Meaning::Plan(id, _) => Some(id),
        compiler::module::Meaning::Open(id, _) | compiler::module::Meaning::Test(id) => Some(id),
        _ => None,
    });
    let mut todo: Vec<FnId> = own.chain(init.iter().copied()).collect();
    let mut seen = BTreeSet::new();
    let mut found = Vec::new();
    while let Some(id) = todo.pop() {
        let Some(function) = program.functions.get(id.at()).filter(|_| seen.insert(id)) else { continue };
        for pc in function.entry.0..function.end.0 {
            let site = program.site_at(id, Pc(pc)).and_then(|site| program.sites[site.at()].callee);
            todo.extend(site);
            for operand in program.code[pc as usize].operands() {
                match mentioned(session, operand) {
                    Some(Value::Imm(Imm::Function(id))) => todo.push(id),
                    Some(Value::Imm(Imm::Native(native))) => {
                        let native = &program.natives[native.at()];
                        found.extend((native.effect != Effect::Pure).then_some((
                            native.effect,
                            native.name,
                            Pc(pc),
                        )));
                    }
                    _ => {}
                }
            }
        }
    }
    found.sort_by_key(|(effect, name, pc)| (*effect, *name, *pc));
    found
}

/// The function that an operand names.
fn mentioned(session: &Session, operand: Operand) -> Option<Value> {
    let program = &session.machine.program;
    match operand {
        Operand::Function(id) => Some(Value::Imm(Imm::Function(id))),
        Operand::Native(id) => Some(Value::Imm(Imm::Native(id))),
        Operand::Const(id) => program.constants.get(id.at()).cloned(),
        Operand::Site(id) => program.sites.get(id.at())?.callee.map(|id| Value::Imm(Imm::Function(id))),
        _ => None,
    }
}
