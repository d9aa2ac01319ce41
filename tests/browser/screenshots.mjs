// The pictures of docs/pictures: `npm run screenshots` (from this folder), or
//   node screenshots.mjs [--all DIR]
// With --all, every view at four widths, light and dark, into DIR.
import { execFileSync } from "node:child_process";
import fs from "node:fs";
import path from "node:path";
import { drawn, folder, here, hlacdb, launch, open, serve } from "./harness.mjs";

const VIEWS = { browse: "", texture: "#/texture/245", query: "#/query?ids=245", compare: "#/compare?a=245&b=250", map: "#/map", statistics: "#/statistics", start: "#/query" };

const all = process.argv[2] === "--all" ? path.resolve(process.argv[3] ?? "screenshots") : null;
const store = process.env.HLACDB_STORE ?? path.join(folder(), "families.hlacdb");
if (!fs.existsSync(store)) hlacdb(store, "synth", "families");
const server = await serve(store, "--read-only"), browser = await launch();

/** A picture of a view after it has loaded. */
async function shoot(file, address, options, prepare) {
  const { page, close } = await open(browser, server.url + address, options);
  await page.waitForFunction(() => document.querySelector("main").children.length > 0 && !document.querySelector("main[aria-busy]"));
  await page.waitForLoadState("networkidle");
  await prepare?.(page);
  if (await page.locator("canvas.volume").count()) await drawn(page);
  await page.waitForTimeout(300);
  await page.screenshot({ path: file, fullPage: false });
  await close();
}

/** Reduces the colours, which grey slices need few of (with pngquant if it is installed). */
function shrink(file) {
  try { execFileSync("pngquant", ["--force", "--skip-if-larger", "--output", file, "--speed", "1", "40", file], { stdio: "ignore" }); } catch { /* optional */ }
  console.log(`${path.relative(process.cwd(), file)}: ${(fs.statSync(file).size / 1024).toFixed(0)} KiB`);
}

try {
  if (all) {
    fs.mkdirSync(all, { recursive: true });
    for (const width of [360, 768, 1440, 3840]) {
      for (const colorScheme of ["light", "dark"]) {
        for (const [name, address] of Object.entries(VIEWS)) {
          await shoot(path.join(all, `${name}-${width}-${colorScheme}.png`), address, { width, height: { 360: 740, 768: 1024, 1440: 900, 3840: 2160 }[width], colorScheme });
        }
      }
    }
  } else {
    const pictures = path.resolve(here, "../../docs/pictures");
    fs.mkdirSync(pictures, { recursive: true });
    const size = { width: 1180, height: 700 };
    await shoot(path.join(pictures, "query.png"), "#/query?ids=203&k=12", { ...size, colorScheme: "light" });
    await shoot(path.join(pictures, "texture.png"), "#/texture/245?form=sphere&tf=0,255,68,ember&cut=0,100,0,100,38,100&cam=-40,24,1.1", { ...size, colorScheme: "dark" });
    for (const name of ["query.png", "texture.png"]) shrink(path.join(pictures, name));
  }
} finally {
  await browser.close();
  await server.stop();
}
