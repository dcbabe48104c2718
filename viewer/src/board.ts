// Everything that lies on the axis of time: stages, events, law and charts, with one cursor.

import type { SparseColumn, LawRow, Run, Words } from "./bundle.ts";
import { recordedFrame } from "./bundle.ts";
import { chartRows, path } from "./charts.ts";
import { h, svg, write } from "./dom.ts";
import { fanRow } from "./fan.ts";
import { formatMargin } from "./numbers.ts";
import { policyRow } from "./policies.ts";
import { type Needs, plot, type Row, row, xOf } from "./row.ts";

export interface Board {
  element: HTMLElement;
  // Put the cursor and the values at it in place.
  update: (frame: number) => void;
  // Seek what is pointed at.
  point: (event: PointerEvent) => void;
}

const STRIP = 30;

export function board(needs: Needs): Board {
  const events = [{ letter: "", run: needs.run }, ...needs.overlays].map((one) => eventRow(needs, one.run, one.letter));
  const policies = needs.against === null ? [] : [needs.policy, needs.against].map((one) => policyRow(needs, one));
  const futures = needs.fan ? [fanRow(needs, needs.fan)] : [];
  const rows = [stageRow(needs), ...events, ...futures, ...policies, ...lawRows(needs), ...chartRows(needs), axisRow(needs)];
  const cursor = h("div", { class: "cursor" });
  const field = h("div", { class: "field", "aria-hidden": true }, cursor);
  const element = h("div", { class: "board" }, ...rows.map((row) => row.element), field);
  const { frames, seek } = needs;
  return {
    element,
    point: (event) => {
      const box = field.getBoundingClientRect();
      seek(((event.clientX - box.left) / box.width) * (frames - 1));
    },
    update: (frame) => {
      cursor.style.transform = `translateX(${(frame / Math.max(frames - 1, 1)) * needs.width}px)`;
      for (const row of rows) row.update(frame);
    },
  };
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
    write(value, stageNameAt(run, words, frame) ?? "not recorded");
  });
}

export function stageNameAt(run: Run, words: Words, frame: number): string | null {
  const time = frame * run.interval + 1e-9;
  const stage = run.values.stages.findLast(({ from_s }) => from_s <= time);
  return stage ? words.stages[stage.stage]!.title : null;
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

// Whether a rule is broken at a frame. A rule without margins in every frame is broken from the first to the last frame of its breach.
export function isBroken({ breach, margins }: LawRow, frame: number): boolean {
  const at = recordedFrame(frame);
  if (!breach || at < breach[0] || at > breach[1]) return false;
  return !margins || (margins[at] ?? 0) < 0;
}

export function lawRowsInOrder(needs: Pick<Needs, "run" | "words" | "policy">): LawRow[] {
  const rank = (one: LawRow): number => (one.breach ? (isCounted(needs, one.rule) ? 0 : 1) : 2);
  return needs.run.law.toSorted((a, b) => rank(a) - rank(b));
}

function lawRows(needs: Needs): Row[] {
  return lawRowsInOrder(needs).map((one) => lawRow(needs, one));
}

function lawRow(needs: Needs, finding: LawRow): Row {
  const { words } = needs;
  const rule = words.rules[finding.rule]!;
  const counts = isCounted(needs, finding.rule);
  const state = !finding.breach ? "near" : counts ? "broken" : "aside";
  const mark = !finding.breach ? "✓" : counts ? "✗" : "(✗)";
  // The mark and `least` describe the whole simulation, `now` the frame at the cursor.
  const least = h("span", { class: "value least" }, `least ${formatMargin(finding.margin, rule.unit)}`);
  const atCursor = h("span", { class: "value now" });
  const description = finding.breach ? (counts ? "broken" : `broken, not counted by policy ${needs.policy}`) : "kept, near its limit";
  const label = h(
    "button",
    {
      type: "button",
      class: `label law ${state}`,
      "data-rule": finding.rule,
      click: () => needs.tellRule(finding.rule),
      focus: () => needs.tellRule(finding.rule),
    },
    h("b", {}, h("span", { "aria-hidden": true }, `${mark} `), `${finding.rule} ${rule.title}`),
    h("span", { class: "unseen" }, `, ${rule.law}: ${description} `),
    h("span", { class: "margins" }, least, atCursor),
  );
  const height = 40;
  const drawing = plot(needs, height, ...breachMarks(needs, finding, height, state));
  return row(label, drawing, `strip law ${state}`, (frame) => {
    const margin = finding.margins?.[recordedFrame(frame)] ?? null;
    write(atCursor, `now ${margin !== null ? formatMargin(margin, rule.unit) : isBroken(finding, frame) ? "broken" : "–"}`);
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
  const spans = breachSpans(one).map(([first, last]) => {
    const from = Math.min(x(first), needs.width - 4);
    const width = Math.max(x(last) - from, 4);
    return svg("rect", { x: from, y: 4, width, height: height - 8, rx: 3, class: "breach", fill: `url(#${id})` });
  });
  return [svg("defs", {}, hatch), ...spans, line];
}

// First and last frame of each stretch in which a rule is broken; from the first to the last frame
// of the breach, where no margin is known in between.
export function breachSpans(one: LawRow): [number, number][] {
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
function marginLine(needs: Needs, margins: SparseColumn, height: number): SVGElement {
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
