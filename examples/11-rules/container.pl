% Two objects out of one container: it need not be closed after the first, nor opened for the second.
%
% After the second rule of the same paper, which leaves out the goals in the middle: they are those of the
% first rule.

container(First_close, Second_open) :-
    transport_task(top_level, First_task),
    transport_task(top_level, Second_task),
    not(First_task == Second_task),
    not_transformed(First_task),
    not_transformed(Second_task),
    fetch_task(First_task, First_fetch),
    fetch_task(Second_task, Second_fetch),
    fetch_from_same_container(First_fetch, Second_fetch),
    close_task(First_task, First_close),
    open_task(Second_task, Second_open),
    before(First_close, Second_open).
