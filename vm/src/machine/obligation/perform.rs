//! Performing what is owed: in the frame that holds the common form, inside the handlers of the
//! call.

use crate::code::{Pc, SiteId};
use crate::failure::{Builtin, Failure};
use crate::host::Host;
use crate::key::{Key, Step};
use crate::op::Op;
use crate::path::Path;
use crate::tree::{COUNTED, RecId, SlotId, Status, Why};
use crate::value::{Obj, Value};

use super::super::call::Slow;
use super::super::cleanup::CleanUp;
use super::super::drive::Driver;
use super::super::{Frame, Here, Machine, Occurrences, RESUME, Run};
use super::{Context, Discharge, Handling, Obligation, Owed, Stage};

impl Machine {
    /// The loop has stopped before an instruction because something of this frame is due.
    pub(in crate::machine) fn perform_due(&mut self, host: &mut dyn Host) -> Slow {
        let run = self.top();
        let (depth, pc) = (run.frames.len(), run.pc);
        if run.handling.last().is_some_and(|it| it.depth == depth) {
            return self.leave_handling(host);
        }
        match self.next_due(depth, pc) {
            Some(at) => self.discharge(host, at, None),
            None => Ok(None),
        }
    }

    /// The obligation of this frame that is to be performed next, if one is. (1, 7)
    fn next_due(&mut self, depth: usize, pc: u32) -> Option<usize> {
        let (program, runs) = (&self.program, &self.runs);
        let run = &runs[runs.len() - 1];
        let view = run.view();
        let held: Vec<usize> = (0..run.obligations.len())
            .filter(|at| run.obligations[*at].holder == (run.tasks.loaded, depth))
            .collect();
        let op = program.code[pc as usize];
        let ended = |it: &Obligation| {
            !program.forms[it.form as usize].contains(pc) || matches!(op, Op::Return(_) | Op::ReturnPlan(_))
        };
        // A form ends before what is around it.
        let ending =
            held.iter().map(|at| &run.obligations[*at]).filter(|it| ended(it)).map(|it| it.form).max();
        if let Some(form) = ending {
            let ended: Vec<usize> = held.into_iter().filter(|at| run.obligations[*at].form == form).collect();
            return self.first_at_end(&ended).or_else(|| self.next_due(depth, pc));
        }
        held.into_iter().find(|at| run.obligations[*at].is_over(program, &view, pc))
    }

    /// Of the obligations of a form that ends: the first whose q is not owed here as well, else the
    /// first. One whose q is owed further out moves there. (7)
    fn first_at_end(&mut self, ended: &[usize]) -> Option<usize> {
        let run = self.top();
        for at in ended {
            let (after, holder, form) =
                (run.obligations[*at].after, run.obligations[*at].holder, run.obligations[*at].form);
            let further =
                run.obligations.iter().find(|it| it.slot == after && (it.holder, it.form) != (holder, form));
            if let Some(outer) =
                further.map(|it| (it.holder, it.level, it.form, it.side.clone(), it.passed.clone()))
            {
                let it = &mut run.obligations[*at];
                (it.holder, it.level, it.form, it.side, it.passed) = outer;
                let (rec, holder) = (it.rec, it.holder);
                self.performed_by(rec, holder);
                return self
                    .first_at_end(&ended.iter().copied().filter(|other| other != at).collect::<Vec<_>>());
            }
        }
        let owed: Vec<SlotId> = ended.iter().map(|at| run.obligations[*at].slot).collect();
        let free = |at: &&usize| !owed.contains(&run.obligations[**at].after);
        ended.iter().find(free).or(ended.first()).copied()
    }

    /// A failure leaves a form: what the form holds is performed before. The index of it.
    pub(in crate::machine) fn due_before_failure(&mut self, form: u32) -> Option<usize> {
        let run = self.top();
        let depth = run.frames.len();
        let held: Vec<usize> = (0..run.obligations.len())
            .filter(|at| {
                let it = &run.obligations[*at];
                it.holder == (run.tasks.loaded, depth) && it.form == form
            })
            .collect();
        if held.is_empty() { None } else { self.first_at_end(&held) }
    }

    /// In an emergency the running frame is left, and what it holds is not performed. (9)
    pub(in crate::machine) fn drop_owed(&mut self, host: &mut dyn Host) {
        let run = self.top();
        let holder = (run.tasks.loaded, run.frames.len());
        let (dropped, kept) =
            std::mem::take(&mut run.obligations).into_iter().partition(|it| it.holder == holder);
        run.obligations = kept;
        let dropped: Vec<Obligation> = dropped;
        for it in dropped {
            self.top().tree.record_mut(it.rec).why = Why::Emergency;
            self.end_record(host, it.rec, Status::Evaporated, Value::NIL);
        }
    }

    /// Performs an obligation on top of the running frame, which goes on afterwards.
    pub(in crate::machine) fn discharge(
        &mut self,
        host: &mut dyn Host,
        at: usize,
        then: Option<Value>,
    ) -> Slow {
        let obligation = self.top().obligations.remove(at);
        let scratch = self.scratch_register();
        let above = self.driver_base();
        let run = self.top();
        if then.is_some() {
            // Performed because its form is left, it is clean-up. (9)
            let limit = run.tasks.get(run.tasks.loaded).limit();
            let cleanup = CleanUp::begin(run.frames.len(), run.now, run.cleanups.last(), limit);
            run.cleanups.push(cleanup.owed());
        }
        run.frames.push(Frame { pc: run.pc, base: run.base, here: run.here, dst: scratch });
        (run.pc, run.base) = (RESUME, above);
        let marks = run.marks_of(&obligation);
        let discharge = Discharge { obligation, stage: Stage::Performing, then, marks };
        run.drivers.push(Driver::Discharge(Box::new(discharge)));
        self.perform_owed(host)
    }

    /// The first register that the running function does not use.
    fn scratch_register(&self) -> u8 {
        let run = &self.runs[self.runs.len() - 1];
        let function = self
            .program
            .function_at(Pc(run.pc))
            .or_else(|| self.program.function_at(Pc(run.pc.saturating_sub(1))));
        function.map_or(0, |it| self.program.functions[it.at()].registers)
    }

    /// Starts the call of the discharge on top.
    fn perform_owed(&mut self, host: &mut dyn Host) -> Slow {
        let run = self.top();
        let now = run.now;
        let Some(Driver::Discharge(discharge)) = run.drivers.last_mut() else { return Ok(None) };
        let rec = discharge.obligation.rec;
        match &discharge.obligation.what {
            Owed::Call(call) => {
                let again = call.again(rec);
                let record = run.tree.record_mut(rec);
                (record.status, record.start) = (Status::Running, now);
                self.trace_start(host, rec);
                self.perform_again(host, again)
            }
            Owed::Code(code, args) => {
                let (code, args) = (*code, args.clone());
                let record = run.tree.record_mut(rec);
                (record.status, record.start) = (Status::Running, now);
                self.trace_start(host, rec);
                self.enter(0, code, args, &[]);
                self.top().here = Here(rec.0);
                Ok(None)
            }
        }
    }

    /// What the discharge called has returned.
    pub(in crate::machine) fn discharge_resumed(
        &mut self,
        host: &mut dyn Host,
        mut discharge: Box<Discharge>,
        value: Value,
    ) -> Slow {
        self.stand_in_form();
        let next = match discharge.stage {
            Stage::Performing => {
                let rec = discharge.obligation.rec;
                if !self.top().tree.record(rec).status.is_final() {
                    self.end_record(host, rec, Status::Succeeded, value);
                }
                0
            }
            // A handler that returns a value ends the obligation.
            Stage::Handling(_) => discharge.obligation.goals.len(),
            Stage::Goal(n) if value.holds() => n + 1,
            Stage::Goal(n) => {
                let slot = self.top().tree.record(discharge.obligation.goals[n].0).slot;
                self.top().drivers.push(Driver::Discharge(discharge));
                return Err(self.goal_missed(slot));
            }
        };
        let goals = &discharge.obligation.goals;
        let reached =
            |at: &usize| self.runs[self.runs.len() - 1].tree.record(goals[*at].0).status == Status::Succeeded;
        match (next..goals.len()).find(reached) {
            Some(n) => {
                let (rec, goal) = goals[n].clone();
                discharge.stage = Stage::Goal(n);
                let run = self.top();
                run.drivers.push(Driver::Discharge(discharge));
                // A goal is a question of its own task, also there, and may be asked after several calls.
                run.here = Here(rec.0);
                run.tree.record_mut(rec).flags |= COUNTED;
                self.ask_goal(host, &goal)
            }
            None => self.end_discharge(host, *discharge),
        }
    }

    /// The driver works for the task of the common form, whomever it has asked about a goal.
    fn stand_in_form(&mut self) {
        let run = self.top();
        run.here = run.frames.last().map_or(run.here, |holder| holder.here);
    }

    fn goal_missed(&self, slot: SlotId) -> crate::native::Raise {
        let path = Path::of(&self.runs[self.runs.len() - 1].tree, slot);
        let message = format!("the goal of {} is not true after what was deferred", path.show());
        let fields = vec![("message", Value::str(message)), ("of", Value::new(Obj::Path(Box::new(path))))];
        Box::new(Failure::with(Builtin::GoalNotReached, fields))
    }

    /// Goes back to the frame that held the obligation, or on with the failure that left it.
    fn end_discharge(&mut self, host: &mut dyn Host, discharge: Discharge) -> Slow {
        let form = discharge.obligation.form;
        self.return_value(Value::NIL)?;
        match discharge.then {
            Some(failure) => {
                self.top().cleanups.pop();
                self.top().leaving = Some(form);
                Ok(self.throw(host, failure))
            }
            None => Ok(None),
        }
    }

    /// A failure has come back to the discharge: the next handler takes it, or it goes on
    /// outwards from the common form. (4)
    pub(in crate::machine) fn discharge_failed(
        &mut self,
        host: &mut dyn Host,
        mut discharge: Box<Discharge>,
        failure: Value,
    ) -> Result<(), Value> {
        self.stand_in_form();
        let rec = discharge.obligation.rec;
        if !self.top().tree.record(rec).status.is_final() {
            self.fail_record(host, rec, &failure);
        }
        let next = match discharge.stage {
            Stage::Performing | Stage::Goal(_) => 0,
            Stage::Handling(n) => n + 1,
        };
        if let Some(context) = discharge.obligation.contexts.get(next) {
            let context = context.clone();
            discharge.stage = Stage::Handling(next);
            let (_, owner) = discharge.obligation.holder;
            self.top().drivers.push(Driver::Discharge(discharge));
            self.enter_handler(context, owner, failure);
            return Ok(());
        }
        // It is a failure of the common form, wherever in that the frame stands.
        let Obligation { form, holder: (_, depth), .. } = discharge.obligation;
        self.top().leaving = Some(form);
        if discharge.then.is_some() {
            self.top().cleanups.pop();
        }
        Err(match discharge.then.or_else(|| self.waiting_at(depth)) {
            // The failure that was on its way goes on, with this one beside it.
            Some(waiting) => super::super::unwind::with_also(&waiting, failure),
            None => failure,
        })
    }

    /// The failure that waits for a clean-up which has just ended in a frame.
    fn waiting_at(&mut self, depth: usize) -> Option<Value> {
        let Frame { pc, base, .. } = self.top().frames[depth];
        let Op::EndCleanUp(pending) = self.program.code[pc as usize] else { return None };
        self.top().cleanups.pop();
        let waiting = &self.top().stack[base as usize + pending as usize];
        waiting.as_failure().is_some().then(|| waiting.clone())
    }

    /// A frame with the registers that the handler's frame had. Those around the common form are as
    /// they are now in the frame with `owner` frames below it.
    fn enter_handler(&mut self, context: Context, owner: usize, failure: Value) {
        let Context { registers, shared, here, handler, failure: register, clauses: form } = context;
        let above = self.driver_base() as usize;
        let range = self.program.forms[form as usize];
        let (counted, mark) = self.calls_counted_in(here, form);
        let run = self.top();
        let live = run.frames[owner].base as usize;
        run.frames.push(Frame { pc: RESUME, base: run.base, here: run.here, dst: 0 });
        (run.pc, run.base, run.here) = (handler.0, above as u32, here);
        for (at, value) in registers.into_iter().enumerate() {
            run.stack[above + at] = if at < shared as usize { run.stack[live + at].clone() } else { value };
        }
        *run.register(register) = failure;
        let clauses = (range.start, range.end);
        run.handling.push(Handling { depth: run.frames.len(), clauses, form, counted, mark });
    }

    /// Takes back how often the calls of a handler have been reached. Says that, and the number of
    /// calls counted in its record.
    fn calls_counted_in(&mut self, here: Here, clauses: u32) -> (Vec<(Key, u32)>, usize) {
        let Machine { program, runs, .. } = self;
        let Some(run) = runs.last_mut() else { return (Vec::new(), 0) };
        let rec = run.record(here);
        let Some(Occurrences { counts, journal }) = run.occurrences.get_mut(&rec) else {
            return (Vec::new(), 0);
        };
        let inside = |site: SiteId| {
            program.forms_outward(program.sites[site.at()].form).any(|(form, _)| form == clauses)
        };
        let tree = &run.tree;
        let called_inside = |key: &Key| {
            let steps = tree.keys.steps(key.chain);
            inside(key.site) || steps.iter().any(|it| matches!(it, Step::Call(site) if inside(*site)))
        };
        // What edits put beside a call of the handler is part of it.
        let edits: Vec<u32> = tree
            .children(tree.record(rec).slot)
            .into_iter()
            .filter(|child| called_inside(&tree.slot(*child).key))
            .flat_map(|child| tree.edits_of(child).iter().copied())
            .collect();
        let is_of = |key: &Key| {
            let is_beside = |step: &Step| matches!(step, Step::Edit(id) if edits.contains(id));
            called_inside(key) || tree.keys.steps(key.chain).iter().any(is_beside)
        };
        let of: Vec<Key> = counts.keys().filter(|key| is_of(key)).copied().collect();
        (of.into_iter().filter_map(|key| counts.remove_entry(&key)).collect(), journal.len())
    }

    /// The handler of an obligation that runs has ended, in whichever way.
    pub(in crate::machine) fn end_handling(&mut self) {
        self.keep_registers();
        let run = self.top();
        let rec = run.record(run.here);
        let Some(handling) = run.handling.pop() else { return };
        if let Some(Occurrences { counts, journal }) = run.occurrences.get_mut(&rec) {
            for key in journal.drain(handling.mark.min(journal.len())..) {
                counts.remove(&key);
            }
            counts.extend(handling.counted);
        }
    }

    /// A handler of an obligation has done `(retry)`, or was left with a value.
    fn leave_handling(&mut self, host: &mut dyn Host) -> Slow {
        let pc = self.top().pc;
        let op = self.program.code[pc as usize];
        let retries = self.top().handling.last().is_some_and(|it| it.is_retry(pc, op));
        self.end_handling();
        if !retries {
            return self.return_value(Value::NIL);
        }
        // Perform it again: the next attempt of the same slot, the same obligation.
        self.return_value(Value::NIL)?;
        let run = self.top();
        let Some(Driver::Discharge(discharge)) = run.drivers.last_mut() else { return Ok(None) };
        discharge.stage = Stage::Performing;
        for (rec, mark) in discharge.marks.iter() {
            if let Some(counted) = run.occurrences.get_mut(rec) {
                counted.take_back(*mark);
            }
            run.tree.retried(*rec);
        }
        let before = discharge.obligation.rec;
        discharge.obligation.rec = run.tree.enter_again(before, run.now);
        self.perform_owed(host)
    }

    /// What a handler changed stays changed, for its next run and for the frame around it.
    fn keep_registers(&mut self) {
        let run = self.top();
        let base = run.base as usize;
        let Some(Driver::Discharge(discharge)) = run.drivers.last_mut() else { return };
        let Obligation { holder: (_, depth), contexts, .. } = &mut discharge.obligation;
        if let Stage::Handling(n) = discharge.stage
            && let Some(context) = contexts.get_mut(n)
        {
            let (len, shared) = (context.registers.len(), context.shared as usize);
            context.registers.clone_from_slice(&run.stack[base..base + len]);
            let live = run.frames[*depth].base as usize;
            let (around, inside) = run.stack.split_at_mut(base);
            around[live..live + shared].clone_from_slice(&inside[..shared]);
        }
    }
}

impl Run {
    /// How many calls have been counted so far in the records that performing it may count in: that of its
    /// parent, where edits put code beside it, and those of its handlers.
    fn marks_of(&self, owed: &Obligation) -> Vec<(RecId, usize)> {
        let parent = if let Owed::Call(call) = &owed.what { Some(call.parent) } else { None };
        let mut records: Vec<RecId> = owed.contexts.iter().map(|it| self.record(it.here)).collect();
        records.extend(parent);
        records.sort_unstable();
        records.dedup();
        let counted = |rec: &RecId| self.occurrences.get(rec).map_or(0, |it| it.journal.len());
        records.into_iter().map(|rec| (rec, counted(&rec))).collect()
    }
}
