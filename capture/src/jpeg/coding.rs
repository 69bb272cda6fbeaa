//! What the MCUs of a scan are made of, and how long each is (ITU-T T.81, F.2.2 and G.1.2).

use super::huffman::{Bits, Table};

/// Coefficients of a block.
pub(super) const COEFFICIENTS: u32 = 64;
/// See [`Coding::least_more`]. Of 9000 files made by putting zeros, random bytes or text into
/// 500 pictures, 8 are taken to be damaged with these.
const LEAST_MORE: usize = 9;
const LEAST_MORE_ALIKE: usize = 200;

pub(super) enum Coding<'a> {
    /// Blocks of whole components or of their DC coefficients: of each component that an MCU
    /// has, how many.
    Blocks(Vec<(usize, Block<'a>)>),
    /// A band of one component's AC coefficients, block by block.
    Band(Band<'a>),
}

#[derive(Clone, Copy)]
pub(super) enum Block<'a> {
    Whole {
        dc: &'a Table,
        ac: &'a Table,
    },
    /// DC coefficients but for their last bits.
    Dc(&'a Table),
    /// One more bit of DC coefficients.
    DcBit,
}

pub(super) struct Band<'a> {
    pub(super) table: &'a Table,
    pub(super) first: u32,
    pub(super) last: u32,
    /// Whether it is one more bit of coefficients that came before.
    pub(super) is_bit: bool,
    /// By block: which of its coefficients are known not to be 0, the lowest bit the first.
    pub(super) nonzero: &'a mut [u64],
    /// How many blocks from here on have nothing more.
    pub(super) empty_blocks: u32,
}

impl Coding<'_> {
    /// Reads an MCU; `None` if it is none.
    pub(super) fn read(&mut self, bits: &mut Bits<'_>, mcu: usize) -> Option<()> {
        match self {
            Self::Blocks(parts) => {
                for &(count, block) in parts.iter() {
                    for _ in 0..count {
                        block.read(bits)?;
                    }
                }
                Some(())
            }
            Self::Band(band) => {
                let mut nonzero = band.nonzero[mcu];
                band.read(bits, &mut nonzero)?;
                band.nonzero[mcu] = nonzero;
                Some(())
            }
        }
    }

    /// How many bytes must be left behind a scan, or before a restart, to be taken for more
    /// of it: fewer are read as MCUs by chance. The more so where these are all of a kind.
    pub(super) fn least_more(&self) -> usize {
        match self {
            Self::Band(band) if band.is_bit => usize::MAX,
            Self::Blocks(parts) if matches!(parts[0].1, Block::DcBit) => usize::MAX,
            Self::Blocks(parts) if parts.len() > 1 => LEAST_MORE,
            _ => LEAST_MORE_ALIKE,
        }
    }

    /// Reads an MCU of which nothing was read in an earlier scan.
    pub(super) fn read_more(&mut self, bits: &mut Bits<'_>) -> Option<()> {
        match self {
            Self::Band(band) => band.read(bits, &mut 0),
            Self::Blocks(_) => self.read(bits, 0),
        }
    }

    /// Whether no block is announced that was not read.
    pub(super) fn is_complete(&self) -> bool {
        match self {
            Self::Band(band) => band.empty_blocks == 0,
            Self::Blocks(_) => true,
        }
    }

    /// Forgets what a restart makes forgotten.
    pub(super) fn restart(&mut self) {
        if let Self::Band(band) = self {
            band.empty_blocks = 0;
        }
    }
}

impl Block<'_> {
    #[inline]
    fn read(self, bits: &mut Bits<'_>) -> Option<()> {
        match self {
            Self::DcBit => {
                bits.number(1);
                Some(())
            }
            Self::Dc(dc) => read_dc(bits, dc),
            Self::Whole { dc, ac } => {
                read_dc(bits, dc)?;
                let mut next = 1;
                while next < COEFFICIENTS {
                    let (zeros, size) = halves(bits.code(ac)?);
                    if size == 0 && zeros < 15 {
                        break;
                    }
                    bits.skip(size);
                    next += zeros + 1;
                    if size > 0 && next > COEFFICIENTS {
                        return None;
                    }
                }
                Some(())
            }
        }
    }
}

/// A difference of DC coefficients.
#[inline]
fn read_dc(bits: &mut Bits<'_>, table: &Table) -> Option<()> {
    let size = bits.code(table)?;
    if size > 15 {
        return None;
    }
    bits.skip(size.into());
    Some(())
}

/// What the value of an AC coefficient's code says: how many zeros come before it, and its
/// bits.
#[inline]
fn halves(value: u8) -> (u32, u32) {
    (u32::from(value >> 4), u32::from(value & 15))
}

impl Band<'_> {
    /// The first bits of a block's coefficients (T.81, G.1.2.2).
    fn read(&mut self, bits: &mut Bits<'_>, nonzero: &mut u64) -> Option<()> {
        if self.is_bit {
            return self.read_bit(bits, nonzero);
        }
        if self.empty_blocks > 0 {
            self.empty_blocks -= 1;
            return Some(());
        }
        let mut next = self.first;
        while next <= self.last {
            let (zeros, size) = halves(bits.code(self.table)?);
            if size == 0 && zeros < 15 {
                self.empty_blocks = (1 << zeros) - 1 + bits.number(zeros);
                break;
            }
            bits.skip(size);
            next += zeros;
            if size > 0 {
                if next > self.last {
                    return None;
                }
                *nonzero |= 1 << next;
            }
            next += 1;
        }
        Some(())
    }

    /// One more bit of them (T.81, G.1.2.3): every coefficient that is not 0 has one, and
    /// codes tell which are no longer 0.
    fn read_bit(&mut self, bits: &mut Bits<'_>, nonzero: &mut u64) -> Option<()> {
        let known = *nonzero;
        let mut next = self.first;
        if self.empty_blocks == 0 {
            while next <= self.last {
                let (mut zeros, size) = halves(bits.code(self.table)?);
                if size == 0 && zeros < 15 {
                    self.empty_blocks = (1 << zeros) + bits.number(zeros);
                    break;
                }
                if size > 1 {
                    return None;
                }
                bits.skip(size);
                // Up to the zero after so many zeros.
                loop {
                    if next > self.last {
                        if size > 0 {
                            return None;
                        }
                        break;
                    }
                    if (known >> next) & 1 == 1 {
                        bits.number(1);
                    } else if zeros == 0 {
                        *nonzero |= u64::from(size) << next;
                        next += 1;
                        break;
                    } else {
                        zeros -= 1;
                    }
                    next += 1;
                }
            }
        }
        if self.empty_blocks > 0 {
            self.empty_blocks -= 1;
            while next <= self.last {
                if (known >> next) & 1 == 1 {
                    bits.number(1);
                }
                next += 1;
            }
        }
        Some(())
    }
}
