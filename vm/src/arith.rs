//! Arithmetic of values: integers of 64 bits that never wrap, floats, and mixtures.

use std::cmp::Ordering;

use crate::native::{Raise, arithmetic_error, type_error};
use crate::value::Value;

type Numbers = Result<Pair, Raise>;

enum Pair {
    Ints(i64, i64),
    Floats(f64, f64),
}

fn numbers(a: &Value, b: &Value) -> Numbers {
    if let (Some(a), Some(b)) = (a.as_int(), b.as_int()) {
        return Ok(Pair::Ints(a, b));
    }
    let float = |value: &Value| value.as_number().ok_or_else(|| type_error("a number", value));
    Ok(Pair::Floats(float(a)?, float(b)?))
}

fn overflow(sign: &str, a: i64, b: i64) -> Raise {
    arithmetic_error(format!("({sign} {a} {b}) is out of the range of integers"))
}

/// A float as a result: nan comes out of nan only.
fn float(result: f64, sign: &str, a: f64, b: f64) -> Result<Value, Raise> {
    if result.is_nan() && !a.is_nan() && !b.is_nan() {
        return Err(arithmetic_error(format!(
            "({sign} {} {}) is no number",
            crate::print::float(a),
            crate::print::float(b)
        )));
    }
    Ok(Value::float(result))
}

macro_rules! operation {
    ($($(#[$doc:meta])+ $name:ident, $sign:literal, $checked:ident, $op:tt;)+) => {
        $($(#[$doc])+
        ///
        /// # Errors
        /// `type-error` if one is no number, `arithmetic-error` if there is no result.
        pub fn $name(a: &Value, b: &Value) -> Result<Value, Raise> {
            match numbers(a, b)? {
                Pair::Ints(a, b) => a.$checked(b).map(Value::int).ok_or_else(|| overflow($sign, a, b)),
                Pair::Floats(a, b) => float(a $op b, $sign, a, b),
            }
        })+
    };
}

operation! {
    /// a + b
    add, "+", checked_add, +;
    /// a - b
    sub, "-", checked_sub, -;
    /// a * b
    mul, "*", checked_mul, *;
}

/// a / b: an integer if both are and it is exact, else a float.
///
/// # Errors
/// `type-error` if one is no number, `arithmetic-error` for a division by zero.
pub fn div(a: &Value, b: &Value) -> Result<Value, Raise> {
    match numbers(a, b)? {
        Pair::Ints(a, 0) => Err(arithmetic_error(format!("(/ {a} 0) divides by zero"))),
        Pair::Ints(a, b) => match a.checked_rem(b) {
            None => Err(overflow("/", a, b)),
            Some(0) => Ok(Value::int(a / b)),
            Some(_) => Ok(Value::float(a as f64 / b as f64)),
        },
        Pair::Floats(a, 0.0) => {
            Err(arithmetic_error(format!("(/ {} 0) divides by zero", crate::print::float(a))))
        }
        Pair::Floats(a, b) => float(a / b, "/", a, b),
    }
}

/// The order of two numbers; none if one is nan.
///
/// # Errors
/// `type-error` if one is no number.
pub fn order(a: &Value, b: &Value) -> Result<Option<Ordering>, Raise> {
    Ok(match (numbers(a, b)?, a.as_int(), b.as_int()) {
        (Pair::Ints(a, b), ..) => Some(a.cmp(&b)),
        (Pair::Floats(_, b), Some(a), _) => int_with_float(a, b),
        (Pair::Floats(a, _), _, Some(b)) => int_with_float(b, a).map(Ordering::reverse),
        (Pair::Floats(a, b), ..) => a.partial_cmp(&b),
    })
}

/// The order of an integer and a float by their exact sizes: a float nearest to the integer may
/// be another number. None for nan.
#[must_use]
pub fn int_with_float(int: i64, float: f64) -> Option<Ordering> {
    // The least float that is too large for an integer; its opposite is the least integer.
    const BEYOND: f64 = 9_223_372_036_854_775_808.0;
    if float.is_nan() {
        return None;
    }
    if float >= BEYOND {
        return Some(Ordering::Less);
    }
    if float < -BEYOND {
        return Some(Ordering::Greater);
    }
    let whole = float.trunc();
    Some(
        int.cmp(&(whole as i64))
            .then_with(|| if whole == float { Ordering::Equal } else { whole.total_cmp(&float) }),
    )
}

/// a < b
///
/// # Errors
/// `type-error` if one is no number.
pub fn less(a: &Value, b: &Value) -> Result<bool, Raise> {
    Ok(order(a, b)? == Some(Ordering::Less))
}

/// a <= b
///
/// # Errors
/// `type-error` if one is no number.
pub fn less_eq(a: &Value, b: &Value) -> Result<bool, Raise> {
    Ok(matches!(order(a, b)?, Some(Ordering::Less | Ordering::Equal)))
}

/// a = b as numbers: an integer and a float of the same size are equal.
///
/// # Errors
/// `type-error` if one is no number.
pub fn num_eq(a: &Value, b: &Value) -> Result<bool, Raise> {
    Ok(order(a, b)? == Some(Ordering::Equal))
}
