//! Random numbers, from the keyed draws of the run: the same seed gives the same numbers at the
//! same place of a plan, whatever its siblings draw.

use vm::machine::Ctx;
use vm::native::{Next, Raise, number, range_error};
use vm::value::Value;

use crate::sequence::{elements, like};
use crate::table::natives;

natives! {
    "random" [1] in ctx => random;
    "random-float" [0] in ctx => |ctx: &mut Ctx<'_>, _args| Ok(Value::float(unit(ctx)).into());
    "random-normal" [0 2] in ctx => normal;
    "random-choice" [1] in ctx => choice;
    "shuffle" [1] in ctx => shuffle;
}

/// In [0, 1), one of 2^53.
fn unit(ctx: &mut Ctx<'_>) -> f64 {
    (ctx.draw() >> 11) as f64 / (1u64 << 53) as f64
}

/// In 0..n, each equally likely. Source: Lemire, Fast Random Integer Generation in an Interval, 2019.
///
/// Draws again where the product falls into the part that would be likelier; after 64 times, which
/// a fair source never needs, it takes what it has.
fn below(ctx: &mut Ctx<'_>, n: u64) -> u64 {
    let unfair = n.wrapping_neg() % n;
    let mut product = 0;
    for _ in 0..64 {
        product = u128::from(ctx.draw()) * u128::from(n);
        if product as u64 >= unfair {
            break;
        }
    }
    (product >> 64) as u64
}

fn random(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let end = number(&args[0])?;
    if !(end > 0.0 && end.is_finite()) {
        return Err(range_error("a random number lies between zero and a positive number", &args[0]));
    }
    Ok(match args[0].as_int() {
        Some(end) => Value::int(below(ctx, end.unsigned_abs()) as i64),
        // Rounding may reach the end itself, which is excluded.
        None => Value::float((unit(ctx) * end).min(end.next_down())),
    }
    .into())
}

/// Source: Box and Muller, 1958; of its two numbers one is used, so that each call is two draws.
fn normal(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let mean = args.first().map_or(Ok(0.0), number)?;
    let deviation = args.get(1).map_or(Ok(1.0), number)?;
    if !(mean.is_finite() && deviation.is_finite() && deviation >= 0.0) {
        let shown = args.get(1).cloned().unwrap_or_default();
        return Err(range_error("mean and deviation are finite, and a deviation is not negative", &shown));
    }
    let radius = (-2.0 * libm::log(1.0 - unit(ctx))).sqrt();
    let angle = std::f64::consts::TAU * unit(ctx);
    Ok(Value::float(mean + deviation * radius * libm::cos(angle)).into())
}

fn choice(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let items = elements(&args[0])?;
    if items.is_empty() {
        return Err(range_error("there is nothing to choose from", &args[0]));
    }
    let at = below(ctx, items.len() as u64) as usize;
    Ok(items[at].clone().into())
}

/// Source: Fisher and Yates, as in Knuth, TAOCP 3.4.2, algorithm P.
fn shuffle(ctx: &mut Ctx<'_>, args: &[Value]) -> Result<Next, Raise> {
    let mut items = elements(&args[0])?;
    for last in (1..items.len()).rev() {
        let other = below(ctx, last as u64 + 1) as usize;
        items.swap(last, other);
    }
    Ok(like(&args[0], items).into())
}
