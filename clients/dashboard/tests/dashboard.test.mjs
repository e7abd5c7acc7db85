// The page in a real browser, against a real server with a simulated robot at work.

import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";
import { createServer } from "node:http";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { tmpdir } from "node:os";
import { VIEWPOINT, cap, ply } from "./files.mjs";
import { drawn, stage, until } from "./harness.mjs";

const on = stage((server) => server.explore("bottle", 12, ["--pad", "flat", "--out", "bottle.ply"]));
const { shown, open } = on;
let server, page;

beforeEach(() => ({ server, page } = on));

const id = async () => (await server.newest()).session_id;

test("the surface is visible, red where nothing was seen, and a permalink leads to the same view", async () => {
  const session = await id();
  await open(`#/session/${session}`);
  await until("the newest revision", async () => (await shown()) === 14);
  const newest = await until("a surface", async () => ((await drawn(page)).share > 0.05 ? drawn(page) : undefined));
  // At the first view most of it is a guess.
  await open(`#/session/${session}?revision=2`);
  await page.reload();
  await until("revision 2", async () => (await shown()) === 2);
  await until("it looks otherwise, and redder", async () => {
    const first = await drawn(page);
    return first.share > 0.05 && first.hash !== newest.hash && first.red - first.green > newest.red - newest.green;
  });
  await until("the first camera is in the address", () => page.url().includes("camera="));
  const stood = page.url();
  await page.getByRole("button", { name: "Top" }).click();
  await until("the camera is in the address", () => page.url() !== stood);
  const link = page.url();
  const before = await until("it stands still", async () => {
    const [one, two] = [await drawn(page), await drawn(page)];
    return one.hash === two.hash && one;
  });
  await page.goto("about:blank");
  await page.goto(link);
  await until("revision 2 again", async () => (await shown()) === 2);
  await until("the same picture", async () => Math.abs((await drawn(page)).share - before.share) < 0.01);
});

test("it follows a robot, stays at an earlier revision when it is there, and goes back to live", async () => {
  const robot = server.explore("can", 200, ["--seed", "3"]);
  const name = await until("the robot's session", async () => {
    const newest = await server.newest();
    return newest.display_name === "can" && newest.revision > 2 && newest.session_id;
  });
  await open(`#/session/${name}`);
  const early = await until("a surface", async () => ((await drawn(page)).share > 0.03 ? { ...(await drawn(page)), revision: await shown() } : undefined));
  await until("it went on", async () => (await shown()) > early.revision + 3);
  await until("it changes with the touches", async () => (await drawn(page)).hash !== early.hash);
  await page.getByRole("slider", { name: "Revision" }).fill("4");
  await until("revision 4", async () => (await shown()) === 4);
  const there = (await server.ask(`/v1/sessions/${name}`)).revision;
  await robot;
  const { revision: end } = await server.ask(`/v1/sessions/${name}`);
  assert.ok(Number(end) > Number(there), "the robot went on meanwhile");
  assert.equal(await shown(), 4, "who looks back is not torn away");
  await page.getByRole("button", { name: "Live" }).click();
  await until("the end", async () => (await shown()) === Number(end));
  // The charts have each attempt.
  assert.ok((await page.locator(".chart:visible").count()) >= 3);
});

test("a server that was killed comes back and the page catches up without a reload", async () => {
  const session = await id();
  await open(`#/session/${session}`);
  await until("live", () => page.locator(".badge.live").isVisible());
  await until("a surface", async () => (await drawn(page)).share > 0.03);
  await page.evaluate(() => (window.isTheSamePage = true));
  await server.kill();
  await until("it says so", () => page.locator(".badge.reconnecting").isVisible());
  assert.ok((await drawn(page)).share > 0.03, "what was there stays");
  await server.run();
  await until("live again", () => page.locator(".badge.live").isVisible());
  const { candidates } = await server.ask(`/v1/sessions/${session}/candidates`, { top_k: 1 });
  const { session: reported } = await server.ask(`/v1/sessions/${session}/contacts`, {
    result: { candidate_id: candidates[0].candidate_id, no_contact: { swept_from: candidates[0].probe_start, swept_to: candidates[0].probe_end } },
  });
  await until("it caught up", async () => (await shown()) === Number(reported.revision));
  assert.equal(await page.evaluate(() => window.isTheSamePage), true);
});

test("a vertex and a next touch say what they are", async () => {
  await open(`#/session/${await id()}`);
  await until("a surface", async () => (await drawn(page)).share > 0.03);
  await page.locator("summary", { hasText: "Layers" }).click();
  await page.getByLabel("next touches").uncheck();
  await page.getByLabel("seen and touched").uncheck();
  const box = await page.locator(".view canvas").boundingBox();
  await page.mouse.click(box.x + box.width / 2, box.y + box.height / 2);
  await until("the vertex", async () => /Vertex \d+ at revision \d+\s+at .* mm/.test(await page.locator(".picked").innerText()));
  assert.match(await page.locator(".picked").innerText(), /uncertainty \d\.\d\d, stated deviation .* mm[\s\S]*nearest attractor/);
  await until("what its score is made of", async () => /(It can be proposed|It is no candidate)[\s\S]*geodesic[\s\S]*uncertainty[\s\S]*score/.test(await page.locator(".picked").innerText()));
  // The best next touch says why it is the best, with the same terms.
  const { candidates } = await server.ask(`/v1/sessions/${await id()}/candidates`, { top_k: 1 });
  await page.getByRole("button", { name: /^Next touch 1/ }).click();
  const text = await until("why", async () => ((text) => text.includes("Why: ") && text)(await page.locator(".picked").innerText()));
  assert.ok(text.includes(`vertex ${candidates[0].vertex}`) && text.includes("risk of failure"), text);
  assert.ok(text.includes(candidates[0].score.toFixed(2)), text);
});

test("sessions are listed with their progress, filtered and compared", async () => {
  await server.explore("mug", 4);
  await open("");
  await until("rows", async () => (await page.locator("tbody tr").count()) >= 2);
  await page.getByLabel("Filter").fill("object:mug");
  await until("one", async () => (await page.locator("tbody tr").count()) === 1);
  assert.match(await page.locator("tbody tr").innerText(), /mug[\s\S]*4 of/);
  await page.getByLabel("Filter").fill("");
  for (const box of [0, 1]) await page.locator("tbody input[type=checkbox]").nth(box).check();
  await page.getByRole("button", { name: "Compare 2" }).click();
  await until("both are drawn", async () => {
    const shares = await page.locator("figure .view").evaluateAll((views) => views.map((view) => Number(view.dataset.revision ?? 0)));
    return shares.length === 2 && shares.every((revision) => revision > 2);
  });
  assert.match(await page.locator("table").innerText(), /failures/);
});

test("a session is created, gets a view from a file, is forked, corrected, finished and deleted", async () => {
  const folder = mkdtempSync(join(tmpdir(), "palpate-view-"));
  const file = join(folder, "patch.ply");
  writeFileSync(file, ply(cap()));

  await open("");
  await page.getByRole("button", { name: "New session" }).click();
  const dialog = page.locator("dialog");
  await dialog.getByLabel("Id", { exact: true }).fill("by hand");
  await dialog.getByRole("button", { name: "Create" }).click();
  await until("the refusal names the field", async () => /session_id/.test(await dialog.locator(".error").innerText()));
  assert.equal(await dialog.getByLabel("Id", { exact: true }).getAttribute("aria-invalid"), "true");
  await dialog.getByLabel("Id", { exact: true }).fill("by-hand");
  await dialog.getByLabel("Height of the table").fill("0.06");
  await dialog.getByRole("button", { name: "Create" }).click();
  await until("it says what is missing", () => page.getByText("Nothing was seen yet").isVisible());

  await page.getByRole("button", { name: "Add view" }).click();
  await dialog.getByLabel("File").setInputFiles(file);
  await dialog.getByLabel("Camera's place").fill(VIEWPOINT);
  await dialog.getByRole("button", { name: "Send" }).click();
  await until("a surface", async () => (await drawn(page)).share > 0.03);

  await page.getByRole("button", { name: "Object moved" }).click();
  await dialog.getByLabel("Moved by").fill("0.01 0 0");
  await dialog.getByRole("button", { name: "Report" }).click();
  await until("the motion is in the log", async () => (await shown()) === 3);

  await page.getByRole("button", { name: "Fork here" }).click();
  await dialog.getByLabel("Id of the fork").fill("by-hand-2");
  await dialog.getByLabel("Method").selectOption("METHOD_PAPER");
  await dialog.getByRole("button", { name: "Fork" }).click();
  await until("the fork is shown", () => page.url().includes("by-hand-2"));
  assert.equal((await server.ask("/v1/sessions/by-hand-2")).config.method, "METHOD_PAPER");

  await page.getByRole("button", { name: "Finish" }).click();
  await dialog.getByRole("button", { name: "Finish" }).click();
  await until("it is finished", async () => (await server.ask("/v1/sessions/by-hand-2")).state === "SESSION_STATE_FINISHED");
  await page.locator("summary", { hasText: "Download" }).click();
  let downloads = [];
  await until("six files are offered", async () => {
    downloads = await page.locator(".actions .menu a").evaluateAll((links) => links.map((link) => link.href));
    return downloads.length === 6;
  });
  for (const address of downloads) assert.equal((await fetch(address)).status, 200, address);
  await page.getByRole("button", { name: "Delete" }).click();
  await dialog.getByRole("button", { name: "Delete" }).click();
  await until("it is gone", async () => !(await server.ask("/v1/sessions")).sessions.some((one) => one.session_id === "by-hand-2"));
  rmSync(folder, { recursive: true });
});

test("a session that is not there, and a server that is not there, are said in words", async () => {
  await open("#/session/nobody");
  await until("words", () => page.getByText("There is no session nobody").isVisible());
  await open("");
  await until("rows", async () => (await page.locator("tbody tr").count()) >= 1);
  await server.kill();
  await until("it says so", () => page.getByText("The server does not answer").isVisible());
  assert.ok((await page.locator("tbody tr").count()) >= 1, "what was known stays");
  await server.run();
  await until("it is back", async () => !(await page.getByText("The server does not answer").isVisible()));
});

test("a simulated robot is started from the page, with its truth as a ghost and the error as a chart", async () => {
  await open("");
  await page.getByRole("button", { name: "Simulated robot" }).click();
  const dialog = page.locator("dialog");
  await dialog.getByLabel("Attempts").fill("5000");
  await dialog.getByRole("button", { name: "Start" }).click();
  await until("the refusal names the field", async () => /attempts/.test(await dialog.locator(".error").innerText()));
  await dialog.getByLabel("Attempts").fill("6");
  await dialog.getByLabel("Pause").fill("100");
  await dialog.getByRole("button", { name: "Start" }).click();
  await until("its last touch", async () => (await shown()) === 8);
  await until("the error", async () => /error, mm/.test(await page.locator(".charts").innerText()));

  // No more than the server allows, and a place is free again when one is stopped.
  await until("its robot is done", async () => !(await server.ask("/v1/simulations")).running.length);
  const slow = { object: "can", pause_ms: 60_000 };
  const two = [await server.ask("/v1/simulations", slow), await server.ask("/v1/simulations", slow)];
  await assert.rejects(server.ask("/v1/simulations", slow), /429.*TOO_MANY_SIMULATIONS/);
  for (const { session_id } of two) {
    assert.equal((await fetch(`${server.url}/v1/simulations/${session_id}`, { method: "DELETE" })).status, 204);
  }
  await until("both have stopped", async () => !(await server.ask("/v1/simulations")).running.length);
});

test("an experiment is summed up as a table of means and spreads", async () => {
  await open("#/experiments");
  await page.locator("main a", { hasText: "explore" }).click();
  await until("means and spreads", async () => /proactive[\s\S]*\d ± \d/.test(await page.locator("table").innerText()));
  await page.getByLabel("Group by").selectOption("labels.object");
  await until("a row for each object", async () => /mug/.test(await page.locator("table").innerText()));
});

test("a picture of the page, for the README", async () => {
  // A session of its own, so that the picture is the same whichever tests ran before.
  await server.explore("bottle", 25, ["--pad", "flat", "--seed", "1"]);
  await open(`#/session/${await id()}`);
  await until("the end", async () => (await shown()) === 27);
  await page.getByRole("button", { name: "Front" }).click();
  await until("the next touches", async () => (await page.locator(".chart:visible").count()) >= 3);
  await page.waitForFunction(() => document.querySelector(".chart canvas").width > 100);
  const picture = await page.screenshot({ path: process.env.PALPATE_PICTURE, animations: "disabled" });
  assert.ok(picture.length < 300_000, `${picture.length} bytes are too many for a README`);
});

test("it is usable on a telephone, in the dark and from the keyboard", async () => {
  await page.setViewportSize({ width: 390, height: 800 });
  await page.emulateMedia({ colorScheme: "dark" });
  await open(`#/session/${await id()}`);
  await until("a surface", async () => (await drawn(page)).share > 0.02);
  assert.equal(await page.evaluate(() => document.documentElement.scrollWidth), 390, "nothing sticks out");
  const ground = await page.evaluate(() => getComputedStyle(document.documentElement).backgroundColor);
  assert.equal(ground, "rgb(22, 24, 27)");
  const before = (await drawn(page)).hash;
  await page.locator(".view canvas").focus();
  await page.keyboard.press("1");
  await until("it is seen from above", async () => (await drawn(page)).hash !== before);
});

test("the page is guarded, cached and compressed, and a foreign page cannot call", async () => {
  const answer = await fetch(`${server.url}/`);
  const policy = answer.headers.get("content-security-policy");
  assert.match(policy, /script-src 'self';/);
  assert.ok(!policy.includes("unsafe"));
  const tag = answer.headers.get("etag");
  assert.equal((await fetch(`${server.url}/`, { headers: { "If-None-Match": tag } })).status, 304);
  const script = /src="(\/assets\/[^"]+\.js)"/.exec(await answer.text())[1];
  const program = await fetch(`${server.url}${script}`, { headers: { "Accept-Encoding": "br" } });
  assert.equal(program.headers.get("content-encoding"), "br");
  assert.match(program.headers.get("cache-control"), /max-age=\d{6,}/);
  assert.equal((await fetch(`${server.url}/v1/nothing`)).headers.get("content-type"), "application/problem+json");

  const foreign = createServer((_, reply) => reply.setHeader("content-type", "text/html").end("<p>elsewhere"));
  await new Promise((done) => foreign.listen(0, "127.0.0.1", done));
  await page.goto(`http://localhost:${foreign.address().port}/`);
  const read = await page.evaluate((url) => fetch(`${url}/v1/sessions`).then((reply) => reply.status, (error) => String(error)), server.url);
  assert.match(String(read), /TypeError/, "another site reads nothing");
  foreign.close();
});
