// A server that asks who calls: a token is given once, held by the page alone, and asked for again when it is revoked.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync } from "node:fs";
import { createServer } from "node:net";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, afterEach, before, beforeEach, test } from "node:test";
import { Server, drawn, launch, program, until } from "./harness.mjs";

let browser, server, page, tokens;
const palpate = (...options) => execFileSync(program, options, { encoding: "utf8", stdio: ["ignore", "pipe", "ignore"] }).trim();
const create = (name, scope) => palpate("token", "create", "--database", join(server.folder, "palpate.db"), "--name", name, "--scope", scope);
const dialog = () => page.getByRole("dialog", { name: "Who are you?" });

async function give(token) {
  await dialog().getByLabel("Token").fill(token);
  await page.keyboard.press("Enter");
}

before(async () => {
  browser = await launch();
  server = new Server();
  Object.assign(server, { robots: 1, more: ["--require-tokens"], folder: mkdtempSync(join(tmpdir(), "palpate-page-")) });
  server.port = await new Promise((done) => {
    const free = createServer().listen(0, "127.0.0.1", () => {
      const { port } = free.address();
      free.close(() => done(port));
    });
  });
  server.url = `http://127.0.0.1:${server.port}`;
  tokens = { robot: create("arm", "robot"), wall: create("wall", "read") };
  await server.run();
  execFileSync(program, ["explore", "--server", server.url, "--object", "box", "--attempts", "3"], { cwd: server.folder, stdio: "ignore", env: { ...process.env, PALPATE_TOKEN: tokens.robot } });
});
after(async () => {
  await browser?.close();
  await server?.stop();
});
beforeEach(async () => (page = await browser.newPage({ viewport: { width: 1280, height: 800 } })));
afterEach(() => page.close());

const newest = async () => {
  const response = await fetch(`${server.url}/v1/sessions`, { headers: { Authorization: `Bearer ${tokens.wall}` } });
  return (await response.json()).sessions[0];
};

test("a token is asked for once, and a wrong one is refused in words", async () => {
  await page.goto(server.url);
  await until("the question", () => dialog().isVisible());
  // A browser lets a page keep a dialog open at the first Escape only.
  for (let press = 0; press < 4; press++) await page.keyboard.press("Escape");
  await until("it stays", () => dialog().isVisible());
  await give("\u201cquoted\u201d");
  await until("that it is none", () => dialog().getByText("this is no token").isVisible());
  await give("nonsense");
  await until("what is wrong with it", () => dialog().getByText("the token is not known here").isVisible());
  await give(tokens.wall);
  await until("the session", async () => (await page.locator("tbody tr").count()) === 1);
  assert.equal(await dialog().count(), 0);
  const stored = await page.evaluate(() => JSON.stringify([{ ...localStorage }, { ...sessionStorage }, document.cookie, document.documentElement.outerHTML]));
  assert.ok(!stored.includes(tokens.wall), "the page holds it in memory alone");
  await page.getByRole("button", { name: "Log out" }).click();
  await until("the question again", () => dialog().isVisible());
});

test("a session is followed and its files are downloaded by tickets", async () => {
  const { session_id, revision } = await newest();
  const asked = [];
  page.on("request", (request) => asked.push(request.url()));
  await page.goto(`${server.url}/#/session/${session_id}`);
  await until("the question", () => dialog().isVisible());
  await give(tokens.robot);
  await until("a surface", async () => (await drawn(page)).share > 0.03);
  await until("it is followed", () => asked.some((url) => /\/events\?after_revision=\d+&ticket=[0-9a-f]{64}$/.test(url)));
  // A touch that comes later is seen without anything being loaded again.
  const headers = { Authorization: `Bearer ${tokens.robot}`, "Content-Type": "application/json" };
  const ask = async (path, body) => {
    const response = await fetch(`${server.url}/v1/sessions/${session_id}${path}`, { method: "POST", headers, body: JSON.stringify(body) });
    assert.ok(response.ok, `${path}: ${response.status} ${await response.clone().text()}`);
    return response.json();
  };
  const [{ candidate_id, probe_start, probe_end }] = (await ask("/candidates", { top_k: 1 })).candidates;
  await ask("/contacts", { result: { candidate_id, no_contact: { swept_from: probe_start, swept_to: probe_end } } });
  await until("the new revision", async () => Number(await page.locator("main.session").getAttribute("data-revision")) > Number(revision));
  await page.locator("summary", { hasText: "Download" }).click();
  const link = page.locator("a[download]", { hasText: "PLY" });
  const [download] = await Promise.all([page.waitForEvent("download"), link.click()]);
  assert.match(readFileSync(await download.path(), "latin1").slice(0, 3), /ply/);
  await page.route("**/v1/tickets", (route) => route.abort());
  await page.locator("summary", { hasText: "Download" }).click();
  await page.locator("summary", { hasText: "Download" }).click();
  await page.locator("a[download]", { hasText: "STL" }).click();
  await until("that it failed", () => page.getByText("the server does not answer").first().isVisible());
  await page.unroute("**/v1/tickets");
  assert.ok(!asked.some((url) => url.includes(tokens.robot)), "no address has the token");
});

test("the table of an experiment is downloaded by a ticket", async () => {
  const { experiment } = await newest();
  await page.goto(`${server.url}/#/experiment/${experiment}`);
  await until("the question", () => dialog().isVisible());
  await give(tokens.wall);
  const [download] = await Promise.all([page.waitForEvent("download"), page.getByRole("link", { name: "CSV" }).click()]);
  assert.match(readFileSync(await download.path(), "utf8"), /attempts/);
});

test("a page whose token is revoked asks for another one and stays where it is; what it may not do is said", async () => {
  const guest = create("guest", "read");
  const { session_id } = await newest();
  await page.goto(`${server.url}/#/session/${session_id}`);
  await until("the question", () => dialog().isVisible());
  await give(guest);
  await until("a surface", async () => (await drawn(page)).share > 0.03);
  palpate("token", "revoke", "--database", join(server.folder, "palpate.db"), "guest");
  await until("the question again", () => dialog().isVisible());
  await until("why", () => dialog().getByText("was revoked").isVisible());
  await give(tokens.wall);
  await until("it goes on", async () => (await dialog().count()) === 0 && (await page.locator("main.session").count()) === 1);
  assert.ok(page.url().endsWith(`#/session/${session_id}`) || page.url().includes(session_id));
  await page.getByRole("button", { name: "Finish" }).click();
  const finish = page.locator("dialog").filter({ hasText: "inish" });
  await finish.getByRole("button", { name: /^Finish/ }).click();
  await until("that it may not", () => finish.getByText("needs the scope robot").isVisible());
});
