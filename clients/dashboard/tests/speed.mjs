// How fast the page is: `node tests/speed.mjs`. Not a test: it prints. Without a graphics card the processor draws.

import { Server, drawn, launch, until } from "./harness.mjs";

const browser = await launch();
const server = await Server.start();
await server.ask("/v1/sessions", { session_id: "fine", frame_id: "base", config: { icosphere_subdivisions: 5 } });
const points = [];
for (let ring = 1; ring <= 12; ring++) {
  for (let step = 0; step < 24; step++) {
    const [polar, turn] = [(1.2 * ring) / 12, (2 * Math.PI * step) / 24];
    points.push([0.04 * Math.sin(polar) * Math.cos(turn), 0.04 * Math.sin(polar) * Math.sin(turn), 0.06 * Math.cos(polar)]);
  }
}
await server.ask("/v1/sessions/fine/priors", { prior: { points, viewpoint: { z: 0.6 } } });
const page = await browser.newPage({ viewport: { width: 1280, height: 800 } });
await page.goto(`${server.url}/#/session/fine`);
await until("a surface", async () => (await drawn(page)).share > 0.03);
const paint = await page.evaluate(() => performance.getEntriesByName("first-contentful-paint")[0]?.startTime);
console.log(`first paint after ${paint?.toFixed(0)} ms`);
// Turning the view draws each frame anew.
const box = await page.locator(".view canvas").boundingBox();
await page.mouse.move(box.x + 300, box.y + 300);
await page.mouse.down();
const devtools = await page.context().newCDPSession(page);
await devtools.send("Performance.enable");
const worked = async () => (await devtools.send("Performance.getMetrics")).metrics.find(({ name }) => name === "ScriptDuration").value;
const workBefore = await worked();
const counted = page.evaluate(
  () =>
    new Promise((done) => {
      let frames = 0;
      const start = performance.now();
      const count = () => {
        frames++;
        if (performance.now() - start < 5000) requestAnimationFrame(count);
        else done([frames, performance.now() - start]);
      };
      requestAnimationFrame(count);
    }),
);
for (let step = 0; step < 150; step++) {
  await page.mouse.move(box.x + 300 + 2 * (step % 100), box.y + 300 + (step % 40));
  await page.waitForTimeout(25);
}
await page.mouse.up();
const [frames, took] = await counted;
const work = (1000 * ((await worked()) - workBefore)) / frames;
console.log(`${((1000 * frames) / took).toFixed(0)} frames a second while 10,242 vertices are turned, ${work.toFixed(1)} ms of scripts for each`);
await browser.close();
await server.stop();
