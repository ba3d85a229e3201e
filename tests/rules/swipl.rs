//! SWI-Prolog, where it is installed: a batch of programs in one process.

use std::io::Write as _;
use std::process::{Command, Stdio};

use super::answers::{End, Found};
use super::generate::Batch;

/// Loads a text from its first argument and asks its programs; one line for each answer and each end.
const DRIVER: &str = r#"
:- set_prolog_flag(occurs_check, true).
:- set_prolog_flag(stack_limit, 500_000_000).
:- initialization(main, main).

main :-
    current_prolog_flag(argv, Argv), append(_, [File, Programs, Inferences, Most], Argv),
    load_files(user:File, [silent(true)]),
    atom_number(Programs, N), atom_number(Inferences, I), atom_number(Most, M),
    Last is N - 1,
    forall(between(0, Last, K), ask(K, I, M)).

ask(K, Inferences, Most) :-
    format(atom(Name), "t~dw", [K]),
    nb_setval(answers, 0),
    catch(call_with_inference_limit(answers(Name, Most, End), Inferences, Result), E, true),
    (   nonvar(E) -> ( E = error(resource_error(_), _) -> Word = limit ; Word = error )
    ;   Result == inference_limit_exceeded -> Word = limit
    ;   Word = End
    ),
    format("= ~w~n", [Word]).

answers(Name, Most, limit) :-
    call(user:Name, Answer),
    copy_term(Answer, Copy), numbervars(Copy, 0, _), put_term(Copy), nl,
    nb_getval(answers, N0), N is N0 + 1, nb_setval(answers, N),
    N >= Most, !.
answers(_, _, no).

put_term('$VAR'(N)) :- integer(N), !, format("?_~d", [N]).
put_term([]) :- !, write(nil).
put_term(T) :- atomic(T), !, write(T).
put_term([H|T]) :- !, write('('), put_term(H), put_rest(T), write(')').
put_term(T) :- T =.. List, put_term(List).

put_rest([]) :- !.
put_rest(V) :- V = '$VAR'(N), integer(N), !, write(' . '), put_term(V).
put_rest([H|T]) :- !, write(' '), put_term(H), put_rest(T).
put_rest(T) :- compound(T), !, T =.. List, List = [H|Rest], write(' '), put_term(H), put_rest(Rest).
put_rest(T) :- write(' . '), put_term(T).
"#;

/// True if it is there.
pub fn is_installed() -> bool {
    Command::new("swipl").arg("--version").stdout(Stdio::null()).status().is_ok_and(|it| it.success())
}

/// What it answers to each program of a batch.
pub fn ask(batch: &Batch, inferences: usize, most: usize) -> Vec<Found> {
    let name = format!("pleach-{}-{}", std::process::id(), super::thread_number());
    let folder = std::env::temp_dir().join(name);
    std::fs::create_dir_all(&folder).expect("a folder can be made");
    let (driver, programs) = (folder.join("driver.pl"), folder.join("programs.pl"));
    for (path, text) in [(&driver, DRIVER), (&programs, &batch.text)] {
        let mut file = std::fs::File::create(path).expect("a file can be made");
        file.write_all(text.as_bytes()).expect("it can be written");
    }
    let args = [batch.programs.to_string(), inferences.to_string(), most.to_string()];
    let output = Command::new("swipl").arg(&driver).arg("--").arg(&programs).args(&args).output();
    let output = output.expect("it can be started");
    let said = String::from_utf8_lossy(&output.stderr);
    // It warns of variables that occur once.
    let errors: Vec<&str> = said.lines().filter(|line| !line.starts_with("Warning")).collect();
    assert!(output.status.success() && errors.is_empty(), "swipl says {}", errors.join("\n"));
    std::fs::remove_dir_all(&folder).expect("the folder can be removed");
    let mut found = vec![Found::default()];
    for line in String::from_utf8_lossy(&output.stdout).lines() {
        let last = found.last_mut().expect("there is one");
        match line.strip_prefix("= ") {
            Some(end) => {
                last.end = match end {
                    "no" => End::No,
                    "error" => End::Error,
                    _ => End::Limit,
                };
                found.push(Found::default());
            }
            None => last.answers.push(line.into()),
        }
    }
    found.pop();
    found
}
