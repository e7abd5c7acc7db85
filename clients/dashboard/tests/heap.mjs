// How much one page holds that is left open on four sessions which are touched all the time: `node tests/heap.mjs MINUTES`.
// Not a test: it prints.

import { Server, launch, until } from "./harness.mjs";

const minutes = Number(process.argv[2] ?? 60);
const browser = await launch();
const server = await Server.start(4);
const started = await Promise.all(
  ["bottle", "can", "mug", "ball"].map((object) => server.ask("/v1/simulations", { object, attempts: 1000, pause_ms: 3500 })),
);
const ids = started.map((one) => one.session_id);
const page = await browser.newPage({ viewport: { width: 1280, height: 800 } });
const devtools = await page.context().newCDPSession(page);
await page.goto(`${server.url}/#/compare/${ids.join(",")}`);
await until("all four are drawn", async () => (await page.locator("figure .view").count()) === 4);
console.log("minute  touches shown  heap MB  elements");
for (let minute = 0; minute <= minutes; minute++) {
  await page.waitForTimeout(minute ? 60_000 : 15_000);
  await devtools.send("HeapProfiler.collectGarbage");
  const { usedSize } = await devtools.send("Runtime.getHeapUsage");
  const elements = await page.evaluate(() => document.querySelectorAll("*").length);
  const revisions = await page.locator("figure .view").evaluateAll((views) => views.map((view) => Number(view.dataset.revision ?? 0)));
  const touches = revisions.reduce((sum, revision) => sum + Math.max(revision - 2, 0), 0);
  console.log(`${String(minute).padStart(6)}  ${String(touches).padStart(13)}  ${(usedSize / 1e6).toFixed(1).padStart(7)}  ${elements}`);
}
await browser.close();
await server.stop();
