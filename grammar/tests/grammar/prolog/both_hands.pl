% Two objects that stand together and go to the same place: carry one in each hand.
both_hands(First_deliver_path, Second_deliver_path) :-
    transport_task(top_level, First_transport, First_path),
    transport_task(top_level, Second_transport, Second_path),
    not(First_transport == Second_transport),
    not_transformed(First_path),
    not_transformed(Second_path),
    one_arm_action(First_transport),
    one_arm_action(Second_transport),
    fetch_task(First_transport, First_fetch, _),
    fetch_task(Second_transport, Second_fetch, _),
    fetch_from_same_loc(First_fetch, Second_fetch),
    deliver_task(First_transport, First_deliver, First_deliver_path),
    deliver_task(Second_transport, Second_deliver, Second_deliver_path),
    deliver_to_same_loc(First_deliver, Second_deliver).

one_arm_action(Task) :-
    task_action_param(Task, object, Object),
    \+ heavy(Object).

fetch_from_same_loc(First, Second) :-
    task_action_param(First, location, Location),
    task_action_param(Second, location, Location).

heavy(an(object, type('Pot'))).
