// How much the page holds while four sessions go on side by side: `node tests/heap.mjs MINUTES`. Not a test: it prints.

import { Server, launch, until } from "./harness.mjs";

const minutes = Number(process.argv[2] ?? 60);
const browser = await launch();
const server = await Server.start();
const names = ["bottle", "can", "mug", "ball"];
let isOver = false;
const robots = names.map(async (name) => {
  // A robot that goes on touching: each of its sessions ends, and the page goes to the next four.
  while (!isOver) await server.explore(name, 60, ["--pad", "flat"]).catch(() => undefined);
});
const page = await browser.newPage({ viewport: { width: 1280, height: 800 } });
const devtools = await page.context().newCDPSession(page);
const end = Date.now() + 60_000 * minutes;
let shown = 0;
console.log("minute  sessions shown  heap MB  elements");
while (Date.now() < end) {
  const { sessions } = await until("four sessions", async () => {
    const list = await server.ask("/v1/sessions");
    return list.sessions.length >= 4 && list;
  });
  await page.goto(`${server.url}/#/compare/${sessions.slice(0, 4).map((one) => one.session_id).join(",")}`);
  shown += 4;
  await page.waitForTimeout(15_000);
  await devtools.send("HeapProfiler.collectGarbage");
  const { usedSize } = await devtools.send("Runtime.getHeapUsage");
  const elements = await page.evaluate(() => document.querySelectorAll("*").length);
  const minute = minutes - (end - Date.now()) / 60_000;
  console.log(`${minute.toFixed(1).padStart(6)}  ${String(shown).padStart(14)}  ${(usedSize / 1e6).toFixed(1).padStart(7)}  ${elements}`);
}
isOver = true;
await browser.close();
await Promise.all(robots);
await server.stop();
