// The road from above, at one instant.

import type { BelievedNeighbour, Overlay, Pose, Run, Vehicle, Words } from "./bundle.ts";
import { believedNeighboursAt, pose } from "./bundle.ts";
import { signsOf } from "./limits.ts";
import { drawBeams, drawBranch, drawBelief, drawTags, drawVehicle, tell, tellVehicles, type View } from "./vehicles.ts";

const LEAST_METRES = 62; // Of road on a narrow screen.
const MOST_SCALE = 10.5; // [px/m]
const DOUBLE = 0.3; // Between the middles of two lines [m].
const MOST_ACROSS = 5; // By how much a road that is seen from far is stretched by itself,
const LEAST_ROAD = 48; // unless it is narrower than this then [px].
const LEAST_STRIPE = 4; // [px]
const LEAST_BAR = 30; // [px]
const SCALE_ROOM = 34; // Above the scale bar [px].
const LEAST_POSTS = 74; // Between two distances at the roadside [px].
const POST_TEXT = 44; // [px]
const SIGN = 11; // Radius of a sign [px].
const POST_ROOM = 27; // For distances between the road and a sign [px].
const CLEAR = 24 / 256; // What lies in fog stays a hint, as in films.
const OWN_LENGTH = 5; // Of road around the ego that no fog hides [m].
const GAP_TEXT = 56; // [px]
const GAP_ASIDE = 22; // For the name of the ego or of the target [px].
const BURST_LASTS = 0.9; // [s]

export interface Look {
  camera: "ego" | "target" | "all";
  stretch: number;
  zoom: number;
  ghosts: boolean;
  moving: boolean; // Whether rain falls and indicators blink.
}

export interface Size {
  width: number;
  height: number;
}

export function draw(canvas: HTMLCanvasElement, { width, height }: Size, run: Run, words: Words, frame: number, look: Look, overlays: Overlay[] = []): void {
  const ratio = window.devicePixelRatio || 1;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const c = canvas.getContext("2d")!;
  c.setTransform(ratio, 0, 0, ratio, 0, 0);
  const here = there(run, frame);
  const branches = overlays.filter((one) => frame >= one.frame).map((one) => ({ ...one, here: there(one.run, frame) }));
  // Where this course has ended, another one may go on.
  const shown = here.length ? here : (branches.find((one) => one.here.length)?.here ?? []);
  const view = viewOf(c, width, height, run, shown, frame, look);
  drawGround(view, run);
  for (const one of here) drawBeams(view, one.vehicle, one.at, words);
  for (const one of here) drawVehicle(view, one.vehicle, one.at, words, run.values.target);
  drawAir(view, run, here[0]?.at, frame, here[0]?.vehicle.length ?? OWN_LENGTH);
  for (const one of branches) drawBranch(view, one.letter, one.here, here, words);
  tellVehicles(view, here, words, run.values.target, false);
  drawGap(view, here, run.values.target);
  tellVehicles(view, here, words, run.values.target, true);
  if (look.ghosts) for (const belief of believedNeighboursAt(run, frame) ?? latestDecisions(run.ghosts, view.time)) drawBelief(view, belief, run, words);
  drawBurst(view, run, here[0]?.at, words);
  drawTags(view);
  drawScaleBar(view);
}

// The latest recorded belief about each vehicle.
function latestDecisions(beliefs: BelievedNeighbour[], time: number): BelievedNeighbour[] {
  const latest = new Map<number | null, BelievedNeighbour>();
  for (const belief of beliefs) if (belief.time_s <= time + 1e-9) latest.set(belief.vehicle, belief);
  return [...latest.values()];
}

function there(run: Run, frame: number): { vehicle: Vehicle; at: Pose }[] {
  return run.vehicles.flatMap((vehicle) => {
    const at = pose(vehicle, frame);
    return at ? [{ vehicle, at }] : [];
  });
}

// The least and the largest zoom, and by how much a step zooms.
export const ZOOM = { least: 0.4, most: 3, step: 1.25 };

function viewOf(
  c: CanvasRenderingContext2D,
  width: number,
  height: number,
  run: Run,
  here: { vehicle: Vehicle; at: Pose }[],
  frame: number,
  look: Look,
): View {
  const places = here.map((one) => one.at.s);
  const target = here.find((one) => one.vehicle.slot === run.values.target);
  const centre = (look.camera === "target" && target ? target : here[0])?.at.s ?? 0;
  const borders = everyBorder(run);
  const wide = Math.abs(borders[borders.length - 1]! - borders[0]!);
  const roomy = Math.min((height * 0.66) / Math.max(wide, 8), width / LEAST_METRES, MOST_SCALE) * look.zoom;
  const reach = Math.max(...places) - Math.min(...places) + 30;
  const scale = look.camera === "all" ? Math.min(width / reach, roomy) : roomy;
  const middle = look.camera === "all" ? (Math.max(...places) + Math.min(...places)) / 2 : centre;
  const anchor = look.camera === "all" ? 0.5 : 0.4;
  const lateral = (borders[0]! + borders[borders.length - 1]!) / 2;
  // From far, lanes would be a hair; the scale bar says how much they are stretched.
  const across = Math.max(scale * look.stretch, Math.min(Math.max(MOST_ACROSS * scale, LEAST_ROAD / wide), roomy));
  return {
    c,
    width,
    height,
    x: (s) => width * anchor + (s - middle) * scale,
    y: (d) => height * 0.5 - (d - lateral) * across,
    scale,
    across,
    time: frame * run.interval,
    night: run.values.weather?.night ?? false,
    moving: look.moving,
    tags: [],
  };
}

// Those of the other direction too.
function everyBorder({ road: { borders, side, oncoming } }: Run): number[] {
  return oncoming ? [...borders, borders.at(-1)! + side * oncoming.width] : borders;
}

function drawGround(view: View, run: Run): void {
  const { c, width, height, x, y, scale, across, night } = view;
  const { lines, side, verges, oncoming } = run.road;
  const borders = everyBorder(run);
  c.fillStyle = night ? "#1a211c" : "#a7b298";
  c.fillRect(0, 0, width, height);
  const wet = Math.max(run.values.weather?.rain_percent ?? 0, run.values.weather?.puddles_percent ?? 0) / 100;
  const first = Math.floor((0 - x(0)) / scale / 10) * 10;
  c.fillStyle = night ? "#1e261f" : "#a1ad92"; // Stripes of mown grass give a sense of motion.
  if (10 * scale >= LEAST_STRIPE) for (let s = first; x(s) < width; s += 20) c.fillRect(x(s), 0, 10 * scale, height);
  const edges = [
    borders[0]! - side * Math.max(verges[0]!, 0.4),
    borders[borders.length - 1]! + side * Math.max(oncoming ? 0 : verges[1]!, 0.4),
  ];
  const band = (from: number, to: number, colour: string): void => {
    c.fillStyle = colour;
    c.fillRect(0, Math.min(y(from), y(to)), width, Math.abs(y(to) - y(from)));
  };
  band(edges[0]!, edges[1]!, night ? "#23272c" : "#7b8086");
  band(borders[0]!, borders[borders.length - 1]!, night ? (wet > 0.3 ? "#2a3037" : "#2d3238") : wet > 0.3 ? "#5c646d" : "#6b7077");
  c.lineWidth = Math.max(0.15 * across, 1);
  c.strokeStyle = night ? "#b9bfc4" : "#f3f4f2";
  borders.forEach((d, k) => {
    const isEdge = k === 0 || k === borders.length - 1;
    const kind = oncoming && isEdge && k ? oncoming.edge : lines?.[k];
    if (oncoming?.marks && k === borders.length - 2) drawCentreLine(view, d, side, oncoming.marks);
    else drawLine(view, d, kind ?? "Broken", isEdge);
  });
  if (run.values.weather?.low_sun) drawSun(view);
  drawPosts(view, edges);
  if (run.values.road.speed_limit_mps !== null) drawSigns(view, run, edges);
}

// The line between the directions: which mark it has, changes along the road. Of two lines the
// first that is named is nearer to the ego's side.
function drawCentreLine(view: View, d: number, side: number, marks: [number | null, string][]): void {
  const { c, width, height, x } = view;
  marks.forEach(([begin, mark], k) => {
    const from = begin === null ? 0 : Math.max(x(begin), 0);
    const to = Math.min(x(marks[k + 1]?.[0] ?? Infinity), width);
    if (from >= to) return;
    const parts = mark.match(/Solid|Broken/g) ?? [mark];
    c.save();
    c.beginPath();
    c.rect(from, 0, to - from, height);
    c.clip();
    parts.forEach((part, place) => drawLine(view, d + side * (place - (parts.length - 1) / 2) * DOUBLE, part, false));
    c.restore();
  });
}

function drawLine({ c, width, x, y, scale }: View, d: number, kind: string, isEdge: boolean): void {
  if (kind === "NONE") return;
  c.save();
  if (!isEdge && !kind.startsWith("Solid")) {
    c.setLineDash([4 * scale, 8 * scale]);
    c.lineDashOffset = -(x(0) % (12 * scale));
  }
  c.beginPath();
  c.moveTo(0, y(d));
  c.lineTo(width, y(d));
  c.stroke();
  c.restore();
}

// Distances along the road, every 50 m or more.
function drawPosts({ c, width, height, x, y, scale, night, tags }: View, edges: number[]): void {
  c.font = "11px system-ui, sans-serif";
  c.textAlign = "center";
  const low = Math.max(y(edges[0]!), y(edges[1]!));
  const step = [50, 100, 200, 500].find((one) => one * scale >= LEAST_POSTS) ?? 1000;
  for (let s = Math.ceil((0 - x(0)) / scale / step) * step; x(s) < width; s += step) {
    c.fillStyle = night ? "#dfe4e8" : "#23291f";
    c.fillRect(x(s) - 1, low + 3, 2, 7);
    const isFree = low + SCALE_ROOM < height || x(s) > 40 + barOf(scale) * scale;
    if (low + 24 >= height || s < 0 || !isFree) continue;
    c.fillText(`${s} m`, x(s), low + 22);
    tags.push({ left: x(s) - POST_TEXT / 2, wide: POST_TEXT, y: low + 22, draw: () => undefined }); // Keeps names of vehicles off this text.
  }
}

// Where the limit changes, beside the slow lane, as drivers of that side see it.
function drawSigns({ c, width, x, y }: View, run: Run, edges: number[]): void {
  const beside = y(edges[0]!) + Math.sign(y(edges[0]!) - y(edges[1]!)) * (SIGN + POST_ROOM);
  c.save();
  c.font = "bold 10px system-ui, sans-serif";
  c.textAlign = "center";
  c.textBaseline = "middle";
  c.lineWidth = 3;
  for (const { at, limit } of signsOf(run.values.road)) {
    if (x(at) < -SIGN || x(at) > width + SIGN) continue;
    c.beginPath();
    c.arc(x(at), beside, SIGN, 0, 2 * Math.PI);
    c.fillStyle = "#ffffff";
    c.strokeStyle = "#b3261e";
    c.fill();
    c.stroke();
    c.fillStyle = "#14181c";
    c.fillText((limit * 3.6).toFixed(0), x(at), beside);
  }
  c.restore();
}

// Rain, what fog hides, and how far the ego sees a lit vehicle.
function drawAir(view: View, run: Run, ego: Pose | undefined, frame: number, length: number): void {
  const { c, width, height, x, time, moving, night } = view;
  const rain = (run.values.weather?.rain_percent ?? 0) / 100;
  if (rain > 0.05) drawRain(view, rain, moving ? time : 0);
  if (!ego) return;
  if (run.air.extinction) drawFog(view, run.air.extinction, ego.s, length / 2);
  const sight = run.sight?.[Math.floor(frame)];
  const end = Math.round(x(ego.s + length / 2 + (sight ?? Infinity))) + 0.5;
  if (!(end <= width)) return;
  c.strokeStyle = night ? "#dfe4e8" : "#23291f";
  c.setLineDash([2, 4]);
  c.lineWidth = 1.2;
  c.beginPath();
  c.moveTo(end, 0);
  c.lineTo(end, height);
  c.stroke();
  c.setLineDash([]);
}

// What a driver at the ego's place would see of each metre of the road (Koschmieder), ahead and behind.
function drawFog({ c, width, height, x, night }: View, extinction: number, own: number, half: number): void {
  const grey = night ? "44,52,61" : "195,201,205"; // As in films.
  const reach = -Math.log(CLEAR) / extinction; // From there on it is no thicker [m].
  for (const way of [1, -1]) {
    const [from, to] = [x(own + way * half), x(own + way * (half + reach))];
    const fog = c.createLinearGradient(from, 0, to, 0);
    for (let k = 0; k <= 8; k++) fog.addColorStop(k / 8, `rgba(${grey},${1 - Math.exp((-extinction * reach * k) / 8)})`);
    const [left, right] = [Math.min(from, to), Math.max(from, to)].map((one) => Math.min(Math.max(one, 0), width)) as [number, number];
    c.fillStyle = fog;
    c.fillRect(left, 0, right - left, height);
    c.fillStyle = `rgba(${grey},${1 - CLEAR})`; // Of one colour: much quicker than a gradient.
    if (way > 0) c.fillRect(right, 0, width - right, height);
    else c.fillRect(0, 0, left, height);
  }
}

// A low sun ahead.
function drawSun({ c, width, height }: View): void {
  const light = c.createRadialGradient(width, height / 2, 0, width, height / 2, width * 0.75);
  light.addColorStop(0, "#ffb04a58");
  light.addColorStop(1, "#ffb04a00");
  c.fillStyle = light;
  c.fillRect(0, 0, width, height);
}

function drawRain({ c, width, height, night }: View, strength: number, time: number): void {
  c.strokeStyle = night ? "#c9d6e23c" : "#eef4f866";
  c.lineWidth = 1;
  c.beginPath();
  const count = Math.round((strength * width * height) / 1000);
  for (let k = 0; k < count; k++) {
    // The R2 sequence spreads drops evenly (Roberts 2018), the same in every drawing.
    const across = (k * 0.7548776662 + time * (0.9 + (k % 7) * 0.05)) % 1;
    const down = (k * 0.569840291 + time * (1.6 + (k % 5) * 0.1)) % 1;
    const [left, top] = [(1 - across) * width, down * height];
    c.moveTo(left, top);
    c.lineTo(left - 3, top + 8);
  }
  c.stroke();
}

// The distance between the bumpers of ego and target.
function drawGap(view: View, here: { vehicle: Vehicle; at: Pose }[], target: number | null): void {
  const ego = here.find((one) => one.vehicle.slot === 0);
  const other = here.find((one) => one.vehicle.slot === target);
  if (!ego || !other) return;
  const way = other.at.s > ego.at.s ? 1 : -1;
  const from = ego.at.s + (way * ego.vehicle.length) / 2;
  const to = other.at.s - (way * other.vehicle.length) / 2;
  const gap = way * (to - from);
  const { c, x, y, night } = view;
  if (gap < 3 || x(from) < 0 || x(from) > view.width) return;
  const row = y(ego.at.d);
  c.strokeStyle = night ? "#ffffffb0" : "#14181db0";
  c.lineWidth = 1.2;
  c.beginPath();
  for (const end of [from, to]) {
    c.moveTo(x(end), row - 4);
    c.lineTo(x(end), row + 4);
  }
  c.moveTo(x(from), row);
  c.lineTo(x(to), row);
  c.stroke();
  // Between the two vehicles if there is room, else above or below both.
  const isRoomy = Math.abs(x(to) - x(from)) > GAP_TEXT;
  const aside = Math.max(ego.vehicle.width, other.vehicle.width) * view.across + GAP_ASIDE;
  const rows = isRoomy ? [row + 4] : [row - aside, row + aside];
  tell(view, (x(from) + x(to)) / 2, rows, [`${gap.toFixed(1)} m`], "#ffffff", "#20262ddd", true);
}

// A collision of the ego, for a moment.
function drawBurst({ c, x, y, scale, across, time }: View, run: Run, ego: Pose | undefined, words: Words): void {
  const met = run.values.events.find((one) => one.event === "collision");
  const age = met ? time - met.time_s : -1;
  if (!ego || age < -1e-9 || age > BURST_LASTS) return;
  const other = run.vehicles.find((one) => one.slot === run.values.collision_partner);
  const at = other && pose(other, time / run.interval);
  const [s, d] = at ? [(ego.s + at.s) / 2, (ego.d + at.d) / 2] : [ego.s, ego.d];
  c.save();
  c.globalAlpha = 1 - age / BURST_LASTS;
  c.translate(x(s), y(d));
  c.fillStyle = words.road.flash;
  c.strokeStyle = words.road.brake;
  c.lineWidth = 2.5;
  c.beginPath();
  for (let k = 0; k < 16; k++) {
    const reach = (k % 2 ? 1.4 : 3.2 + age * 2) * Math.sqrt(scale * across);
    c.lineTo(reach * Math.cos((k * Math.PI) / 8), reach * Math.sin((k * Math.PI) / 8));
  }
  c.closePath();
  c.fill();
  c.stroke();
  c.restore();
}

// How long the scale bar is [m].
function barOf(scale: number): number {
  return [20, 50, 100, 200, 500].find((one) => one * scale >= LEAST_BAR) ?? 1000;
}

function drawScaleBar({ c, height, scale, across, night }: View): void {
  const metres = barOf(scale);
  const ink = night ? "#eef1f4" : "#14181d";
  c.fillStyle = ink;
  c.fillRect(12, height - 10, metres * scale, 2);
  c.fillRect(12, height - 14, 1.5, 6);
  c.fillRect(12 + metres * scale - 1.5, height - 14, 1.5, 6);
  c.font = "11px system-ui, sans-serif";
  c.textAlign = "left";
  const stretch = across > scale ? `, across ×${Math.round(across / scale)}` : "";
  c.fillText(`${metres} m${stretch}`, 20 + metres * scale, height - 7);
}
