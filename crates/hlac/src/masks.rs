//! The 251 masks, in the order and with the letters of the paper (Suzuki, Yaginuma, Osawa, Figure 3).

/// The number of masks: the length of every array of sums or moments.
pub const MASK_COUNT: usize = 251;

/// The number of masks of one, two and three cells, which follow one another in every array of [`MASK_COUNT`] values.
pub const MASKS_BY_ORDER: [usize; 3] = [1, 13, 237];

/// The masks as the paper prints them, in its order.
const LETTERS: &str = "\
    a ab ak am an ad ae aj km ks kv ms mt ns akl akm akn ako aks akt aku akv akw akx abk abl aln abm abn \
    abo abc amn amp amq ams amt amv amw amy amz abd ano anp anq anr ans ant anu anv anw anx any anz anA \
    abe abf abj ack acn ace adk adm adn adp adq ade adg adh adj aek ael aem aen aeo aep aeq aer aef aeg \
    aeh aei aej afk afn agm agn ahm ahn ain ajk ajm ajn ajs ajt ajv ajw klm kls klv kmn kmo kmp kmq kms \
    kmt kmu kmv kmw kmx kmy kmz knp kns knv kny kos kov kpv kpw kqv kst ksu ksv ksw ksx ktv kuv kvw kvx \
    kvy kvz kwy bks bkv lmn lmt lmw lnp lns lnv lny lpw lst lsw ltv lvw bms bmt bmv bmw lwy bmy bmz bns \
    bnv bny mns mnt mnu mot mps mpt mqs mqt mst msv msw msy msz mtu mtv mtw mtx mty mtz muw nos nps npt \
    npu nqs nrs nst nsu nsv nsw nsx nsy nsz nsA ntv nty nuv nuy ost osw otv psv psw ptv ptw puw qsv qsw \
    qtv rsw bjs bjt bjv bjw cks ckv cns cnv cny dks dkt dku dkv dkw dkx dms dmt dns dnt dnu djs djt djv \
    djw eks ekv ems emt ens ejs ejt ejv ejw fks fkv fns gms gmt gns gnt gnu hms hmt hns ins";

/// One cell pattern: a set of one, two or three cells of the 3x3x3 window.
///
/// The paper names the cells by letters (Figure 3b), and a mask by those of its cells:
///
/// ```text
///   layer 1 (z = 0)   layer 2 (z = 1)   layer 3 (z = 2)
///      a b c             j k l             s t u        y = 0
///      d e f             m n o             v w x        y = 1
///      g h i             p q r             y z A        y = 2
///    x=0 1 2
/// ```
///
/// Every set `{0}`, `{0, a}`, `{0, a, b}` with `a`, `b` in `{-1, 0, 1}^3` is a mask exactly once up to translation:
/// 1 + 13 + 237 = 251. The letters also fix *where* in the window a pattern lies, so that sums are defined to the bit at
/// the borders of a volume too.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mask {
    cells: [u8; 3],
    count: u8,
}

impl Mask {
    /// The one to three cells, as indices `9 z + 3 y + x` into the window, ascending.
    pub const fn cells(&self) -> &[u8] {
        self.cells.split_at(self.count as usize).0
    }

    /// The number of cells: 1, 2 or 3. (The paper's order N is one less.)
    pub const fn order(&self) -> usize {
        self.count as usize
    }

    /// The cells as offsets `[z, y, x]` from the window's first cell, each 0, 1 or 2.
    pub fn offsets(&self) -> impl Iterator<Item = [usize; 3]> + '_ {
        self.cells().iter().map(|&cell| {
            let cell = usize::from(cell);
            [cell / 9, cell / 3 % 3, cell % 3]
        })
    }

    /// The paper's name of the mask, e.g. `akl`.
    pub fn letters(&self) -> String {
        self.cells().iter().map(|&cell| letter(cell)).collect()
    }
}

/// The letter of cell `9 z + 3 y + x`: `a` to `z`, then `A`.
fn letter(cell: u8) -> char {
    if cell == 26 { 'A' } else { char::from(b'a' + cell) }
}

/// The 251 masks in the paper's order: first the masks of one cell, then those of two, then those of three.
pub const MASKS: [Mask; MASK_COUNT] = parse(LETTERS.as_bytes());

const fn parse(text: &[u8]) -> [Mask; MASK_COUNT] {
    let mut masks = [Mask { cells: [0; 3], count: 0 }; MASK_COUNT];
    let (mut at, mut mask) = (0, 0);
    while at < text.len() {
        if text[at] == b' ' {
            mask += 1;
        } else {
            let cell = if text[at] == b'A' { 26 } else { text[at] - b'a' };
            masks[mask].cells[masks[mask].count as usize] = cell;
            masks[mask].count += 1;
        }
        at += 1;
    }
    assert!(mask + 1 == MASK_COUNT, "the letters name 251 masks");
    masks
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// A pattern moved so that its smallest offset on every axis is 0.
    fn normalised(cells: &BTreeSet<[i32; 3]>) -> BTreeSet<[i32; 3]> {
        let low = |axis: usize| cells.iter().map(|c| c[axis]).min().unwrap();
        let low = [low(0), low(1), low(2)];
        cells.iter().map(|c| [c[0] - low[0], c[1] - low[1], c[2] - low[2]]).collect()
    }

    #[test]
    fn the_masks_are_all_patterns_up_to_translation() {
        let cube: Vec<[i32; 3]> = (0..27).map(|i| [i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1]).collect();
        let mut derived = BTreeSet::new();
        for a in &cube {
            for b in &cube {
                derived.insert(normalised(&BTreeSet::from([[0, 0, 0], *a, *b])));
            }
        }
        assert_eq!(derived.len(), MASK_COUNT);
        let lettered: BTreeSet<_> =
            MASKS.iter().map(|m| normalised(&m.offsets().map(|o| o.map(|v| v as i32)).collect())).collect();
        assert_eq!(lettered, derived);
    }

    #[test]
    fn masks_are_sorted_by_their_number_of_cells() {
        let mut at = 0;
        for (order, count) in MASKS_BY_ORDER.iter().enumerate() {
            for mask in &MASKS[at..at + count] {
                assert_eq!(mask.order(), order + 1);
            }
            at += count;
        }
        assert_eq!(at, MASK_COUNT);
        assert_eq!(MASKS[14].letters(), "akl");
        assert_eq!(MASKS[250].letters(), "ins");
    }

    #[test]
    fn cells_are_sorted() {
        for mask in &MASKS {
            assert!(mask.cells().windows(2).all(|w| w[0] < w[1]), "{}", mask.letters());
        }
    }
}
