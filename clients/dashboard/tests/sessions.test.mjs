// The list of sessions, and what is sent to them from the page.

import assert from "node:assert/strict";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { test } from "node:test";
import { CAMERA_POSE, INTRINSICS, VIEWPOINT, cap, depthPng, pcd } from "./files.mjs";
import { drawn, stage, until } from "./harness.mjs";

const on = stage();

test("sessions are filtered by experiment and by label", async () => {
  const create = (session_id, experiment, labels) => on.server.ask("/v1/sessions", { session_id, frame_id: "base", experiment, labels });
  await create("one", "mugs", { method: "paper", gripper: "left" });
  await create("two", "mugs", { method: "palpate" });
  await create("three", "bowls", { method: "paper" });
  await on.open("");
  const listed = () => on.page.locator("tbody tr td:nth-child(2)").allInnerTexts();
  const are = async (...names) => (await listed()).sort().join() === names.sort().join();
  const filter = on.page.getByLabel("Filter");
  await until("all", () => are("one", "two", "three"));
  await filter.fill("experiment:mugs");
  await until("those of the experiment", () => are("one", "two"));
  await filter.fill("experiment:mugs method:paper");
  await until("the one of the experiment and the label", () => are("one"));
  await filter.fill("nothing of the kind");
  await until("it says that none is left", () => on.page.getByText("No session matches").isVisible());
  await filter.fill("");
  await on.page.getByRole("button", { name: "method: paper" }).first().click();
  await until("a click on a label filters by it", () => are("one", "three"));
  assert.equal(await filter.inputValue(), "method:paper");
  // What can be filtered by is offered while one writes.
  const offered = await on.page.locator("#filters option").evaluateAll((options) => options.map(({ value }) => value));
  assert.deepEqual(offered.filter((value) => /experiment:|gripper/.test(value)).sort(), ["experiment:bowls", "experiment:mugs", "gripper:left"]);
});

test("what a page notes in the address while it is left keeps nobody from the next one", async () => {
  for (const session_id of ["left", "next"]) await on.server.ask("/v1/sessions", { session_id, frame_id: "base" });
  await on.open("#/session/left");
  await until("the first session", () => on.page.getByRole("heading", { name: "left" }).isVisible());
  // The browser tells of the new address after this task only; until then the page of the old one is at work.
  await on.page.evaluate(() => {
    location.hash = "#/session/next";
    document.querySelector("input[type=range]").dispatchEvent(new Event("input"));
  });
  await until("the next session", () => on.page.getByRole("heading", { name: "next" }).isVisible());
});

test("a view is taken from a PCD file and from a 16-bit depth image", async () => {
  const folder = mkdtempSync(join(tmpdir(), "palpate-view-"));
  writeFileSync(join(folder, "cap.pcd"), pcd(cap()));
  writeFileSync(join(folder, "cap.png"), depthPng());
  const dialog = on.page.locator("dialog");
  const begin = async (session_id) => {
    await on.server.ask("/v1/sessions", { session_id, frame_id: "base" });
    await on.open(`#/session/${session_id}`);
    await until("it says what is missing", () => on.page.getByText("Nothing was seen yet").isVisible());
    await on.page.getByRole("button", { name: "Add view" }).click();
  };
  const taken = async (session_id) => {
    await until("a surface", async () => (await drawn(on.page)).share > 0.03);
    const { stats } = await on.server.ask(`/v1/sessions/${session_id}`);
    assert.ok(stats.visual_points > 100, `${stats.visual_points} points were seen`);
    const mesh = await on.server.ask(`/v1/sessions/${session_id}/mesh?format=json`);
    const tops = Math.max(...mesh.vertices.map(([, , z]) => z));
    assert.ok(Math.abs(tops - 0.14) < 0.003, `the ball's top is at ${tops} m`);
  };

  await begin("from-pcd");
  await dialog.getByLabel("File").setInputFiles(join(folder, "cap.pcd"));
  await dialog.getByLabel("Camera's place").fill(VIEWPOINT);
  await dialog.getByRole("button", { name: "Send" }).click();
  await taken("from-pcd");

  await begin("from-depth");
  await dialog.getByLabel("File").setInputFiles(join(folder, "cap.png"));
  await dialog.getByRole("button", { name: "Send" }).click();
  await until("what is missing is named", async () => /fx|intrinsics/.test(await dialog.locator(".error").innerText()));
  await dialog.getByLabel("fx fy cx cy").fill(INTRINSICS);
  await dialog.getByLabel("Camera's pose").fill(CAMERA_POSE);
  await dialog.getByRole("button", { name: "Send" }).click();
  await taken("from-depth");
  rmSync(folder, { recursive: true });
});
