//! Turns of tasks, and what happens between two rounds: the clock, timers, answers, deadlock.

use serde_json::Value as Json;

use crate::code::SiteId;
use crate::failure::{Builtin, Failure};
use crate::host::{Host, Request};
use crate::log::{Entry, Event, Question};
use crate::native::Raise;
use crate::persist::SavedTree;
use crate::tree::Status;
use crate::value::{Obj, Value};

use super::super::call::Slow;
use super::super::cleanup::{CleanUp, too_long};
use super::super::{Exit, Machine, Outcome, QUANTUM_NS, from_json};
use super::evaporation::evaporation;
use super::{Asked, State, TaskId, Waits};

/// How many of those who wait the message of a deadlock names.
const MOST_TOLD: usize = 10;
/// How often a run may come to where nothing can go on: each time something is stopped.
const MOST_DEADLOCKS: u32 = 10_000;

impl Machine {
    /// Makes a task the loaded one.
    fn load(&mut self, id: TaskId) {
        let loaded = self.top().tasks.loaded;
        if loaded == id {
            return;
        }
        if self.top().tasks.get(loaded).state != State::Ended {
            let used = self.window_above() as usize;
            self.top().park(used);
        }
        self.top().unpark(id);
    }

    // ------------------------------------------------------------------ turns

    /// Gives the next task its turn. Answers the outcome if that ends the outermost run.
    pub(in crate::machine) fn next_turn(&mut self, host: &mut dyn Host) -> Option<Outcome> {
        loop {
            let Some(id) = self.top().tasks.round.pop() else {
                let outcome = self.end_round(host);
                if outcome.is_some() || self.halted || self.top().tasks.running {
                    return outcome;
                }
                continue;
            };
            if self.top().tasks.get(id).state != State::Ready {
                continue;
            }
            if self.top().is_held(id) {
                self.top().tasks.held.push(id);
                continue;
            }
            self.load(id);
            // What the end of another turn led to is no part of this one.
            self.steps += std::mem::take(&mut self.beside);
            let tasks = &mut self.top().tasks;
            (tasks.running, tasks.in_turn) = (true, 0);
            return self.begin_turn(host);
        }
    }

    /// What a turn begins with: the end of the task, if somebody asked for it, or a failure.
    fn begin_turn(&mut self, host: &mut dyn Host) -> Option<Outcome> {
        let run = self.top();
        let task = run.tasks.get_mut(run.tasks.loaded);
        let (mid, has_begun) = (std::mem::take(&mut task.mid), std::mem::replace(&mut task.has_begun, true));
        let (rec, raise) = (task.rec, task.rare.as_mut().and_then(|it| it.raise.take()));
        if let (false, Some(why)) = (has_begun, task.evaporate) {
            // It has a record nevertheless, which begins and ends now.
            task.thrown = true;
            run.tree.record_mut(rec).start = run.now;
            return self.end_task(host, Err(evaporation(why)));
        }
        let asked = task.evaporate.is_some() && !task.thrown && run.cleanups.is_empty();
        if mid && (asked || raise.is_some()) {
            // Frames are looked up one instruction back, where calls stand.
            run.pc += 1;
        }
        if let Some(raise) = raise {
            return self.refuse(host, raise);
        }
        let exit = match self.evaporate_if_asked(host) {
            Some(exit) => Some(exit),
            None => self.begin_edited(host),
        };
        self.task_exit(host, exit?)
    }

    /// The call of a branch with edits.
    fn begin_edited(&mut self, host: &mut dyn Host) -> Option<Exit> {
        let run = self.top();
        let call = run.tasks.get_mut(run.tasks.loaded).rare.as_mut()?.begins_with.take()?;
        match self.drive(host, 0, *call) {
            Ok(exit) => exit,
            Err(raise) => self.unwind(host, raise),
        }
    }

    /// The loaded task has used up its quantum.
    pub(in crate::machine) fn use_up_turn(&mut self) {
        self.forget_left_cleanups();
        let tasks = &mut self.top().tasks;
        (tasks.running, tasks.busy) = (false, true);
        let id = tasks.loaded;
        tasks.get_mut(id).mid = true;
        tasks.ready.push(id);
    }

    /// The loaded task asks the outside; the answer goes to this position of its stack.
    pub(in crate::machine) fn wait_for_answer(&mut self, request: Request, register: usize) {
        let run = self.top();
        let rec = run.record(run.here);
        let record = run.tree.record(rec);
        let number = run.asked.entry(rec).or_default();
        *number += 1;
        let (slot, attempt, number) = (record.slot.0, record.attempt, *number);
        let question = Question { slot, attempt, number, request: request.describe() };
        run.tasks.wait(Waits::Answer);
        run.tasks.asked.push(Asked { task: run.tasks.loaded, request, question, register });
    }

    /// The code of the loaded task has ended.
    pub(in crate::machine) fn end_task(&mut self, host: &mut dyn Host, outcome: Outcome) -> Option<Outcome> {
        let id = self.top().tasks.loaded;
        if id == TaskId::ROOT {
            return self.end_run(outcome);
        }
        if let Err(failure) = &outcome {
            self.tell_of_clean_up(host, failure);
        }
        let rec = self.top().tasks.get(id).rec;
        // The record of a branch with edits may have been ended by its driver, or be deferred.
        let status = self.top().tree.record(rec).status;
        if !status.is_final() && status != Status::Deferred {
            match &outcome {
                Ok(value) => self.end_record(host, rec, Status::Succeeded, value.clone()),
                Err(failure) => self.fail_record(host, rec, failure),
            }
        }
        let run = self.top();
        run.tasks.running = false;
        run.tasks.get_mut(id).state = State::Ended;
        // Nothing of it is left but what others know of it.
        run.frames.clear();
        run.drivers.clear();
        run.leaving = None;
        run.handling.clear();
        run.cleanups.clear();
        let joiners = run.tasks.get_mut(id).rare.as_mut().map(|it| std::mem::take(&mut it.joiners));
        for (waiting, token) in joiners.unwrap_or_default() {
            if run.tasks.is_waiting(waiting, token) {
                run.tasks.make_ready(waiting);
            }
        }
        self.status_changed(host, id);
        self.branch_ended(id, outcome);
        None
    }

    /// The loaded task waits. In a clean-up it does so for a limited time.
    pub(in crate::machine) fn has_begun_to_wait(&mut self) {
        self.forget_left_cleanups();
        let run = self.top();
        let id = run.tasks.loaded;
        let task = run.tasks.get(id);
        match run.cleanups.last().map(CleanUp::deadline) {
            // Once it has been said that the time is over, it is not said again.
            Some(deadline) if deadline <= run.now => {}
            Some(deadline) => run.tasks.set_timer(deadline, true),
            // Who is to be stopped does not wait.
            None if task.evaporate.is_some() && !task.thrown => run.tasks.make_ready(id),
            None => {}
        }
    }

    // ------------------------------------------------------------------ between two rounds

    /// All had their turns: the clock moves, timers fire, answers come.
    fn end_round(&mut self, host: &mut dyn Host) -> Option<Outcome> {
        self.round += 1;
        let run = self.top();
        run.tasks.rounds += 1;
        let busy = std::mem::take(&mut run.tasks.busy);
        let next = run.tasks.next_timer();
        if busy {
            let later = run.now + QUANTUM_NS;
            let later = next.filter(|at| *at > run.now).map_or(later, |at| at.min(later));
            if self.ends_before(later) {
                self.top().tasks.busy = true;
                return None;
            }
            self.top().now = later;
        } else if run.tasks.ready.is_empty() && run.tasks.asked.is_empty() {
            match next {
                Some(at) => {
                    let now = run.now;
                    if self.ends_before(at) {
                        return None;
                    }
                    // What is in the log has been waited for.
                    if !self.log.is_replaying() && !host.pass(at.saturating_sub(now)) {
                        self.halt_in_round();
                        return None;
                    }
                    self.top().now = now.max(at);
                }
                None => return self.deadlock(host),
            }
        }
        let run = self.top();
        let now = run.now;
        run.tasks.fire(now);
        if let Err(differs) = self.answer_all(host) {
            return self.interrupt(host, Box::new(Failure::new(Builtin::ProgramError, differs)));
        }
        if busy {
            self.top().check_cleanups();
        }
        if let Err(raise) = self.check_memory_again(busy) {
            let outcome = self.interrupt(host, raise);
            if outcome.is_some() {
                return outcome;
            }
        }
        let order = (self.schedule != 0).then_some((self.schedule, self.round));
        self.top().tasks.begin_round(order);
        None
    }

    /// The run is stopped between two rounds: this one does not end before it goes on.
    fn halt_in_round(&mut self) {
        self.round -= 1;
        self.top().tasks.rounds -= 1;
        self.halted = true;
    }

    /// True if the clock of the outermost run is to stop before this time. It stands at its end then.
    fn ends_before(&mut self, next: u64) -> bool {
        let Some(end) = self.clock_end.filter(|end| *end < next && self.runs.len() == 1) else {
            return false;
        };
        self.top().now = self.top().now.max(end);
        self.clock_ended = true;
        self.halt_in_round();
        true
    }

    /// Answers what the tasks asked in this round, from the log or from the host: one entry of the log.
    fn answer_all(&mut self, host: &mut dyn Host) -> Result<(), String> {
        let tasks = &mut self.top().tasks;
        let mut asked = std::mem::take(&mut tasks.asked);
        asked.retain(|it| matches!(tasks.get(it.task).state, State::Waiting(Waits::Answer)));
        if asked.is_empty() {
            return Ok(());
        }
        let entry = match self.log.replay(self.round, asked.iter().map(|it| &it.question))? {
            Some(entry) => entry,
            None => {
                let event = |it: &Asked| {
                    let answer = host.answer(&it.request);
                    Event { question: it.question.clone(), answer }
                };
                let events = asked.iter().map(event).collect();
                let (round, step, clock) = (self.round, self.steps, self.top().now);
                let entry = Entry { round, step, clock, events };
                host.commit(&entry);
                self.log.add(entry.clone());
                entry
            }
        };
        for (it, event) in asked.iter().zip(entry.events) {
            let value = event.answer.and_then(|answer| match &it.request {
                Request::LoadTree { .. } => self.loaded_tree(host, &answer),
                _ => Ok(from_json(&answer)),
            });
            let run = self.top();
            match value {
                Ok(value) => run.set_register(it.task, it.register, value),
                Err(why) => run.tasks.get_mut(it.task).will_raise(no_answer(&it.request, why)),
            }
            run.tasks.make_ready(it.task);
        }
        Ok(())
    }

    /// A tree from its rows.
    fn loaded_tree(&mut self, host: &mut dyn Host, rows: &Json) -> Result<Value, String> {
        let saved = SavedTree::from_rows(rows)?;
        let read = host.reader();
        let (tree, orphans) = self.restore(host, &saved, Some(SiteId(0)), &*read)?;
        for (edit, why) in orphans {
            let line = format!("an edit of the tree holds no more: {}: {why}", edit.edit);
            host.complain(&crate::show::safe(&line));
        }
        Ok(Value::new(Obj::Tree(std::rc::Rc::new(tree))))
    }

    /// Raises a failure between two rounds, in the task that ran last or else in the root.
    fn interrupt(&mut self, host: &mut dyn Host, raise: Raise) -> Option<Outcome> {
        let tasks = &self.top().tasks;
        let last = tasks.loaded;
        let id = if tasks.get(last).state == State::Ended { TaskId::ROOT } else { last };
        self.load(id);
        let tasks = &mut self.top().tasks;
        tasks.make_ready(id);
        // Frames are looked up one instruction back, where calls stand: a task that waits stands behind
        // its call, another one before an instruction that is not done.
        let mid = std::mem::take(&mut tasks.get_mut(id).mid);
        let runs = self.runs.len();
        self.top().pc += u32::from(mid);
        let outcome = self.refuse(host, raise);
        if self.runs.len() == runs {
            let tasks = &mut self.top().tasks;
            tasks.running = false;
            if tasks.get(id).state == State::Ended {
                tasks.ready.retain(|ready| *ready != id);
            }
        }
        outcome
    }

    /// Nobody can ever go on.
    fn deadlock(&mut self, host: &mut dyn Host) -> Option<Outcome> {
        let run = self.top();
        run.tasks.deadlocks += 1;
        if run.tasks.deadlocks > MOST_DEADLOCKS {
            let failure = Failure::new(Builtin::Deadlock, "nothing can go on, and nothing can be stopped");
            return Some(Err(self.abandon(failure)));
        }
        // What waits in a clean-up cannot be stopped by the failure of another task.
        let cleaning = run.tasks.all.iter().enumerate().map(|(at, task)| (TaskId(at as u32), task));
        let stuck = cleaning
            .filter(|(_, task)| matches!(task.state, State::Waiting(waits) if waits != Waits::Branches))
            .map(|(id, _)| id)
            .find(|id| run.is_cleaning_up(*id));
        if let Some(id) = stuck {
            run.tasks.get_mut(id).will_raise(too_long());
            run.tasks.make_ready(id);
            return None;
        }
        let lines = self.stuck();
        let waits = Value::list(lines.iter().map(|line| Value::str(line.as_str())).collect::<Vec<_>>());
        let mut told: Vec<String> = lines.iter().take(MOST_TOLD).cloned().collect();
        if lines.len() > MOST_TOLD {
            told.push(format!("and so do {} others", lines.len() - MOST_TOLD));
        }
        let message = format!("nothing can go on: {}", told.join("; "));
        let fields = vec![("message", Value::str(message)), ("waits", waits)];
        self.load(TaskId::ROOT);
        self.interrupt(host, Box::new(Failure::with(Builtin::Deadlock, fields)))
    }

    /// `(sleep s)`: the value of the call is nil, when the time has come.
    pub(in crate::machine) fn sleep(&mut self, d: u8, ns: u64) -> Slow {
        let run = self.top();
        *run.register(d) = Value::NIL;
        run.tasks.wait_until(run.now.saturating_add(ns));
        Ok(Some(Exit::Wait))
    }
}

fn no_answer(request: &Request, why: String) -> Raise {
    let path = match request {
        Request::ReadFile(path) | Request::WriteFile { path, .. } => Value::str(path.as_str()),
        Request::LoadTree { store, .. }
        | Request::SaveTree { store, .. }
        | Request::Versions { store, .. } => Value::str(store.as_str()),
        Request::Clock => Value::NIL,
    };
    Box::new(Failure::with(Builtin::FileFailure, vec![("message", Value::str(why)), ("path", path)]))
}
