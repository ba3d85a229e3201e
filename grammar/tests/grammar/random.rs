//! What must hold for any text: random forms, random tokens, random bytes.

use grammar::{FileId, Form, FormKind, Prefix, Span, completeness, format, parse, parse_bytes};
use proptest::prelude::*;

use crate::formatting::formatted;

fn form() -> impl Strategy<Value = Form> {
    let head = prop::sample::select(HEADS).prop_map(|name| FormKind::Symbol(name.into()));
    let leaf = prop_oneof![
        4 => head.clone(),
        2 => "[a-z?!<>=*.:@|#\"'12+-]{0,4}".prop_map(|name| FormKind::Symbol(name.as_str().into())),
        1 => any::<String>().prop_map(|name| FormKind::Symbol(name.as_str().into())),
        3 => "[a-z]{1,5}".prop_map(|name| FormKind::Keyword(name.as_str().into())),
        1 => any::<String>().prop_map(|name| FormKind::Keyword(name.as_str().into())),
        2 => any::<i64>().prop_map(FormKind::Int),
        2 => any::<f64>().prop_filter("nan is not equal to itself", |x| !x.is_nan()).prop_map(FormKind::Float),
        2 => any::<String>().prop_map(|text| FormKind::Str(text.into())),
    ];
    let leaf = leaf.prop_map(at_start);
    leaf.prop_recursive(7, 120, 8, move |inner| {
        let items = || prop::collection::vec(inner.clone(), 0..8);
        let pairs = prop::collection::vec((inner.clone(), inner.clone()), 0..4);
        let call = (head.clone(), items()).prop_map(|(head, mut items)| {
            items.insert(0, at_start(head));
            FormKind::List(items)
        });
        let prefixed = (prop::sample::select(PREFIXES), inner.clone());
        prop_oneof![
            6 => call,
            3 => items().prop_map(FormKind::List),
            1 => items().prop_map(FormKind::Vector),
            1 => pairs.prop_map(FormKind::Map),
            1 => prefixed.prop_map(|(sign, form)| FormKind::Prefixed(sign, Box::new(form))),
        ]
        .prop_map(at_start)
    })
}

const PREFIXES: &[Prefix] = &[Prefix::Quote, Prefix::Quasi, Prefix::Unquote, Prefix::Splice];

const HEADS: &[&str] = &[
    "f",
    "a",
    "an",
    "if",
    "let",
    "when",
    "cond",
    "case",
    "par",
    "def-plan",
    "def-fun",
    "def-rules",
    "def-const",
    "def-method",
    "def-failure",
    "def-odd",
    "with-failure-handling",
    "with-retry-counters",
    "with-it",
    "lambda",
    "<-",
    "perform",
    "partial-order",
    "dolist",
    "module",
    "a-function-with-a-rather-long-name",
];

fn at_start(kind: FormKind) -> Form {
    Form::new(kind, Span::default())
}

/// Writes `form` with blanks, line ends and comments drawn from `noise` between its tokens.
fn scatter(form: &Form, noise: &mut impl Iterator<Item = u8>, out: &mut String) {
    gap(noise, out);
    match &form.kind {
        FormKind::List(items) => {
            out.push('(');
            items.iter().for_each(|item| scatter(item, noise, out));
            gap(noise, out);
            out.push(')');
        }
        FormKind::Vector(items) => {
            out.push('[');
            items.iter().for_each(|item| scatter(item, noise, out));
            gap(noise, out);
            out.push(']');
        }
        FormKind::Map(pairs) => {
            out.push('{');
            pairs.iter().flat_map(|(key, value)| [key, value]).for_each(|item| scatter(item, noise, out));
            gap(noise, out);
            out.push('}');
        }
        FormKind::Prefixed(sign, form) => {
            out.push_str(sign.sign());
            scatter(form, noise, out);
        }
        FormKind::Str(text)
            if !text.contains('\\') && noise.next().is_some_and(|byte| byte.is_multiple_of(2)) =>
        {
            // Line ends as they are, where they would be printed as escapes.
            out.push_str(&at_start(FormKind::Str(text.clone())).to_string().replace("\\n", "\n"));
        }
        _ => out.push_str(&form.to_string()),
    }
}

fn gap(noise: &mut impl Iterator<Item = u8>, out: &mut String) {
    out.push(' ');
    loop {
        out.push_str(match noise.next().unwrap_or_default() % 32 {
            0..16 => return,
            16..20 => "\n ",
            20 => "\n\n ",
            21 => "\r\n ",
            22..25 => "; line (\n ",
            25 => " ;;\t\n\n ",
            26..29 => "#| in |#",
            29 => "#| two\n lines |# ",
            30 => "   ",
            _ => " ; größe \u{3000}\r\n ",
        });
    }
}

/// The text of each form reads as that form, and forms lie within one another in their order.
fn check_spans(text: &str, forms: &[Form], start: usize, end: usize) -> Result<(), TestCaseError> {
    let mut at = start;
    for form in forms {
        let (first, last) = (form.span.start as usize, form.span.end as usize);
        prop_assert!(at <= first && first < last && last <= end, "{form} at {:?}", form.span);
        let again = parse(FileId(0), &text[first..last]);
        prop_assert_eq!(&again.forms[..], std::slice::from_ref(form));
        match &form.kind {
            FormKind::List(items) | FormKind::Vector(items) => check_spans(text, items, first + 1, last - 1)?,
            FormKind::Map(pairs) => {
                let items: Vec<Form> =
                    pairs.iter().flat_map(|(key, value)| [key.clone(), value.clone()]).collect();
                check_spans(text, &items, first + 1, last - 1)?;
            }
            FormKind::Prefixed(sign, form) => {
                check_spans(text, std::slice::from_ref(form), first + sign.sign().len(), last)?;
            }
            _ => {}
        }
        at = last;
    }
    Ok(())
}

/// Errors are within the text and in order.
pub(crate) fn check_order(text: &str, errors: &[grammar::ParseError]) -> Result<(), TestCaseError> {
    let mut last = 0;
    for error in errors {
        let span = error.span();
        prop_assert!(
            last <= span.start && span.start <= span.end && span.end as usize <= text.len(),
            "{error:?}"
        );
        prop_assert!(text.is_char_boundary(span.start as usize) && text.is_char_boundary(span.end as usize));
        prop_assert!(
            miette::Diagnostic::code(error).is_some_and(|code| code.to_string() != "parse::internal")
        );
        last = span.start;
    }
    Ok(())
}

/// Nothing else is asked of a wild text than that its errors can be shown.
fn check_wild(text: &str) -> Result<(), TestCaseError> {
    let parsed = parse(FileId(0), text);
    check_order(text, &parsed.errors)?;
    prop_assert_eq!(format(text).is_ok(), parsed.errors.is_empty());
    let printed: String = parsed.forms.iter().map(|form| form.to_string() + "\n").collect();
    let again = parse(FileId(0), &printed);
    prop_assert_eq!(again.errors, []);
    let reprinted: String = again.forms.iter().map(|form| form.to_string() + "\n").collect();
    prop_assert_eq!(reprinted, printed);
    let _ = completeness(text);
    Ok(())
}

const SOUP: &[&str] = &[
    "(", ")", "[", "]", "{", "}", "(", ")", "'", "`", ",", ",@", "\"", "\\", "|", "#|", "|#", "#", ";", "\n",
    "\n(def-x", " ", " ", "a", ":k", ":", "1", "1.", "-", "0x", "e9", "@", "ö", "“", "\u{0}", "\u{202e}",
    "\"s\"", "+nan",
];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(if cfg!(debug_assertions) { 400 } else { 20_000 }))]

    #[test]
    fn printed_forms_read_back(form in form()) {
        let text = form.to_string();
        prop_assert!(!text.contains('\n'));
        let parsed = parse(FileId(0), &text);
        prop_assert_eq!(parsed.errors, []);
        prop_assert_eq!(parsed.forms, [form]);
    }

    #[test]
    fn formatting_keeps_forms_and_comments(
        forms in prop::collection::vec(form(), 0..4),
        noise in prop::collection::vec(any::<u8>(), 0..600),
    ) {
        let mut text = String::new();
        let mut noise = noise.into_iter();
        forms.iter().for_each(|form| scatter(form, &mut noise, &mut text));
        gap(&mut noise, &mut text);
        let parsed = parse(FileId(0), &text);
        prop_assert_eq!(&parsed.errors, &[]);
        prop_assert_eq!(&parsed.forms, &forms);
        formatted(&text);
        check_spans(&text, &parsed.forms, 0, text.len())?;
    }

    #[test]
    fn bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let _ = parse_bytes(FileId(0), &bytes);
        check_wild(&String::from_utf8_lossy(&bytes))?;
    }

    #[test]
    fn any_text_never_panics(text in any::<String>()) {
        check_wild(&text)?;
    }

    #[test]
    fn tokens_in_any_order_never_panic(tokens in prop::collection::vec(prop::sample::select(SOUP), 0..60)) {
        check_wild(&tokens.concat())?;
    }
}
