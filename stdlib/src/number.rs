//! Numbers: integers of 64 bits that never wrap, and floats.
//!
//! The four operations and the comparisons of two numbers are the machine's (`vm::arith`); here they
//! take any number of arguments. A float that is no number comes out of one that is none only;
//! otherwise it is an `arithmetic-error`.

use vm::arith;
use vm::failure::{Builtin, Failure};
use vm::native::{Raise, arithmetic_error, int, number, range_error, str, type_error};
use vm::value::{Imm, Value};

use crate::table::natives;

natives! {
    "+" [0 ..] => |args: &[Value]| fold(arith::add, 0, args);
    "*" [0 ..] => |args: &[Value]| fold(arith::mul, 1, args);
    "-" [1 ..] => subtract;
    "/" [1 ..] => divide;
    "1+" [1] => |args: &[Value]| arith::add(&args[0], &Value::int(1));
    "1-" [1] => |args: &[Value]| arith::sub(&args[0], &Value::int(1));
    "<" [1 ..] => |args: &[Value]| chain(args, arith::less);
    "<=" [1 ..] => |args: &[Value]| chain(args, arith::less_eq);
    ">" [1 ..] => |args: &[Value]| chain(args, |a, b| arith::less(b, a));
    ">=" [1 ..] => |args: &[Value]| chain(args, |a, b| arith::less_eq(b, a));
    "=" [1 ..] => |args: &[Value]| chain(args, arith::num_eq);
    "/=" [2] => |args: &[Value]| Ok(Value::bool(!arith::num_eq(&args[0], &args[1])?));
    "min" [1 ..] => |args: &[Value]| extreme(args, arith::less);
    "max" [1 ..] => |args: &[Value]| extreme(args, |new, best| arith::less(best, new));
    "abs" [1] => absolute;
    "sign" [1] => sign;
    "signum" [1] => sign;

    "div" [2] => |args: &[Value]| Rounding::Down.divide(args);
    "mod" [2] => modulo;
    "rem" [2] => remainder;
    "floor" [1 2] => |args: &[Value]| Rounding::Down.divide(args);
    "ceiling" [1 2] => |args: &[Value]| Rounding::Up.divide(args);
    "round" [1 2] => |args: &[Value]| Rounding::Nearest.divide(args);
    "truncate" [1 2] => |args: &[Value]| Rounding::ToZero.divide(args);
    "float" [1] => |args: &[Value]| number(&args[0]).map(Value::float);
    "gcd" [0 ..] => greatest_divisor;
    "lcm" [0 ..] => least_multiple;

    "sqrt" [1] => |args: &[Value]| real("sqrt", f64::sqrt, args);
    "expt" [2] => power;
    "exp" [1] => |args: &[Value]| real("exp", libm::exp, args);
    "log" [1 2] => logarithm;
    "sin" [1] => |args: &[Value]| real("sin", libm::sin, args);
    "cos" [1] => |args: &[Value]| real("cos", libm::cos, args);
    "tan" [1] => |args: &[Value]| real("tan", libm::tan, args);
    "asin" [1] => |args: &[Value]| real("asin", libm::asin, args);
    "acos" [1] => |args: &[Value]| real("acos", libm::acos, args);
    "atan" [1 2] => arc_tangent;
    "atan2" [2] => arc_tangent;
    "hypot" [2] => |args: &[Value]| Ok(Value::float(libm::hypot(number(&args[0])?, number(&args[1])?)));

    "number?" [1] => |args: &[Value]| is_number(args);
    "numberp" [1] => |args: &[Value]| is_number(args);
    "integer?" [1] => |args: &[Value]| is_integer(args);
    "integerp" [1] => |args: &[Value]| is_integer(args);
    "float?" [1] => |args: &[Value]| is_float(args);
    "floatp" [1] => |args: &[Value]| is_float(args);
    "nan?" [1] => |args: &[Value]| Ok(Value::bool(number(&args[0])?.is_nan()));
    "finite?" [1] => |args: &[Value]| Ok(Value::bool(number(&args[0])?.is_finite()));
    "zero?" [1] => |args: &[Value]| Ok(Value::bool(number(&args[0])? == 0.0));
    "zerop" [1] => |args: &[Value]| Ok(Value::bool(number(&args[0])? == 0.0));
    "positive?" [1] => |args: &[Value]| Ok(Value::bool(number(&args[0])? > 0.0));
    "plusp" [1] => |args: &[Value]| Ok(Value::bool(number(&args[0])? > 0.0));
    "negative?" [1] => |args: &[Value]| Ok(Value::bool(number(&args[0])? < 0.0));
    "minusp" [1] => |args: &[Value]| Ok(Value::bool(number(&args[0])? < 0.0));
    "even?" [1] => |args: &[Value]| Ok(Value::bool(int(&args[0])? & 1 == 0));
    "evenp" [1] => |args: &[Value]| Ok(Value::bool(int(&args[0])? & 1 == 0));
    "odd?" [1] => |args: &[Value]| Ok(Value::bool(int(&args[0])? & 1 == 1));
    "oddp" [1] => |args: &[Value]| Ok(Value::bool(int(&args[0])? & 1 == 1));

    "bit-and" [0 ..] => |args: &[Value]| bits(args, -1, |a, b| a & b);
    "logand" [0 ..] => |args: &[Value]| bits(args, -1, |a, b| a & b);
    "bit-or" [0 ..] => |args: &[Value]| bits(args, 0, |a, b| a | b);
    "logior" [0 ..] => |args: &[Value]| bits(args, 0, |a, b| a | b);
    "bit-xor" [0 ..] => |args: &[Value]| bits(args, 0, |a, b| a ^ b);
    "logxor" [0 ..] => |args: &[Value]| bits(args, 0, |a, b| a ^ b);
    "bit-not" [1] => |args: &[Value]| Ok(Value::int(!int(&args[0])?));
    "lognot" [1] => |args: &[Value]| Ok(Value::int(!int(&args[0])?));
    "shift" [2] => shift;
    "ash" [2] => shift;

    "number->string" [1 2] => number_to_string;
    "parse-number" [1 2] => parse_number;
    "parse-integer" [1 2] => parse_integer;
}

type Two<T> = fn(&Value, &Value) -> Result<T, Raise>;

fn fold(op: Two<Value>, unit: i64, args: &[Value]) -> Result<Value, Raise> {
    let Some((first, rest)) = args.split_first() else { return Ok(Value::int(unit)) };
    number(first)?;
    rest.iter().try_fold(first.clone(), |sum, arg| op(&sum, arg))
}

fn subtract(args: &[Value]) -> Result<Value, Raise> {
    match args {
        [Value::Imm(Imm::Float(x))] => Ok(Value::float(-x)),
        [x] => arith::sub(&Value::int(0), x),
        _ => fold(arith::sub, 0, args),
    }
}

fn divide(args: &[Value]) -> Result<Value, Raise> {
    if let [x] = args { arith::div(&Value::int(1), x) } else { fold(arith::div, 1, args) }
}

/// True if `holds` between each argument and the next. All are checked to be numbers, even those
/// after the first pair that does not hold.
fn chain(args: &[Value], holds: Two<bool>) -> Result<Value, Raise> {
    for arg in args {
        number(arg)?;
    }
    for pair in args.windows(2) {
        if !holds(&pair[0], &pair[1])? {
            return Ok(Value::FALSE);
        }
    }
    Ok(Value::TRUE)
}

/// The first argument that no other is `better` than; nan if there is one.
fn extreme(args: &[Value], better: Two<bool>) -> Result<Value, Raise> {
    let mut best = &args[0];
    for arg in args {
        if number(arg)?.is_nan() || better(arg, best)? {
            best = arg;
        }
    }
    Ok(best.clone())
}

fn absolute(args: &[Value]) -> Result<Value, Raise> {
    match args[0].as_int() {
        Some(i) => i.checked_abs().map(Value::int).ok_or_else(|| out_of_range(format!("(abs {i})"))),
        None => number(&args[0]).map(|f| Value::float(f.abs())),
    }
}

fn sign(args: &[Value]) -> Result<Value, Raise> {
    let x = number(&args[0])?;
    Ok(Value::int(i64::from(x > 0.0) - i64::from(x < 0.0)))
}

fn out_of_range(call: String) -> Raise {
    arithmetic_error(format!("{call} is out of the range of integers"))
}

// ---------------------------------------------------------------------------------------------
// Division with a remainder, rounding

/// How the exact quotient becomes an integer.
#[derive(Clone, Copy)]
enum Rounding {
    Down,
    Up,
    ToZero,
    /// To the nearest, halves to the even one.
    Nearest,
}

impl Rounding {
    /// `x` or `x / y`, rounded.
    fn divide(self, args: &[Value]) -> Result<Value, Raise> {
        let [x, y] = args else {
            return if args[0].as_int().is_some() {
                Ok(args[0].clone())
            } else {
                self.integer(number(&args[0])?)
            };
        };
        let (Some(x), Some(y)) = (x.as_int(), y.as_int()) else {
            return self.integer(number(&arith::div(x, y)?)?);
        };
        if y == 0 {
            return Err(divided_by_zero());
        }
        let quotient = self.quotient(x.into(), y.into());
        i64::try_from(quotient)
            .map(Value::int)
            .map_err(|_| out_of_range(format!("the quotient of {x} and {y}")))
    }

    /// In 128 bits nothing overflows.
    fn quotient(self, x: i128, y: i128) -> i128 {
        let (quotient, rest) = (x / y, x % y);
        let away = quotient + if (x < 0) == (y < 0) { 1 } else { -1 };
        let goes_away = match self {
            _ if rest == 0 => false,
            Rounding::ToZero => false,
            Rounding::Down => away < quotient,
            Rounding::Up => away > quotient,
            Rounding::Nearest => match (2 * rest.abs()).cmp(&y.abs()) {
                std::cmp::Ordering::Less => false,
                std::cmp::Ordering::Equal => quotient % 2 != 0,
                std::cmp::Ordering::Greater => true,
            },
        };
        if goes_away { away } else { quotient }
    }

    fn integer(self, x: f64) -> Result<Value, Raise> {
        let rounded = match self {
            Rounding::Down => x.floor(),
            Rounding::Up => x.ceil(),
            Rounding::ToZero => x.trunc(),
            Rounding::Nearest => x.round_ties_even(),
        };
        const END: f64 = 9_223_372_036_854_775_808.0; // 2^63
        let fits = (-END..END).contains(&rounded);
        if fits { Ok(Value::int(rounded as i64)) } else { Err(out_of_range(vm::print::float(x))) }
    }
}

fn divided_by_zero() -> Raise {
    arithmetic_error("division by zero")
}

/// What two integers or two floats leave; the sign is that of the first.
fn rest_of(args: &[Value]) -> Result<Value, Raise> {
    let (x, y) = (number(&args[0])?, number(&args[1])?);
    if y == 0.0 {
        return Err(divided_by_zero());
    }
    match (args[0].as_int(), args[1].as_int()) {
        (Some(x), Some(y)) => Ok(Value::int(x.wrapping_rem(y))),
        _ => checked("rem", x % y, &[x, y]),
    }
}

fn remainder(args: &[Value]) -> Result<Value, Raise> {
    rest_of(args)
}

/// As `rem`, but the sign is that of the divisor.
fn modulo(args: &[Value]) -> Result<Value, Raise> {
    let rest = rest_of(args)?;
    let (r, y) = (number(&rest)?, number(&args[1])?);
    let other_side = r != 0.0 && (r < 0.0) != (y < 0.0);
    if other_side { arith::add(&rest, &args[1]) } else { Ok(rest) }
}

fn divisor_of(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { divisor_of(b, a % b) }
}

fn greatest_divisor(args: &[Value]) -> Result<Value, Raise> {
    let mut divisor = 0;
    for arg in args {
        divisor = divisor_of(divisor, int(arg)?.unsigned_abs());
    }
    i64::try_from(divisor).map(Value::int).map_err(|_| out_of_range("gcd".into()))
}

fn least_multiple(args: &[Value]) -> Result<Value, Raise> {
    let mut multiple = 1u64;
    let mut fits = true;
    for arg in args {
        let n = int(arg)?.unsigned_abs();
        if n == 0 {
            return Ok(Value::int(0));
        }
        let next = multiple.checked_mul(n / divisor_of(multiple, n));
        fits &= next.is_some();
        multiple = next.unwrap_or(1);
    }
    let multiple = i64::try_from(multiple).ok().filter(|_| fits);
    multiple.map(Value::int).ok_or_else(|| out_of_range("lcm".into()))
}

// ---------------------------------------------------------------------------------------------
// Real functions

/// A float as a result: nan comes out of nan only.
fn checked(name: &str, result: f64, args: &[f64]) -> Result<Value, Raise> {
    if result.is_nan() && !args.iter().any(|arg| arg.is_nan()) {
        let args: Vec<_> = args.iter().map(|arg| vm::print::float(*arg)).collect();
        return Err(arithmetic_error(format!("({name} {}) is no number", args.join(" "))));
    }
    Ok(Value::float(result))
}

fn real(name: &str, function: fn(f64) -> f64, args: &[Value]) -> Result<Value, Raise> {
    let x = number(&args[0])?;
    checked(name, function(x), &[x])
}

/// (log x) and (log x base). The logarithm of zero fails as a division by zero does.
fn logarithm(args: &[Value]) -> Result<Value, Raise> {
    let x = number(&args[0])?;
    let base = args.get(1).map(number).transpose()?;
    if x == 0.0 || base == Some(0.0) || base == Some(1.0) {
        return Err(arithmetic_error("the logarithm of zero, or to base zero or one, is no number"));
    }
    let result = match base {
        None => libm::log(x),
        Some(2.0) => libm::log2(x),
        Some(10.0) => libm::log10(x),
        Some(base) => libm::log(x) / libm::log(base),
    };
    checked("log", result, &[x, base.unwrap_or(1.0)])
}

fn arc_tangent(args: &[Value]) -> Result<Value, Raise> {
    let y = number(&args[0])?;
    Ok(Value::float(match args.get(1) {
        None => libm::atan(y),
        Some(x) => libm::atan2(y, number(x)?),
    }))
}

/// An integer where both are and the result is one, else a float.
fn power(args: &[Value]) -> Result<Value, Raise> {
    let (x, y) = (number(&args[0])?, number(&args[1])?);
    if x == 0.0 && y < 0.0 {
        return Err(divided_by_zero());
    }
    let (Some(base), Some(exponent)) = (args[0].as_int(), args[1].as_int()) else {
        return checked("expt", libm::pow(x, y), &[x, y]);
    };
    let whole = integer_power(base, exponent.unsigned_abs());
    match whole {
        Some(whole) if exponent >= 0 => Ok(Value::int(whole)),
        None if exponent >= 0 => Err(out_of_range(format!("(expt {base} {exponent})"))),
        Some(whole) => arith::div(&Value::int(1), &Value::int(whole)),
        None => Ok(Value::float(libm::pow(x, y))),
    }
}

fn integer_power(base: i64, exponent: u64) -> Option<i64> {
    match (base, u32::try_from(exponent)) {
        (_, Ok(exponent)) => base.checked_pow(exponent),
        (0 | 1, Err(_)) => Some(base),
        (-1, Err(_)) => Some(if exponent.is_multiple_of(2) { 1 } else { -1 }),
        (_, Err(_)) => None,
    }
}

// ---------------------------------------------------------------------------------------------
// Questions, bits

fn is_number(args: &[Value]) -> Result<Value, Raise> {
    Ok(Value::bool(args[0].as_number().is_some()))
}

fn is_integer(args: &[Value]) -> Result<Value, Raise> {
    Ok(Value::bool(args[0].as_int().is_some()))
}

fn is_float(args: &[Value]) -> Result<Value, Raise> {
    Ok(Value::bool(matches!(args[0], Value::Imm(Imm::Float(_)))))
}

fn bits(args: &[Value], unit: i64, op: fn(i64, i64) -> i64) -> Result<Value, Raise> {
    args.iter().try_fold(unit, |all, arg| Ok(op(all, int(arg)?))).map(Value::int)
}

/// To the left by a positive number, to the right by a negative one.
fn shift(args: &[Value]) -> Result<Value, Raise> {
    let (x, by) = (int(&args[0])?, int(&args[1])?);
    if by <= 0 {
        return Ok(Value::int(x >> by.unsigned_abs().min(63)));
    }
    let fits = x == 0 || by < 64;
    let shifted = fits.then(|| i128::from(x) << by.min(63)).and_then(|shifted| i64::try_from(shifted).ok());
    shifted.map(Value::int).ok_or_else(|| out_of_range(format!("(shift {x} {by})")))
}

// ---------------------------------------------------------------------------------------------
// Text

fn radix(arg: Option<&Value>) -> Result<u32, Raise> {
    let Some(arg) = arg else { return Ok(10) };
    let radix = u32::try_from(int(arg)?).ok().filter(|radix| (2..=36).contains(radix));
    radix.ok_or_else(|| range_error("a radix is a number from 2 to 36", arg))
}

fn number_to_string(args: &[Value]) -> Result<Value, Raise> {
    let radix = radix(args.get(1))?;
    match args[0].as_int() {
        Some(i) => Ok(Value::str(digits(i, radix))),
        None if radix == 10 => number(&args[0]).map(|f| Value::str(vm::print::float(f))),
        None => Err(type_error("an integer", &args[0])),
    }
}

fn digits(i: i64, radix: u32) -> String {
    let mut left = i.unsigned_abs();
    let mut text = Vec::new();
    while left > 0 || text.is_empty() {
        text.extend(char::from_digit((left % u64::from(radix)) as u32, radix));
        left /= u64::from(radix);
    }
    if i < 0 {
        text.push('-');
    }
    text.iter().rev().collect()
}

/// The failure of text that is not what it should be.
fn unreadable(expected: &str, text: &str) -> Raise {
    let shown = vm::print::brief(&Value::str(text));
    Box::new(Failure::with(
        Builtin::ParseError,
        vec![("message", Value::str(format!("{shown} is not {expected}"))), ("text", Value::str(text))],
    ))
}

fn parse_number(args: &[Value]) -> Result<Value, Raise> {
    let text = str(&args[0])?;
    match (read_number(text), args.get(1)) {
        (Some(number), _) => Ok(number),
        (None, Some(default)) => Ok(default.clone()),
        (None, None) => Err(unreadable("a number", text)),
    }
}

fn parse_integer(args: &[Value]) -> Result<Value, Raise> {
    let text = str(&args[0])?;
    let radix = radix(args.get(1))?;
    i64::from_str_radix(text, radix).map(Value::int).map_err(|_| unreadable("an integer", text))
}

/// Decimal integers and floats. Rust also reads words such as `infinity`, programs do not.
fn read_number(text: &str) -> Option<Value> {
    match text {
        "+inf" => return Some(Value::float(f64::INFINITY)),
        "-inf" => return Some(Value::float(f64::NEG_INFINITY)),
        "+nan" => return Some(Value::float(f64::NAN)),
        _ => {}
    }
    let plain = text.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'+' | b'-' | b'.' | b'e' | b'E'));
    let unsigned = text.strip_prefix(['+', '-']).unwrap_or(text);
    let bare_point = text.ends_with('.') || text.contains(".e") || text.contains(".E");
    if !plain || bare_point || !unsigned.starts_with(|c: char| c.is_ascii_digit()) {
        return None;
    }
    if unsigned.bytes().all(|byte| byte.is_ascii_digit()) {
        return text.parse().ok().map(Value::int);
    }
    text.parse().ok().filter(|f: &f64| f.is_finite()).map(Value::float)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ints(values: &[i64]) -> Vec<Value> {
        values.iter().copied().map(Value::int).collect()
    }

    #[test]
    fn quotients_round_as_they_say() {
        for (x, y, [down, up, zero, near]) in [
            (7, 2, [3, 4, 3, 4]),
            (-7, 2, [-4, -3, -3, -4]),
            (5, 2, [2, 3, 2, 2]),
            (5, -2, [-3, -2, -2, -2]),
            (6, 3, [2, 2, 2, 2]),
        ] {
            assert_eq!(Rounding::Down.quotient(x, y), down, "{x} {y}");
            assert_eq!(Rounding::Up.quotient(x, y), up, "{x} {y}");
            assert_eq!(Rounding::ToZero.quotient(x, y), zero, "{x} {y}");
            assert_eq!(Rounding::Nearest.quotient(x, y), near, "{x} {y}");
        }
    }

    #[test]
    fn the_ends_of_the_range_fail_and_never_wrap() {
        let name = |result: Result<Value, Raise>| result.map_err(|raise| raise.name.to_string());
        let failed = Err("arithmetic-error".to_string());
        assert_eq!(name(Rounding::Down.divide(&ints(&[i64::MIN, -1]))), failed);
        assert_eq!(name(absolute(&ints(&[i64::MIN]))), failed);
        assert_eq!(name(subtract(&ints(&[i64::MIN]))), failed);
        assert_eq!(name(power(&ints(&[2, 63]))), failed);
        assert_eq!(name(shift(&ints(&[1, 63]))), failed);
        assert_eq!(name(shift(&ints(&[-1, 63]))), Ok(Value::int(i64::MIN)));
        assert_eq!(name(shift(&ints(&[1, 64]))), failed);
        assert_eq!(name(shift(&ints(&[-1, i64::MAX]))), failed);
        assert_eq!(name(shift(&ints(&[0, i64::MAX]))), Ok(Value::int(0)));
        assert_eq!(name(shift(&ints(&[-5, i64::MIN]))), Ok(Value::int(-1)));
        assert_eq!(name(modulo(&ints(&[i64::MIN, -1]))), Ok(Value::int(0)));
        assert_eq!(name(power(&ints(&[-1, i64::MIN]))), Ok(Value::int(1)));
        assert_eq!(name(greatest_divisor(&ints(&[i64::MIN]))), failed);
        assert_eq!(name(Rounding::Down.divide(&[Value::float(9.3e18)])), failed);
        assert_eq!(name(Rounding::Down.divide(&[Value::float(f64::NAN)])), failed);
        assert_eq!(digits(i64::MIN, 10), i64::MIN.to_string());
    }

    #[test]
    fn text_is_a_number_or_not() {
        for (text, number) in [
            ("42", Value::int(42)),
            ("-7", Value::int(-7)),
            ("1.5", Value::float(1.5)),
            ("2e3", Value::float(2e3)),
        ] {
            assert_eq!(read_number(text), Some(number), "{text}");
        }
        let too_large = ["99999999999999999999", "1e999"];
        for text in ["", "-", "x", "1x", ".5", "5.", "1e", "infinity", "nan", " 1", "--1", "1.2.3", "1.e5"]
            .into_iter()
            .chain(too_large)
        {
            assert_eq!(read_number(text), None, "{text}");
        }
    }
}
