// A real server, a simulated robot, and a real browser that looks at them.

import { spawn } from "node:child_process";
import { existsSync, mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { createServer } from "node:net";
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
  static async start() {
    const server = new Server();
    server.folder = mkdtempSync(join(tmpdir(), "palpate-page-"));
    server.port = await freePort();
    server.url = `http://127.0.0.1:${server.port}`;
    await server.run();
    return server;
  }

  async run() {
    const options = ["serve", "--listen", `127.0.0.1:${this.port}`, "--database", join(this.folder, "palpate.db"), "--simulated-robots", "2"];
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

/** How much of the view is drawn, and how: the share of its middle that is not background, and its mean colour. */
export async function drawn(page, selector = ".view canvas") {
  return page.evaluate((selector) => {
    const canvas = document.querySelector(selector);
    const copy = document.createElement("canvas");
    [copy.width, copy.height] = [canvas.width, canvas.height];
    const context = copy.getContext("2d", { willReadFrequently: true });
    context.drawImage(canvas, 0, 0);
    const [x, y] = [Math.floor(canvas.width / 4), Math.floor(canvas.height / 4)];
    const { data } = context.getImageData(x, y, 2 * x, 2 * y);
    let [count, red, green, blue, hash] = [0, 0, 0, 0, 0];
    for (let at = 0; at < data.length; at += 4) {
      if (data[at + 3] < 128) continue;
      count++;
      red += data[at];
      green += data[at + 1];
      blue += data[at + 2];
      hash = (31 * hash + data[at] + 7 * data[at + 1] + 13 * data[at + 2]) | 0;
    }
    return { share: (4 * count) / data.length, red: red / count, green: green / count, blue: blue / count, hash };
  }, selector);
}
