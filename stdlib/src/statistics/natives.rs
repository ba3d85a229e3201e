//! The functions of this folder for plans: lists of numbers in, numbers and maps out.

use vm::native::{Raise, list, number, range_error, type_error};
use vm::value::{Map, Value};

use super::distribution::{binomial_at_least, student_quantile};
use super::{MOST_TRIALS, Summary, effect, fisher, holm, mcnemar, mean, median, median_interval};
use super::{paired_t, welch_t, wilcoxon, wilson};
use crate::table::natives;

natives! {
    "mean" [1] => |args: &[Value]| known(mean(&numbers(&args[0])?), SOME, &args[0]).map(Value::float);
    "median" [1] => |args: &[Value]| known(median(&numbers(&args[0])?), SOME, &args[0]).map(Value::float);
    "summary" [1] => summary;
    "paired-t-test" [2] => |args: &[Value]| t_test(paired_t, PAIRS, args);
    "welch-t-test" [2] => |args: &[Value]| t_test(welch_t, TWO, args);
    "wilcoxon-test" [2] => wilcoxon_test;
    "effect-size" [2] => effect_size;
    "wilson-interval" [2] => wilson_interval;
    "mcnemar-test" [2] => mcnemar_test;
    "fisher-test" [4] => fisher_test;
    "holm" [1] => holm_correction;
    "student-t-quantile" [2] => quantile_of_student;
    "binomial-at-least" [3] => at_least;
}

// What is missing when there is no answer.
const SOME: &str = "at least one number, all finite";
const TWO: &str = "at least two numbers in each list, all finite";
const PAIRS: &str = "at least two numbers in each list, as many in both, all finite";
const PAIR: &str = "at least one number in each list, as many in both, all finite";

fn summary(args: &[Value]) -> Result<Value, Raise> {
    let values = numbers(&args[0])?;
    let summary = known(Summary::of(&values), SOME, &args[0])?;
    let of_median = median_interval(&values);
    Ok(map([
        ("n", Value::int(count(summary.n))),
        ("mean", Value::float(summary.mean)),
        ("sd", maybe(summary.sd)),
        ("low", maybe(summary.low)),
        ("high", maybe(summary.high)),
        ("min", Value::float(summary.min)),
        ("q1", Value::float(summary.q1)),
        ("median", Value::float(summary.median)),
        ("q3", Value::float(summary.q3)),
        ("max", Value::float(summary.max)),
        ("median-low", maybe(of_median.map(|it| it.low))),
        ("median-high", maybe(of_median.map(|it| it.high))),
    ]))
}

fn t_test(
    test: fn(&[f64], &[f64]) -> Option<super::TTest>,
    needs: &str,
    args: &[Value],
) -> Result<Value, Raise> {
    let test = known(test(&numbers(&args[0])?, &numbers(&args[1])?), needs, &args[0])?;
    Ok(map([
        ("difference", Value::float(test.difference)),
        ("low", Value::float(test.low)),
        ("high", Value::float(test.high)),
        ("t", Value::float(test.t)),
        ("degrees", Value::float(test.degrees)),
        ("p", Value::float(test.p)),
    ]))
}

fn wilcoxon_test(args: &[Value]) -> Result<Value, Raise> {
    let test = known(wilcoxon(&numbers(&args[0])?, &numbers(&args[1])?), PAIR, &args[0])?;
    Ok(map([
        ("n", Value::int(count(test.n))),
        ("v", Value::float(test.v)),
        ("p", Value::float(test.p)),
        ("exact", Value::bool(test.exact)),
    ]))
}

fn effect_size(args: &[Value]) -> Result<Value, Raise> {
    let (a, b) = (numbers(&args[0])?, numbers(&args[1])?);
    let delta =
        known(effect::cliffs_delta(&a, &b), "at least one number in each list, all finite", &args[0])?;
    Ok(map([
        ("d", maybe(effect::cohens_d(&a, &b))),
        ("g", maybe(effect::hedges_g(&a, &b))),
        ("dz", maybe(effect::d_z(&a, &b))),
        ("delta", Value::float(delta)),
    ]))
}

fn wilson_interval(args: &[Value]) -> Result<Value, Raise> {
    let (k, n) = (whole(&args[0])?, whole(&args[1])?);
    let interval = known(wilson(k, n), "at least one trial, and no more successes than trials", &args[0])?;
    Ok(map([("low", Value::float(interval.low)), ("high", Value::float(interval.high))]))
}

fn mcnemar_test(args: &[Value]) -> Result<Value, Raise> {
    known(mcnemar(whole(&args[0])?, whole(&args[1])?), &most_trials(), &args[0]).map(Value::float)
}

fn fisher_test(args: &[Value]) -> Result<Value, Raise> {
    let [a, b, c, d] = [&args[0], &args[1], &args[2], &args[3]].map(whole);
    known(fisher(a?, b?, c?, d?), &most_trials(), &args[0]).map(Value::float)
}

fn holm_correction(args: &[Value]) -> Result<Value, Raise> {
    let ps = known(holm(&numbers(&args[0])?), "probabilities from 0 to 1", &args[0])?;
    Ok(Value::list(ps.into_iter().map(Value::float)))
}

fn quantile_of_student(args: &[Value]) -> Result<Value, Raise> {
    let (p, degrees) = (number(&args[0])?, number(&args[1])?);
    if !(p > 0.0 && p < 1.0) {
        return Err(range_error("a probability between 0 and 1, without these", &args[0]));
    }
    known(student_quantile(p, degrees), "degrees of freedom are above 0", &args[1]).map(Value::float)
}

fn at_least(args: &[Value]) -> Result<Value, Raise> {
    let (k, n, p) = (whole(&args[0])?, whole(&args[1])?, number(&args[2])?);
    if n > MOST_TRIALS {
        return Err(range_error(most_trials(), &args[1]));
    }
    known(binomial_at_least(k, n, p), "a probability from 0 to 1", &args[2]).map(Value::float)
}

// ---------------------------------------------------------------------------------------------
// From values, and to them

/// What was found; else a failure that says what is needed.
fn known<T>(found: Option<T>, needs: &str, given: &Value) -> Result<T, Raise> {
    found.ok_or_else(|| range_error(needs, given))
}

fn numbers(value: &Value) -> Result<Vec<f64>, Raise> {
    list(value)?.iter().map(number).collect()
}

fn whole(value: &Value) -> Result<u64, Raise> {
    let n = value.as_int().ok_or_else(|| type_error("an integer", value))?;
    u64::try_from(n).map_err(|_| range_error("a number from 0", value))
}

fn most_trials() -> String {
    format!("at most {MOST_TRIALS} trials")
}

fn count(n: usize) -> i64 {
    i64::try_from(n).unwrap_or(i64::MAX)
}

fn maybe(number: Option<f64>) -> Value {
    number.map_or(Value::NIL, Value::float)
}

fn map<const N: usize>(entries: [(&str, Value); N]) -> Value {
    let mut map = Map::new();
    for (name, value) in entries {
        map.insert(Value::keyword(name), value);
    }
    Value::map(map)
}
