% Two objects that stand at the same place and go to the same place can be carried together, one in each
% hand: the first is delivered after the second has been fetched.
%
% After the first rule of Kazhoyan, Niedzwiecki, Beetz: "Towards Plan Transformations for Real-World Pick and
% Place Tasks" (2020). Read literally it pairs each two transports in both orders.

both_hands(First_deliver, Second_deliver) :-
    transport_task(top_level, First_task),
    transport_task(top_level, Second_task),
    not(First_task == Second_task),
    not_transformed(First_task),
    not_transformed(Second_task),
    one_arm_action(First_task),
    one_arm_action(Second_task),
    fetch_task(First_task, First_fetch),
    fetch_task(Second_task, Second_fetch),
    fetch_from_same_loc(First_fetch, Second_fetch),
    deliver_task(First_task, First_deliver),
    deliver_task(Second_task, Second_deliver),
    deliver_to_same_loc(First_deliver, Second_deliver).
