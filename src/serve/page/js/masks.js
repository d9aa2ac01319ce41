// The 251 masks in the order of the paper (Figure 3a). The letters a to z and A are the cells of the 3x3x3 window, layer by layer.
import { svg } from "./dom.js";

const CELLS = "abcdefghijklmnopqrstuvwxyzA";

/** The letters of each mask. */
export const MASKS = `
  a ab ak am an ad ae aj km ks kv ms mt ns akl akm akn ako aks akt aku akv akw akx abk abl aln abm abn abo abc amn amp
  amq ams amt amv amw amy amz abd ano anp anq anr ans ant anu anv anw anx any anz anA abe abf abj ack acn ace adk adm
  adn adp adq ade adg adh adj aek ael aem aen aeo aep aeq aer aef aeg aeh aei aej afk afn agm agn ahm ahn ain ajk ajm
  ajn ajs ajt ajv ajw klm kls klv kmn kmo kmp kmq kms kmt kmu kmv kmw kmx kmy kmz knp kns knv kny kos kov kpv kpw kqv
  kst ksu ksv ksw ksx ktv kuv kvw kvx kvy kvz kwy bks bkv lmn lmt lmw lnp lns lnv lny lpw lst lsw ltv lvw bms bmt bmv
  bmw lwy bmy bmz bns bnv bny mns mnt mnu mot mps mpt mqs mqt mst msv msw msy msz mtu mtv mtw mtx mty mtz muw nos nps
  npt npu nqs nrs nst nsu nsv nsw nsx nsy nsz nsA ntv nty nuv nuy ost osw otv psv psw ptv ptw puw qsv qsw qtv rsw bjs
  bjt bjv bjw cks ckv cns cnv cny dks dkt dku dkv dkw dkx dms dmt dns dnt dnu djs djt djv djw eks ekv ems emt ens ejs
  ejt ejv ejw fks fkv fns gms gmt gns gnt gnu hms hmt hns ins`.trim().split(/\s+/);

/** The ranges of the masks of one, two and three cells. */
export const ORDERS = [{ from: 0, to: 1, name: "1" }, { from: 1, to: 14, name: "2" }, { from: 14, to: 251, name: "3 cells" }];

/** A mask as three small layers of 3x3 cells. */
export function glyph(letters, size = 4) {
  const on = new Set([...letters].map((letter) => CELLS.indexOf(letter)));
  const layer = 3 * size + 2, cells = [];
  for (let at = 0; at < 27; at += 1) {
    const [z, y, x] = [Math.floor(at / 9), Math.floor(at / 3) % 3, at % 3];
    cells.push(svg("rect", { x: z * (layer + size) + x * (size + 1), y: y * (size + 1), width: size, height: size, class: on.has(at) ? "on" : "off" }));
  }
  return svg("svg", { class: "glyph", width: 3 * layer + 2 * size, height: layer, role: "img", "aria-label": `cells ${[...letters].join(", ")}` }, ...cells);
}
