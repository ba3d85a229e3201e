% SWI-Prolog's side of `benches/rules.rs`: swipl -O peer.pl -- WORKLOAD FILE…
% Prints the milliseconds of CPU time of one run.
:- use_module(library(lists)).
:- set_prolog_flag(stack_limit, 8_000_000_000).
:- initialization(main, main).

main :-
    current_prolog_flag(argv, Argv), append(_, [W|Files], Argv), member(W, [nrev,zebra,first,second,both,none,findall,deep,churn,tc,all,paper,group,first_answer]), !,
    forall(member(File, Files), load_files(user:File, [silent(true)])),
    atom_concat(W, '_work', Name),
    warm(W, Name),
    statistics(cputime, T0), ( call(user:Name, R) -> true ; R = failed ), statistics(cputime, T1),
    T is (T1 - T0) * 1000,
    format("~w ~3f~n", [R, T]).

% The first call makes the indexes; tables are made each time.
warm(W, _) :- member(W, [tc, deep, paper]), !.
warm(_, Name) :- ( call(user:Name, _) -> true ; true ).
