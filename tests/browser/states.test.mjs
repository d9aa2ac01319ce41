// Special servers: empty, read-only, without voxels, with a token.
import assert from "node:assert/strict";
import fs from "node:fs";
import path from "node:path";
import { after, before, test } from "node:test";
import { browserPath, drop, folder, hlacdb, launch, npy, open, serve, synthesise } from "./harness.mjs";

const skip = browserPath() ? false : "there is no Chromium: apt-get install chromium";
let browser, dir;
before(async () => {
  if (skip) return;
  dir = folder();
  browser = await launch();
});
after(() => browser?.close());

async function against(store, words, run, options) {
  const server = await serve(store, ...words);
  const { page, errors, close } = await open(browser, server.url, options);
  try {
    await run(page, server);
    assert.deepEqual(errors, []);
  } finally {
    await close();
    await server.stop();
  }
}

/** Writes moments without voxels, as another program would. */
function moments(file, rows) {
  const header = `{'descr': '<f4', 'fortran_order': False, 'shape': (${rows}, 251), }`.padEnd(117) + "\n";
  const bytes = Buffer.alloc(128 + rows * 251 * 4);
  bytes.write("\x93NUMPY\x01\x00", 0, "latin1");
  bytes.writeUInt16LE(118, 8);
  bytes.write(header, 10, "latin1");
  for (let row = 0; row < rows; row += 1) {
    const mean = 0.3 + 0.4 * ((row * 0.618) % 1);
    for (let at = 0; at < 251; at += 1) bytes.writeFloatLE(mean ** (at === 0 ? 1 : at < 14 ? 2 : 3) * (1 + 0.1 * Math.sin(row * at)), 128 + 4 * (row * 251 + at));
  }
  fs.writeFileSync(file, bytes);
}

test("an empty store explains how to add textures, and accepts its first file", { skip, timeout: 60000 }, async () => {
  await against(path.join(dir, "empty.hlacdb"), [], async (page) => {
    await page.getByRole("heading", { name: "This store is empty" }).waitFor();
    for (const view of ["query", "map", "statistics"]) {
      await page.locator(`#nav [data-view=${view}]`).click();
      await page.locator("main h1, main h2").first().waitFor();
      await page.waitForFunction(() => !document.querySelector("main[aria-busy]"));
    }
    await drop(page, [{ name: "first.npy", bytes: npy(20, (z, y, x) => (x * 13 + y * 7 + z * 3) & 255) }]);
    await page.getByRole("button", { name: "Add", exact: true }).click();
    await page.getByText("1 texture added").first().waitFor();
  });
});

test("a read-only server offers no changes", { skip, timeout: 60000 }, async () => {
  const store = synthesise(path.join(dir, "read.hlacdb"));
  await against(store, ["--read-only"], async (page, server) => {
    await page.getByText("read-only").first().waitFor();
    await page.goto(`${server.url}#/texture/4`);
    await page.locator(".tags .pair").first().waitFor();
    assert.equal(await page.getByRole("button", { name: "Remove…" }).count(), 0);
    assert.equal(await page.getByLabel("Key of a new tag").count(), 0);
    await page.goto(`${server.url}#/statistics`);
    await page.getByText("This server is read-only").waitFor();
    // A file can still start a query.
    await drop(page, [{ name: "ramp.npy", bytes: npy(32, (z, y, x) => 4 * (z + x)) }]);
    await page.locator(".hit").first().waitFor();
  });
});

test("textures without voxels are found, listed and plotted", { skip, timeout: 60000 }, async () => {
  const store = path.join(dir, "moments.hlacdb"), file = path.join(dir, "moments.npy");
  moments(file, 3000);
  hlacdb(store, "import", file);
  await against(store, [], async (page, server) => {
    await page.getByRole("heading", { name: "3,000 textures" }).waitFor();
    await page.locator(".grid .no-voxels").first().waitFor();
    await page.locator(".grid").evaluate((grid) => { grid.scrollTop = grid.scrollHeight; });
    await page.waitForFunction(() => [...document.querySelectorAll(".grid .edge")].some((id) => id.textContent === "3000"));
    await page.goto(`${server.url}#/texture/17`);
    await page.getByText("Only the moments of this texture are stored").waitFor();
    await page.locator(".plot-stage").waitFor();
    await page.goto(`${server.url}#/query?ids=17&k=4&space=paper`);
    await page.waitForFunction(() => document.querySelectorAll(".hit").length === 4);
  });
});

test("a token is required, and removed from the address", { skip, timeout: 60000 }, async () => {
  const store = synthesise(path.join(dir, "token.hlacdb"));
  const server = await serve(store, "--token", "open-sesame-open-sesame");
  const { page, close } = await open(browser, `${server.url}?token=open-sesame-open-sesame`);
  try {
    await page.getByRole("heading", { name: "60 textures" }).waitFor();
    assert.ok(!page.url().includes("sesame"), "the token is removed from the address");
    await page.context().clearCookies();
    await page.evaluate(() => { location.hash = "#/texture/2"; });
    await page.getByRole("heading", { name: "This server requires a token" }).waitFor();
  } finally {
    await close();
    await server.stop();
  }
});
