// A real server, a simulated robot, and a real browser that looks at them.

import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { existsSync, mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { createServer } from "node:net";
import { after, afterEach, before, beforeEach } from "node:test";
import { chromium } from "playwright-core";

export const program = process.env.PALPATE_BINARY;
if (!program) throw new Error("PALPATE_BINARY says which program is tested: PALPATE_BINARY=../../target/release/palpate npm test");

const browserPath = ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"].find((path) => existsSync(path));
if (!browserPath) throw new Error("the tests need a browser: apt-get install chromium");

/** Without a graphics card the processor draws; nothing is looked for on the network. */
const ARGUMENTS = [
  "--no-sandbox",
  "--use-angle=swiftshader",
  "--enable-unsafe-swiftshader",
  "--ignore-gpu-blocklist",
  "--disable-background-networking",
  "--disable-component-update",
  "--disable-sync",
  "--no-first-run",
];

export const launch = () => chromium.launch({ executablePath: browserPath, args: ARGUMENTS });

export async function until(what, condition, seconds = 30) {
  const end = Date.now() + 1000 * seconds;
  let last;
  while (Date.now() < end) {
    try {
      last = await condition();
      if (last) return last;
    } catch (error) {
      last = error;
    }
    await new Promise((done) => setTimeout(done, 100));
  }
  throw new Error(`${what}: not within ${seconds} s; last ${last}`);
}

function freePort() {
  return new Promise((done) => {
    const server = createServer().listen(0, "127.0.0.1", () => {
      const { port } = server.address();
      server.close(() => done(port));
    });
  });
}

/** A server with a database that lasts as long as the object, through kills and restarts. */
export class Server {
  static async start(robots = 2, more = []) {
    const server = new Server();
    server.robots = robots;
    server.more = more;
    server.folder = mkdtempSync(join(tmpdir(), "palpate-page-"));
    server.port = await freePort();
    server.url = `http://127.0.0.1:${server.port}`;
    await server.run();
    return server;
  }

  async run() {
    const options = ["serve", "--listen", `127.0.0.1:${this.port}`, "--database", join(this.folder, "palpate.db"), "--simulated-robots", String(this.robots), ...this.more];
    this.process = spawn(program, options, { stdio: "ignore" });
    await until("the server", async () => (await fetch(`${this.url}/readyz`)).ok);
  }

  isRunning() {
    return this.process.exitCode === null && this.process.signalCode === null;
  }

  kill(signal = "SIGKILL") {
    return new Promise((done) => {
      this.process.once("exit", done);
      this.process.kill(signal);
    });
  }

  async stop() {
    await this.kill("SIGTERM");
    rmSync(this.folder, { recursive: true });
  }

  /** A simulated robot explores an object; the promise is that of its end. */
  explore(name, attempts, more = []) {
    const options = ["explore", "--server", this.url, "--object", name, "--attempts", String(attempts), ...more];
    const robot = spawn(program, options, { stdio: ["ignore", "pipe", "pipe"], cwd: this.folder });
    let text = "";
    robot.stdout.on("data", (data) => (text += data));
    robot.stderr.on("data", (data) => (text += data));
    return new Promise((done, fail) =>
      robot.once("exit", (code) => (code === 0 ? done(text) : fail(new Error(`explore: ${code}\n${text}`)))),
    );
  }

  async ask(path, body) {
    const init = body && { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) };
    const response = await fetch(`${this.url}${path}`, init);
    if (!response.ok) throw new Error(`${path}: ${response.status} ${await response.text()}`);
    return response.json();
  }

  async newest() {
    const { sessions } = await this.ask("/v1/sessions");
    return sessions[0];
  }
}

/** A browser and a server for the tests of a file, and a fresh page for each, in which nothing may go wrong.
 * What all of them look at is made by `prepare`. */
export function stage(prepare = async () => {}) {
  const on = {
    /** The revision that the page shows. */
    shown: () => on.page.locator("main.session").getAttribute("data-revision").then(Number),
    open: (hash) => on.page.goto(`${on.server.url}/${hash}`),
  };
  let complaints;
  before(async () => {
    on.browser = await launch();
    on.server = await Server.start();
    await prepare(on.server);
  });
  after(async () => {
    await on.browser?.close();
    await on.server?.stop();
  });
  beforeEach(async () => {
    on.page = await on.browser.newPage({ viewport: { width: 1280, height: 800 } });
    complaints = [];
    on.page.on("pageerror", (error) => complaints.push(String(error)));
    on.page.on("console", (message) => {
      // A browser says by itself when a server is gone or refuses; everything else is a fault.
      if (message.type() === "error" && !/Failed to load resource|ERR_|EventSource|blocked by CORS/.test(message.text())) complaints.push(message.text());
    });
  });
  afterEach(async () => {
    await on.page.close();
    // A test that failed between a kill and a restart is the only one that fails.
    if (!on.server.isRunning()) await on.server.run();
    assert.deepEqual(complaints, [], "the browser complained");
  });
  return on;
}

/** Leaves only some of the layers of the view: "surface", "seen and touched", "next touches", "table, keep-out", "reference". */
export async function onlyLayers(page, ...names) {
  const layers = page.locator(".view-tools details");
  await layers.evaluate((details) => (details.open = true));
  for (const label of await layers.locator("label").all()) await label.getByRole("checkbox").setChecked(names.includes(await label.innerText()));
  await layers.evaluate((details) => (details.open = false));
}

/** The spots of one colour in the view, each with how many pixels it has and whether its middle is of that colour. */
export async function spots(page, [red, green, blue]) {
  return page.evaluate(([red, green, blue]) => {
    const canvas = document.querySelector(".view canvas");
    const copy = document.createElement("canvas");
    const { width, height } = Object.assign(copy, { width: canvas.width, height: canvas.height });
    const context = copy.getContext("2d", { willReadFrequently: true });
    context.drawImage(canvas, 0, 0);
    const { data } = context.getImageData(0, 0, width, height);
    const isOf = (at) => Math.abs(data[4 * at] - red) + Math.abs(data[4 * at + 1] - green) + Math.abs(data[4 * at + 2] - blue) < 60 && data[4 * at + 3] > 200;
    const seen = new Uint8Array(width * height);
    const found = [];
    for (let start = 0; start < seen.length; start++) {
      if (seen[start] || !isOf(start)) continue;
      let [pixels, x, y] = [0, 0, 0];
      const waiting = [start];
      seen[start] = 1;
      while (waiting.length) {
        const at = waiting.pop();
        pixels++;
        x += at % width;
        y += Math.floor(at / width);
        for (const next of [at - 1, at + 1, at - width, at + width, at - width - 1, at - width + 1, at + width - 1, at + width + 1]) {
          if (next >= 0 && next < seen.length && !seen[next] && isOf(next)) {
            seen[next] = 1;
            waiting.push(next);
          }
        }
      }
      if (pixels > 8) found.push({ pixels, isFilled: isOf(Math.round(y / pixels) * width + Math.round(x / pixels)) });
    }
    return found;
  }, [red, green, blue]);
}

/** How much of the view is drawn, and how: the share of its middle that is at least as opaque, and its mean colour. */
export async function drawn(page, opacity = 0.5) {
  return page.evaluate((opacity) => {
    const canvas = document.querySelector(".view canvas");
    const copy = document.createElement("canvas");
    [copy.width, copy.height] = [canvas.width, canvas.height];
    const context = copy.getContext("2d", { willReadFrequently: true });
    context.drawImage(canvas, 0, 0);
    const [x, y] = [Math.floor(canvas.width / 4), Math.floor(canvas.height / 4)];
    const { data } = context.getImageData(x, y, 2 * x, 2 * y);
    let [count, red, green, blue, hash] = [0, 0, 0, 0, 0];
    for (let at = 0; at < data.length; at += 4) {
      if (data[at + 3] <= 255 * opacity) continue;
      count++;
      red += data[at];
      green += data[at + 1];
      blue += data[at + 2];
      hash = (31 * hash + data[at] + 7 * data[at + 1] + 13 * data[at + 2]) | 0;
    }
    return { share: (4 * count) / data.length, red: red / count, green: green / count, blue: blue / count, hash };
  }, opacity);
}
