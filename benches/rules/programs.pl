% Workloads that Pleach and SWI-Prolog both read. `f/2` and `edge/2` are in files that the benchmark writes.
% work(Result) of each is a predicate of its own: `nrev_work` …

app([], L, L).
app([H|T], L, [H|R]) :- app(T, L, R).
nrev([], []).
nrev([H|T], R) :- nrev(T, RT), app(RT, [H], R).
range(N, N, [N]) :- !.
range(I, N, [I|T]) :- I < N, I1 is I + 1, range(I1, N, T).
nrev_loop(0, _) :- !.
nrev_loop(N, L) :- \+ \+ nrev(L, _), N1 is N - 1, nrev_loop(N1, L).
nrev_work(N) :- N = 20000, range(1, 30, L), nrev_loop(N, L).

mem(X, [X|_]).
mem(X, [_|T]) :- mem(X, T).
right_of(X, Y, [Y,X|_]).
right_of(X, Y, [_|T]) :- right_of(X, Y, T).
next_to(X, Y, L) :- right_of(X, Y, L).
next_to(X, Y, L) :- right_of(Y, X, L).
zebra(Owner) :-
  Hs = [h(_,norwegian,_,_,_), _, h(_,_,_,milk,_), _, _],
  mem(h(red,english,_,_,_), Hs), mem(h(green,_,_,coffee,_), Hs),
  mem(h(_,spanish,dog,_,_), Hs), mem(h(_,ukrainian,_,tea,_), Hs),
  right_of(h(green,_,_,_,_), h(ivory,_,_,_,_), Hs),
  mem(h(_,_,snails,_,winston), Hs), mem(h(yellow,_,_,_,kools), Hs),
  next_to(h(_,_,_,_,chesterfield), h(_,_,fox,_,_), Hs),
  next_to(h(_,_,_,_,kools), h(_,_,horse,_,_), Hs),
  mem(h(_,_,_,orange_juice,lucky), Hs), mem(h(_,japanese,_,_,parliament), Hs),
  next_to(h(_,norwegian,_,_,_), h(blue,_,_,_,_), Hs),
  mem(h(_,Owner,zebra,_,_), Hs).
zebra_loop(0) :- !.
zebra_loop(N) :- zebra(_), N1 is N - 1, zebra_loop(N1).
zebra_work(Owner) :- zebra_loop(100), zebra(Owner).

% The n-th fact is f(n, n mod 1000 * 7). `none_work` is the loop without a look-up.
next(6993, 0) :- !.
next(K, K1) :- K1 is K + 7.
none_loop(N, N, _, S, S) :- !.
none_loop(I, N, K, S0, S) :- next(K, K1), S1 is S0 + K, I1 is I + 1, none_loop(I1, N, K1, S1, S).
first_loop(N, N, _, S, S) :- !.
first_loop(I, N, K, S0, S) :- next(K, K1), f(I, J), S1 is S0 + J, I1 is I + 1, first_loop(I1, N, K1, S1, S).
second_loop(N, N, _, S, S) :- !.
second_loop(I, N, K, S0, S) :- next(K, K1), f(A, K), !, S1 is S0 + A, I1 is I + 1, second_loop(I1, N, K1, S1, S).
both_loop(N, N, _, S, S) :- !.
both_loop(I, N, K, S0, S) :- next(K, K1), f(I, K), S1 is S0 + K, I1 is I + 1, both_loop(I1, N, K1, S1, S).
none_work(S) :- none_loop(0, 100000, 0, 0, S).
first_work(S) :- first_loop(0, 100000, 0, 0, S).
second_work(S) :- second_loop(0, 100000, 0, 0, S).
both_work(S) :- both_loop(0, 100000, 0, 0, S).

len([], N, N).
len([_|T], N0, N) :- N1 is N0 + 1, len(T, N1, N).
findall_work(N) :- findall(A-B, (f(A, B), B > 3500), L), len(L, 0, N).

deep(0, 0) :- !.
deep(N, D) :- N1 is N - 1, deep(N1, D1), D is D1 + 1.
deep_work(D) :- deep(1000000, D).

% A deterministic loop that makes garbage.
churn(0, _) :- !.
churn(N, L) :- nrev(L, R), N1 is N - 1, churn(N1, R).
churn_work(N) :- N = 20000, range(1, 30, L), churn(N, L).

:- table path/2.
path(X, Y) :- edge(X, Y).
path(X, Y) :- path(X, Z), edge(Z, Y).
tc_work(N) :- findall(X-Y, path(X, Y), L), len(L, 0, N).
