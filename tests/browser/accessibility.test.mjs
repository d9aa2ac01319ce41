// axe-core finds no serious violation in any view, wide and narrow, light and dark.
import assert from "node:assert/strict";
import fs from "node:fs";
import path from "node:path";
import { createRequire } from "node:module";
import { after, before, test } from "node:test";
import { browserPath, folder, launch, open, serve, synthesise } from "./harness.mjs";

const skip = browserPath() ? false : "there is no Chromium: apt-get install chromium";
const axe = fs.readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const VIEWS = { browse: "", marked: "#/?mark=2,3&where=family%3Dwood", texture: "#/texture/7", query: "#/query?ids=7&k=6", start: "#/query", compare: "#/compare?a=7&b=12", map: "#/map?sel=9", statistics: "#/statistics", missing: "#/texture/999" };
let browser, server;

before(async () => {
  if (skip) return;
  const store = synthesise(path.join(folder(), "axe.hlacdb"));
  [browser, server] = [await launch(), await serve(store)];
});
after(async () => {
  await browser?.close();
  await server?.stop();
});

for (const [width, colorScheme] of [[1280, "light"], [390, "dark"]]) {
  for (const [name, address] of Object.entries(VIEWS)) {
    test(`${name}, ${width} wide, ${colorScheme}`, { skip, timeout: 60000 }, async () => {
      const { page, close } = await open(browser, server.url + address, { width, colorScheme, bypassCSP: true });
      try {
        await page.waitForFunction(() => document.querySelector("main").children.length > 0 && !document.querySelector("main[aria-busy]"));
        await page.waitForLoadState("networkidle");
        await page.evaluate(axe);
        const { violations } = await page.evaluate(() => axe.run(document, { resultTypes: ["violations"] }));
        const grave = violations.filter((one) => ["serious", "critical"].includes(one.impact));
        assert.deepEqual(grave.map((one) => `${one.id}: ${one.nodes.slice(0, 3).map((node) => `${node.html.slice(0, 160)} ${node.any[0]?.message ?? ""}`).join(" | ")}`), []);
        const wider = await page.evaluate(() => [document.documentElement.scrollWidth, document.querySelector("main").scrollWidth].some((wide) => wide > innerWidth));
        assert.equal(wider, false, "no content is wider than the window");
      } finally { await close(); }
    });
  }
}
