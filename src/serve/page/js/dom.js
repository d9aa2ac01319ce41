// Creates elements. Styles are set through the CSS object model only, because the security policy of the page forbids inline styles.

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
    if (key === "on") for (const [event, listener] of Object.entries(value)) node.addEventListener(event, listener);
    else if (key === "style") for (const [name, text] of Object.entries(value)) node.style.setProperty(name, text);
    else if (key === "data") Object.assign(node.dataset, value);
    else if (key === "class") node.setAttribute("class", value);
    else if (["value", "checked", "disabled", "hidden", "selected", "indeterminate"].includes(key)) node[key] = value;
    else node.setAttribute(key, value === true ? "" : value);
  }
  node.append(...children.flat(Infinity).filter((child) => child !== null && child !== undefined && child !== false));
  return node;
}

let lastId = 0;
/** An id that no other element of the page has. */
export const uniqueId = (stem) => `${stem}-${++lastId}`;

/** A name whose middle is left out if it is too long, because names often differ at their ends. */
export function shortenedName(name, props = {}) {
  if (name.length < 16) return el("span", { ...props, class: "name" }, name);
  // The origin of a block is kept whole, because it distinguishes the blocks of a volume.
  const end = /\[[\d,]{1,16}\]$/.exec(name)?.[0].length ?? 9;
  return el("span", { ...props, class: "name cut-name" }, el("span", {}, name.slice(0, -end)), el("span", {}, name.slice(-end)));
}

/** Calls `run` once `wait` ms have passed without a further call. `.flush()` runs it at once, `.cancel()` discards the call. */
export function debounce(wait, run) {
  let timer = 0, last = null;
  const later = (...args) => {
    last = args;
    clearTimeout(timer);
    timer = setTimeout(later.flush, wait);
  };
  later.flush = () => { clearTimeout(timer); if (last) { const args = last; last = null; run(...args); } };
  later.cancel = () => { clearTimeout(timer); last = null; };
  return later;
}

/** Calls `run` at most once per frame, with the last arguments. `.cancel()` discards the call. */
export function oncePerFrame(run) {
  let request = 0, last;
  const soon = (...args) => {
    last = args;
    if (!request) request = requestAnimationFrame(() => { request = 0; run(...last); });
  };
  soon.cancel = () => { cancelAnimationFrame(request); request = 0; };
  return soon;
}

/** Whether `target` takes key presses itself, so that they are not shortcuts. */
export const acceptsKeys = (target) =>
  target instanceof Element && target.closest("input:not([type=range]):not([type=checkbox]):not([type=radio]), textarea, select, [contenteditable], dialog") !== null;
