// The logic of the page that needs no browser.

import assert from "node:assert/strict";
import { test } from "node:test";

import { breachSpans, isBroken } from "../src/board.ts";
import { column, pose, sparse, type Vehicle } from "../src/bundle.ts";
import { scale } from "../src/charts.ts";
import { limitsAlong, signsOf } from "../src/limits.ts";
import { MOST_BRANCHES, MOST_CHANGES, noChoice, parse, print, type Moment } from "../src/link.ts";

test("columns are sums of their differences", () => {
  assert.deepEqual(column([5, 1, -2]), [5, 6, 4]);
  assert.deepEqual(column([100, -90, 1, 0], 1, 2), [100, 110, 121, 132]);
  assert.deepEqual(sparse([null, 3, null, 2, -1], 2), [null, 6, null, 10, 8]);
});

const car: Vehicle = {
  slot: 1,
  symbol: "1",
  kind: 0,
  paint: "#ffffff",
  length: 4,
  width: 2,
  first: 10,
  last: 12,
  away: new Set([12]),
  s: [100, 102, 104],
  d: [0, 1, 2],
  angle: [0, 0, 0],
  speed: [20, 22, 24],
  accel: [1, 2, 3],
  lights: [0, 4, 0],
};

test("a vehicle is between two frames, and nowhere where it was not recorded", () => {
  assert.equal(pose(car, 9), null);
  assert.equal(pose(car, 12), null);
  assert.equal(pose(car, 13), null);
  assert.deepEqual(pose(car, 10.5), { s: 101, d: 0.5, angle: 0, speed: 21, accel: 1, lights: 0 });
  assert.equal(pose(car, 11)!.lights, 4);
});

test("the limit of a frame is that of the ego's place and direction", () => {
  const lower_limits = [
    { from_m: 0, to_m: 500, speed_limit_mps: 5, direction: -1 },
    { from_m: 100, to_m: 200, speed_limit_mps: 14, direction: 0 },
    { from_m: 200, to_m: 300, speed_limit_mps: 20, direction: 1 },
  ];
  const road = { lane_ids: [1], speed_limit_mps: 25, lower_limits };
  assert.deepEqual(limitsAlong(road, [99.9, 100, null, 199.9, 200, 300]), [25, 14, null, 14, 20, 25]);
  assert.deepEqual(limitsAlong({ lane_ids: [1], speed_limit_mps: 25 }, [5, null]), [25, null]);
  assert.deepEqual(signsOf(road), [{ at: 100, limit: 14 }, { at: 200, limit: 20 }, { at: 300, limit: 25 }]);
  assert.deepEqual(signsOf({ lane_ids: [1], speed_limit_mps: 25 }), []);
});

const choice = { ...noChoice(), classes: ["Success_I", "No_attempt"], rules: ["L3"], margin: { rule: "L8", least: -5, most: null }, sql: "SELECT 'a,b' & 1", order: "margin" as const, descending: true, first: 50 };
const moment: Moment = {
  sim: 3,
  t: 4.25,
  policy: "strict",
  against: "paper",
  cam: "all",
  stretch: 2,
  ghosts: false,
  theme: "dark",
  choice,
  branches: [[{ what: "ABORT", t: 6.35 }], [{ what: "HardRainNight", t: 0 }, { what: "STAY", t: 2.5 }]],
  beside: 42,
  fan: "belief",
};
const plain: Moment = { sim: 3, t: 4.25, policy: "paper", cam: "ego", stretch: 1, ghosts: true, theme: "system", choice: noChoice(), branches: [], beside: null, against: null, fan: null };

test("a link says the moment that was printed", () => {
  assert.deepEqual(parse(print(moment, "paper")), moment);
  assert.equal(print(plain, "paper"), "#sim=3&t=4.25");
  assert.equal(print({ ...plain, sim: null }, "paper"), "#");
  for (const t of [0, 0.05, 10, 100.1]) assert.equal(parse(print({ ...plain, t }, "paper")).t, t);
});

test("what a link cannot mean is left out", () => {
  const found = parse("#sim=x&t=-1&cam=moon&stretch=9&policy=%3Cb%3E&if=a%3Cb@1,ABORT@x~,STAY@-2&fan=moon&margin=L3:x:&from=-3&sort=moon&vs=1.5");
  assert.deepEqual(found, { policy: "<b>", ghosts: true, branches: [], choice: { ...noChoice(), margin: { rule: "L3", least: null, most: null } } });
  assert.deepEqual(parse("#if=STAY@1~x~ABORT@2,y").branches, [[{ what: "STAY", t: 1 }, { what: "ABORT", t: 2 }]]);
  assert.equal(parse(`#if=${Array(9).fill("STAY@1~STAY@2~STAY@3~STAY@4~STAY@5").join(",")}`).branches.flat().length, MOST_BRANCHES * MOST_CHANGES);
  assert.deepEqual(parse(""), { stretch: 1, ghosts: true, branches: [], choice: noChoice() });
});

test("a rule is broken where its margin is negative", () => {
  const one = { rule: "L12", margin: -1, breach: [1, 5] as [number, number], margins: [9, -1, 2, -1, -2, -1, 3], paragraph: "" };
  assert.deepEqual(breachSpans(one), [[1, 1], [3, 5]]);
  assert.equal(isBroken(one, 2), false);
  assert.equal(isBroken(one, 4), true);
  assert.deepEqual(breachSpans({ ...one, margins: null }), [[1, 5]]);
  assert.deepEqual(breachSpans({ ...one, breach: null }), []);
});

test("a scale has round ends that hold all values", () => {
  for (const [least, most] of [[-3.2, 4.9], [48, 119], [0, 0], [-100, 50], [0.1, 0.2]] as const) {
    const [low, high, ticks] = scale(least, most);
    assert.ok(low <= least && high >= most && low < high);
    assert.ok(ticks.length >= 2 && ticks.length <= 6 && ticks[0] === low && ticks.at(-1) === high);
  }
});
