// What is drawn in the view, by its pixels.

import assert from "node:assert/strict";
import { test } from "node:test";
import { drawn, onlyLayers, spots, stage, until } from "./harness.mjs";

const TOUCHED = [0x1c, 0x7e, 0xd6];
let doubting;
const on = stage(async (server) => {
  // Some of its touches are false: what they say is at odds with the others.
  await server.explore("bottle", 12, ["--pad", "flat", "--false-contacts", "0.2", "--seed", "2"]);
  doubting = await server.newest();
});

test("touches are filled spots, and hollow ones where they are doubted", async () => {
  const { doubted_seqs } = doubting.stats;
  assert.ok(doubted_seqs.length >= 1, "the robot reported something false");
  await on.open(`#/session/${doubting.session_id}`);
  await until("the newest revision", async () => (await on.shown()) === Number(doubting.revision));
  await onlyLayers(on.page, "seen and touched");
  const found = await until("as many hollow spots as doubted touches", async () => {
    const found = await spots(on.page, TOUCHED);
    return found.filter(({ isFilled }) => !isFilled).length === doubted_seqs.length && found;
  });
  assert.ok(found.filter(({ isFilled }) => isFilled).length >= 3, JSON.stringify(found));
  // A doubt is said in words as well, with what can be done about it.
  await until("words", () => on.page.getByText(`The touch of event ${doubted_seqs[0]} contradicts the others`).isVisible());
});

test("green to red, or cividis, which has neither", async () => {
  await on.open(`#/session/${doubting.session_id}`);
  await until("a surface", async () => (await drawn(on.page)).share > 0.03);
  await onlyLayers(on.page, "surface");
  const leaning = async () => {
    const { red, green, blue } = await drawn(on.page);
    return { red: Math.round(red), green: Math.round(green), blue: Math.round(blue) };
  };
  const paper = await until("the paper's colours", async () => ((mean) => mean.blue < 0.5 * mean.green && mean)(await leaning()));
  await on.page.getByLabel("Colours").selectOption("cividis");
  const cividis = await until("cividis", async () => ((mean) => mean.blue > 0.55 * mean.green && mean)(await leaning()));
  assert.ok(cividis.blue > paper.blue + 20, `${JSON.stringify(cividis)} is bluer than ${JSON.stringify(paper)}`);
  // The choice is remembered, and the legend has numbers in the unit that is shown.
  await on.page.reload();
  await until("cividis again", async () => (await leaning()).blue > 0.55 * (await leaning()).green);
  await on.page.getByLabel("Coloured by").selectOption("std");
  await until("millimetres", async () => /0\.00 mm[\s\S]*\d\.\d\d mm/.test(await on.page.locator(".legend .ends").innerText()));
});

test("the view is as fine after it was turned as before, however slow drawing is", async () => {
  await on.open(`#/session/${doubting.session_id}`);
  await until("a surface", async () => (await drawn(on.page)).share > 0.03);
  const width = () => on.page.evaluate(() => document.querySelector(".view canvas").width);
  const [before, { hash }] = [await width(), await drawn(on.page)];
  const box = await on.page.locator(".view canvas").boundingBox();
  await on.page.mouse.move(box.x + 200, box.y + 300);
  await on.page.mouse.down();
  for (let step = 1; step <= 40; step++) await on.page.mouse.move(box.x + 200 + 5 * step, box.y + 300 + step);
  await on.page.mouse.up();
  await until("it is seen from elsewhere, and fine", async () => (await width()) === before && (await drawn(on.page)).hash !== hash);
});

test("the truth is a ghost that can be hidden, and what is hidden stays so at other revisions", async () => {
  const { session_id } = await on.server.ask("/v1/simulations", { object: "can", attempts: 3 });
  await on.open(`#/session/${session_id}`);
  await until("its last touch", async () => (await on.shown()) === 5);
  await until("the reference", async () => /error, mm/.test(await on.page.locator(".charts").innerText()));
  await onlyLayers(on.page, "reference");
  const ghost = await until("a ghost", async () => ((one) => one.share > 0.03 && one)(await drawn(on.page, 0.05)));
  assert.ok(ghost.blue > ghost.red, JSON.stringify(ghost));
  await onlyLayers(on.page);
  await until("nothing", async () => (await drawn(on.page, 0)).share === 0);
  await on.page.getByRole("slider", { name: "Revision" }).fill("3");
  await until("revision 3", async () => (await on.shown()) === 3);
  await until("still nothing", async () => (await drawn(on.page, 0)).share === 0);
  await onlyLayers(on.page, "seen and touched");
  await until("its first touch and what was seen", async () => (await spots(on.page, TOUCHED)).length >= 1);
});
