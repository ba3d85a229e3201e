//! Vectors, maps and descriptions in clauses.

use crate::value::{Value, equal};

use super::lower::Keys;
use super::store::{Cell, Shape, Store};

/// True if a structure has this shape and these keys; then its values are in `values`.
pub(super) fn take_apart(store: &Store, at: u32, keys: &Keys, values: &mut [Cell]) -> bool {
    let (shape, parts) = store.parts(at);
    if shape != keys.shape {
        return false;
    }
    match shape {
        Shape::Vector => {
            if parts.len() != keys.values as usize {
                return false;
            }
            values[..parts.len()].copy_from_slice(parts);
            true
        }
        Shape::Map => pairs(store, parts, keys, values),
        Shape::Desc => match parts.split_first() {
            Some((kind, rest)) => is(store, *kind, &keys.kind) && pairs(store, rest, keys, values),
            None => false,
        },
    }
}

fn pairs(store: &Store, parts: &[Cell], keys: &Keys, values: &mut [Cell]) -> bool {
    if parts.len() != 2 * keys.keys.len() {
        return false;
    }
    for ((pair, key), value) in parts.chunks_exact(2).zip(&keys.keys).zip(values) {
        if !is(store, pair[0], key) {
            return false;
        }
        *value = pair[1];
    }
    true
}

/// True if a cell is this constant.
fn is(store: &Store, cell: Cell, value: &Value) -> bool {
    match (store.deref(cell), value) {
        (Cell::Imm(a), Value::Imm(b)) => super::store::same_imm(&a, b),
        (Cell::Obj(at), value) => equal(store.object(at), value, 10_000) == Some(true),
        _ => false,
    }
}

/// A structure with these keys and values.
pub(super) fn make(store: &mut Store, keys: &Keys, values: &[Cell]) -> Cell {
    let n = keys.values as usize;
    match keys.shape {
        Shape::Vector => store.structure(Shape::Vector, values[..n].iter().copied()),
        shape => {
            let mut parts = Vec::with_capacity(1 + 2 * n);
            if shape == Shape::Desc {
                parts.push(store.import(&keys.kind));
            }
            for (key, value) in keys.keys.iter().zip(values) {
                parts.push(store.import(key));
                parts.push(*value);
            }
            store.structure(shape, parts)
        }
    }
}
