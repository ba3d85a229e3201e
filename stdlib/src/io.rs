//! Output of the run, files, clocks.
//!
//! Printing goes to the run's own output and needs no grant. What comes from outside is asked for
//! by [`Next::Ask`]: the machine asks between two rounds and writes the answer into the run's log.

use vm::host::Request;
use vm::machine::Ctx;
use vm::native::{Next, Raise, str};
use vm::value::Value;

use crate::limit;
use crate::string::shown;
use crate::table::natives;

natives! {
    "print" [0 ..] in ctx => print;
    "write" [1] in ctx => write;
    "write-string" [1] in ctx => write_string;
    "newline" [0] in ctx => |ctx: &mut Ctx<'_>, _args| ctx.print("\n").map(|()| Value::NIL.into());
    "now" [0] in ctx => |ctx: &mut Ctx<'_>, _args| Ok(Value::float(ctx.now_s()).into());
    "read-file" [1] in ctx Read => read_file;
    "write-file" [2] in ctx Write => write_file;
    "current-time" [0] in ctx Clock => |_ctx, _args| Ok(Next::Ask(Request::Clock));
}

fn print(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let mut line = limit::Text::default();
    for (i, arg) in args.iter().enumerate() {
        if i > 0 {
            line.push(" ")?;
        }
        line.push(&shown(ctx, arg))?;
    }
    line.push("\n")?;
    ctx.print(&line.into_string())?;
    Ok(Value::NIL.into())
}

fn write(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let text = ctx.text(&args[0], true);
    ctx.print(&text)?;
    Ok(Value::NIL.into())
}

fn write_string(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    ctx.print(str(&args[0])?)?;
    Ok(Value::NIL.into())
}

/// The host answers with the text, with nothing, or with a number of seconds.
fn read_file(_ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    Ok(Next::Ask(Request::ReadFile(str(&args[0])?.into())))
}

fn write_file(_ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let (path, text) = (str(&args[0])?.into(), str(&args[1])?.into());
    Ok(Next::Ask(Request::WriteFile { path, text }))
}
