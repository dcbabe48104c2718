// Everything that lies on the axis of time: stages, events, law and charts, with one cursor.

import type { Gaps, LawRow, Overlay, Run, Words } from "./bundle.ts";
import { h, svg, write } from "./dom.ts";

export interface Board {
  element: HTMLElement;
  // Put the cursor and the values at it in place.
  update: (frame: number) => void;
}

export interface Needs {
  run: Run;
  words: Words;
  policy: string;
  width: number; // Of the plots [px].
  overlays: Overlay[]; // Other courses on the same clock.
  frames: number; // Of the longest course.
  seek: (frame: number) => void;
  tellRule: (rule: string) => void;
}

interface Row {
  element: HTMLElement;
  update: (frame: number) => void;
}

interface Line {
  name: string;
  kind: "ego" | "target" | "other" | "limit" | "faint" | "belief" | "branch";
  letter?: string; // Of a branch.
  values: Gaps;
  digits: number;
}

const KMH = 3.6;
const CHART = 92;
const STRIP = 30;
const MOST_GAP = 100; // [m]; what is farther is of no interest here.

export function board(needs: Needs): Board {
  const events = [{ letter: "", run: needs.run }, ...needs.overlays].map((one) => eventRow(needs, one.run, one.letter));
  const rows = [stageRow(needs), ...events, ...lawRows(needs), ...chartRows(needs), axisRow(needs)];
  const cursor = h("div", { class: "cursor" });
  const field = h("div", { class: "field", "aria-hidden": true }, cursor);
  const element = h("div", { class: "board" }, ...rows.map((row) => row.element), field);
  const { frames, seek } = needs;
  const seekTo = (event: PointerEvent): void => {
    const box = field.getBoundingClientRect();
    seek(((event.clientX - box.left) / box.width) * (frames - 1));
  };
  field.addEventListener("pointerdown", (event) => {
    field.setPointerCapture(event.pointerId);
    seekTo(event);
  });
  field.addEventListener("pointermove", (event) => {
    if (field.hasPointerCapture(event.pointerId)) seekTo(event);
  });
  return {
    element,
    update: (frame) => {
      cursor.style.transform = `translateX(${(frame / Math.max(frames - 1, 1)) * needs.width}px)`;
      for (const row of rows) row.update(frame);
    },
  };
}

function plot(needs: Needs, height: number, ...children: (Node | null)[]): SVGElement {
  return svg(
    "svg",
    { width: needs.width, height, viewBox: `0 0 ${needs.width} ${height}`, "aria-hidden": "true" },
    ...children,
  );
}

function xOf(needs: Needs): (frame: number) => number {
  return (frame) => (frame / Math.max(needs.frames - 1, 1)) * needs.width;
}

function row(label: Node, drawing: SVGElement, kind: string, update: Row["update"] = () => undefined): Row {
  return { element: h("div", { class: `row ${kind}` }, label, h("div", { class: "plot" }, drawing)), update };
}

function stageRow(needs: Needs): Row {
  const { run, words } = needs;
  const x = xOf(needs);
  const value = h("span", { class: "value" });
  const parts = run.values.stages.flatMap((one) => {
    const stage = words.stages[one.stage]!;
    const [from, to] = [x(one.from_s / run.interval), x(one.to_s / run.interval)];
    const fits = to - from > stage.title.length * 6.6 + 8;
    return [
      svg("rect", { x: from, y: 3, width: Math.max(to - from - 1, 1), height: STRIP - 6, rx: 3, fill: stage.colour }),
      fits ? svg("text", { x: (from + to) / 2, y: 19.5, fill: stage.ink, class: "inside" }, stage.title) : null,
    ];
  });
  const label = h("div", { class: "label" }, h("b", {}, "Stage"), value);
  return row(label, plot(needs, STRIP, ...parts), "strip", (frame) => {
    write(value, stageAt(run, words, frame) ?? "not recorded");
  });
}

export function stageAt(run: Run, words: Words, frame: number): string | null {
  const time = frame * run.interval + 1e-9;
  const found = run.values.stages.filter((one) => one.from_s <= time).pop();
  return found ? words.stages[found.stage]!.title : null;
}

function eventRow(needs: Needs, run: Run, letter: string): Row {
  const x = xOf(needs);
  let last = -Infinity;
  let level = 0;
  const marks = run.values.events.flatMap((one, k) => {
    const place = x(one.frame);
    level = place - last < 15 ? level + 1 : 0;
    last = place;
    const text = svg("text", { x: Math.min(Math.max(place, 6), needs.width - 6), y: 13 + (level % 2) * 13, class: "event" }, run.told.events[k]!.letter);
    text.append(svg("title", {}, run.told.events[k]!.sentence));
    return [svg("line", { x1: place, x2: place, y1: 27, y2: 34, class: "tick" }), text];
  });
  const value = h("span", { class: "value" });
  const label = h("div", { class: letter ? "label key branch" : "label" }, h("b", {}, letter ? `Events in ${letter}` : "Events"), value);
  return row(label, plot(needs, 34, ...marks), "strip", (frame) => {
    const k = run.values.events.findLastIndex((one) => one.frame <= frame + 1e-6);
    write(value, k < 0 ? "" : run.told.events[k]!.name);
  });
}

export function isCounted(needs: Pick<Needs, "run" | "words" | "policy">, rule: string): boolean {
  return needs.words.policies[needs.policy]!.required.includes(rule);
}

// Whether a rule is broken at a frame.
export function isBroken(one: LawRow, frame: number): boolean {
  const at = Math.floor(frame + 1e-6);
  if (!one.breach || at < one.breach[0] || at > one.breach[1]) return false;
  const margin = one.margins?.[at];
  return one.margins ? margin !== null && margin !== undefined && margin < 0 : true;
}

export function lawOrder(needs: Pick<Needs, "run" | "words" | "policy">): LawRow[] {
  const rank = (one: LawRow): number => (one.breach ? (isCounted(needs, one.rule) ? 0 : 1) : 2);
  return needs.run.law.toSorted((a, b) => rank(a) - rank(b));
}

function lawRows(needs: Needs): Row[] {
  return lawOrder(needs).map((one) => lawRow(needs, one));
}

function lawRow(needs: Needs, one: LawRow): Row {
  const { words } = needs;
  const rule = words.rules[one.rule]!;
  const counts = isCounted(needs, one.rule);
  const state = !one.breach ? "near" : counts ? "broken" : "aside";
  const mark = one.breach ? "✗" : "✓";
  const value = h("span", { class: "value" });
  const about = one.breach ? (counts ? "broken" : `broken, not counted by policy ${needs.policy}`) : "kept, near its limit";
  const label = h(
    "button",
    {
      type: "button",
      class: `label law ${state}`,
      "data-rule": one.rule,
      click: () => needs.tellRule(one.rule),
      focus: () => needs.tellRule(one.rule),
    },
    h("b", {}, h("span", { "aria-hidden": true }, `${mark} `), `${one.rule} ${rule.title}`),
    h("span", { class: "unseen" }, `, ${rule.law}: ${about} `),
    value,
  );
  const height = 40;
  const drawing = plot(needs, height, ...breachMarks(needs, one, height, state));
  return row(label, drawing, `strip law ${state}`, (frame) => {
    const margin = one.margins?.[Math.round(frame)];
    if (margin !== null && margin !== undefined) write(value, `${signed(margin, 1)} ${rule.unit}`);
    else write(value, one.margins || !isBroken(one, frame) ? "–" : `${signed(one.margin, 1)} ${rule.unit}`);
  });
}

function breachMarks(needs: Needs, one: LawRow, height: number, state: string): (SVGElement | null)[] {
  const x = xOf(needs);
  const line = one.margins && marginLine(needs, one.margins, height);
  if (!one.breach) return [line];
  const id = `hatch-${state}`;
  const hatch = svg(
    "pattern",
    { id, width: 6, height: 6, patternUnits: "userSpaceOnUse", patternTransform: "rotate(45)" },
    svg("rect", { width: 6, height: 6, class: "hatch-ground" }),
    svg("rect", { width: 2.2, height: 6, class: "hatch-line" }),
  );
  const spans = brokenSpans(one).map(([first, last]) => {
    const from = Math.min(x(first), needs.width - 4);
    const width = Math.max(x(last) - from, 4);
    return svg("rect", { x: from, y: 4, width, height: height - 8, rx: 3, class: "breach", fill: `url(#${id})` });
  });
  return [svg("defs", {}, hatch), ...spans, line];
}

// First and last frame of each stretch in which a rule is broken; from the first to the last frame
// of the breach, where no margin is known in between.
export function brokenSpans(one: LawRow): [number, number][] {
  if (!one.breach || !one.margins) return one.breach ? [one.breach] : [];
  const spans: [number, number][] = [];
  for (let frame = one.breach[0]; frame <= one.breach[1]; frame++) {
    if (!isBroken(one, frame)) continue;
    const last = spans.at(-1);
    if (last && last[1] === frame - 1) last[1] = frame;
    else spans.push([frame, frame]);
  }
  return spans;
}

// The margin over time around its limit, which is a line in the middle; beyond twice the breach, or
// far from the limit, it runs along the edge.
function marginLine(needs: Needs, margins: Gaps, height: number): SVGElement {
  const there = margins.filter((one) => one !== null);
  const reach = Math.max(-Math.min(...there, 0), Math.min(Math.max(...there, 0), 30), 0.5);
  const y = (one: number): number => height / 2 - (Math.min(Math.max(one / reach, -1), 1) * (height - 8)) / 2;
  return svg(
    "g",
    {},
    svg("line", { x1: 0, x2: needs.width, y1: height / 2, y2: height / 2, class: "limit" }),
    svg("path", { d: path(xOf(needs), margins, y), class: "margin" }),
  );
}

function path(x: (frame: number) => number, values: Gaps, y: (value: number) => number): string {
  let text = "";
  let isDown = false;
  values.forEach((one, frame) => {
    if (one !== null) text += `${isDown ? "L" : "M"}${x(frame).toFixed(1)} ${y(one).toFixed(1)}`;
    isDown = one !== null;
  });
  return text;
}

function along(run: Run, slot: number | null, of: (vehicle: Run["vehicles"][number], k: number) => number): Gaps {
  const vehicle = run.vehicles.find((one) => one.slot === slot);
  return Array.from({ length: run.frames }, (_, frame) => {
    if (!vehicle || frame < vehicle.first || frame > vehicle.last || vehicle.away.has(frame)) return null;
    return of(vehicle, frame - vehicle.first);
  });
}

// Between the bumpers of ego and target: positive while it is ahead, nothing alongside.
function lead(run: Run): Gaps {
  const [ego, target] = [run.vehicles[0]!, run.vehicles.find((one) => one.slot === run.values.target)];
  if (!target) return Array.from({ length: run.frames }, () => null);
  const own = along(run, 0, (one, k) => one.s[k]!);
  const reach = (ego.length + target.length) / 2;
  return along(run, target.slot, (one, k) => one.s[k]!).map((one, frame) => {
    if (one === null || own[frame] === null) return null;
    const apart = one - own[frame]!;
    return Math.sign(apart) * Math.max(Math.abs(apart) - reach, 0);
  });
}

function chartRows(needs: Needs): Row[] {
  const { run } = needs;
  const target = run.values.target;
  const symbol = run.vehicles.find((one) => one.slot === target)?.symbol;
  const both = (of: (vehicle: Run["vehicles"][number], k: number) => number, digits: number): Line[] => [
    ...(symbol ? [{ name: `target ${symbol}`, kind: "target" as const, values: along(run, target, of), digits }] : []),
    { name: "ego", kind: "ego" as const, values: along(run, 0, of), digits },
  ];
  // The ego of each other course.
  const others = (of: (vehicle: Run["vehicles"][number], k: number) => number, digits: number): Line[] =>
    needs.overlays.map((one) => ({ name: `ego in ${one.letter}`, kind: "branch", letter: one.letter, values: along(one.run, 0, of).map((value, k) => (k < one.frame ? null : value)), digits }));
  const limit = run.values.road.speed_limit_mps;
  const constant = (value: number): Gaps => Array.from({ length: needs.frames }, () => value);
  const limits: Line[] =
    limit === null ? [] : [{ name: "limit", kind: "limit", values: constant(limit * KMH), digits: 0 }];
  const bystanders: Line[] = run.vehicles
    .filter((one) => one.slot !== 0 && one.slot !== target)
    .map((one) => ({ name: "", kind: "faint", values: along(run, one.slot, (of, k) => of.speed[k]! * KMH), digits: 0 }));
  const gaps: Line[] = [
    ...(symbol ? [{ name: `target ${symbol}`, kind: "target" as const, values: lead(run), digits: 1 }] : []),
    { name: "next ahead", kind: "ego", values: run.gap, digits: 1 },
    ...(run.every ? [{ name: "as believed", kind: "belief" as const, values: Array.from({ length: run.frames }, (_, frame) => believedAt(run, frame)), digits: 1 }] : []),
    ...needs.overlays.map((one): Line => ({ name: `next ahead in ${one.letter}`, kind: "branch", letter: one.letter, values: one.run.gap.map((gap, k) => (k < one.frame ? null : gap)), digits: 1 })),
  ];
  const clipped = (line: Line): Line => ({ ...line, values: line.values.map((one) => (one !== null && Math.abs(one) > MOST_GAP ? null : one)) });
  return [
    chart(needs, "Speed", "km/h", [...bystanders, ...limits, ...both((one, k) => one.speed[k]! * KMH, 0), ...others((one, k) => one.speed[k]! * KMH, 0)]),
    chart(needs, "Gap", "m", gaps.map(clipped)),
    chart(needs, "Lateral position", "m", [...both((one, k) => one.d[k]!, 2), ...others((one, k) => one.d[k]!, 2)], run.road.borders),
    chart(needs, "Acceleration", "m/s²", [...both((one, k) => one.accel[k]!, 1), ...others((one, k) => one.accel[k]!, 1)]),
  ];
}

// The gap to the vehicle ahead as the driver believes it; null if it sees none.
export function believedAt(run: Run, frame: number): number | null {
  const role = run.every?.roles.find((one) => one.role === "lead");
  const gap = role?.gap_mm[Math.floor((Math.round(frame) * run.interval * 1000) / run.every!.interval_ms + 1e-6)];
  return gap == null ? null : gap / 1000;
}

// In the legend the ego comes first, other courses last.
function ranked(lines: Line[]): Line[] {
  const rank = ["ego", "target", "belief", "branch"];
  return lines.toSorted((a, b) => rank.indexOf(a.kind) - rank.indexOf(b.kind));
}

function chart(needs: Needs, title: string, unit: string, lines: Line[], rules?: number[]): Row {
  const values = lines.flatMap((line) => line.values.filter((one) => one !== null));
  const [low, high, ticks] = scale(Math.min(...values), Math.max(...values), rules);
  const y = (value: number): number => CHART - 6 - ((value - low) / (high - low)) * (CHART - 22);
  const grid = ticks.flatMap((tick) => [
    svg("line", { x1: 0, x2: needs.width, y1: y(tick), y2: y(tick), class: tick === 0 && !rules ? "grid zero" : "grid" }),
    rules ? null : svg("text", { x: 3, y: y(tick) - 3, class: "tick-text" }, String(tick)),
  ]);
  const curves = lines.map((line) => svg("path", { d: path(xOf(needs), line.values, y), class: `curve ${line.kind} ${line.letter ? `branch-${line.letter}` : ""}` }));
  const shown = lines.filter((line) => line.name && line.kind !== "limit");
  const readings = ranked(shown).map((line) => ({ line, value: h("span", { class: "number" }) }));
  const legend = readings.map(({ line, value }) =>
    h("span", { class: `key ${line.kind} ${line.letter ? `branch-${line.letter}` : ""}` }, h("i", {}), ` ${line.name} `, value),
  );
  const extra = lines.some((line) => line.kind === "limit") ? h("span", { class: "key limit" }, h("i", {}), " limit") : null;
  const empty = values.length ? null : svg("text", { x: 8, y: CHART / 2, class: "tick-text" }, "nothing to show");
  const label = h("div", { class: "label chart" }, h("b", {}, title, h("small", {}, ` ${unit}`)), ...legend, extra);
  return row(label, plot(needs, CHART, ...(values.length ? grid : []), ...curves, empty), "chart", (frame) => {
    for (const { line, value } of readings) {
      const now = line.values[Math.round(frame)];
      write(value, now === null || now === undefined ? "–" : plain(now, line.digits));
    }
  });
}

// Round ends that hold all values, and the places of the lines between.
export function scale(least: number, most: number, rules?: number[]): [number, number, number[]] {
  if (rules) return [Math.min(...rules, least) - 0.5, Math.max(...rules, most) + 0.5, rules];
  if (!Number.isFinite(least)) return [0, 1, []];
  const reach = Math.max(most - least, 1);
  const step = [1, 2, 5, 10, 20, 50, 100, 200, 500].find((one) => reach / one <= 3) ?? 1000;
  const low = Math.floor(least / step) * step;
  const high = Math.max(Math.ceil(most / step) * step, low + step);
  const ticks = Array.from({ length: Math.round((high - low) / step) + 1 }, (_, k) => low + k * step);
  return [low, high, ticks];
}

function axisRow(needs: Needs): Row {
  const seconds = (needs.frames - 1) * needs.run.interval;
  const step = [0.5, 1, 2, 5, 10, 20, 50].find((one) => (seconds / one) * 46 <= needs.width) ?? 100;
  const x = xOf(needs);
  const ticks: SVGElement[] = [];
  for (let t = 0; t <= seconds + 1e-6; t += step) {
    const place = x(t / needs.run.interval);
    const anchor = place < 10 ? "start" : place > needs.width - 10 ? "end" : "middle";
    ticks.push(svg("line", { x1: place, x2: place, y1: 0, y2: 5, class: "tick" }));
    ticks.push(svg("text", { x: place, y: 18, class: "tick-text", "text-anchor": anchor }, t ? `${t}` : "0 s"));
  }
  return row(h("div", { class: "label" }, h("small", {}, "time s")), plot(needs, 22, ...ticks), "axis");
}

// Without the sign of a zero.
function plain(value: number, digits: number): string {
  return (Number(value.toFixed(digits)) || 0).toFixed(digits).replace("-", "−");
}

export function signed(value: number, digits: number): string {
  return `${value < 0 ? "−" : "+"}${Math.abs(value).toFixed(digits)}`;
}
