//! Queries of rules: what `ask`, `answers`, `query` and `with-facts` become.

use vm::native::{Next, Raise, index};
use vm::rules::Ask;
use vm::rules::clause::PredId;
use vm::value::Value;

use crate::table::natives;

natives! {
    "%ask" [1 ..] in ctx => |_ctx, args| query(args, Ask::Whether);
    "%answers" [1 ..] in ctx => |_ctx, args| query(args, Ask::All);
    "%query" [1 ..] in ctx => |_ctx, args| query(args, Ask::Stream);
    "%explain" [1] in ctx => |_ctx, args| Ok(Next::Explain(args[0].clone(), true));
    "%explain-not" [1] in ctx => |_ctx, args| Ok(Next::Explain(args[0].clone(), false));
    "%push-facts" [1] in ctx => |_ctx, args| Ok(Next::PushFacts(args[0].clone()));
    "%pop-scope" [0] in ctx => |_ctx, _args| Ok(Next::PopScope);
    "%push-tree" [1] in ctx => |_ctx, args| Ok(Next::PushTree(args[0].clone()));
}

/// The compiler gives the predicate by its number.
fn query(args: &[Value], ask: Ask) -> Result<Next, Raise> {
    let predicate = PredId(index(&args[0])? as u32);
    Ok(Next::Query { predicate, inputs: args[1..].to_vec(), ask })
}
