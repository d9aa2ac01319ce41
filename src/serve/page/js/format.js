// Formats numbers for people.

const whole = new Intl.NumberFormat("en");

/** 12345 → 12,345 */
export const count = (n) => whole.format(n);

/** `3 textures`, `1 texture` */
export const counted = (n, one, many = `${one}s`) => `${count(n)} ${n === 1 ? one : many}`;

/** A distance with a fixed number of digits. */
export const distance = (d) => (d === null || d === undefined ? "–" : d >= 100 ? d.toFixed(1) : d.toFixed(4));

/** Three significant digits; very large and very small numbers with an exponent. */
export function short(x) {
  if (x === 0 || !Number.isFinite(x)) return String(x);
  const size = Math.abs(x);
  return size >= 1e5 || size < 1e-4 ? x.toExponential(2) : String(Number(x.toPrecision(3)));
}

/** 134746112 → 128.5 MiB */
export function bytes(n) {
  const units = ["B", "KiB", "MiB", "GiB", "TiB"];
  let at = 0;
  while (n >= 1024 && at < units.length - 1) { n /= 1024; at += 1; }
  return `${at === 0 ? n : n.toFixed(1)} ${units[at]}`;
}

/** Microseconds in a suitable unit. */
export const time = (us) => (us < 1000 ? `${Math.round(us)} µs` : us < 1e6 ? `${short(us / 1000)} ms` : `${short(us / 1e6)} s`);

/** [48,48,48] → 48 × 48 × 48 */
export const shape = (sides) => (sides ? sides.join(" × ") : "moments only");

/** A share in percent, with a minus sign if negative. */
export const percent = (x) => `${(100 * x).toFixed(Math.abs(x) < 0.0995 ? 1 : 0).replace("-", "−")} %`;
