//! Forms and comments as one tree, measured.
//!
//! A comment belongs to a form: it *trails* the form it follows on the same line, is *glued* to
//! the one it precedes on the same line, or stands on lines of its own above it. What follows the
//! last form of a bracket is its *tail*.

use crate::form::{Form, FormKind, Prefix};
use crate::format::style::{self, Body, Breaks, Role, Style};
use crate::parse::{Comment, Parsed};
use crate::span::Span;

/// A width that fits nowhere: the node must be broken.
pub(super) const BROKEN: usize = usize::MAX;

/// A form to be written.
pub(super) struct Node<'t> {
    /// The prefixes before it, `'` or `,@` or several.
    pub(super) signs: Box<str>,
    pub(super) shape: Shape<'t>,
    /// Its width on one line, or [`BROKEN`].
    pub(super) flat: usize,
    /// About the least width that it can be squeezed into. Does not depend on the author's line
    /// breaks, so that choices made by it come out the same when the result is formatted again.
    pub(super) narrow: usize,
}

pub(super) enum Shape<'t> {
    /// Copied from the source.
    Atom(&'t str),
    Group(Box<Group<'t>>),
}

/// A bracketed form.
pub(super) struct Group<'t> {
    pub(super) open: char,
    pub(super) close: char,
    pub(super) style: Style,
    pub(super) items: Vec<Item<'t>>,
    /// Comments on the line of the opening bracket, before the first item's line.
    pub(super) head: Vec<&'t str>,
    /// Comments between the last item and the closing bracket.
    pub(super) tail: Vec<OwnLine<'t>>,
}

/// A form within a bracket, with its comments.
pub(super) struct Item<'t> {
    pub(super) node: Node<'t>,
    /// The author put it on a new line.
    pub(super) line: bool,
    /// The author left a blank line before it.
    pub(super) blank: bool,
    /// It is a keyword, which may go with the form after it.
    pub(super) keyword: bool,
    /// It is a definition.
    pub(super) definition: bool,
    pub(super) notes: Option<Box<Notes<'t>>>,
}

/// The comments of an item.
#[derive(Default)]
pub(super) struct Notes<'t> {
    pub(super) own: Vec<OwnLine<'t>>,
    pub(super) glued: Vec<&'t str>,
    pub(super) trailing: Vec<&'t str>,
}

/// A comment on a line of its own.
pub(super) struct OwnLine<'t> {
    pub(super) text: &'t str,
    pub(super) blank: bool,
}

/// The whole file.
pub(super) struct File<'t> {
    pub(super) items: Vec<Item<'t>>,
    pub(super) tail: Vec<OwnLine<'t>>,
}

impl Item<'_> {
    /// Width on one line with the comments that are glued to it, or [`BROKEN`].
    pub(super) fn flat(&self) -> usize {
        match &self.notes {
            None => self.node.flat,
            Some(notes) if notes.own.is_empty() && notes.trailing.is_empty() => {
                self.node.flat.saturating_add(glued_width(&notes.glued))
            }
            Some(_) => BROKEN,
        }
    }

    /// The same, if comments that trail it go on the line after all.
    pub(super) fn flat_code(&self) -> usize {
        match &self.notes {
            Some(notes) if notes.own.is_empty() => self.node.flat.saturating_add(glued_width(&notes.glued)),
            _ => self.flat(),
        }
    }

    pub(super) fn narrow(&self) -> usize {
        let glued = self.notes.as_ref().map_or(0, |notes| glued_width(&notes.glued));
        self.node.narrow + glued
    }
}

fn glued_width(glued: &[&str]) -> usize {
    glued.iter().map(|comment| width(comment) + 1).sum()
}

pub(super) fn width(text: &str) -> usize {
    if text.is_ascii() { text.len() } else { text.chars().count() }
}

/// Builds the tree of a text without errors.
pub(super) fn build<'t>(text: &'t str, parsed: &Parsed) -> File<'t> {
    let mut builder = Builder { text, comments: &parsed.comments };
    let forms: Vec<&Form> = parsed.forms.iter().collect();
    let place = Place { start: 0, end: text.len(), bracketed: false };
    let (items, mut head, tail) = builder.items(&forms, place, |_| Role::Code);
    debug_assert!(head.is_empty(), "only brackets have a head");
    head.clear();
    File { items, tail }
}

struct Builder<'t, 'c> {
    text: &'t str,
    /// Those that have not been given to a form.
    comments: &'c [Comment],
}

/// The inside of a bracket, or the whole file.
#[derive(Clone, Copy)]
struct Place {
    start: usize,
    end: usize,
    bracketed: bool,
}

/// What stands between two neighbours.
#[derive(Default)]
struct Gap<'t> {
    trailing: Vec<&'t str>,
    own: Vec<OwnLine<'t>>,
    glued: Vec<&'t str>,
    /// Line ends before the second neighbour (or what is glued to it).
    newlines: usize,
}

type Items<'t> = (Vec<Item<'t>>, Vec<&'t str>, Vec<OwnLine<'t>>);

impl<'t> Builder<'t, '_> {
    fn slice(&self, span: Span) -> &'t str {
        &self.text[span.start as usize..span.end as usize]
    }

    fn newlines(&self, start: usize, end: usize) -> usize {
        self.text.as_bytes()[start..end].iter().filter(|byte| **byte == b'\n').count()
    }

    /// The comments that begin before byte `end`.
    fn take_comments(&mut self, end: usize) -> &[Comment] {
        let count = self.comments.iter().take_while(|comment| (comment.span.start as usize) < end).count();
        let (taken, rest) = self.comments.split_at(count);
        self.comments = rest;
        taken
    }

    /// Comments and line ends between `start`, the end of one neighbour, and `end`, where the other
    /// begins; `closes` if that is a bracket or the end of the file.
    fn gap(&mut self, start: usize, end: usize, closes: bool) -> Gap<'t> {
        if self.comments.first().is_none_or(|comment| comment.span.start as usize >= end) {
            return Gap { newlines: self.newlines(start, end), ..Gap::default() };
        }
        self.commented_gap(start, end, closes)
    }

    fn commented_gap(&mut self, start: usize, end: usize, closes: bool) -> Gap<'t> {
        let comments: Vec<Comment> = self.take_comments(end).to_vec();
        let starts = comments.iter().map(|comment| comment.span.start as usize).chain([end]);
        let ends = [start].into_iter().chain(comments.iter().map(|comment| comment.span.end as usize));
        // How many line ends stand before each comment, and before the second neighbour.
        let before: Vec<usize> = ends.zip(starts).map(|(from, to)| self.newlines(from, to)).collect();
        let texts: Vec<&'t str> =
            comments.iter().map(|comment| self.slice(comment.span).trim_end()).collect();
        let mut own_end = comments.len();
        while !closes
            && own_end > 0
            && before[own_end] == 0
            && comments[own_end - 1].block
            && !texts[own_end - 1].contains('\n')
        {
            own_end -= 1;
        }
        let own_start = before[..own_end].iter().position(|newlines| *newlines > 0).unwrap_or(own_end);
        let own = own_start..own_end;
        Gap {
            trailing: texts[..own_start].to_vec(),
            own: own.map(|at| OwnLine { text: texts[at], blank: before[at] > 1 }).collect(),
            glued: texts[own_end..].to_vec(),
            newlines: before[own_end],
        }
    }

    fn items(&mut self, forms: &[&Form], place: Place, role: impl Fn(usize) -> Role) -> Items<'t> {
        let mut items: Vec<Item<'t>> = Vec::with_capacity(forms.len());
        let mut head = Vec::new();
        let mut previous_end = place.start;
        for (index, form) in forms.iter().enumerate() {
            let (notes, newlines) = self.before(previous_end, form, &mut items, &mut head, place);
            let item = self.item(form, role(index), newlines, notes);
            items.push(item);
            previous_end = form.span.end as usize;
        }
        let gap = self.gap(previous_end, place.end, true);
        let tail = self.place_trailing(&mut items, &mut head, gap.trailing, gap.own, place);
        (items, head, tail)
    }

    /// The comments that belong to `form`, and the line ends before it. Those that belong to what
    /// stands before are given to it.
    ///
    /// This and the other functions that are never inlined keep the frames of the recursion over
    /// nested forms small.
    #[inline(never)]
    fn before(
        &mut self,
        previous_end: usize,
        form: &Form,
        items: &mut [Item<'t>],
        head: &mut Vec<&'t str>,
        place: Place,
    ) -> (Option<Box<Notes<'t>>>, usize) {
        let gap = self.gap(previous_end, form.span.start as usize, false);
        let own = self.place_trailing(items, head, gap.trailing, gap.own, place);
        let has_notes = !own.is_empty() || !gap.glued.is_empty();
        let notes = has_notes.then(|| Box::new(Notes { own, glued: gap.glued, trailing: Vec::new() }));
        (notes, gap.newlines)
    }

    /// Gives trailing comments to the item, or bracket, that they follow. What follows the start of
    /// the file is on a line of its own. Returns the comments on their own lines.
    fn place_trailing(
        &self,
        items: &mut [Item<'t>],
        head: &mut Vec<&'t str>,
        trailing: Vec<&'t str>,
        mut own: Vec<OwnLine<'t>>,
        place: Place,
    ) -> Vec<OwnLine<'t>> {
        if trailing.is_empty() {
            return own;
        }
        match items.last_mut() {
            Some(item) => item.notes.get_or_insert_default().trailing = trailing,
            None if place.bracketed => *head = trailing,
            None => {
                own.splice(0..0, trailing.into_iter().map(|text| OwnLine { text, blank: false }));
            }
        }
        own
    }

    fn item(
        &mut self,
        form: &Form,
        role: Role,
        newlines: usize,
        mut notes: Option<Box<Notes<'t>>>,
    ) -> Item<'t> {
        let (core, role, signs) = self.peel(form, role, &mut notes);
        Item {
            node: self.node(core, role, signs),
            line: newlines > 0 || notes.as_ref().is_some_and(|notes| !notes.own.is_empty()),
            blank: newlines > 1,
            keyword: matches!(form.kind, FormKind::Keyword(_)),
            definition: style::is_definition(form),
            notes,
        }
    }

    /// The form behind the prefixes of `form`, its role, and the prefixes.
    #[inline(never)]
    fn peel<'f>(
        &mut self,
        form: &'f Form,
        mut role: Role,
        notes: &mut Option<Box<Notes<'t>>>,
    ) -> (&'f Form, Role, Box<str>) {
        let mut signs = String::new();
        let mut core = form;
        while let FormKind::Prefixed(sign, inner) = &core.kind {
            signs.push_str(sign.sign());
            // A comment between a prefix and its form moves before the prefix, and so do those before it.
            let inside: Vec<Comment> = self.take_comments(inner.span.start as usize).to_vec();
            if !inside.is_empty() {
                let notes = notes.get_or_insert_default();
                let texts = inside.iter().map(|comment| self.slice(comment.span).trim_end());
                let moved: Vec<&'t str> = notes.glued.drain(..).chain(texts).collect();
                notes.own.extend(moved.into_iter().map(|text| OwnLine { text, blank: false }));
            }
            role = if *sign == Prefix::Quote { Role::Quoted } else { Role::Code };
            core = inner;
        }
        (core, role, signs.into_boxed_str())
    }

    fn node(&mut self, form: &Form, role: Role, signs: Box<str>) -> Node<'t> {
        let Some((brackets, children, style)) = children(form, role) else { return self.atom(form, signs) };
        let place =
            Place { start: form.span.start as usize + 1, end: form.span.end as usize - 1, bracketed: true };
        let is_list = brackets[0] == '(';
        let roles = |index| if is_list { style::role_of(&children, role, style, index) } else { Role::Code };
        let (items, head, tail) = self.items(&children, place, roles);
        group(Group { open: brackets[0], close: brackets[1], style, items, head, tail }, signs)
    }

    #[inline(never)]
    fn atom(&self, form: &Form, signs: Box<str>) -> Node<'t> {
        let text = self.slice(form.span);
        let narrow = signs.len() + width(text.lines().next().unwrap_or_default());
        let flat = if text.contains('\n') { BROKEN } else { narrow };
        Node { signs, shape: Shape::Atom(text), flat, narrow }
    }
}

#[inline(never)]
fn group<'t>(group: Group<'t>, signs: Box<str>) -> Node<'t> {
    let (flat, narrow) = (signs.len().saturating_add(group.flat()), signs.len() + group.narrow());
    Node { signs, shape: Shape::Group(Box::new(group)), flat, narrow }
}

/// The brackets, elements and style of `form`, unless it is an atom.
#[inline(never)]
fn children(form: &Form, role: Role) -> Option<([char; 2], Vec<&Form>, Style)> {
    Some(match &form.kind {
        FormKind::List(items) => {
            let children: Vec<&Form> = items.iter().collect();
            let style = style::of_list(&children, role);
            (['(', ')'], children, style)
        }
        FormKind::Vector(items) => (['[', ']'], items.iter().collect(), Style::Data),
        FormKind::Map(pairs) => {
            (['{', '}'], pairs.iter().flat_map(|(key, value)| [key, value]).collect(), Style::Map)
        }
        _ => return None,
    })
}

impl Group<'_> {
    fn flat(&self) -> usize {
        if !self.head.is_empty() || !self.tail.is_empty() || self.must_break() {
            return BROKEN;
        }
        let blanks = self.items.len().saturating_sub(1);
        self.items.iter().fold(2 + blanks, |sum, item| sum.saturating_add(item.flat()))
    }

    /// True if the style asks for a break even where all would fit.
    ///
    /// A line break of the author's counts only at a place where the broken form has one too, or
    /// else it would be gone when the result is formatted again.
    fn must_break(&self) -> bool {
        let line_from = |first: usize| self.items.iter().skip(first).any(|item| item.line);
        match self.style {
            Style::Call => false,
            Style::Aligned => line_from(2),
            Style::Data | Style::Rows => line_from(1),
            Style::Map => self.items.iter().step_by(2).skip(1).any(|key| key.line),
            Style::Body(body) => {
                let units = units(&self.items, self.body_start(body), body.pairs);
                let (mut count, mut line) = (0, false);
                for unit in units {
                    count += 1;
                    line |= unit[0].line;
                }
                match body.breaks {
                    Breaks::Author => line,
                    Breaks::Several => line || count > 1,
                    Breaks::Always => count > 0,
                }
            }
        }
    }

    /// Where the body starts: after the name, its signature, and flags like `:tabled`.
    pub(super) fn body_start(&self, body: Body) -> usize {
        let start = (1 + body.signature).min(self.items.len());
        if body.breaks != Breaks::Always {
            return start;
        }
        let flags = self.items[start..].iter().take_while(|item| item.keyword).count();
        (start + flags).min(self.items.len() - 1).max(start)
    }

    fn narrow(&self) -> usize {
        let widest = |items: &[Item<'_>]| items.iter().map(Item::narrow).max().unwrap_or(0);
        match self.style {
            Style::Body(body) => {
                let start = self.body_start(body);
                let name = self.items.first().map_or(0, Item::narrow);
                let signature = self.items.get(1..start).map_or(0, widest);
                let inner = widest(&self.items[start..]);
                (1 + name).max(4 + signature).max(body.indent + inner + 1)
            }
            _ => widest(&self.items) + 2,
        }
    }
}

/// The items from `start` on, a keyword together with what follows it if `pairs`.
pub(super) fn units<'g, 't>(items: &'g [Item<'t>], start: usize, pairs: bool) -> Units<'g, 't> {
    Units { rest: items.get(start..).unwrap_or_default(), pairs }
}

/// See [`units`].
#[derive(Clone)]
pub(super) struct Units<'g, 't> {
    rest: &'g [Item<'t>],
    pairs: bool,
}

impl<'g, 't> Iterator for Units<'g, 't> {
    type Item = &'g [Item<'t>];

    fn next(&mut self) -> Option<&'g [Item<'t>]> {
        let is_pair = self.pairs && matches!(self.rest, [key, value, ..] if key.keyword && !value.keyword);
        let count = if is_pair { 2 } else { 1 };
        let (unit, rest) = self.rest.split_at_checked(count)?;
        self.rest = rest;
        Some(unit)
    }
}
