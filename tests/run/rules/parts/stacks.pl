% What stands on what; the facts are stated elsewhere.
:- dynamic(lamp/1).

above(X, Y) :- on(X, Y).
above(X, Z) :- on(X, Y), above(Y, Z).

free(X) :- on(X, _), \+ on(_, X), \+ lamp(X).

height(X, 0) :- \+ on(X, _), !.
height(X, N) :- on(X, Y), height(Y, M), N is M + 1.

split(List, Front, Back) :- append(Front, Back, List), length(Front, N), N =:= 1.
