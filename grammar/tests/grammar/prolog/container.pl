:- use_module(library(lists)).

/* Several objects out of one container: it stays open until the last one is out. */
container(Container, Closes) :-
    setof(Close, Open^in_container(Container, Open, Close), Closes),
    length(Closes, N), N > 1,
    forall(( member(A, Closes), member(B, Closes), not(A == B) ),
           fetch_from_same_container(A, B)).

in_container(Container, Open_path, Close_path) :-
    transport_task(top_level, Transport, _),
    open_task(Transport, Open, Open_path),
    close_task(Transport, _Close, Close_path),
    not_transformed(Close_path),
    (   task_action_param(Open, object, Container)
    ->  true
    ;   task_action_param(Open, location, [in, Container|_])
    ).
