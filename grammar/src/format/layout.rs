//! Writes the measured tree.
//!
//! Each function writes at the current column and is told in `rest` how many closing brackets
//! must follow on the last line. [`Layout::separate`] alone writes between two items; it sees to it that
//! nothing follows a line comment on its line, whatever the style would like.

use crate::format::WIDTH;
use crate::format::style::{Body, Style};
use crate::format::tree::{BROKEN, File, Group, Item, Node, OwnLine, Shape, units, width};

/// Writes a file; `size` is about how long the result will be.
pub(super) fn write(file: &File<'_>, size: usize) -> String {
    let mut layout = Layout { out: String::with_capacity(size + size / 4), column: 0, after: After::Form };
    let mut previous_stands_apart = false;
    for (index, item) in file.items.iter().enumerate() {
        let stands_apart = layout.top_level(item, index == 0, previous_stands_apart);
        previous_stands_apart = stands_apart;
    }
    for (index, comment) in file.tail.iter().enumerate() {
        let is_first = index == 0 && file.items.is_empty();
        layout.own_line(comment, 0, is_first);
    }
    if !layout.out.is_empty() {
        layout.out.push('\n');
    }
    layout.out
}

/// What was written last.
#[derive(Clone, Copy, PartialEq, Eq)]
enum After {
    Form,
    /// A comment that only a bracket may follow on its line.
    Block,
    /// A comment that nothing may follow on its line.
    Line,
}

/// What a style wants between two items.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Want {
    Nothing,
    Blank,
    Line,
}

struct Layout {
    out: String,
    column: usize,
    after: After,
}

impl Layout {
    fn text(&mut self, text: &str) {
        self.out.push_str(text);
        match text.rfind('\n') {
            Some(at) => self.column = width(&text[at + 1..]),
            None => self.column += width(text),
        }
        self.after = After::Form;
    }

    fn sign(&mut self, sign: char) {
        self.out.push(sign);
        self.column += 1;
        self.after = After::Form;
    }

    fn comment(&mut self, text: &str) {
        self.text(text);
        self.after = if text.starts_with("#|") { After::Block } else { After::Line };
    }

    /// Goes to `column` of a new line. Beyond [`WIDTH`] indentation would cost more than it says.
    fn line(&mut self, column: usize, blank: bool) {
        self.out.push_str(if blank { "\n\n" } else { "\n" });
        self.column = column.min(WIDTH);
        self.out.extend(std::iter::repeat_n(' ', self.column));
        self.after = After::Form;
    }

    fn own_line(&mut self, comment: &OwnLine<'_>, column: usize, is_first: bool) {
        if !(is_first && self.out.is_empty()) {
            self.line(column, comment.blank && !is_first);
        }
        self.comment(comment.text);
    }

    /// True if `flat` columns and `rest` brackets fit on this line.
    fn fits(&self, flat: usize, rest: usize) -> bool {
        flat != BROKEN && self.column + flat + rest <= WIDTH
    }

    /// Writes a form of the top level. Definitions of several lines stand apart from their
    /// neighbours by a blank line; returns whether this is one.
    fn top_level(&mut self, item: &Item<'_>, is_first: bool, previous_stands_apart: bool) -> bool {
        let start = self.out.len();
        let own = item.notes.as_ref().map_or(&[][..], |notes| &notes.own);
        for (index, comment) in own.iter().enumerate() {
            self.own_line(comment, 0, is_first && index == 0);
        }
        if !(is_first && own.is_empty()) {
            self.line(0, item.blank && !(is_first && own.is_empty()));
        }
        let form_start = self.out.len();
        self.glued(item);
        self.item(item, 0);
        let stands_apart = item.definition && self.out[form_start..].contains('\n');
        if !is_first && (stands_apart || previous_stands_apart) && !self.out[start..].starts_with("\n\n") {
            self.out.insert(start, '\n');
        }
        stands_apart
    }

    /// Comments before `item` that share its line.
    fn glued(&mut self, item: &Item<'_>) {
        for comment in item.notes.iter().flat_map(|notes| &notes.glued) {
            self.text(comment);
            self.sign(' ');
        }
    }

    /// Writes what stands between what was last written and `item`: a blank, or line ends and
    /// comments, `column` being where a new line starts. No blank line if `is_first`.
    fn separate(&mut self, item: &Item<'_>, want: Want, column: usize, is_first: bool) {
        let own = item.notes.as_ref().map_or(&[][..], |notes| &notes.own);
        for (index, comment) in own.iter().enumerate() {
            let is_first = is_first && index == 0;
            self.line(column, comment.blank && !is_first);
            self.comment(comment.text);
        }
        if want == Want::Line || self.after != After::Form {
            self.line(column, item.blank && !(is_first && own.is_empty()));
        } else if want == Want::Blank {
            self.sign(' ');
        }
        self.glued(item);
    }

    /// A node with the comments that trail it.
    fn item(&mut self, item: &Item<'_>, rest: usize) {
        self.node(&item.node, rest);
        for comment in item.notes.iter().flat_map(|notes| &notes.trailing) {
            self.sign(' ');
            self.comment(comment);
        }
    }

    fn node(&mut self, node: &Node<'_>, rest: usize) {
        if self.fits(node.flat, rest) {
            return self.flat(node);
        }
        self.text(&node.signs);
        match &node.shape {
            Shape::Atom(text) => self.text(text),
            Shape::Group(group) => self.group(group, rest),
        }
    }

    fn flat(&mut self, node: &Node<'_>) {
        self.text(&node.signs);
        match &node.shape {
            Shape::Atom(text) => self.text(text),
            Shape::Group(group) => {
                self.sign(group.open);
                for (index, item) in group.items.iter().enumerate() {
                    if index > 0 {
                        self.sign(' ');
                    }
                    self.glued(item);
                    self.flat(&item.node);
                }
                self.sign(group.close);
            }
        }
    }

    fn group(&mut self, group: &Group<'_>, rest: usize) {
        let inner = self.column + 1;
        self.sign(group.open);
        for comment in &group.head {
            self.sign(' ');
            self.comment(comment);
        }
        let end = match group.style {
            Style::Call => self.call(group, inner, rest + 1, true),
            Style::Aligned => self.call(group, inner, rest + 1, false),
            Style::Body(body) => self.body(group, body, inner, rest + 1),
            Style::Data => self.fill(&group.items, inner, rest + 1, true),
            Style::Rows => self.rows(group, inner, rest + 1),
            Style::Map => self.map(group, inner, rest + 1),
        };
        for comment in &group.tail {
            self.line(end, comment.blank && !group.items.is_empty());
            self.comment(comment.text);
        }
        if self.after == After::Line {
            self.line(end, false);
        }
        self.sign(group.close);
    }

    /// `(f a b)`. Returns the column of the arguments.
    fn call(&mut self, group: &Group<'_>, inner: usize, rest: usize, fill: bool) -> usize {
        let Some(name) = group.items.first() else { return inner };
        let alone = if group.items.len() == 1 { rest } else { 0 };
        self.separate(name, Want::Nothing, inner, true);
        self.node(&name.node, alone);
        let below_first = self.column + 1;
        self.trailing(name);
        let arguments = units(&group.items, 1, true);
        let narrow = arguments.clone().map(narrow_unit).max().unwrap_or(0);
        let hangs = below_first + narrow + rest <= WIDTH;
        let (column, first_want) = if hangs { (below_first, Want::Blank) } else { (inner, Want::Line) };
        if fill
            && group.items[1..].iter().all(|item| !item.keyword && matches!(item.node.shape, Shape::Atom(_)))
        {
            return self.fill_arguments(&group.items[1..], column, first_want, rest);
        }
        self.units(arguments, column, first_want, rest);
        column
    }

    fn trailing(&mut self, item: &Item<'_>) {
        for comment in item.notes.iter().flat_map(|notes| &notes.trailing) {
            self.sign(' ');
            self.comment(comment);
        }
    }

    /// Units on lines of their own, only the first may be wanted elsewhere.
    fn units<'g, 't: 'g>(
        &mut self,
        units: impl Iterator<Item = &'g [Item<'t>]>,
        column: usize,
        first_want: Want,
        rest: usize,
    ) {
        let mut units = units.peekable();
        let mut is_first = true;
        while let Some(unit) = units.next() {
            let rest = if units.peek().is_none() { rest } else { 0 };
            self.unit(unit, if is_first { first_want } else { Want::Line }, column, is_first, rest);
            is_first = false;
        }
    }

    /// A form, or a key and its value, which stay on a line if there is room.
    fn unit(&mut self, unit: &[Item<'_>], want: Want, column: usize, is_first: bool, rest: usize) {
        let Some((last, keys)) = unit.split_last() else { return };
        let Some(key) = keys.first() else {
            self.separate(last, want, column, is_first);
            return self.item(last, rest);
        };
        self.separate(key, want, column, is_first);
        self.item(key, 0);
        let beside = self.fits(last.flat_code(), rest + 1) || self.column + 1 + last.narrow() + rest <= WIDTH;
        self.separate(last, if beside { Want::Blank } else { Want::Line }, column + 2, false);
        self.item(last, rest);
    }

    /// `(when test body…)`. Returns the column of the body.
    fn body(&mut self, group: &Group<'_>, body: Body, inner: usize, rest: usize) -> usize {
        let column = inner - 1 + body.indent;
        let start = group.body_start(body);
        let has_body = start < group.items.len();
        for (index, item) in group.items[..start].iter().enumerate() {
            let rest = if has_body || index + 1 < start { 0 } else { rest };
            let want = match index {
                0 => Want::Nothing,
                _ if self.stays_beside(item, group, index, rest) => Want::Blank,
                _ => Want::Line,
            };
            let new_line = if index == 0 { inner } else { inner + 3 };
            self.separate(item, want, new_line, index == 0);
            self.item(item, rest);
        }
        self.units(units(&group.items, start, body.pairs), column, Want::Line, rest);
        column
    }

    /// Whether an item of a signature goes on the line of the one before it.
    fn stays_beside(&self, item: &Item<'_>, group: &Group<'_>, index: usize, rest: usize) -> bool {
        if self.fits(item.flat_code(), rest + 1) {
            return true;
        }
        // Handlers are long: beside the name they would be pressed against the margin.
        let is_handlers =
            index == 1 && matches!(group.items[0].node.shape, Shape::Atom("with-failure-handling"));
        !is_handlers && self.column + 1 + item.narrow() + rest <= WIDTH
    }

    /// As many items on a line as fit; if `keep`, also the author's line breaks.
    fn fill(&mut self, items: &[Item<'_>], column: usize, rest: usize, keep: bool) -> usize {
        let mut line_start = self.out.len();
        for (index, item) in items.iter().enumerate() {
            let rest = if index + 1 == items.len() { rest } else { 0 };
            let several_lines = self.out[line_start..].contains('\n');
            let breaks = several_lines || (keep && item.line) || !self.fits(item.flat_code(), rest + 1);
            let want = match index {
                0 => Want::Nothing,
                _ if breaks => Want::Line,
                _ => Want::Blank,
            };
            self.separate(item, want, column, index == 0);
            line_start = self.out.len();
            self.item(item, rest);
        }
        column
    }

    fn fill_arguments(&mut self, items: &[Item<'_>], column: usize, first_want: Want, rest: usize) -> usize {
        let Some((first, others)) = items.split_first() else { return column };
        let last_rest = if others.is_empty() { rest } else { 0 };
        self.separate(first, first_want, column, true);
        self.item(first, last_rest);
        for (index, item) in others.iter().enumerate() {
            let rest = if index + 1 == others.len() { rest } else { 0 };
            let want = if self.fits(item.flat_code(), rest + 1) { Want::Blank } else { Want::Line };
            self.separate(item, want, column, false);
            self.item(item, rest);
        }
        column
    }

    fn rows(&mut self, group: &Group<'_>, column: usize, rest: usize) -> usize {
        for (index, item) in group.items.iter().enumerate() {
            let rest = if index + 1 == group.items.len() { rest } else { 0 };
            self.separate(item, if index == 0 { Want::Nothing } else { Want::Line }, column, index == 0);
            self.item(item, rest);
        }
        column
    }

    fn map(&mut self, group: &Group<'_>, column: usize, rest: usize) -> usize {
        let pairs = group.items.len() / 2;
        for (index, pair) in group.items.chunks(2).enumerate() {
            let rest = if index + 1 == pairs { rest } else { 0 };
            self.unit(pair, if index == 0 { Want::Nothing } else { Want::Line }, column, index == 0, rest);
        }
        column
    }
}

fn narrow_unit(unit: &[Item<'_>]) -> usize {
    match unit {
        [key, value] => key.narrow().max(2 + value.narrow()),
        _ => unit.iter().map(Item::narrow).max().unwrap_or(0),
    }
}
