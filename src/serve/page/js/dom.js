// Making elements. Styles are set through the CSS object model only, which the page's strict policy allows.

const SVG = "http://www.w3.org/2000/svg";

/** An element: `el("a", {href, class, on: {click}, style: {width}, "aria-label": …}, children…)`. */
export function el(name, props = {}, ...children) {
  return fill(document.createElement(name), props, children);
}

/** The same, for SVG. */
export function svg(name, props = {}, ...children) {
  return fill(document.createElementNS(SVG, name), props, children);
}

function fill(node, props, children) {
  for (const [key, value] of Object.entries(props)) {
    if (value === undefined || value === null || value === false) continue;
    if (key === "on") for (const [event, heard] of Object.entries(value)) node.addEventListener(event, heard);
    else if (key === "style") for (const [name, text] of Object.entries(value)) node.style.setProperty(name, text);
    else if (key === "data") Object.assign(node.dataset, value);
    else if (key === "class") node.setAttribute("class", value);
    else if (["value", "checked", "disabled", "hidden", "selected", "indeterminate"].includes(key)) node[key] = value;
    else node.setAttribute(key, value === true ? "" : value);
  }
  node.append(...children.flat(Infinity).filter((child) => child !== null && child !== undefined && child !== false));
  return node;
}

let made = 0;
/** An id that no other element of the page has. */
export const freshId = (stem) => `${stem}-${++made}`;

/** A name that may be too long for its place: what is left out is its middle, for names often differ at their ends. */
export function named(name, props = {}) {
  if (name.length < 16) return el("span", { ...props, class: "name" }, name);
  // The place of a block stays whole: it is what tells blocks of one volume apart.
  const end = /\[[\d,]{1,16}\]$/.exec(name)?.[0].length ?? 9;
  return el("span", { ...props, class: "name cut-name" }, el("span", {}, name.slice(0, -end)), el("span", {}, name.slice(-end)));
}

/** Calls `what` once things have been quiet for `wait` ms; `.now()` calls it at once, `.drop()` never. */
export function settled(wait, what) {
  let timer = 0, last = null;
  const later = (...args) => {
    last = args;
    clearTimeout(timer);
    timer = setTimeout(later.now, wait);
  };
  later.now = () => { clearTimeout(timer); if (last) { const args = last; last = null; what(...args); } };
  later.drop = () => { clearTimeout(timer); last = null; };
  return later;
}

/** Calls `what` at most once a frame, with the last arguments. */
export function eachFrame(what) {
  let asked = 0, last;
  const soon = (...args) => {
    last = args;
    if (!asked) asked = requestAnimationFrame(() => { asked = 0; what(...last); });
  };
  soon.drop = () => { cancelAnimationFrame(asked); asked = 0; };
  return soon;
}

/** Whether the reader has asked for less motion. */
export const lessMotion = () => matchMedia("(prefers-reduced-motion: reduce)").matches;

/** Whether keys typed at `target` are meant for it and are no shortcuts. */
export const takesKeys = (target) =>
  target instanceof Element && target.closest("input:not([type=range]):not([type=checkbox]):not([type=radio]), textarea, select, [contenteditable], dialog") !== null;
