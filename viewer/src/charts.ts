// Values over time as curves: speeds, gaps, lateral positions, accelerations.

import { beliefAbout, type SparseColumn, recordedFrame, type Run, symbolOf, type Values, type Vehicle } from "./bundle.ts";
import { h, svg, write } from "./dom.ts";
import { limitsAlong } from "./limits.ts";
import { plain } from "./numbers.ts";
import { type Needs, plot, type Row, row, xOf } from "./row.ts";

interface Line {
  name: string;
  kind: "ego" | "target" | "behind" | "limit" | "faint" | "belief" | "belief-target" | "branch";
  letter?: string; // Of a branch.
  values: SparseColumn;
  vehicles?: SparseColumn; // The slots of the vehicles that the values are about, where these change: a curve joins values of one vehicle.
  format?: (value: number) => string; // For the value at the cursor; a line without it is constant.
}

// From bottom to top, with the lines between and their words.
interface Axis {
  low: number;
  high: number;
  ticks: [number, string][];
}

// A quantity of a vehicle at one of its recorded frames.
type Quantity = (vehicle: Vehicle, k: number) => number;

const KMH = 3.6;
const CHART = 92;
const NEAR_GAP = 100; // [m]; in charts with far larger gaps the axis ends here, so that near gaps remain readable.
const MAX_SPREAD = 2; // The axis includes all gaps if none exceeds this multiple of NEAR_GAP.
const TICK_ROOM = 34; // Width of the texts of an axis [px].
const ARROW_ROOM = 52; // Width of an arrow with its value [px].
const LONG_TTC_S = 20; // A longer time to collision has no decimals.
const TIMES = [10, 5, 3, 2, 1, 0.5, 0.2, 0.1]; // [s]
const TICK = 13; // Between the words of an axis [px].

export function path(x: (frame: number) => number, values: SparseColumn, y: (value: number) => number, vehicles?: SparseColumn): string {
  let text = "";
  let isDown = false;
  values.forEach((value, frame) => {
    if (frame > 0 && vehicles && vehicles[frame] !== vehicles[frame - 1]) isDown = false;
    if (value !== null) {
      const point = `${x(frame).toFixed(1)} ${y(value).toFixed(1)}`;
      text += isDown ? `L${point}` : `M${point}L${point}`; // The second point makes a dot of a value that stands alone.
    }
    isDown = value !== null;
  });
  return text;
}

function vehicleSeries(run: Run, slot: number | null, quantity: Quantity): SparseColumn {
  const vehicle = run.vehicles.find((candidate) => candidate.slot === slot);
  return Array.from({ length: run.frames }, (_, frame) => {
    if (!vehicle || frame < vehicle.first || frame > vehicle.last || vehicle.away.has(frame)) return null;
    return quantity(vehicle, frame - vehicle.first);
  });
}

const station: Quantity = (vehicle, k) => vehicle.s[k]!;
const speedKmh: Quantity = (vehicle, k) => vehicle.speed[k]! * KMH;

// The gap between the bumpers of ego and target: negative once the target is behind, zero alongside.
function targetLead(run: Run): SparseColumn {
  const [ego, target] = [run.vehicles[0]!, run.vehicles.find((vehicle) => vehicle.slot === run.values.target)];
  if (!target) return Array.from({ length: run.frames }, () => null);
  const egoS = vehicleSeries(run, 0, station);
  const halfLengths = (ego.length + target.length) / 2;
  return vehicleSeries(run, target.slot, station).map((targetS, frame) => {
    if (targetS === null || egoS[frame] === null) return null;
    const distance = targetS - egoS[frame]!;
    return Math.sign(distance) * Math.max(Math.abs(distance) - halfLengths, 0);
  });
}

function withDigits(digits: number): (value: number) => string {
  return (value) => plain(value, digits);
}

export function chartRows(needs: Needs): Row[] {
  const { run, words } = needs;
  const target = run.values.target;
  const symbol = run.vehicles.find((vehicle) => vehicle.slot === target)?.symbol;
  // A line of this course, and one of each other course from where that one begins.
  const egoLines = (name: string, series: (run: Run) => SparseColumn, format: (value: number) => string, vehicles?: (run: Run) => SparseColumn): Line[] => [
    { name, kind: "ego", values: series(run), format, ...(vehicles && { vehicles: vehicles(run) }) },
    ...needs.overlays.map(({ letter, run: branch, frame: begin }): Line => ({
      ...{ name: `${name} in ${letter}`, kind: "branch", letter, format },
      values: series(branch).map((value, frame) => (frame < begin ? null : value)),
      ...(vehicles && { vehicles: vehicles(branch) }),
    })),
  ];
  const targetLine = (values: SparseColumn, digits: number): Line[] => (symbol ? [{ name: `target ${symbol}`, kind: "target", values, format: withDigits(digits) }] : []);
  const egoAndTarget = (quantity: Quantity, digits: number): Line[] => [
    ...targetLine(vehicleSeries(run, target, quantity), digits),
    ...egoLines("ego", (course) => vehicleSeries(course, 0, quantity), withDigits(digits)),
  ];
  const bystanders = run.vehicles
    .filter(({ slot }) => slot !== 0 && slot !== target)
    .map(({ slot }): Line => ({ name: "", kind: "faint", values: vehicleSeries(run, slot, speedKmh), format: withDigits(0) }));
  const timesToCollision: Line[] = [
    ...egoLines("next ahead", (course) => course.ttc.ahead, formatTtc, (course) => course.leader),
    { name: "next behind", kind: "behind", values: run.ttc.behind, vehicles: run.follower, format: formatTtc },
    constantLine(needs, `critical ${words.critical_ttc_s} s`, 1 / words.critical_ttc_s),
  ];
  const gaps: Line[] = [
    ...targetLine(targetLead(run), 1),
    ...egoLines("next ahead", (course) => course.gap, withDigits(1), (course) => course.leader),
    ...(run.every ? beliefLines(run, symbol) : []),
  ];
  return [
    chart(needs, "Speed", "km/h", [...bystanders, ...limitLines(needs), ...egoAndTarget(speedKmh, 0)]),
    chart(needs, "Gap", "m", gaps, gapAxis),
    chart(needs, "Time to collision", "s", timesToCollision, ttcAxis),
    chart(needs, "Lateral position", "m", egoAndTarget((vehicle, k) => vehicle.d[k]!, 2), (values) => laneAxis(run.road.borders, values)),
    chart(needs, "Acceleration", "m/s²", egoAndTarget((vehicle, k) => vehicle.accel[k]!, 1)),
  ];
}

function constantLine(needs: Needs, name: string, value: number): Line {
  return { name, kind: "limit", values: Array.from({ length: needs.frames }, () => value) };
}

function limitLines(needs: Needs): Line[] {
  const road: Values["road"] = needs.run.values.road;
  if (road.speed_limit_mps === null) return [];
  if (!road.lower_limits) return [constantLine(needs, "limit", road.speed_limit_mps * KMH)];
  const limits = limitsAlong(road, vehicleSeries(needs.run, 0, station));
  return [{ name: "limit", kind: "limit", values: limits.map((limit) => (limit === null ? null : limit * KMH)), format: withDigits(0) }];
}

// The believed gaps to the target and to the vehicle that is next ahead in each frame.
function beliefLines(run: Run, symbol: string | undefined): Line[] {
  const target = run.leader.map(() => run.values.target);
  return [
    ...(symbol ? [{ name: `${symbol} believed`, kind: "belief-target" as const, values: believedGaps(run, target), format: withDigits(1) }] : []),
    { name: "believed", kind: "belief", values: believedGaps(run, run.leader), vehicles: run.leader, format: withDigits(1) },
  ];
}

function formatTtc(inverse: number): string {
  if (inverse <= 0) return "never";
  return 1 / inverse > LONG_TTC_S ? `over ${LONG_TTC_S}` : plain(1 / inverse, 1);
}

// In the legend a belief follows the line of its vehicle; branches come last.
function inLegendOrder(lines: Line[]): Line[] {
  const rank = ["target", "belief-target", "ego", "behind", "belief", "limit", "branch"];
  return lines.toSorted((a, b) => rank.indexOf(a.kind) - rank.indexOf(b.kind));
}

function chart(needs: Needs, title: string, unit: string, lines: Line[], axis: (values: number[]) => Axis = linearAxis): Row {
  const values = lines.flatMap((line) => line.values.filter((value) => value !== null));
  const { low, high, ticks } = axis(values);
  const y = (value: number): number => CHART - 6 - ((Math.min(Math.max(value, low), high) - low) / (high - low)) * (CHART - 22);
  const grid = ticks.map(([tick, text]) => svg("line", { x1: 0, x2: needs.width, y1: y(tick), y2: y(tick), class: tick === 0 && text ? "grid zero" : "grid" }));
  const tickTexts = ticks.map(([tick, text]) => (text ? svg("text", { x: 3, y: y(tick) - 3, class: "tick-text" }, text) : null));
  const curves = lines.map((line) => svg("path", { d: path(xOf(needs), line.values, y, line.vehicles), class: `curve ${line.kind} ${line.letter ? `branch-${line.letter}` : ""}` }));
  const readings = inLegendOrder(lines.filter((line) => line.name && line.format)).map((line) => ({ line, reading: h("span", { class: "number" }), vehicle: h("span", {}) }));
  const key = ({ kind, letter, name }: Line, vehicle: Node | null, value: Node | null): HTMLElement =>
    h("span", { class: `key ${kind} ${letter ? `branch-${letter}` : ""}` }, h("i", {}), " ", ...(kind === "belief" ? [vehicle, name] : [`${name} `, vehicle]), " ", value);
  const legend = [...readings.map(({ line, reading, vehicle }) => key(line, vehicle, reading)), ...lines.filter((line) => line.name && !line.format).map((line) => key(line, null, null))];
  const empty = values.length ? null : svg("text", { x: 8, y: CHART / 2, class: "tick-text" }, "nothing to show");
  const label = h("div", { class: "label chart" }, h("b", {}, title, h("small", {}, ` ${unit}`)), ...legend);
  return row(label, plot(needs, CHART, ...(values.length ? grid : []), ...curves, ...(values.length ? tickTexts : []), ...edgeTexts(needs, lines, low, high), empty), "chart", (frame) => {
    const at = recordedFrame(frame);
    for (const { line, reading, vehicle } of readings) {
      const value = line.values[at] ?? null;
      const slot = line.vehicles?.[at] ?? null;
      write(reading, value === null ? "–" : line.format!(value));
      write(vehicle, slot === null ? "" : `${symbolOf(needs.run, slot)} `);
    }
  });
}

// Arrows where curves run along the edge of their chart, with the farthest value of each stretch. Beliefs have no arrows, as the
// curves of the true gaps have them.
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
export function beyondEdge(values: SparseColumn, low: number, high: number, isAbove: boolean): { frame: number; value: number }[] {
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
function believedGaps(run: Run, vehicles: SparseColumn): SparseColumn {
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
  const step = power * [1, 2, 5, 10].find((factor) => reach / (power * factor) <= 3)!;
  const low = Math.floor(least / step) * step;
  const high = Math.max(Math.ceil(most / step) * step, low + step);
  const ticks = Array.from({ length: Math.round((high - low) / step) + 1 }, (_, k) => low + k * step);
  return [low, high, ticks];
}

function linearAxis(values: number[]): Axis {
  const [low, high, ticks] = scale(...extent(values));
  return { low, high, ticks: ticks.map((tick) => [tick, String(tick)]) };
}

// The axis of gaps: up to NEAR_GAP if some gaps are near and others far larger, else all gaps.
export function gapAxis(gaps: number[]): Axis {
  const isNear = gaps.some((gap) => Math.abs(gap) <= NEAR_GAP);
  const isWide = gaps.some((gap) => Math.abs(gap) > MAX_SPREAD * NEAR_GAP);
  return linearAxis([0, ...(isNear && isWide ? gaps.map((gap) => Math.min(Math.max(gap, -NEAR_GAP), NEAR_GAP)) : gaps)]);
}

// The borders of the lanes, without words.
function laneAxis(borders: number[], values: number[]): Axis {
  const [least, most] = extent(values);
  return { low: Math.min(...borders, least) - 0.5, high: Math.max(...borders, most) + 0.5, ticks: borders.map((border) => [border, ""]) };
}

// Of inverse times: what is urgent lies at the top. The words are of times that lie apart enough.
function ttcAxis(values: number[]): Axis {
  const high = extent(values)[1] * 1.15;
  const ticks: [number, string][] = [[0, "never"]];
  for (const time of TIMES) {
    const place = 1 / time;
    if (((place - ticks.at(-1)![0]) / high) * (CHART - 22) >= TICK && place <= high) ticks.push([place, `${time} s`]);
  }
  return { low: 0, high, ticks };
}
