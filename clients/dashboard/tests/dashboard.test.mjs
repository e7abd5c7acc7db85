import assert from "node:assert/strict";
import { createServer } from "node:http";
import { readFileSync, writeFileSync } from "node:fs";
import { after, before, test } from "node:test";
import { Server, browser, pixels, until } from "./harness.mjs";

let chromium;
let server;
let first;
before(async () => {
  chromium = await browser();
  server = await Server.start("--simulated-robots", "4");
  first = await server.explored({ seed: 1, attempts: 8 });
});
after(async () => {
  await chromium?.close();
  await server?.remove();
});

async function open(path, options = {}, at = server) {
  const page = await chromium.newPage({ viewport: { width: 1280, height: 900 }, ...options });
  page.errors = [];
  page.on("pageerror", (error) => page.errors.push(String(error)));
  page.on("console", (message) => /Content.Security.Policy/i.test(message.text()) && page.errors.push(message.text()));
  await page.goto(`${at.url}/${path}`);
  return page;
}
const isDrawn = (page, index = 0) => until(async () => (await pixels(page, index)).share > 0.02, "the surface is visible");
const revision = (page, index = 0) =>
  page.locator(".panel").nth(index).getAttribute("data-revision", { timeout: 20_000 }).then(Number);
const submit = (page) => page.locator("dialog button[type=submit]").click();
const closed = (page) => page.locator("dialog").waitFor({ state: "detached" });

test("the surface is visible and changes with each touch", async () => {
  const { session_id: id } = await server.simulate({ seed: 2, attempts: 6, pause_ms: 2000 });
  const page = await open(`#/${id}`);
  await isDrawn(page);
  const seen = new Set();
  await until(async () => {
    seen.add((await pixels(page)).sum);
    return (await revision(page)) >= 8;
  }, "six touches arrive");
  assert.ok(seen.size >= 4, `${seen.size} different pictures`);
  assert.equal(await page.locator(".live").getAttribute("aria-pressed"), "true");
  assert.deepEqual(page.errors, []);
  await page.close();
});

test("the scrubber goes back, by mouse and by keys, and the link restores revision and camera", async () => {
  const page = await open(`#/${first}`);
  await isDrawn(page);
  await until(async () => (await revision(page)) === 10, "the newest revision");
  const newest = (await pixels(page)).sum;
  await page.locator("input[type=range]").fill("3");
  await until(async () => (await revision(page)) === 3, "revision 3");
  assert.notEqual((await pixels(page)).sum, newest);
  assert.equal(await page.locator(".live").getAttribute("aria-pressed"), "false");
  await page.locator(".name").focus();
  await page.keyboard.press("ArrowRight");
  await until(async () => (await revision(page)) === 4, "revision 4");
  await page.keyboard.press("1");
  await until(() => page.evaluate(() => /revision=4&camera=-?0\.00/.test(location.hash)), "a link with the camera");
  const again = await open(await page.evaluate(() => location.hash));
  await isDrawn(again);
  assert.equal(await revision(again), 4);
  assert.equal(await again.evaluate(() => location.hash), await page.evaluate(() => location.hash));
  await page.getByRole("button", { name: "live" }).click();
  await until(async () => (await revision(page)) === 10, "live again");
  await page.close();
  await again.close();
});

test("vertices and candidates can be picked", async () => {
  const page = await open(`#/${first}`);
  await isDrawn(page);
  const box = await page.locator(".view canvas").boundingBox();
  const note = page.locator(".picked");
  const said = [];
  await until(async () => {
    for (let y = 0.2; y < 0.85; y += 0.05) {
      for (let x = 0.3; x < 0.72; x += 0.03) {
        await page.mouse.move(box.x + x * box.width, box.y + y * box.height);
        const text = await note.textContent();
        if (text) said.push(text);
      }
    }
    return said.some((text) => /Vertex \d+: uncertainty 0\.\d+, deviation ± [\d.]+ mm/.test(text)) &&
      said.some((text) => /Candidate: .*Risk of failure/.test(text));
  }, "a vertex and a candidate under the mouse");
  await page.close();
});

test("sessions are compared side by side, with linked cameras and one table", async () => {
  const second = await server.explored({ object: "can", seed: 3, attempts: 5 });
  const page = await open(`#/${first}+${second}`);
  await isDrawn(page, 0);
  await isDrawn(page, 1);
  assert.equal(await page.locator(".table tbody tr").count(), 2);
  const before = (await pixels(page, 1)).sum;
  const box = await page.locator(".view canvas").first().boundingBox();
  await page.mouse.move(box.x + 30, box.y + 40);
  await page.mouse.down();
  await page.mouse.move(box.x + 150, box.y + 90, { steps: 4 });
  await page.mouse.up();
  await until(async () => (await pixels(page, 1)).sum !== before, "the other camera follows");
  assert.deepEqual(page.errors, []);
  await page.close();
});

test("a server that was killed and started again is caught up with, without a reload", async () => {
  const own = await Server.start("--simulated-robots", "1");
  const id = await own.explored({ attempts: 3 });
  const page = await open(`#/${id}`, {}, own);
  await isDrawn(page);
  await page.evaluate(() => (window.isSamePage = true));
  await own.kill();
  await page.getByRole("status").filter({ hasText: "reconnecting" }).waitFor();
  assert.ok((await pixels(page)).share > 0.02, "what was seen stays");
  await own.up();
  await own.send(`/v1/sessions/${id}/events/3/retract`, { reason: "a test" });
  await until(async () => (await revision(page)) === 6, "the event after the restart");
  assert.equal(await page.evaluate(() => window.isSamePage), true);
  await page.close();
  await own.remove();
});

test("a page that finds no server says so", async () => {
  const page = await open("");
  await page.route("**/v1/**", (route) => route.abort());
  await page.reload();
  await page.getByText("The server does not answer").waitFor();
  await page.unroute("**/v1/**");
  await page.locator(".sessions li").first().waitFor();
  await page.close();
});

test("sessions are created, and an error names its field", async () => {
  const page = await open(`#/${first}`);
  await page.getByRole("button", { name: "New session" }).click();
  await page.getByLabel("Icosphere subdivisions").fill("99");
  await submit(page);
  await page.locator("dialog [role=alert]").filter({ hasText: "config.icosphere_subdivisions" }).waitFor();
  await page.getByLabel("Icosphere subdivisions").fill("3");
  await page.getByLabel("Id").fill("made-here");
  await submit(page);
  await closed(page);
  await page.getByText("No view yet").waitFor();
  const ply = ["ply", "format ascii 1.0", "element vertex 200", "property float x", "property float y", "property float z", "end_header"];
  for (let i = 0; i < 200; i += 1) {
    const [polar, turn] = [1.4 * Math.sqrt(i / 200), 2.4 * i];
    ply.push([0.04 * Math.sin(polar) * Math.cos(turn), 0.04 * Math.sin(polar) * Math.sin(turn), 0.04 * Math.cos(polar)].join(" "));
  }
  await page.getByRole("button", { name: "Upload view" }).click();
  await page.locator("input[type=file]").setInputFiles({ name: "cap.ply", mimeType: "application/ply", buffer: Buffer.from(`${ply.join("\n")}\n`) });
  await page.getByLabel("Camera at").fill("0,0,0.5");
  await submit(page);
  await closed(page);
  await isDrawn(page);
  await page.close();
});

test("a session is forked, corrected, retracted from, finished and downloaded", async () => {
  const page = await open(`#/${first}`);
  await isDrawn(page);
  await page.getByRole("button", { name: "Fork" }).click();
  await page.getByLabel("New id").fill("forked-here");
  await submit(page);
  await closed(page);
  await until(() => page.evaluate(() => location.hash.startsWith("#/forked-here")), "the fork is shown");
  await isDrawn(page);
  await page.getByRole("button", { name: "Retract" }).click();
  await page.locator("input[name=seq]").fill("3");
  await page.getByLabel("Reason").fill("the cable touched");
  await submit(page);
  await closed(page);
  await until(async () => (await server.session("forked-here")).retracted_seqs.includes(3), "it is retracted");
  await page.getByRole("button", { name: "Object moved" }).click();
  await page.getByLabel("Moved along x").fill("5");
  await submit(page);
  await closed(page);
  const download = page.waitForEvent("download");
  await page.getByLabel("Download").selectOption("stl");
  assert.match((await download).suggestedFilename(), /^forked-here-r\d+\.stl$/);
  await page.getByRole("button", { name: "Finish" }).click();
  await submit(page);
  await closed(page);
  await until(async () => (await server.session("forked-here")).state === "SESSION_STATE_FINISHED", "it is finished");
  await page.close();
});

test("a simulated robot is started from the page, and is not offered where none is allowed", async () => {
  const page = await open(`#/${first}`);
  await page.getByRole("button", { name: "Simulated robot" }).click();
  await page.getByLabel("Object").selectOption("pear");
  await page.getByLabel("Touches").fill("0");
  await submit(page);
  await page.locator("dialog [role=alert]").filter({ hasText: "attempts" }).waitFor();
  await page.getByLabel("Touches").fill("2");
  await submit(page);
  await closed(page);
  await isDrawn(page);
  await page.close();
  const closedServer = await Server.start();
  const bare = await open("", {}, closedServer);
  await bare.getByRole("button", { name: "New session" }).waitFor();
  assert.equal(await bare.getByRole("button", { name: "Simulated robot" }).count(), 0);
  assert.equal((await fetch(`${closedServer.url}/v1/simulations`)).status, 404);
  await bare.close();
  await closedServer.remove();
});

test("a foreign page cannot call the API", async () => {
  const foreign = createServer((_, answer) => answer.setHeader("content-type", "text/html").end("<title>foreign</title>"));
  await new Promise((resolve) => foreign.listen(0, "127.0.0.1", resolve));
  const page = await chromium.newPage();
  await page.goto(`http://127.0.0.1:${foreign.address().port}/`);
  const call = (method) => page.evaluate(([url, method]) => fetch(url, { method, headers: method === "POST" ? { "content-type": "text/plain" } : {} }).then(() => "read", () => "refused"), [`${server.url}/v1/sessions`, method]);
  assert.equal(await call("GET"), "refused");
  assert.equal(await call("POST"), "refused");
  await page.close();
  foreign.close();
});

test("files are compressed and cached, and paths of the API are not the page", async () => {
  const page = await fetch(`${server.url}/`, { headers: { "accept-encoding": "br" } });
  assert.equal(page.headers.get("content-encoding"), "br");
  assert.equal(page.headers.get("cache-control"), "no-cache");
  assert.ok(!page.headers.get("content-security-policy").includes("unsafe"));
  const script = (await page.text()).match(/src="(\/assets\/[^"]+\.js)"/)[1];
  assert.match((await fetch(server.url + script)).headers.get("cache-control"), /immutable/);
  const known = await fetch(`${server.url}/`, { headers: { "accept-encoding": "br", "if-none-match": page.headers.get("etag") } });
  assert.equal(known.status, 304);
  const wrong = await fetch(`${server.url}/v1/nothing`);
  assert.equal(wrong.status, 404);
  assert.match(wrong.headers.get("content-type"), /problem\+json/);
});

for (const colorScheme of ["light", "dark"]) {
  for (const width of [1280, 390]) {
    test(`the page fits ${width} pixels in ${colorScheme}`, async () => {
      const page = await open(`#/${first}`, { colorScheme, viewport: { width, height: 900 } });
      await isDrawn(page);
      await until(async () => (await page.locator(".u-over").count()) >= 3, "the charts");
      await page.locator(".strip").waitFor();
      assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth), "nothing sticks out");
      if (process.env.PICTURES) {
        await until(async () => (await revision(page)) === 10, "the newest revision");
        writeFileSync(`${process.env.PICTURES}/${width}-${colorScheme}.png`, await page.screenshot({ fullPage: width < 700 }));
      }
      assert.deepEqual(page.errors, []);
      await page.close();
    });
  }
}

test("the picture of the README is of a real session", async () => {
  const id = await server.explored({ seed: 1, attempts: 20 });
  const page = await open(`#/${id}`);
  await isDrawn(page);
  await until(async () => (await revision(page)) === 22, "the newest revision");
  await page.locator("figure", { hasText: "Error to reference" }).waitFor();
  const picture = await page.screenshot();
  assert.ok(picture.length < 300_000, `${picture.length} bytes`);
  if (process.env.PICTURE) writeFileSync(process.env.PICTURE, picture);
  assert.equal(readFileSync(new URL("../../../docs/images/dashboard.png", import.meta.url)).subarray(1, 4).toString(), "PNG");
  await page.close();
});
