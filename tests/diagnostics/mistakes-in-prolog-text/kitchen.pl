free(X) :- on(X, Y), \+ on(_, X).
full(X) :- on(_, X), assert(full(X)).
heavy(X) :- weighs(X, W), W > 3.
