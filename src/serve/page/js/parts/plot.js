// Plots as SVG: 251 values with a cursor that the pointer and the arrow keys move, and bars.
import { el, svg } from "../dom.js";
import { short } from "../format.js";
import { MASKS, ORDERS, glyph } from "../masks.js";

const [WIDE, TALL, LEFT, BOTTOM, TOP] = [1004, 200, 46, 22, 8];
const STEP = (WIDE - LEFT) / 251;

/** Round tick values for an axis from `low` to `high`. */
function ticks(low, high) {
  const rough = (high - low) / 4, power = 10 ** Math.floor(Math.log10(rough || 1));
  const step = [1, 2, 5, 10].map((n) => n * power).find((n) => n >= rough) ?? power;
  const all = [];
  for (let at = Math.ceil(low / step - 1e-9) * step; at <= high + step * 1e-9; at += step) all.push(Math.abs(at) < step * 1e-9 ? 0 : at);
  return all;
}

/**
 * A plot over the 251 masks. `stems`: values drawn from 0; `line`: values joined by a line; `band`, `outer`: areas {low, high}.
 * `describe(index)`: the text for one mask.
 */
export function plot251({ label, stems = null, line = null, band = null, outer = null, describe }) {
  const values = [stems, line, band?.low, band?.high, outer?.low, outer?.high].filter(Boolean).flat().filter(Number.isFinite);
  let low = Math.min(0, ...values), high = Math.max(0, ...values);
  if (low === high) high = 1;
  const x = (at) => LEFT + (at + 0.5) * STEP, y = (value) => TOP + ((high - value) / (high - low)) * (TALL - TOP - BOTTOM);
  const area = ({ low, high }) => `M${high.map((value, at) => `${x(at)},${y(value)}`).join("L")}L${low.map((value, at) => `${x(at)},${y(value)}`).reverse().join("L")}Z`;
  const cursor = svg("line", { class: "cursor", y1: TOP, y2: TALL - BOTTOM, x1: -9, x2: -9 });
  const picture = svg("svg", { class: "plot", viewBox: `0 0 ${WIDE} ${TALL}`, preserveAspectRatio: "none", "aria-hidden": "true" },
    ...ticks(low, high).map((at) => svg("line", { class: at === 0 ? "zero" : "rule", x1: LEFT, x2: WIDE, y1: y(at), y2: y(at) })),
    ...ORDERS.slice(1).map(({ from }) => svg("line", { class: "rule order", x1: LEFT + from * STEP, x2: LEFT + from * STEP, y1: TOP, y2: TALL - BOTTOM })),
    outer && svg("path", { class: "outer", d: area(outer) }),
    band && svg("path", { class: "band", d: area(band) }),
    stems && svg("path", { class: "stems", d: stems.map((value, at) => (Number.isFinite(value) ? `M${x(at)},${y(0)}V${y(value)}` : "")).join("") }),
    line && svg("path", { class: "line", d: `M${line.map((value, at) => `${x(at)},${y(value)}`).join("L")}` }),
    cursor);
  // Labels are HTML over the picture, because the picture is stretched to any width.
  const labels = [
    ...ticks(low, high).map((at) => el("span", { class: "y edge", style: { top: `${(y(at) / TALL) * 100}%` } }, short(at))),
    ...ORDERS.map(({ from, to, name }, at) => el("span", { class: "order-name edge", style: { left: `${((at === 0 ? LEFT - 14 : LEFT + from * STEP + 4) / WIDE) * 100}%` }, title: `masks ${from + 1} to ${to}` }, name)),
  ];
  const readout = el("p", { class: "readout", role: "status" });
  const stage = el("div", { class: "plot-stage", tabindex: "0", role: "slider", "aria-label": `${label}: arrow keys move through the masks`, "aria-valuemin": 1, "aria-valuemax": 251, "aria-valuenow": 1 }, picture, labels);
  let at = 0;
  const go = (to) => {
    at = Math.max(0, Math.min(250, to));
    cursor.setAttribute("x1", x(at));
    cursor.setAttribute("x2", x(at));
    stage.setAttribute("aria-valuenow", at + 1);
    stage.setAttribute("aria-valuetext", `mask ${MASKS[at]}: ${describe(at)}`);
    readout.replaceChildren(glyph(MASKS[at]), el("b", {}, MASKS[at]), el("span", { class: "edge" }, `mask ${at + 1}`), el("span", {}, describe(at)));
  };
  stage.addEventListener("pointermove", (event) => {
    const box = stage.getBoundingClientRect();
    go(Math.floor((((event.clientX - box.left) / box.width) * WIDE - LEFT) / STEP));
  });
  stage.addEventListener("keydown", (event) => {
    const to = { ArrowLeft: at - 1, ArrowRight: at + 1, ArrowDown: at - 1, ArrowUp: at + 1, PageUp: at + 25, PageDown: at - 25, Home: 0, End: 250 }[event.key];
    if (to === undefined || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    go(to);
  });
  go(0);
  readout.removeAttribute("role");
  return el("figure", { class: "plot-figure" }, stage, readout);
}

/** A bar chart of rows {name, value, text, title}. Negative values extend to the left of zero in another colour. */
export function bars(rows, { label, most = null } = {}) {
  const reach = most ?? Math.max(...rows.map((row) => Math.abs(row.value)), 1e-12);
  const left = rows.some((row) => row.value < 0) ? Math.max(...rows.map((row) => Math.max(0, -row.value))) / reach : 0;
  const zero = (100 * left) / (1 + left), unit = 100 / (1 + left);
  return el("table", { class: "bars" }, label && el("caption", { class: "visually-hidden" }, label),
    el("tbody", {}, ...rows.map((row) => {
      const long = (Math.abs(row.value) / reach) * unit;
      return el("tr", { title: row.title }, el("th", { scope: "row" }, row.name),
        el("td", { class: "bar-cell", "aria-hidden": "true" }, el("span", { class: row.value < 0 ? "bar-fill minus" : "bar-fill", style: { left: `${row.value < 0 ? zero - long : zero}%`, width: `${long}%` } })),
        el("td", { class: "edge number" }, row.text));
    })));
}
