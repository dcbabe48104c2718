// Values over time as curves: speeds, gaps, places across the road, accelerations.

import { beliefAbout, type Gaps, recordedFrame, type Run, symbolOf, type Values } from "./bundle.ts";
import { h, svg, write } from "./dom.ts";
import { limitsAlong } from "./limits.ts";
import { plain } from "./numbers.ts";
import { type Needs, plot, type Row, row, xOf } from "./row.ts";

interface Line {
  name: string;
  kind: "ego" | "target" | "behind" | "limit" | "faint" | "belief" | "belief-target" | "branch";
  letter?: string; // Of a branch.
  values: Gaps;
  vehicles?: Gaps; // The slots of the vehicles that the values are about, where these change: a curve joins values of one vehicle.
  told?: (value: number) => string; // Of what changes.
}

// From bottom to top, with the lines between and their words.
interface Axis {
  low: number;
  high: number;
  ticks: [number, string][];
}

const KMH = 3.6;
const CHART = 92;
const NEAR_GAP = 100; // [m]; where gaps differ by much, larger ones run along the edge, or the near ones could not be read.
const MAX_SPREAD = 2; // Up to this multiple of a near gap the axis holds all of them.
const TICK_ROOM = 34; // For the words of an axis [px].
const ARROW_ROOM = 52; // Between two texts at the edge [px].
const FAR = 20; // [s]; a collision that is farther is not told to a tenth.
const TIMES = [10, 5, 3, 2, 1, 0.5, 0.2, 0.1]; // [s]
const TICK = 13; // Between the words of an axis [px].

export function path(x: (frame: number) => number, values: Gaps, y: (value: number) => number, vehicles?: Gaps): string {
  let text = "";
  let isDown = false;
  values.forEach((one, frame) => {
    if (frame > 0 && vehicles && vehicles[frame] !== vehicles[frame - 1]) isDown = false;
    // A value alone between others is a dot.
    if (one !== null) text += `${isDown ? "L" : `M${x(frame).toFixed(1)} ${y(one).toFixed(1)}L`}${x(frame).toFixed(1)} ${y(one).toFixed(1)}`;
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
  const { run, words } = needs;
  const target = run.values.target;
  const symbol = run.vehicles.find((one) => one.slot === target)?.symbol;
  type Of = (vehicle: Run["vehicles"][number], k: number) => number;
  const to = (digits: number) => (value: number): string => plain(value, digits);
  const own = (name: string, of: (run: Run) => Gaps, told: (value: number) => string, about?: (run: Run) => Gaps): Line[] => [
    { name, kind: "ego", values: of(run), told, ...(about && { vehicles: about(run) }) },
    // From where the other courses begin.
    ...needs.overlays.map((one): Line => ({ name: `${name} in ${one.letter}`, kind: "branch", letter: one.letter, values: of(one.run).map((value, k) => (k < one.frame ? null : value)), told, ...(about && { vehicles: about(one.run) }) })),
  ];
  const both = (of: Of, digits: number): Line[] => [
    ...(symbol ? [{ name: `target ${symbol}`, kind: "target" as const, values: along(run, target, of), told: to(digits) }] : []),
    ...own("ego", (one) => along(one, 0, of), to(digits)),
  ];
  const constant = (name: string, value: number): Line => ({ name, kind: "limit", values: Array.from({ length: needs.frames }, () => value) });
  const limits = (road: Values["road"]): Line[] => {
    if (road.speed_limit_mps === null) return [];
    if (!road.lower_limits) return [constant("limit", road.speed_limit_mps * KMH)];
    const values = limitsAlong(road, along(run, 0, (one, k) => one.s[k]!));
    return [{ name: "limit", kind: "limit", values: values.map((one) => (one === null ? null : one * KMH)), told: to(0) }];
  };
  const bystanders = run.vehicles
    .filter((one) => one.slot !== 0 && one.slot !== target)
    .map((one): Line => ({ name: "", kind: "faint", values: along(run, one.slot, (of, k) => of.speed[k]! * KMH), told: to(0) }));
  const gaps: Line[] = [
    ...(symbol ? [{ name: `target ${symbol}`, kind: "target" as const, values: lead(run), told: to(1) }] : []),
    ...own("next ahead", (one) => one.gap, to(1), (one) => one.leader),
    ...(run.every && symbol ? [{ name: `${symbol} believed`, kind: "belief-target" as const, values: believedGaps(run, run.leader.map(() => target)), told: to(1) }] : []),
    ...(run.every ? [{ name: "believed", kind: "belief" as const, values: believedGaps(run, run.leader), vehicles: run.leader, told: to(1) }] : []),
  ];
  const urgent: Line[] = [
    ...own("next ahead", (one) => one.ttc.ahead, timeTo, (one) => one.leader),
    { name: "next behind", kind: "behind", values: run.ttc.behind, vehicles: run.follower, told: timeTo },
    constant(`critical ${words.critical_ttc_s} s`, 1 / words.critical_ttc_s),
  ];
  return [
    chart(needs, "Speed", "km/h", [...bystanders, ...limits(run.values.road), ...both((one, k) => one.speed[k]! * KMH, 0)]),
    chart(needs, "Gap", "m", gaps, gapAxis),
    chart(needs, "Time to collision", "s", urgent, urgency),
    chart(needs, "Lateral position", "m", both((one, k) => one.d[k]!, 2), (values) => across(run.road.borders, values)),
    chart(needs, "Acceleration", "m/s²", both((one, k) => one.accel[k]!, 1)),
  ];
}

// A time to collision, from its inverse.
function timeTo(inverse: number): string {
  if (inverse <= 0) return "never";
  return 1 / inverse > FAR ? `over ${FAR}` : plain(1 / inverse, 1);
}

// In the legend a belief follows what it is about; other courses come last.
function ranked(lines: Line[]): Line[] {
  const rank = ["target", "belief-target", "ego", "behind", "belief", "limit", "branch"];
  return lines.toSorted((a, b) => rank.indexOf(a.kind) - rank.indexOf(b.kind));
}

function chart(needs: Needs, title: string, unit: string, lines: Line[], axis: (values: number[]) => Axis = even): Row {
  const values = lines.flatMap((line) => line.values.filter((one) => one !== null));
  const { low, high, ticks } = axis(values);
  const y = (value: number): number => CHART - 6 - ((Math.min(Math.max(value, low), high) - low) / (high - low)) * (CHART - 22);
  const grid = ticks.flatMap(([tick, text]) => [
    svg("line", { x1: 0, x2: needs.width, y1: y(tick), y2: y(tick), class: tick === 0 && text ? "grid zero" : "grid" }),
    text ? svg("text", { x: 3, y: y(tick) - 3, class: "tick-text" }, text) : null,
  ]);
  const curves = lines.map((line) => svg("path", { d: path(xOf(needs), line.values, y, line.vehicles), class: `curve ${line.kind} ${line.letter ? `branch-${line.letter}` : ""}` }));
  const readings = ranked(lines.filter((line) => line.name && line.told)).map((line) => ({ line, value: h("span", { class: "number" }), vehicle: h("span", {}) }));
  const key = ({ kind, letter, name }: Line, vehicle: Node | null, value: Node | null): HTMLElement =>
    h("span", { class: `key ${kind} ${letter ? `branch-${letter}` : ""}` }, h("i", {}), " ", ...(kind === "belief" ? [vehicle, name] : [`${name} `, vehicle]), " ", value);
  const legend = [...readings.map(({ line, value, vehicle }) => key(line, vehicle, value)), ...lines.filter((line) => line.name && !line.told).map((line) => key(line, null, null))];
  const empty = values.length ? null : svg("text", { x: 8, y: CHART / 2, class: "tick-text" }, "nothing to show");
  const label = h("div", { class: "label chart" }, h("b", {}, title, h("small", {}, ` ${unit}`)), ...legend);
  return row(label, plot(needs, CHART, ...(values.length ? grid : []), ...curves, ...edgeTexts(needs, lines, low, high), empty), "chart", (frame) => {
    const at = recordedFrame(frame);
    for (const { line, value, vehicle } of readings) {
      const now = line.values[at] ?? null;
      const slot = line.vehicles?.[at] ?? null;
      write(value, now === null ? "–" : line.told!(now));
      write(vehicle, slot === null ? "" : `${symbolOf(needs.run, slot)} `);
    }
  });
}

// Arrows where curves run along the edge of their chart, with the farthest value of each stretch. Beliefs have none, as they
// repeat what they are about.
function edgeTexts(needs: Needs, lines: Line[], low: number, high: number): SVGElement[] {
  const x = xOf(needs);
  const texts: SVGElement[] = [];
  const curves = lines.filter(({ kind }) => kind !== "belief" && kind !== "belief-target");
  for (const isAbove of [true, false]) {
    let freeFrom = 0; // [px]
    for (const { frame, value } of curves.flatMap((line) => beyondEdge(line.values, low, high, isAbove)).toSorted((a, b) => a.frame - b.frame)) {
      const place = Math.min(Math.max(x(frame), TICK_ROOM), needs.width - ARROW_ROOM);
      if (place < freeFrom) continue;
      freeFrom = place + ARROW_ROOM;
      texts.push(svg("text", { x: place, y: isAbove ? 11 : CHART - 9, class: "tick-text edge" }, `${isAbove ? "▲" : "▼"} ${plain(value, 0)}`));
    }
  }
  return texts;
}

// The farthest value of each stretch that lies beyond one end of an axis.
export function beyondEdge(values: Gaps, low: number, high: number, isAbove: boolean): { frame: number; value: number }[] {
  const stretches: { frame: number; value: number; last: number }[] = [];
  values.forEach((value, frame) => {
    if (value === null || (isAbove ? value <= high : value >= low)) return;
    const stretch = stretches.at(-1);
    if (!stretch || stretch.last !== frame - 1) stretches.push({ frame, value, last: frame });
    else {
      stretch.last = frame;
      if (isAbove ? value > stretch.value : value < stretch.value) [stretch.frame, stretch.value] = [frame, value];
    }
  });
  return stretches.map(({ frame, value }) => ({ frame, value }));
}

// The believed gap to a vehicle at each frame, negative where the vehicle is behind.
function believedGaps(run: Run, vehicles: Gaps): Gaps {
  return vehicles.map((slot, frame) => {
    const belief = slot === null ? null : beliefAbout(run, slot, frame);
    if (!belief || belief.gap === null) return null;
    return belief.isBehind ? -belief.gap : belief.gap;
  });
}

function extent(values: number[]): [number, number] {
  return values.reduce(([least, most], value) => [Math.min(least, value), Math.max(most, value)], [Infinity, -Infinity] as [number, number]);
}

// Round ends that hold all values, and the places of the lines between.
export function scale(least: number, most: number): [number, number, number[]] {
  if (!Number.isFinite(least)) return [0, 1, []];
  const reach = Math.max(most - least, 1);
  const power = 10 ** Math.max(Math.floor(Math.log10(reach / 3)), 0);
  const step = power * [1, 2, 5, 10].find((one) => reach / (power * one) <= 3)!;
  const low = Math.floor(least / step) * step;
  const high = Math.max(Math.ceil(most / step) * step, low + step);
  const ticks = Array.from({ length: Math.round((high - low) / step) + 1 }, (_, k) => low + k * step);
  return [low, high, ticks];
}

function even(values: number[]): Axis {
  const [low, high, ticks] = scale(...extent(values));
  return { low, high, ticks: ticks.map((tick) => [tick, String(tick)]) };
}

// Holds the near gaps; all gaps, if none is near.
export function gapAxis(gaps: number[]): Axis {
  const isNear = gaps.some((gap) => Math.abs(gap) <= NEAR_GAP);
  const isWide = gaps.some((gap) => Math.abs(gap) > MAX_SPREAD * NEAR_GAP);
  return even([0, ...(isNear && isWide ? gaps.map((gap) => Math.min(Math.max(gap, -NEAR_GAP), NEAR_GAP)) : gaps)]);
}

// The borders of the lanes, without words.
function across(borders: number[], values: number[]): Axis {
  const [least, most] = extent(values);
  return { low: Math.min(...borders, least) - 0.5, high: Math.max(...borders, most) + 0.5, ticks: borders.map((one) => [one, ""]) };
}

// Of inverse times: what is urgent lies at the top. The words are of times that lie apart enough.
function urgency(values: number[]): Axis {
  const high = extent(values)[1] * 1.15;
  const ticks: [number, string][] = [[0, "never"]];
  for (const time of TIMES) {
    const place = 1 / time;
    if (((place - ticks.at(-1)![0]) / high) * (CHART - 22) >= TICK && place <= high) ticks.push([place, `${time} s`]);
  }
  return { low: 0, high, ticks };
}
