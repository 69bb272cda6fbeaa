//! Huffman codes and the bits that they are read from (ITU-T T.81, C.2 and F.2.2.3 to F.2.2.5).

use super::RESTARTS;

/// How many bits are looked up at once: hardly a code is longer.
const SHORT_BITS: u32 = 9;
/// Bits of the longest code.
const LONGEST: usize = 16;

/// The codes of one table.
pub(super) struct Table {
    /// By the next [`SHORT_BITS`] bits: a code's length and value; length 0 where it is longer.
    short: [(u8, u8); 1 << SHORT_BITS],
    /// By length: what lies above its codes and all shorter ones, as the first of 16 bits.
    ends: [u32; LONGEST + 1],
    /// By length: its first code.
    firsts: [u32; LONGEST + 1],
    /// By length: how many codes are shorter.
    starts: [usize; LONGEST + 1],
    /// The codes' values.
    values: Vec<u8>,
}

impl Table {
    /// The table at the beginning of a segment that defines them: its class (0 for DC, 1 for
    /// AC) and number, itself, and the rest of the segment. `None` if it is no such table.
    pub(super) fn read(segment: &[u8]) -> Option<(usize, usize, Self, &[u8])> {
        let (&[place], rest) = segment.split_first_chunk()?;
        let (counts, rest) = rest.split_first_chunk::<LONGEST>()?;
        let total = counts.iter().map(|&count| usize::from(count)).sum();
        let (values, rest) = rest.split_at_checked(total)?;
        let (class, number) = (usize::from(place >> 4), usize::from(place & 15));
        Some((class, number, Self::new(counts, values)?, rest))
    }

    /// Codes by how many there are of each length, and their values; `None` if they are more
    /// than fit.
    fn new(counts: &[u8; LONGEST], values: &[u8]) -> Option<Self> {
        let mut table = Self {
            short: [(0, 0); 1 << SHORT_BITS],
            ends: [0; LONGEST + 1],
            firsts: [0; LONGEST + 1],
            starts: [0; LONGEST + 1],
            values: values.to_vec(),
        };
        let mut code = 0_u32;
        let mut start = 0;
        for (length, &count) in (1..=LONGEST).zip(counts) {
            let count = usize::from(count);
            table.firsts[length] = code;
            table.starts[length] = start;
            for &value in &values[start..start + count] {
                if let Some(free) = SHORT_BITS.checked_sub(length as u32) {
                    let at = (code as usize) << free;
                    let entries = table.short.get_mut(at..at + (1 << free))?;
                    entries.fill((length as u8, value));
                }
                code += 1;
            }
            if code > 1 << length {
                return None;
            }
            table.ends[length] = code << (LONGEST - length);
            start += count;
            code <<= 1;
        }
        Some(table)
    }

    /// Length and value of the code that 16 bits begin with, one longer than
    /// [`SHORT_BITS`]; `None` if there is none.
    #[cold]
    fn long(&self, bits: u32) -> Option<(u8, u8)> {
        let mut lengths = SHORT_BITS as usize + 1..=LONGEST;
        let length = lengths.find(|&length| bits < self.ends[length])?;
        let code = (bits >> (LONGEST - length)).checked_sub(self.firsts[length])?;
        let value = *self.values.get(self.starts[length] + code as usize)?;
        Some((length as u8, value))
    }
}

/// The bits of a scan, up to its next marker; behind them come zeros without end.
#[derive(Clone)]
pub(super) struct Bits<'a> {
    bytes: &'a [u8],
    /// Where in `bytes` to go on; at the marker once `is_at_marker`.
    at: usize,
    is_at_marker: bool,
    /// The next bits, first the highest.
    buffer: u64,
    /// How many of them count.
    held: u32,
    /// How many zeros were put behind the scan's bits since the last restart.
    zeros: u32,
}

impl<'a> Bits<'a> {
    /// What follows a scan's header.
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self {
            bytes,
            at: 0,
            is_at_marker: false,
            buffer: 0,
            held: 0,
            zeros: 0,
        }
    }

    /// The next code's value; `None` if the bits are no code.
    #[inline]
    pub(super) fn code(&mut self, table: &Table) -> Option<u8> {
        self.refill();
        let (length, value) = match table.short[(self.buffer >> (64 - SHORT_BITS)) as usize] {
            (0, _) => table.long((self.buffer >> (64 - LONGEST)) as u32)?,
            short => short,
        };
        self.skip(u32::from(length));
        Some(value)
    }

    /// The next bits, 16 at most, as a number.
    #[inline]
    pub(super) fn number(&mut self, bits: u32) -> u32 {
        self.refill();
        let number = (self.buffer >> 32 >> (32 - bits)) as u32;
        self.skip(bits);
        number
    }

    /// Passes over 16 bits at most; once, right after a code.
    #[inline]
    pub(super) fn skip(&mut self, bits: u32) {
        self.buffer <<= bits;
        self.held -= bits;
    }

    /// Whether more was read than there is before the next marker.
    #[inline]
    pub(super) fn is_overrun(&self) -> bool {
        self.zeros > self.held
    }

    /// Whether nothing is left before the next marker but the ones that fill up a byte.
    pub(super) fn is_at_end(&mut self) -> bool {
        self.refill();
        let left = self.held.saturating_sub(self.zeros);
        let last = self.buffer >> 32 >> (32 - left.min(32));
        left < 8 && (last == (1 << left) - 1)
    }

    /// The next whole byte that nothing has read of yet; `None` at the marker.
    pub(super) fn byte(&mut self) -> Option<u8> {
        self.skip(self.held % 8);
        self.refill();
        (self.held > self.zeros).then(|| self.number(8) as u8)
    }

    /// Goes on behind the marker if that is a restart; whether it was. Only once
    /// [`Self::byte`] is `None`.
    pub(super) fn restart(&mut self) -> bool {
        let fill = self.bytes[self.at..].iter().take_while(|&&b| b == 0xFF);
        let marker = self.at + fill.count();
        let is_restart = self.bytes.get(marker).is_some_and(|m| RESTARTS.contains(m));
        if is_restart {
            *self = Self {
                at: marker + 1,
                ..Self::new(self.bytes)
            };
        }
        is_restart
    }

    /// What begins with the marker that ends the bits. Only once [`Self::byte`] is `None`.
    pub(super) fn rest(&self) -> &'a [u8] {
        &self.bytes[self.at..]
    }

    /// Makes that 32 bits are held: a code and the number behind it.
    #[inline]
    fn refill(&mut self) {
        if self.held < 32 {
            self.fill();
        }
    }

    /// Makes that 56 bits are held; of those behind `held` the buffer may have some already.
    fn fill(&mut self) {
        // Most often no byte of the next eight is FF.
        if let Some(next) = self.bytes[self.at..].first_chunk() {
            let next = u64::from_be_bytes(*next);
            if !has_ff(next) {
                let bytes = (63 - self.held) / 8;
                self.buffer |= next >> self.held;
                self.held += 8 * bytes;
                self.at += bytes as usize;
                return;
            }
        }
        while self.held <= 56 {
            match self.unstuffed() {
                Some(byte) => self.buffer |= u64::from(byte) << (56 - self.held),
                None => self.zeros += 8,
            }
            self.held += 8;
        }
    }

    /// The next byte, FF where that is written as FF 00; `None` before a marker.
    fn unstuffed(&mut self) -> Option<u8> {
        if self.is_at_marker {
            return None;
        }
        let rest = &self.bytes[self.at..];
        if let Some(&byte) = rest.first().filter(|&&byte| byte != 0xFF) {
            self.at += 1;
            return Some(byte);
        }
        let fill = rest.iter().take_while(|&&byte| byte == 0xFF).count();
        if rest.get(fill) == Some(&0) {
            self.at += fill + 1;
            return Some(0xFF);
        }
        self.is_at_marker = true;
        None
    }
}

/// Whether one of eight bytes is FF: whether one of their complements is 0, which alone has
/// a borrow from its highest bit though that is not set.
fn has_ff(bytes: u64) -> bool {
    const LOWEST: u64 = 0x0101_0101_0101_0101;
    let complement = !bytes;
    complement.wrapping_sub(LOWEST) & bytes & (LOWEST << 7) != 0
}
