// Colours for the values of a tag, as different as possible.

// Hues a golden angle apart in three lightnesses, in OKLCH.
export function palette(n, dark) {
  const lights = dark ? [0.78, 0.66, 0.86] : [0.58, 0.45, 0.68];
  return Array.from({ length: n }, (_, at) => rgb(lights[at % 3], n > 24 ? 0.11 + 0.03 * (at % 2) : 0.13, (at * 137.508 + 35) % 360));
}

/** OKLCH to [r, g, b] of sRGB, clipped. */
function rgb(light, chroma, hue) {
  const a = chroma * Math.cos((hue * Math.PI) / 180), b = chroma * Math.sin((hue * Math.PI) / 180);
  const l = (light + 0.3963377774 * a + 0.2158037573 * b) ** 3, m = (light - 0.1055613458 * a - 0.0638541728 * b) ** 3, s = (light - 0.0894841775 * a - 1.291485548 * b) ** 3;
  return [4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s, -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s, -0.0041960863 * l - 0.7034186147 * m + 1.707614701 * s]
    .map((x) => Math.round(255 * Math.max(0, Math.min(1, x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055))));
}

export const css = ([r, g, b]) => `rgb(${r} ${g} ${b})`;
