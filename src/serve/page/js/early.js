// Runs before anything is painted, so that a chosen theme does not flash the other one first.
"use strict";
try {
  const chosen = localStorage.getItem("hlacdb-theme");
  if (chosen === "light" || chosen === "dark") document.documentElement.dataset.theme = chosen;
} catch { /* no storage: the system's colours */ }
