// Values over time as curves: speeds, gaps, places across the road, accelerations.

import { believedAt, type Gaps, type Run } from "./bundle.ts";
import { h, svg, write } from "./dom.ts";
import { plain } from "./numbers.ts";
import { type Needs, plot, type Row, row, xOf } from "./row.ts";

interface Line {
  name: string;
  kind: "ego" | "target" | "other" | "limit" | "faint" | "belief" | "branch";
  letter?: string; // Of a branch.
  values: Gaps;
  digits: number;
}

const KMH = 3.6;
const CHART = 92;
const MOST_GAP = 100; // [m]; what is farther is of no interest here.

export function path(x: (frame: number) => number, values: Gaps, y: (value: number) => number): string {
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

export function chartRows(needs: Needs): Row[] {
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
