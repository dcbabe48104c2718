// The logic of the page that needs no browser.

import assert from "node:assert/strict";
import { test } from "node:test";

import { breachSpans, isBroken } from "../src/board.ts";
import { beliefAbout, column, type BelievedNeighbour, believedNeighboursAt, pose, type Row, type Run, sparse, type Vehicle, type Words } from "../src/bundle.ts";
import { beyondEdge, gapAxis, path, scale } from "../src/charts.ts";
import { limitsAlong, signsOf } from "../src/limits.ts";
import { MOST_BRANCHES, MOST_CHANGES, noChoice, parse, print, type Moment } from "../src/link.ts";
import { formatMargin } from "../src/numbers.ts";
import { cells } from "../src/report.ts";
import { mostInformative } from "../src/source.ts";
import { describeLaw, type Reader } from "../src/text.ts";
import { beliefLabels } from "../src/vehicles.ts";

test("columns are sums of their differences", () => {
  assert.deepEqual(column([5, 1, -2]), [5, 6, 4]);
  assert.deepEqual(column([100, -90, 1, 0], 1, 2), [100, 110, 121, 132]);
  assert.deepEqual(sparse([null, 3, null, 2, -1], 2), [null, 6, null, 10, 8]);
});

test("a finding of an import report names its vehicle and time, or the whole file", () => {
  const gap = { recording: "a.csv", check: "gaps", vehicle: "12 (2)", first_time_s: 8.1, rows: 3, consequence: "corrected", detail: "interpolated" };
  assert.deepEqual(cells(gap), ["a.csv", "gaps", "12 (2)", "8.1 s", "3", "corrected", "interpolated"]);
  assert.deepEqual(cells({ ...gap, vehicle: null, first_time_s: null }).slice(2, 4), ["whole file", "–"]);
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
  branches: [[{ what: "CANCEL", t: 6.35 }], [{ what: "HardRainNight", t: 0 }, { what: "STAY", t: 2.5 }]],
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
  const found = parse("#sim=x&t=-1&cam=moon&stretch=9&policy=%3Cb%3E&if=a%3Cb@1,CANCEL@x~,STAY@-2&fan=moon&margin=L3:x:&from=-3&sort=moon&vs=1.5");
  assert.deepEqual(found, { policy: "<b>", ghosts: true, branches: [], choice: { ...noChoice(), margin: { rule: "L3", least: null, most: null } } });
  assert.deepEqual(parse("#if=STAY@1~x~CANCEL@2,y").branches, [[{ what: "STAY", t: 1 }, { what: "CANCEL", t: 2 }]]);
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

// Vehicle 1 is the driver's leader until the second decision, then vehicle 2, which drives in the lane that is entered.
const changingLanes = {
  interval: 0.05,
  frames: 4,
  vehicles: [{ slot: 0, symbol: "E" }, { slot: 1, symbol: "1" }, { slot: 2, symbol: "2" }],
  every: {
    interval_ms: 50,
    roles: [
      { role: "leader", slot: [1, 1, 2, 2], seen: [1, 1, 1, 0], s_mm: [0, 0, 0, 0], d_mm: [0, 0, 0, 0], gap_mm: [20000, 19000, 80000, null], true_gap_mm: [21000, 20000, 85000, 84000], length_mm: [4000, 4000, 4000, 4000], width_mm: [2000, 2000, 2000, 2000] },
      { role: "right_leader", slot: [null, null, 1, 1], seen: [0, 0, 1, 2], s_mm: [null, null, 0, 0], d_mm: [null, null, 0, 0], gap_mm: [null, null, 18000, 17000], true_gap_mm: [null, null, 19000, 18000], length_mm: [null, null, 4000, 4000], width_mm: [null, null, 2000, 2000] },
      { role: "follower", slot: [null, null, null, 1], seen: [0, 0, 0, 0], s_mm: [null, null, null, 0], d_mm: [null, null, null, 0], gap_mm: [null, null, null, null], true_gap_mm: [null, null, null, 3000], length_mm: [null, null, null, 4000], width_mm: [null, null, null, 2000] },
    ],
  },
} as unknown as Run;

test("a belief is found by the vehicle that it is about, not by its role", () => {
  assert.deepEqual([0, 1, 2, 2.9].map((frame) => beliefAbout(changingLanes, 1, frame)?.gap), [20, 19, 18, 18]);
  assert.deepEqual(beliefAbout(changingLanes, 2, 2), { gap: 80, trueGap: 85, isBehind: false });
  assert.equal(beliefAbout(changingLanes, 2, 1), null);
  assert.deepEqual(beliefAbout(changingLanes, 2, 3), { gap: null, trueGap: 84, isBehind: false });
  assert.equal(beliefAbout(changingLanes, 1, 3)!.gap, 17); // Seen in one of two roles.
  assert.equal(beliefAbout({ ...changingLanes, every: null }, 1, 0), null);
  assert.deepEqual(believedNeighboursAt(changingLanes, 2)!.map((ghost) => [ghost.vehicle, ghost.gap_m]), [[2, 80], [1, 18]]);
});

test("a belief on the road names its vehicle", () => {
  const ghost = { time_s: 1.4, decision: "", vehicle: 2, gap_m: 23, true_gap_m: 24.4 } as BelievedNeighbour;
  assert.deepEqual(beliefLabels(ghost, changingLanes), ["2 believed 23 m, true 24 m", "2 believed 23 m"]);
  assert.deepEqual(beliefLabels({ ...ghost, gap_m: null, decision: "PULL_OUT" }, changingLanes), ["2 not seen, true 24 m at 1.40 s", "2 not seen"]);
  assert.equal(beliefLabels({ ...ghost, vehicle: null, true_gap_m: null }, changingLanes)[0], "believed 23 m, no vehicle there");
});

test("a curve does not join values of two vehicles", () => {
  const joined = path((frame) => frame, [1, 2, 3, 4], (value) => value, [1, 1, 2, 2]);
  assert.equal(joined, "M0.0 1.0L0.0 1.0L1.0 2.0M2.0 3.0L2.0 3.0L3.0 4.0");
});

test("an axis of gaps holds all of them, or says how far they go beyond it", () => {
  for (const gaps of [[150, 400], [5000, 20000], [12, 180], [-3, 40]]) {
    const { low, high } = gapAxis(gaps);
    assert.ok(low <= Math.min(0, ...gaps) && high >= Math.max(...gaps));
  }
  const { low, high } = gapAxis([-300, 20, 400]);
  assert.deepEqual([low, high], [-100, 100]);
  assert.deepEqual(beyondEdge([50, 120, 400, null, 130, 90, 101], low, high, true), [{ frame: 2, value: 400 }, { frame: 4, value: 130 }, { frame: 6, value: 101 }]);
  assert.deepEqual(beyondEdge([-50, -120, -300], low, high, false), [{ frame: 2, value: -300 }]);
});

test("the sign of a margin is written, however small it is", () => {
  assert.equal(formatMargin(-24.969, "m"), "−24.97 m");
  assert.equal(formatMargin(0, "s"), "+0.00 s");
  assert.equal(formatMargin(-0.32, "1"), "−0.32");
  assert.equal(formatMargin(-0.0004, "m"), "−0.0004 m");
  assert.equal(formatMargin(0.004, "m/s"), "+0.004 m/s");
});

test("the law at a frame and that of the whole simulation are told apart", () => {
  const words = { policies: { paper: { required: ["L3", "L12"] } }, rules: { L3: { title: "Safe distance", unit: "m" }, L12: { title: "Speed limit", unit: "m/s" }, L18: { title: "Indicate", unit: "s" } } };
  const law = [
    { rule: "L3", margin: -8, breach: [20, 60], margins: null, paragraph: "" },
    { rule: "L12", margin: -2, breach: [70, 79], margins: null, paragraph: "" },
    { rule: "L18", margin: -0.5, breach: [10, 12], margins: null, paragraph: "" },
  ];
  const run = (rows: unknown[], undecidable: string[] = []): Reader => ({ run: { law: rows, interval: 0.05, values: { policies: { paper: { undecidable } } } }, words, policy: "paper" }) as unknown as Reader;
  assert.equal(describeLaw(run(law), 61), "No rule is broken at this moment. Broken before: L3 until 3.00 s, L18 until 0.60 s (not counted by paper). Broken later: L12 from 3.50 s.");
  assert.equal(describeLaw(run([{ ...law[0], breach: [8, 8] }]), 9).split(". ")[1], "Broken before: L3 at 0.40 s.");
  assert.equal(describeLaw(run(law), 60).split(". ")[0], "Broken now: L3 Safe distance −8.00 m");
  assert.equal(describeLaw(run([{ ...law[0], breach: null }]), 5), "No rule is broken in this simulation.");
  assert.equal(describeLaw(run([], ["L3"]), 5), "No rule is known to be broken; undecidable: L3.");
});

test("a page opens on an attempt that is recorded to its end, or on what is nearest to that", () => {
  const row = (number: number, name: string, duration_s: number): Row => ({ number, classes: { paper: name }, duration_s }) as unknown as Row;
  const first = (...rows: Row[]): number => mostInformative(rows, "paper", { min_duration_s: 2 } as Words).number;
  assert.equal(first(row(0, "Success_L", 0.1), row(1, "No_attempt", 20), row(2, "censored", 20), row(3, "Success_L", 20)), 3);
  assert.equal(first(row(0, "Success_L", 0.1), row(1, "No_attempt", 20), row(2, "censored", 20)), 2);
  assert.equal(first(row(0, "No_attempt", 0.1), row(1, "No_attempt", 20)), 1);
  assert.equal(first(row(0, "No_attempt", 0.1), row(1, "No_attempt", 0.3)), 1);
});

test("a scale has round ends that hold all values", () => {
  for (const [least, most] of [[-3.2, 4.9], [48, 119], [0, 0], [-100, 50], [0.1, 0.2]] as const) {
    const [low, high, ticks] = scale(least, most);
    assert.ok(low <= least && high >= most && low < high);
    assert.ok(ticks.length >= 2 && ticks.length <= 6 && ticks[0] === low && ticks.at(-1) === high);
  }
});
