// The address that `palpate demo` prints, in a browser.

import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { drawn, launch, program, until } from "./harness.mjs";

let browser;
before(async () => (browser = await launch()));
after(() => browser?.close());

test("the demo's address shows its session while it runs, and with --keep after", async () => {
  const folder = mkdtempSync(join(tmpdir(), "palpate-demo-"));
  // Many attempts, so that a fast machine is still at work when the page is there.
  const attempts = 250;
  const demo = spawn(program, ["demo", "--keep", "--attempts", String(attempts)], { cwd: folder, stdio: ["ignore", "pipe", "inherit"] });
  try {
    let printed = "";
    demo.stdout.on("data", (text) => (printed += text));
    const address = await until("an address", () => /Watch it while it runs: (\S+)/.exec(printed)?.[1]);
    const page = await browser.newPage({ viewport: { width: 1280, height: 800 } });
    await page.goto(address);
    const revision = () => page.locator("main.session").getAttribute("data-revision").then(Number);
    await until("a surface while it runs", async () => (await revision()) > 2 && (await drawn(page)).share > 0.03);
    assert.ok(!printed.includes("Still serving"), "the robot is at work");
    const seen = await revision();
    await until("it goes on", async () => (await revision()) > seen);
    await until("the demo is over", () => printed.includes("Still serving"), 120);
    const session = await (await fetch(new URL("/v1/sessions/demo", address))).json();
    const end = Number(session.revision);
    await until(`its last touch, ${end}`, async () => (await revision()) === end);
    await page.reload();
    await until("its last touch again, after a reload", async () => (await revision()) === end && (await drawn(page)).share > 0.03);
    assert.ok(printed.includes(`${address} shows it`), "the same address is printed for after");
  } finally {
    demo.kill("SIGINT");
    await new Promise((done) => (demo.exitCode === null ? demo.once("exit", done) : done()));
    rmSync(folder, { recursive: true });
  }
});
