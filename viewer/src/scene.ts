// The road from above, at one instant.

import type { Ghost, Pose, Run, Vehicle, Words } from "./bundle.ts";
import { pose } from "./bundle.ts";

export const LIGHTS = { left: 1, right: 2, brake: 4, low: 8, high: 16, fog: 32 };
const GHOST_LASTS = 1.5; // [s]
const TWO_WHEELER_WIDTH = 1.2; // [m]
const LEAST_METRES = 62; // Of road on a narrow screen.
const MOST_SCALE = 10.5; // [px/m]
const SAME_LANE = 1.2; // [m]
const BURST_LASTS = 0.9; // [s]

export interface Look {
  camera: "ego" | "target" | "all";
  stretch: number;
  zoom: number;
  ghosts: boolean;
  moving: boolean; // Whether rain falls and indicators blink.
}

interface View {
  c: CanvasRenderingContext2D;
  width: number;
  height: number;
  x: (s: number) => number;
  y: (d: number) => number;
  scale: number; // Along the road [px/m].
  across: number; // Across it [px/m].
  time: number;
  night: boolean;
  moving: boolean;
}

export interface Size {
  width: number;
  height: number;
}

export function draw(canvas: HTMLCanvasElement, { width, height }: Size, run: Run, words: Words, frame: number, look: Look): void {
  const ratio = window.devicePixelRatio || 1;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const c = canvas.getContext("2d")!;
  c.setTransform(ratio, 0, 0, ratio, 0, 0);
  const here = run.vehicles.flatMap((vehicle) => {
    const at = pose(vehicle, frame);
    return at ? [{ vehicle, at }] : [];
  });
  const view = viewOf(c, width, height, run, here, frame, look);
  drawGround(view, run);
  for (const one of here) drawBeams(view, one.vehicle, one.at, words);
  for (const one of here) drawVehicle(view, one.vehicle, one.at, words, run.values.target);
  drawAir(view, run, here[0]?.at, frame, here[0]?.vehicle.length ?? 0);
  if (look.ghosts) for (const one of run.ghosts) drawGhost(view, one, words, here[0]?.at);
  drawGap(view, here, run.values.target);
  drawLabels(view, here, words, run.values.target);
  drawBurst(view, run, here[0]?.at, words);
  drawScaleBar(view);
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
  const { borders } = run.road;
  const wide = Math.abs(borders[borders.length - 1]! - borders[0]!);
  const roomy = Math.min((height * 0.66) / Math.max(wide, 8), width / LEAST_METRES, MOST_SCALE) * look.zoom;
  const reach = Math.max(...places) - Math.min(...places) + 30;
  const scale = look.camera === "all" ? Math.min(width / reach, roomy) : roomy;
  const middle = look.camera === "all" ? (Math.max(...places) + Math.min(...places)) / 2 : centre;
  const anchor = look.camera === "all" ? 0.5 : 0.4;
  const lateral = (borders[0]! + borders[borders.length - 1]!) / 2;
  const across = scale * look.stretch;
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
  };
}

function drawGround(view: View, run: Run): void {
  const { c, width, height, x, y, scale, across, night } = view;
  const { borders, lines, side, verges } = run.road;
  c.fillStyle = night ? "#1a211c" : "#a7b298";
  c.fillRect(0, 0, width, height);
  const wet = Math.max(run.values.weather?.rain_percent ?? 0, run.values.weather?.puddles_percent ?? 0) / 100;
  const first = Math.floor((0 - x(0)) / scale / 10) * 10;
  c.fillStyle = night ? "#1e261f" : "#a1ad92"; // Stripes of mown grass give a sense of motion.
  for (let s = first; x(s) < width; s += 20) c.fillRect(x(s), 0, 10 * scale, height);
  const edges = [
    borders[0]! - side * Math.max(verges[0]!, 0.4),
    borders[borders.length - 1]! + side * Math.max(verges[1]!, 0.4),
  ];
  const band = (from: number, to: number, colour: string): void => {
    c.fillStyle = colour;
    c.fillRect(0, Math.min(y(from), y(to)), width, Math.abs(y(to) - y(from)));
  };
  band(edges[0]!, edges[1]!, night ? "#23272c" : "#7b8086");
  band(borders[0]!, borders[borders.length - 1]!, night ? (wet > 0.3 ? "#2a3037" : "#2d3238") : wet > 0.3 ? "#5c646d" : "#6b7077");
  c.lineWidth = Math.max(0.15 * across, 1);
  c.strokeStyle = night ? "#b9bfc4" : "#f3f4f2";
  borders.forEach((d, k) => drawLine(view, d, lines?.[k] ?? "Broken", k === 0 || k === borders.length - 1));
  if (run.values.weather?.horizon_line) drawSun(view);
  drawPosts(view, edges);
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

// Distances along the road, every 50 m.
function drawPosts({ c, width, height, x, y, scale, night }: View, edges: number[]): void {
  c.font = "11px system-ui, sans-serif";
  c.textAlign = "center";
  const low = Math.max(y(edges[0]!), y(edges[1]!));
  for (let s = Math.ceil((0 - x(0)) / scale / 50) * 50; x(s) < width; s += 50) {
    c.fillStyle = night ? "#dfe4e8" : "#23291f";
    c.fillRect(x(s) - 1, low + 3, 2, 7);
    if (low + 24 < height && s >= 0) c.fillText(`${s} m`, x(s), low + 22);
  }
}

function inFrame(view: View, at: Pose, paint: () => void): void {
  const { c, x, y, scale, across } = view;
  c.save();
  c.translate(x(at.s), y(at.d));
  c.scale(scale, across);
  c.rotate(-at.angle);
  paint();
  c.restore();
}

// Light of the headlamps on the road at night.
function drawBeams(view: View, vehicle: Vehicle, at: Pose, words: Words): void {
  if (!view.night || !(at.lights & (LIGHTS.low | LIGHTS.high))) return;
  const { c } = view;
  inFrame(view, at, () => {
    const front = vehicle.length / 2;
    const reach = at.lights & LIGHTS.high ? 60 : 34;
    const glow = c.createLinearGradient(front, 0, front + reach, 0);
    glow.addColorStop(0, `${words.road.lamp}66`);
    glow.addColorStop(1, `${words.road.lamp}00`);
    c.fillStyle = glow;
    c.beginPath();
    c.moveTo(front, -vehicle.width * 0.4);
    c.lineTo(front + reach, -vehicle.width * 0.4 - reach * 0.09);
    c.lineTo(front + reach, vehicle.width * 0.4 + reach * 0.09);
    c.lineTo(front, vehicle.width * 0.4);
    c.fill();
  });
}

function drawVehicle(view: View, vehicle: Vehicle, at: Pose, words: Words, target: number | null): void {
  const { c } = view;
  const { length, width } = vehicle;
  inFrame(view, at, () => {
    const corner = Math.min(0.45, width * 0.25);
    c.fillStyle = view.night ? "#00000066" : "#00000038";
    rounded(c, -length / 2 - 0.12, -width / 2 + 0.1, length + 0.3, width + 0.2, corner);
    c.fill();
    c.fillStyle = vehicle.paint;
    rounded(c, -length / 2, -width / 2, length, width, corner);
    c.fill();
    drawRoof(c, vehicle, words);
    c.lineWidth = 0.08;
    c.strokeStyle = "#0000008c";
    rounded(c, -length / 2, -width / 2, length, width, corner);
    c.stroke();
    drawLamps(view, vehicle, at, words);
  });
  const mark = vehicle.slot === 0 ? words.road.ego : vehicle.slot === target ? words.road.target : null;
  if (mark) drawMark(view, vehicle, at, mark, vehicle.slot === 0);
}

// A frame around the ego, and a dashed one around the target.
function drawMark(view: View, vehicle: Vehicle, at: Pose, colour: string, isEgo: boolean): void {
  const { c, scale, across } = view;
  inFrame(view, at, () => {
    const [dx, dy] = [5 / scale, 5 / across];
    const { length, width } = vehicle;
    rounded(c, -length / 2 - dx, -width / 2 - dy, length + 2 * dx, width + 2 * dy, 0.5);
    c.setTransform(window.devicePixelRatio || 1, 0, 0, window.devicePixelRatio || 1, 0, 0);
    if (!isEgo) c.setLineDash([5, 3]);
    c.lineWidth = 4.5;
    c.strokeStyle = "#0d1116b0";
    c.stroke();
    c.lineWidth = 2.2;
    c.strokeStyle = colour;
    c.stroke();
  });
}

function drawRoof(c: CanvasRenderingContext2D, { length, width }: Vehicle, words: Words): void {
  if (width < TWO_WHEELER_WIDTH) {
    c.fillStyle = words.road.glass; // The rider.
    c.beginPath();
    c.arc(-0.05 * length, 0, width * 0.3, 0, 2 * Math.PI);
    c.fill();
    return;
  }
  c.fillStyle = words.road.glass;
  const cab = length > 7 ? length / 2 - 2.1 : length * 0.12;
  rounded(c, cab, -width * 0.4, Math.min(length * 0.14, 0.8), width * 0.8, 0.15);
  c.fill();
  if (length <= 7) {
    rounded(c, -length * 0.38, -width * 0.38, length * 0.1, width * 0.76, 0.12);
    c.fill();
  } else {
    c.fillStyle = "#00000030"; // Between cab and load.
    c.fillRect(cab - 0.5, -width / 2, 0.25, width);
  }
}

function drawLamps(view: View, { length, width }: Vehicle, at: Pose, words: Words): void {
  const { c, time, moving, night } = view;
  const rear = -length / 2;
  const half = Math.min(width / 2 - 0.12, 1.1);
  const lamp = (place: number, side: number, colour: string, size: number): void => {
    c.fillStyle = colour;
    c.fillRect(place - (place > 0 ? 0.28 : 0), side * half - size / 2, 0.28, size);
  };
  const glow = (place: number, side: number, colour: string, size: number): void => {
    const light = c.createRadialGradient(place, side * half, 0, place, side * half, size);
    light.addColorStop(0, colour);
    light.addColorStop(1, `${colour.slice(0, 7)}00`);
    c.fillStyle = light;
    c.beginPath();
    c.arc(place, side * half, size, 0, 2 * Math.PI);
    c.fill();
  };
  for (const side of [-1, 1]) {
    if (at.lights & (LIGHTS.low | LIGHTS.high)) lamp(length / 2, side, words.road.lamp, 0.4);
    if (at.lights & LIGHTS.brake) {
      lamp(rear, side, words.road.brake, 0.5);
      glow(rear, side, `${words.road.brake}cc`, 1.3);
    } else if (at.lights & LIGHTS.low || night) lamp(rear, side, words.road.tail, 0.4);
    const isOn = at.lights & (side < 0 ? LIGHTS.left : LIGHTS.right);
    if (isOn && (!moving || (time * 1.5) % 1 < 0.6)) {
      for (const place of [rear, length / 2]) {
        lamp(place, side, words.road.indicator, 0.5);
        glow(place, side, `${words.road.indicator}ee`, 1.1);
      }
    }
  }
}

function rounded(c: CanvasRenderingContext2D, x: number, y: number, w: number, h: number, r: number): void {
  c.beginPath();
  c.roundRect(x, y, w, h, r);
}

// Fog and rain, and how far the ego sees a lit vehicle.
function drawAir(view: View, run: Run, ego: Pose | undefined, frame: number, length: number): void {
  const { c, width, height, x, scale, time, moving, night } = view;
  const rain = (run.values.weather?.rain_percent ?? 0) / 100;
  if (rain > 0.05) drawRain(view, rain, moving ? time : 0);
  const sight = run.sight?.[Math.floor(frame)];
  if (!ego || sight === undefined) return;
  const front = x(ego.s + length / 2);
  const reach = sight * scale;
  if (reach > width * 1.5) return;
  const grey = night ? "30,36,42" : "214,219,222";
  // As thick ahead as behind, though the ego looks ahead.
  for (const way of [1, -1]) {
    const fog = c.createLinearGradient(front, 0, front + way * reach, 0);
    fog.addColorStop(0, `rgba(${grey},${night ? 0 : 0.08})`);
    fog.addColorStop(0.35, `rgba(${grey},0.3)`);
    fog.addColorStop(1, `rgba(${grey},0.9)`);
    c.fillStyle = fog;
    c.fillRect(way > 0 ? front : 0, 0, way > 0 ? width - front : front, height);
  }
  const end = Math.round(front + reach) + 0.5;
  if (end > width) return;
  c.strokeStyle = night ? "#dfe4e8" : "#23291f";
  c.setLineDash([2, 4]);
  c.lineWidth = 1.2;
  c.beginPath();
  c.moveTo(end, 0);
  c.lineTo(end, height);
  c.stroke();
  c.setLineDash([]);
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
    // The golden ratio and the square root of 2 spread drops evenly, the same in every drawing.
    const across = (k * 0.618034 + time * (0.9 + (k % 7) * 0.05)) % 1;
    const down = (k * 0.414214 + time * (1.6 + (k % 5) * 0.1)) % 1;
    const [left, top] = [(1 - across) * width, down * height];
    c.moveTo(left, top);
    c.lineTo(left - 3, top + 8);
  }
  c.stroke();
}

// Where somebody was believed to be at a decision, and for a while where it would be since.
function drawGhost(view: View, ghost: Ghost, words: Words, own: Pose | undefined): void {
  const { c, x, y, scale, across, time } = view;
  const age = time - ghost.time_s;
  if (age < -1e-9 || age > GHOST_LASTS) return;
  const middle = x(ghost.s_m + ghost.speed_mps * age);
  const [w, h] = [ghost.length_m * scale, ghost.width_m * across];
  c.save();
  c.globalAlpha = 1 - 0.6 * (age / GHOST_LASTS);
  rounded(c, middle - w / 2, y(ghost.d_m) - h / 2, w, h, 4);
  if (!ghost.seen) hatch(c, middle, y(ghost.d_m), w, h);
  rounded(c, middle - w / 2, y(ghost.d_m) - h / 2, w, h, 4);
  c.lineWidth = 4;
  c.strokeStyle = "#0d1116a0";
  c.stroke();
  c.setLineDash([4, 3]);
  c.lineWidth = 2;
  c.strokeStyle = "#ffffff";
  c.stroke();
  c.setLineDash([]);
  const text = ghost.gap_m === null ? "not seen" : `believed ${ghost.gap_m.toFixed(0)} m`;
  const truth = ghost.true_gap_m === null ? ", nobody there" : `, true ${ghost.true_gap_m.toFixed(0)} m`;
  // On the other side than the name of the vehicle.
  const side = own && ghost.d_m < own.d - SAME_LANE ? -h / 2 - 9 : h / 2 + 18;
  tag(view, middle, y(ghost.d_m) + side, text + truth, "#ffffff", words.road.glass);
  c.restore();
}

function hatch(c: CanvasRenderingContext2D, x: number, y: number, w: number, h: number): void {
  c.save();
  c.clip();
  c.strokeStyle = "#ffffffb0";
  c.lineWidth = 1.5;
  c.beginPath();
  for (let k = -h; k < w; k += 6) {
    c.moveTo(x - w / 2 + k, y + h / 2);
    c.lineTo(x - w / 2 + k + h, y - h / 2);
  }
  c.stroke();
  c.restore();
}

function tag({ c, width }: View, x: number, y: number, text: string, ink: string, ground: string): void {
  c.font = "600 11px system-ui, sans-serif";
  const wide = c.measureText(text).width + 10;
  const left = Math.min(Math.max(x - wide / 2, 2), width - wide - 2);
  c.fillStyle = ground;
  rounded(c, left, y - 12, wide, 16, 4);
  c.fill();
  c.fillStyle = ink;
  c.textAlign = "center";
  c.fillText(text, left + wide / 2, y);
}

// Who is who, and how fast, above each vehicle.
function drawLabels(view: View, here: { vehicle: Vehicle; at: Pose }[], words: Words, target: number | null): void {
  const { x, y, across, width } = view;
  const own = here.find((one) => one.vehicle.slot === 0)?.at;
  for (const { vehicle, at } of here.toReversed()) {
    const place = x(at.s);
    const [isEgo, isTarget] = [vehicle.slot === 0, vehicle.slot === target];
    const ground = isEgo ? words.road.ego : isTarget ? words.road.target : "#20262ddd";
    const name = isEgo ? "E" : isTarget ? `${vehicle.symbol} target` : vehicle.symbol;
    const ink = isEgo || isTarget ? "#14181d" : "#ffffff";
    const isIn = place > -20 && place < width + 20;
    if (!isIn && !isTarget) continue;
    const arrow = isIn ? "" : place > 0 ? " ▸" : " ◂";
    const text = `${name} ${Math.round(at.speed * 3.6)} km/h${arrow}`;
    // Below those on the ego's right, so that names of neighbours do not lie on each other.
    const isBelow = own !== undefined && at.d < own.d - SAME_LANE;
    const away = (vehicle.width / 2) * across + 10;
    tag(view, place, y(at.d) + (isBelow ? away + 10 : -away), text, ink, ground);
  }
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
  tag(view, (x(from) + x(to)) / 2, row + 4, `${gap.toFixed(1)} m`, "#ffffff", "#20262ddd");
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

function drawScaleBar({ c, height, scale, across, night }: View): void {
  const ink = night ? "#eef1f4" : "#14181d";
  c.fillStyle = ink;
  c.fillRect(12, height - 10, 20 * scale, 2);
  c.fillRect(12, height - 14, 1.5, 6);
  c.fillRect(12 + 20 * scale - 1.5, height - 14, 1.5, 6);
  c.font = "11px system-ui, sans-serif";
  c.textAlign = "left";
  const stretch = across > scale ? `, across ×${Math.round(across / scale)}` : "";
  c.fillText(`20 m${stretch}`, 20 + 20 * scale, height - 7);
}
