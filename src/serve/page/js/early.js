// Runs before the first paint, so that the page does not flash in the other theme.
"use strict";
try {
  const chosen = localStorage.getItem("hlacdb-theme");
  if (chosen === "light" || chosen === "dark") document.documentElement.dataset.theme = chosen;
} catch { /* no storage: the theme of the system */ }
