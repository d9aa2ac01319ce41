// The theme: light, dark, or that of the system. The event `theme` makes canvases redraw.

const ORDER = ["system", "light", "dark"];
const SIGN = { system: "◐", light: "○", dark: "●" };

const read = () => { try { return localStorage.getItem("hlacdb-theme") ?? "system"; } catch { return "system"; } };

function apply(theme, button) {
  if (theme === "system") delete document.documentElement.dataset.theme;
  else document.documentElement.dataset.theme = theme;
  try {
    if (theme === "system") localStorage.removeItem("hlacdb-theme");
    else localStorage.setItem("hlacdb-theme", theme);
  } catch { /* no storage: chosen until the page is closed */ }
  button.textContent = SIGN[theme];
  button.setAttribute("aria-label", `Colours: ${theme}`);
  button.title = `Colours: ${theme}`;
  dispatchEvent(new Event("theme"));
}

/** Makes the button switch to the next theme. */
export function themeButton(button) {
  let theme = ORDER.includes(read()) ? read() : "system";
  apply(theme, button);
  button.addEventListener("click", () => {
    theme = ORDER[(ORDER.indexOf(theme) + 1) % ORDER.length];
    apply(theme, button);
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => dispatchEvent(new Event("theme")));
}

let probe = null;
/** A colour of the style sheet for use in a canvas: `colour("--ink")` → rgb(…). */
export function colour(name) {
  if (!probe) {
    probe = document.createElement("i");
    probe.hidden = true;
    document.body.append(probe);
  }
  probe.style.color = `var(${name})`;
  return getComputedStyle(probe).color;
}
