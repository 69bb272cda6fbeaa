//! Whether a JPEG's compressed data are those of a whole picture (ITU-T T.81, annexes F and
//! G): its codes are read as a decoder reads them, but no pixel is made of them. What is
//! damaged is nearly always a code that is none sooner or later, or ends too early or late.
//!
//! What decoders make a whole picture of must never be called damaged. So nothing is said of
//! codings that cannot be read here (arithmetic, lossless, hierarchical, 12 bits), of tables
//! that are not in the file, of heights that are told behind the picture, of missing restarts
//! where there are none at all, nor of padding.

use super::coding::{Band, Block, COEFFICIENTS, Coding};
use super::huffman::{Bits, Table};
use super::{
    BASELINE, END_OF_IMAGE, EXTENDED, HUFFMAN_TABLE, NUMBER_OF_LINES, PROGRESSIVE,
    RESTART_INTERVAL, RESTARTS, START_OF_SCAN, is_frame, markers,
};

const BLOCK_SIDE: usize = 8;
/// Larger pictures are not looked at.
const MAX_BLOCKS: usize = 1 << 24;

/// The share of a picture, from its top, that comes before where damage shows; it begins
/// there or before. `None` if none is found.
pub(crate) fn damage(bytes: &[u8]) -> Option<f64> {
    let mut markers = markers(bytes);
    let mut tables = Tables::default();
    let mut frame = None;
    let mut interval = 0;
    while let Some((marker, segment)) = markers.next() {
        match marker {
            END_OF_IMAGE => return None,
            HUFFMAN_TABLE => tables.define(segment)?,
            RESTART_INTERVAL => interval = usize::from(number(segment)?),
            START_OF_SCAN => {
                let frame: &mut Frame = frame.as_mut()?;
                let scan = Scan::new(segment, frame, &tables)?;
                let total = scan.mcus;
                match scan.walk(Bits::new(markers.rest), interval) {
                    Ok(rest) => markers.rest = rest,
                    Err(_) if is_excused(markers.rest, interval, total) => return None,
                    Err(whole) => return Some(whole as f64 / total as f64),
                }
            }
            BASELINE | EXTENDED | PROGRESSIVE => frame = Some(Frame::new(marker, segment)?),
            other if is_frame(other) => return None,
            _ => {}
        }
    }
    None
}

/// Whether a scan that seems to be damaged may be whole: where its number of lines is told
/// behind it, and where restarts are announced but none is there.
fn is_excused(data: &[u8], interval: usize, mcus: usize) -> bool {
    let is_marker = |pair: &&[u8]| pair[0] == 0xFF && ![0, 0xFF].contains(&pair[1]);
    let mut markers = data.windows(2).filter(is_marker).map(|pair| pair[1]);
    let first = markers.next();
    let is_restart = |marker: &u8| RESTARTS.contains(marker);
    let lacks_restarts = interval > 0 && interval < mcus && !first.as_ref().is_some_and(is_restart);
    let end = first.into_iter().chain(markers).find(|m| !is_restart(m));
    lacks_restarts || end == Some(NUMBER_OF_LINES)
}

/// The two bytes that a segment begins with.
fn number(segment: &[u8]) -> Option<u16> {
    segment
        .first_chunk()
        .map(|bytes| u16::from_be_bytes(*bytes))
}

/// Tables by class, 0 for DC and 1 for AC, and number.
#[derive(Default)]
struct Tables([[Option<Box<Table>>; 4]; 2]);

impl Tables {
    fn define(&mut self, mut segment: &[u8]) -> Option<()> {
        while !segment.is_empty() {
            let (class, number, table, rest) = Table::read(segment)?;
            *self.0.get_mut(class)?.get_mut(number)? = Some(Box::new(table));
            segment = rest;
        }
        Some(())
    }

    fn dc(&self, number: u8) -> Option<&Table> {
        self.0[0].get(usize::from(number))?.as_deref()
    }

    fn ac(&self, number: u8) -> Option<&Table> {
        self.0[1].get(usize::from(number))?.as_deref()
    }
}

/// What all scans of a picture have in common.
struct Frame {
    is_progressive: bool,
    /// In a scan of several components, and in a row of it.
    mcus: usize,
    mcus_across: usize,
    components: Vec<Component>,
}

struct Component {
    id: u8,
    /// Blocks in an MCU of several components.
    blocks_per_mcu: usize,
    /// In a scan of this component alone, and in a row of it.
    blocks: usize,
    blocks_across: usize,
    /// See [`Band::nonzero`].
    nonzero: Vec<u64>,
}

impl Frame {
    fn new(marker: u8, segment: &[u8]) -> Option<Self> {
        let (&[bits, h1, h0, w1, w0, count], components) = segment.split_first_chunk()?;
        let width = usize::from(u16::from_be_bytes([w1, w0]));
        let height = usize::from(u16::from_be_bytes([h1, h0]));
        let components = components.get(..3 * usize::from(count))?;
        let sides = |component: &[u8]| {
            let (across, down) = (component[1] >> 4, component[1] & 15);
            (usize::from(across), usize::from(down))
        };
        let (mut most_across, mut most_down) = (0, 0);
        for component in components.chunks_exact(3) {
            let (across, down) = sides(component);
            if !(1..=4).contains(&across) || !(1..=4).contains(&down) {
                return None;
            }
            most_across = most_across.max(across);
            most_down = most_down.max(down);
        }
        if bits != 8 || width == 0 || height == 0 || count == 0 {
            return None;
        }
        let mcus_across = width.div_ceil(BLOCK_SIDE * most_across);
        let mcus = mcus_across * height.div_ceil(BLOCK_SIDE * most_down);
        let components = components.chunks_exact(3).map(|component| {
            let (across, down) = sides(component);
            let blocks_across = (width * across).div_ceil(most_across).div_ceil(BLOCK_SIDE);
            let blocks_down = (height * down).div_ceil(most_down).div_ceil(BLOCK_SIDE);
            Component {
                id: component[0],
                blocks_per_mcu: across * down,
                blocks: blocks_across * blocks_down,
                blocks_across,
                nonzero: Vec::new(),
            }
        });
        let components: Vec<Component> = components.collect();
        let blocks: usize = components.iter().map(|component| component.blocks).sum();
        (blocks <= MAX_BLOCKS).then_some(Self {
            is_progressive: marker == PROGRESSIVE,
            mcus,
            mcus_across,
            components,
        })
    }
}

/// A scan and what reads it.
struct Scan<'a> {
    mcus: usize,
    mcus_across: usize,
    coding: Coding<'a>,
}

impl<'a> Scan<'a> {
    /// From a scan's header. `None` if it cannot be read here.
    fn new(header: &[u8], frame: &'a mut Frame, tables: &'a Tables) -> Option<Self> {
        let (&[count], rest) = header.split_first_chunk()?;
        let (chosen, rest) = rest.split_at_checked(2 * usize::from(count))?;
        let &[first, last, bits] = rest.first_chunk()?;
        let index = |id: u8| frame.components.iter().position(|c| c.id == id);
        let is_bit = bits >> 4 != 0;

        if frame.is_progressive && first > 0 {
            let &[id, table] = chosen else { return None };
            if last < first || u32::from(last) >= COEFFICIENTS {
                return None;
            }
            let index = index(id)?;
            let component = &mut frame.components[index];
            component.nonzero.resize(component.blocks, 0);
            let band = Band {
                table: tables.ac(table & 15)?,
                first: first.into(),
                last: last.into(),
                is_bit,
                nonzero: &mut component.nonzero,
                empty_blocks: 0,
            };
            return Some(Self {
                mcus: component.blocks,
                mcus_across: component.blocks_across,
                coding: Coding::Band(band),
            });
        }

        if frame.is_progressive && last > 0 {
            return None;
        }
        let (mut mcus, mut mcus_across) = (frame.mcus, frame.mcus_across);
        let mut parts = Vec::new();
        for part in chosen.chunks_exact(2) {
            let component = &frame.components[index(part[0])?];
            let (dc, ac) = (part[1] >> 4, part[1] & 15);
            let block = match (frame.is_progressive, is_bit) {
                (false, _) => Block::Whole {
                    dc: tables.dc(dc)?,
                    ac: tables.ac(ac)?,
                },
                (true, false) => Block::Dc(tables.dc(dc)?),
                (true, true) => Block::DcBit,
            };
            if count == 1 {
                (mcus, mcus_across) = (component.blocks, component.blocks_across);
                parts.push((1, block));
            } else {
                parts.push((component.blocks_per_mcu, block));
            }
        }
        let coding = Coding::Blocks(parts);
        (count > 0).then_some(Self {
            mcus,
            mcus_across,
            coding,
        })
    }

    /// Reads all of a scan: what follows it, or how many MCUs come before where it is seen to
    /// be damaged.
    fn walk<'b>(mut self, mut bits: Bits<'b>, interval: usize) -> Result<&'b [u8], usize> {
        let interval = if interval == 0 { self.mcus } else { interval };
        let mut begin = 0;
        while begin < self.mcus {
            let end = self.mcus.min(begin + interval);
            for mcu in begin..end {
                let is_read = self.coding.read(&mut bits, mcu).is_some();
                if bits.is_overrun() {
                    // A last byte alone may be missing: it changes nothing that can be seen.
                    if mcu + 1 < end {
                        return Err(mcu);
                    }
                    break;
                }
                if !is_read {
                    return Err(mcu);
                }
            }
            if self.is_followed_by_more(&mut bits, end) {
                return Err(end);
            }
            while bits.byte().is_some() {}
            if end < self.mcus && !bits.restart() {
                return Err(end);
            }
            self.coding.restart();
            begin = end;
        }
        Ok(bits.rest())
    }

    /// Whether what is left before the next marker, once `end` MCUs were read, is more of
    /// them: padding is not, nor what cameras and programs put there. Heights that are told
    /// too low may leave whole rows.
    fn is_followed_by_more(&mut self, bits: &mut Bits<'_>, end: usize) -> bool {
        if bits.is_at_end() || left(bits.clone()) < self.coding.least_more() {
            return false;
        }
        let mut more = 0;
        while !bits.is_at_end() {
            if self.coding.read_more(bits).is_none() || bits.is_overrun() {
                return false;
            }
            more += 1;
        }
        self.coding.is_complete() && (end < self.mcus || more % self.mcus_across != 0)
    }
}

/// How many bytes are left before the next marker; none if they are all the same.
fn left(mut bits: Bits<'_>) -> usize {
    let first = bits.byte();
    let (mut bytes, mut alike) = (0, 0);
    let mut next = first;
    while let Some(byte) = next {
        bytes += 1;
        alike += usize::from(Some(byte) == first);
        next = bits.byte();
    }
    if alike == bytes { 0 } else { bytes }
}
