//! Forms to code.
