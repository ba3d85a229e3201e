% The both-hands rule for SWI-Prolog over facts of a tree: task(Id, Parent, Name, Path, Status),
% prop(Id, Key, Value), replaced(Id).
transport_task(T) :- task(T, _, transporting, _, _), under(T, 1).
under(T, A) :- task(T, P, _, _, _), ( P == A -> true ; P > 0, under(P, A) ).
one_arm(T) :- prop(T, arms, A), A \== both.
deliver_path(T, P) :- task(D, T, delivering, _, _), task(D, _, _, P, _).
paper(P1, P2) :- transport_task(A), transport_task(B), A \== B, \+ replaced(A), \+ replaced(B),
  one_arm(A), one_arm(B), prop(A, location, F), prop(B, location, F), prop(A, target, T), prop(B, target, T),
  deliver_path(A, P1), deliver_path(B, P2).
best(P1, P2) :- transport_task(A), \+ replaced(A), one_arm(A), prop(A, location, F), prop(A, target, T),
  prop(B, location, F), A \== B, task(B, _, transporting, _, _), under(B, 1), \+ replaced(B), one_arm(B),
  prop(B, target, T), deliver_path(A, P1), deliver_path(B, P2).
all_work(N) :- findall(A-B, best(A, B), L), length(L, N).
paper_work(N) :- findall(A-B, paper(A, B), L), length(L, N).
first_answer_work(1) :- forall(between(1, 1000, _), (best(_, _) -> true)).
candidate(F-T, A) :- transport_task(A), \+ replaced(A), one_arm(A), prop(A, location, F), prop(A, target, T).
group_work(N) :- findall(K-A, candidate(K, A), L), keysort(L, S), group_pairs_by_key(S, G),
  findall(x, member(_-[_,_|_], G), Xs), length(Xs, N).
