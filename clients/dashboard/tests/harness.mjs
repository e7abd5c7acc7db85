// A real server of its own for a test, and a real browser in front of it.
import { spawn } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { createServer } from "node:net";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { chromium } from "playwright-core";

const PROGRAM = process.env.PALPATE;
if (!PROGRAM) throw new Error("PALPATE must name the program, such as ../../target/release/palpate");
const WAIT_MS = 20_000;

export async function browser() {
  return chromium.launch({
    executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
    args: ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox", "--disable-background-networking",
      "--disable-component-update", "--disable-sync", "--no-first-run"],
  });
}

async function freePort() {
  const server = createServer().listen(0, "127.0.0.1");
  await new Promise((resolve) => server.once("listening", resolve));
  const { port } = server.address();
  await new Promise((resolve) => server.close(resolve));
  return port;
}

export async function until(check, what) {
  const end = Date.now() + WAIT_MS;
  for (;;) {
    const value = await check();
    if (value) return value;
    if (Date.now() > end) throw new Error(`not within ${WAIT_MS / 1000} s: ${what}`);
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
}

export class Server {
  folder = mkdtempSync(join(tmpdir(), "palpate-"));

  static async start(...args) {
    const server = new Server();
    server.port = await freePort();
    server.url = `http://127.0.0.1:${server.port}`;
    server.args = args;
    await server.up();
    return server;
  }

  async up() {
    const where = ["--listen", `127.0.0.1:${this.port}`, "--database", join(this.folder, "palpate.db")];
    this.process = spawn(PROGRAM, ["serve", ...where, "--log", "error", ...this.args], { stdio: "inherit" });
    await until(() => fetch(`${this.url}/readyz`).then((answer) => answer.ok, () => false), "the server is ready");
  }

  async kill() {
    const ended = new Promise((resolve) => this.process.once("exit", resolve));
    this.process.kill("SIGKILL");
    await ended;
  }

  async remove() {
    await this.kill();
    rmSync(this.folder, { recursive: true });
  }

  async send(path, body) {
    const answer = await fetch(`${this.url}${path}`, {
      method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(body),
    });
    if (!answer.ok) throw new Error(await answer.text());
    return answer.json();
  }

  async session(id) {
    return (await fetch(`${this.url}/v1/sessions/${id}`)).json();
  }

  simulate(more) {
    return this.send("/v1/simulations", { object: "bottle", attempts: 8, pause_ms: 0, ...more });
  }

  /** A session whose robot has ended. */
  async explored(more) {
    const { session_id: id, attempts } = await this.simulate(more);
    await until(async () => (await this.session(id)).stats.attempts >= attempts, "the robot has touched");
    return id;
  }
}

/** The share of the view's pixels that are coloured, and their mean colour. */
export function pixels(page, index = 0) {
  return page.evaluate((index) => {
    const canvas = document.querySelectorAll(".view canvas")[index];
    if (!canvas) return { share: 0, sum: 0 };
    const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext("2d");
    copy.drawImage(canvas, 0, 0);
    const { data } = copy.getImageData(0, 0, canvas.width, canvas.height);
    let coloured = 0;
    let sum = 0;
    for (let i = 0; i < data.length; i += 4) {
      const [r, g, b] = [data[i], data[i + 1], data[i + 2]];
      sum += ((i / 4) % 997) * (r + 3 * g + 7 * b);
      if (Math.max(r, g, b) - Math.min(r, g, b) > 40) coloured += 1;
    }
    return { share: coloured / (data.length / 4), sum };
  }, index);
}
