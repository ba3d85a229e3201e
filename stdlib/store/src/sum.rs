//! Checksums of rows.
//!
//! SQLite's own check does not see a flipped bit in a text or a number. Each row therefore has a number
//! computed from its table, its key and all its fields; a row of another place does not fit either. One step of
//! the mixing can be undone, so a change within one word of eight bytes is always seen; any other is missed once in 2⁶⁴.

/// Bytes of a step of all lanes.
const LANES: usize = 4 * 8;

/// A sum that is being computed.
pub struct Sum(u64);

impl Sum {
    /// For a row of a table.
    pub fn of(table: &str) -> Sum {
        Sum(0).text(table)
    }

    fn word(self, word: u64) -> Sum {
        Sum(vm::random::mix(self.0 ^ word).wrapping_add(1))
    }

    /// With a number.
    pub fn number(self, number: i64) -> Sum {
        self.word(number as u64)
    }

    /// With a text.
    pub fn text(self, text: &str) -> Sum {
        self.bytes(text.as_bytes())
    }

    /// With bytes.
    pub fn bytes(self, bytes: &[u8]) -> Sum {
        let mut sum = self.word(bytes.len() as u64);
        // Long texts in four lanes, none of which waits for the others.
        let (stripes, rest) = bytes.as_chunks::<LANES>();
        if !stripes.is_empty() {
            let mut lanes = [sum.0, 1, 2, 3];
            for stripe in stripes {
                for (lane, word) in lanes.iter_mut().zip(stripe.as_chunks::<8>().0) {
                    *lane = Sum(*lane).word(u64::from_le_bytes(*word)).0;
                }
            }
            sum = lanes.into_iter().fold(Sum(stripes.len() as u64), Sum::word);
        }
        for chunk in rest.chunks(8) {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            sum = sum.word(u64::from_le_bytes(word));
        }
        sum
    }

    /// With a number that may be missing.
    pub fn maybe_number(self, number: Option<i64>) -> Sum {
        match number {
            None => self.word(0),
            Some(number) => self.word(1).number(number),
        }
    }

    /// With a text that may be missing.
    pub fn maybe(self, text: Option<&str>) -> Sum {
        match text {
            None => self.word(0),
            Some(text) => self.word(1).text(text),
        }
    }

    /// The number.
    pub fn end(self) -> i64 {
        self.0 as i64
    }
}

#[cfg(test)]
mod tests {
    use super::Sum;

    #[test]
    fn each_bit_and_each_border_counts() {
        let sum = |a: &str, b: &str| Sum::of("t").text(a).text(b).end();
        let text = "place of the milk".to_string();
        let right = sum(&text, "x");
        for bit in 0..7 * text.len() {
            let mut bytes = text.clone().into_bytes();
            bytes[bit / 7] ^= 1 << (bit % 7);
            assert_ne!(sum(&String::from_utf8(bytes).expect("ASCII"), "x"), right);
        }
        assert_ne!(sum("ab", "c"), sum("a", "bc"));
        assert_ne!(Sum::of("t").maybe(None).end(), Sum::of("t").maybe(Some("")).end());
    }
}
