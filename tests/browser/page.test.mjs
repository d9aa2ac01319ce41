// The page as people use it.
import assert from "node:assert/strict";
import path from "node:path";
import { after, before, test } from "node:test";
import { apart, browserPath, drawn, drop, folder, launch, npy, open, pixels, serve, synthesise } from "./harness.mjs";

const skip = browserPath() ? false : "there is no Chromium: apt-get install chromium";
let browser, server;

before(async () => {
  if (skip) return;
  const store = synthesise(path.join(folder(), "page.hlacdb"));
  [browser, server] = [await launch(), await serve(store)];
});
after(async () => {
  await browser?.close();
  await server?.stop();
});

/** A test with its own page. An error in the console of the browser fails it. */
function on(name, address, run, options = {}) {
  test(name, { skip, timeout: 90000 }, async () => {
    const { page, errors, close } = await open(browser, server.url + address, options);
    try {
      await run(page);
      assert.deepEqual(errors, []);
    } finally { await close(); }
  });
}

const checker = npy(32, (z, y, x) => ((z >> 2) + (y >> 2) + (x >> 2)) % 2 ? 210 : 40);
const firstHit = (page) => page.locator(".hit .name").first().innerText();
const hits = (page, n) => page.waitForFunction((n) => document.querySelectorAll(".hits:not([aria-busy]) .hit").length === n, n);

on("the grid shows the textures and their pictures", "", async (page) => {
  await page.getByRole("heading", { name: "60 textures" }).waitFor();
  await page.waitForFunction(() => [...document.querySelectorAll(".grid img")].filter((image) => image.naturalWidth > 0).length > 10);
  assert.equal(await page.locator(".grid").getAttribute("role"), "grid");
});

on("tags filter, and the address, back and forward follow", "", async (page) => {
  await page.locator(".facet", { hasText: "marble" }).click();
  await page.getByRole("heading", { name: "10 of 60 textures" }).waitFor();
  assert.match(page.url(), /where=family%3Dmarble|where=family=marble/);
  assert.ok((await page.locator(".grid .name").allInnerTexts()).filter(Boolean).every((name) => name.includes("marble")));
  await page.goBack();
  await page.getByRole("heading", { name: "60 textures", exact: true }).waitFor();
  await page.goForward();
  await page.getByRole("heading", { name: "10 of 60 textures" }).waitFor();
  await page.reload();
  await page.getByRole("heading", { name: "10 of 60 textures" }).waitFor();
  assert.equal(await page.locator(".facet", { hasText: "marble" }).getAttribute("aria-pressed"), "true");
  await page.getByRole("button", { name: "Remove the filter family=marble" }).click();
  await page.getByRole("heading", { name: "60 textures", exact: true }).waitFor();
});

on("text is searched with the keyboard, and an empty result is explained", "", async (page) => {
  await page.locator(".grid img").first().waitFor();
  await page.keyboard.press("/");
  await page.keyboard.type("granite");
  await page.getByRole("heading", { name: "10 of 60 textures" }).waitFor();
  await page.keyboard.type("zzz");
  await page.getByRole("heading", { name: "No texture matches" }).waitFor();
  await page.getByRole("button", { name: "Show all textures" }).click();
  await page.getByRole("heading", { name: "60 textures", exact: true }).waitFor();
});

on("the keyboard moves through the grid", "", async (page) => {
  await page.locator(".grid a[href]").first().waitFor();
  await page.locator(".grid a[tabindex='0']").focus();
  await page.keyboard.press("ArrowRight");
  await page.keyboard.press("ArrowRight");
  assert.equal(await page.evaluate(() => document.activeElement.getAttribute("href")), "#/texture/3");
  await page.keyboard.press("x");
  await page.getByText("1 marked").waitFor();
  assert.match(page.url(), /mark=3/);
  await page.keyboard.press("Escape");
  await page.keyboard.press("End");
  assert.equal(await page.evaluate(() => document.activeElement.getAttribute("href")), "#/texture/60");
  await page.keyboard.press("Enter");
  await page.getByRole("heading", { level: 1 }).waitFor();
  assert.match(page.url(), /texture\/60/);
  await page.goBack();
  await page.locator(".grid a[href]").first().waitFor();
  await page.locator(".grid a[tabindex='0']").focus();
  await page.keyboard.press("f");
  await page.locator(".hit").first().waitFor();
});

on("a texture: its volume is turned, formed and cut, and the address records it", "#/texture/12", async (page) => {
  await drawn(page);
  const first = await pixels(page, "canvas.volume");
  assert.ok(first.lit > 300, `almost nothing is drawn: ${first.lit} of 9216 pixels`);
  const box = await page.locator("canvas.volume").boundingBox();
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  await page.mouse.down();
  await page.mouse.move(box.x + box.width / 2 + 150, box.y + box.height / 2 + 40, { steps: 4 });
  await page.mouse.up();
  await drawn(page);
  const turned = await pixels(page, "canvas.volume");
  assert.notEqual(turned.hash, first.hash);
  const seen = new Set([first.hash, turned.hash]);
  for (const form of ["Cube", "Sphere", "Torus"]) {
    await page.locator(".viewer-controls").getByRole("radio", { name: form }).check();
    await drawn(page);
    const carved = await pixels(page, "canvas.volume");
    assert.ok(carved.lit > 300 && !seen.has(carved.hash), form);
    seen.add(carved.hash);
  }
  await page.getByLabel("Cut from the end of x").fill("50");
  await drawn(page);
  const cut = await pixels(page, "canvas.volume");
  assert.ok(!seen.has(cut.hash));
  await page.waitForFunction(() => /form=torus/.test(location.hash) && /cam=/.test(location.hash) && /cut=0,100,0,100,0,50/.test(location.hash));
  await page.reload();
  await drawn(page);
  // The address records whole degrees, and a slow machine draws fewer pixels, so the picture is only nearly the same.
  const restored = await pixels(page, "canvas.volume");
  assert.ok(apart(restored, cut) < 20 && apart(cut, first) > 40, `${apart(restored, cut)} and ${apart(cut, first)}`);
  assert.ok(await page.locator(".viewer-controls").getByRole("radio", { name: "Torus" }).isChecked());
  assert.equal(await page.getByLabel("Cut from the end of x").inputValue(), "50");
  await page.locator("canvas.volume").focus();
  await page.keyboard.press("ArrowLeft");
  await drawn(page);
  assert.notEqual((await pixels(page, "canvas.volume")).hash, restored.hash);
});

on("a texture: slices, scrubbers, moments", "#/texture/12", async (page) => {
  await page.locator(".contact-stage img").waitFor();
  await page.waitForFunction(() => document.querySelector(".contact-stage img").naturalWidth > 0);
  const scrub = page.locator(".scrub").first();
  await scrub.getByRole("slider").fill("4");
  assert.equal(await scrub.locator("output").innerText(), "5 of 32");
  await page.waitForFunction(() => /at=4,16,16/.test(location.hash));
  await page.getByRole("radio", { name: "across x" }).check();
  await page.waitForFunction(() => /axis=x/.test(location.hash));
  const plot = page.locator(".plot-stage");
  await plot.focus();
  await page.keyboard.press("End");
  assert.equal(await plot.getAttribute("aria-valuenow"), "251");
  assert.match(await page.locator(".readout").innerText(), /ins/);
});

on("tags are set and removed", "#/texture/5", async (page) => {
  await page.getByLabel("Key of a new tag").fill("seen");
  await page.getByLabel("Its value").fill("yes");
  await page.getByRole("button", { name: "Set" }).click();
  await page.getByRole("link", { name: "yes" }).waitFor();
  await page.reload();
  await page.getByRole("link", { name: "yes" }).waitFor();
  await page.getByRole("button", { name: "Remove the tag seen" }).click();
  await page.getByRole("link", { name: "yes" }).waitFor({ state: "detached" });
});

on("a query: hits with slices; k and space are live; the address is restored", "#/texture/12", async (page) => {
  await page.getByRole("link", { name: "Find similar" }).click();
  await hits(page, 30);
  await page.waitForFunction(() => [...document.querySelectorAll(".hit img")].slice(0, 4).every((image) => image.naturalWidth > 0));
  const ranks = await page.locator(".hit .rank").allInnerTexts();
  assert.deepEqual(ranks.map(Number), Array.from({ length: 30 }, (_, at) => at + 1));
  await page.getByLabel("hits", { exact: true }).fill("7");
  await hits(page, 7);
  const before = await page.locator(".hit .name").allInnerTexts();
  await page.getByLabel("space", { exact: true }).selectOption("paper");
  await page.waitForFunction(() => document.querySelector(".summary").textContent.startsWith("paper"));
  assert.match(page.url(), /k=7/);
  assert.match(page.url(), /space=paper/);
  const paper = await page.locator(".hit .name").allInnerTexts();
  assert.notDeepEqual(paper, before);
  await page.reload();
  await hits(page, 7);
  assert.deepEqual(await page.locator(".hit .name").allInnerTexts(), paper);
  await page.goBack();
  await page.getByRole("link", { name: "Find similar" }).waitFor();
});

on("several hits are marked, searched by together, and compared", "#/query?ids=12&k=9", async (page) => {
  await hits(page, 9);
  for (const at of [0, 1]) await page.locator(".hit input[type=checkbox]").nth(at).check();
  await page.getByText("2 marked").waitFor();
  const compare = await page.locator(".tray").getByRole("link", { name: "Compare" }).getAttribute("href");
  await page.getByRole("link", { name: "Find similar to all" }).click();
  await page.locator(".examples.several").waitFor();
  assert.equal(await page.locator(".example").count(), 2);
  await page.locator(".hit").first().waitFor();
  await page.getByLabel("combine").selectOption("min");
  await page.waitForFunction(() => /combine=min/.test(location.hash));
  await page.evaluate((address) => { location.hash = address; }, compare);
  await page.getByRole("heading", { name: "How they differ" }).waitFor();
  await page.waitForFunction(() => document.querySelectorAll("canvas.volume[data-drawn=yes]").length === 2, null, { timeout: 30000 });
  const before = await Promise.all([0, 1].map((at) => pixels(page, `.compare-one:nth-child(${at + 1}) canvas.volume`)));
  await page.locator("canvas.volume").first().focus();
  await page.keyboard.press("Shift+ArrowRight");
  await page.waitForFunction(() => document.querySelectorAll("canvas.volume[data-drawn=yes]").length === 2, null, { timeout: 30000 });
  const then = await Promise.all([0, 1].map((at) => pixels(page, `.compare-one:nth-child(${at + 1}) canvas.volume`)));
  assert.ok(then.every((one, at) => one.hash !== before[at].hash), "the two turn together");
  await page.locator(".bars .bar-fill").first().waitFor({ state: "attached" });
});

on("a dropped file finds similar textures", "", async (page) => {
  await page.locator(".grid img").first().waitFor();
  await drop(page, [{ name: "checker.npy", bytes: checker }]);
  await hits(page, 30);
  await page.locator(".example-name", { hasText: "checker.npy" }).waitFor();
  await page.waitForFunction(() => document.querySelector(".examples img")?.naturalWidth > 0);
  assert.match(page.url(), /upload=/);
  const nearest = await firstHit(page);
  await page.reload();
  await hits(page, 30);
  assert.equal(await firstHit(page), nearest);
});

on("a texture's own file finds it first; a block of a texture is an example", "#/texture/23", async (page) => {
  const voxels = await page.evaluate(async () => [...new Uint8Array(await (await fetch("api/v1/textures/23/voxels")).arrayBuffer())]);
  await drop(page, [{ name: "same.npy", bytes: npy(32, (z, y, x) => voxels[(z * 32 + y) * 32 + x]) }]);
  await hits(page, 30);
  assert.match(await page.locator(".hit a").first().getAttribute("href"), /texture\/23$/);
  await page.goto(`${server.url}#/query?block=23,0,0,0,16,32,32&k=5`);
  await hits(page, 5);
  await page.getByText("a block of").waitFor();
});

on("a bad file is refused with a sentence", "", async (page) => {
  await page.locator(".grid img").first().waitFor();
  await drop(page, [{ name: "holiday.npy", bytes: Buffer.from("this is no volume at all") }]);
  const toast = page.getByRole("alert");
  await toast.waitFor();
  assert.match(await toast.innerText(), /holiday\.npy/);
  await page.getByRole("button", { name: "Dismiss" }).click();
  await toast.waitFor({ state: "detached" });
  assert.ok(!page.url().includes("upload="));
}, { expected: ["/api/v1/query"] });

on("several files are added to the store", "", async (page) => {
  await page.locator(".grid img").first().waitFor();
  await drop(page, [1, 2].map((n) => ({ name: `stripes-${n}.npy`, bytes: npy(24, (z) => ((z / (n + 2)) & 1 ? 200 : 30)) })));
  await page.getByRole("textbox", { name: /Tags for all of them/ }).fill("family=stripes");
  await page.getByRole("button", { name: "Add", exact: true }).click();
  await page.getByText("2 textures added").first().waitFor();
  await page.goto(`${server.url}#/?text=stripes`);
  await page.getByRole("heading", { name: /^2 of / }).waitFor();
  for (let left = 2; left > 0; left -= 1) {
    await page.goto(`${server.url}#/?text=stripes`);
    await page.locator(".grid a[href]").first().click();
    await page.getByRole("button", { name: "Remove…" }).click();
    await page.getByRole("button", { name: "Remove", exact: true }).click();
    await page.getByText("was removed").first().waitFor();
    await page.reload();
  }
});

on("the map is drawn and zoomed, and a point is selected", "#/map", async (page) => {
  await page.locator("canvas.map").waitFor();
  await page.locator(".visible-list img").first().waitFor();
  const far = await pixels(page, "canvas.map");
  assert.ok(far.lit > 60);
  await page.locator("canvas.map").focus();
  for (let n = 0; n < 4; n += 1) await page.keyboard.press("+");
  await page.waitForFunction(() => /view=/.test(location.hash));
  assert.notEqual((await pixels(page, "canvas.map")).hash, far.hash);
  await page.keyboard.press("Enter");
  await page.locator(".map-card h2").waitFor();
  assert.match(page.url(), /sel=\d+/);
  const name = await page.locator(".map-card h2").innerText();
  await page.reload();
  await page.locator(".map-card h2", { hasText: name }).waitFor();
  await page.locator(".legend .facet", { hasText: "wood" }).click();
  await page.waitForFunction(() => /only=wood/.test(location.hash));
  await page.locator(".map-card").getByRole("link", { name: "Find similar" }).click();
  await page.locator(".hit").first().waitFor();
});

on("statistics, and a reindex with progress", "#/statistics", async (page) => {
  await page.locator(".plot-stage").waitFor();
  const epoch = () => page.locator(".statistics-body").innerText().then((text) => Number(/epoch (\d+)/.exec(text)[1]));
  const before = await epoch();
  await page.getByRole("button", { name: "Fit the spaces again" }).click();
  await page.waitForFunction((before) => Number(/epoch (\d+)/.exec(document.querySelector(".statistics-body").innerText)?.[1]) > before, before, { timeout: 60000 });
});

on("missing things are explained", "#/texture/9999", async (page) => {
  await page.getByRole("heading", { name: "Not found" }).waitFor();
  await page.evaluate(() => { location.hash = "#/query?upload=gone"; });
  await page.getByRole("heading", { name: "The upload has expired" }).waitFor();
  await page.evaluate(() => { location.hash = "#/nowhere"; });
  await page.getByText("no view called “nowhere”").waitFor();
}, { expected: ["/api/v1/textures/9999", "/api/v1/query", "/api/v1/uploads/"] });

on("the chosen theme is remembered", "", async (page) => {
  const ground = () => page.evaluate(() => getComputedStyle(document.body).backgroundColor);
  const system = await ground();
  await page.locator("#theme").click();
  await page.locator("#theme").click();
  const dark = await ground();
  assert.notEqual(dark, system);
  await page.reload();
  assert.equal(await ground(), dark);
}, { colorScheme: "light" });

test("without WebGL2 the slices and an explanation are shown", { skip, timeout: 60000 }, async () => {
  const plain = await launch(["--no-sandbox", "--disable-3d-apis"]);
  const { page, errors, close } = await open(plain, `${server.url}#/texture/3`);
  await page.getByText("This browser cannot draw the volume").waitFor();
  await page.locator(".contact-stage img").waitFor();
  await page.locator(".scrub canvas").first().waitFor();
  assert.deepEqual(errors, []);
  await close();
  await plain.close();
});
