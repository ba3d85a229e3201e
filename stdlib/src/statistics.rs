//! Distributions, from the crate `statrs`.

use statrs::distribution::{Binomial, ContinuousCDF, DiscreteCDF, StudentsT};
use vm::native::{Raise, number, range_error, type_error};
use vm::value::Value;

use crate::table::natives;

natives! {
    "student-t-quantile" [2] => student_t_quantile;
    "binomial-at-least" [3] => binomial_at_least;
}

fn student_t_quantile(args: &[Value]) -> Result<Value, Raise> {
    let (p, degrees) = (number(&args[0])?, number(&args[1])?);
    if !(p > 0.0 && p < 1.0) {
        return Err(range_error("a probability between 0 and 1, without these", &args[0]));
    }
    let t = StudentsT::new(0.0, 1.0, degrees)
        .map_err(|_| range_error("degrees of freedom are above 0", &args[1]))?;
    Ok(Value::float(t.inverse_cdf(p)))
}

fn binomial_at_least(args: &[Value]) -> Result<Value, Raise> {
    let (k, n) = (whole(&args[0])?, whole(&args[1])?);
    let trials = Binomial::new(number(&args[2])?, n)
        .map_err(|_| range_error("a probability from 0 to 1", &args[2]))?;
    Ok(Value::float(match k {
        0 => 1.0,
        k if k > n => 0.0,
        k => trials.sf(k - 1),
    }))
}

fn whole(value: &Value) -> Result<u64, Raise> {
    let n = value.as_int().ok_or_else(|| type_error("an integer", value))?;
    u64::try_from(n).map_err(|_| range_error("a number from 0", value))
}
