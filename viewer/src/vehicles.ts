// Vehicles from above: bodies, lamps, marks, names, and where they were believed to be.

import type { BelievedNeighbour, Pose, Run, Vehicle, Words } from "./bundle.ts";
import { isOncoming, pose } from "./bundle.ts";
import { plain } from "./numbers.ts";

const LIGHTS = { left: 1, right: 2, brake: 4, low: 8, high: 16, fog: 32 };
const GHOST_LASTS = 1.5; // [s]
const TWO_WHEELER_WIDTH = 1.2; // [m]
const SAME_LANE = 1.2; // [m]
const SMALL = 4; // [px/m]; below it bodies are drawn without what is smaller than a pixel.
const LEAST_BODY = 4; // Its length then [px].
const ALONG = 0.15; // The sine of the angle to the road at which a small body is drawn as turned.
const SAME_PLACE = 0.3; // [m]; what is nearer is not drawn twice.

export interface Placed {
  vehicle: Vehicle;
  at: Pose;
}

export interface View {
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
  tags: Tag[];
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
export function drawBeams(view: View, vehicle: Vehicle, at: Pose, words: Words): void {
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

export function drawVehicle(view: View, vehicle: Vehicle, at: Pose, words: Words, target: number | null): void {
  const { c, scale } = view;
  const { length, width } = vehicle;
  if (scale < SMALL) drawSmall(view, vehicle, at, words);
  else inFrame(view, at, () => {
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

// From far: a body of at least some pixels, its brake lamps and indicators.
function drawSmall(view: View, { length, width, paint }: Vehicle, at: Pose, words: Words): void {
  const { c, x, y, scale, across, time, moving, night } = view;
  const [w, h] = [Math.max(length * scale, LEAST_BODY), width * across];
  const turned = Math.abs(Math.sin(at.angle));
  if (turned > ALONG) {
    inFrame(view, at, () => {
      c.fillStyle = paint;
      c.fillRect(-length / 2, -width / 2, length, width);
    });
    return;
  }
  const way = Math.cos(at.angle) < 0 ? -1 : 1;
  const [left, top] = [x(at.s) - w / 2, y(at.d) - h / 2];
  c.fillStyle = night ? "#00000080" : "#00000060";
  c.fillRect(left - 0.6, top - 0.6, w + 1.2, h + 1.2);
  c.fillStyle = paint;
  c.fillRect(left, top, w, h);
  const lamp = (place: number, from: number, part: number, colour: string): void => {
    c.fillStyle = colour;
    c.fillRect(way * place > 0 ? left + w - 1 : left - 1, top + from * h, 2, part * h);
  };
  if (at.lights & (LIGHTS.low | LIGHTS.high)) lamp(1, 0.1, 0.8, words.road.lamp);
  if (at.lights & LIGHTS.brake) lamp(-1, 0, 1, words.road.brake);
  else if (night) lamp(-1, 0.1, 0.8, words.road.tail);
  const isOn = !moving || (time * 1.5) % 1 < 0.6;
  for (const [bit, isTop] of [[LIGHTS.left, way > 0], [LIGHTS.right, way < 0]] as const) {
    if (!(at.lights & bit) || !isOn) continue;
    for (const place of [1, -1]) lamp(place, isTop ? -0.1 : 0.75, 0.35, words.road.indicator);
  }
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

// Vehicles of a branch that are elsewhere than in the original.
export function drawBranch(view: View, letter: string, branch: Placed[], original: Placed[], words: Words): void {
  const { c, x, y, scale, across } = view;
  for (const { vehicle, at } of branch) {
    const same = original.find((one) => one.vehicle.slot === vehicle.slot);
    if (same && Math.hypot(same.at.s - at.s, same.at.d - at.d) < SAME_PLACE) continue;
    const [w, h] = [vehicle.length * scale, vehicle.width * across];
    c.save();
    rounded(c, x(at.s) - w / 2, y(at.d) - h / 2, w, h, 4);
    c.fillStyle = `${words.road.branch}59`;
    c.fill();
    c.lineWidth = 4;
    c.strokeStyle = "#0d1116a0";
    c.stroke();
    c.setLineDash([7, 3]);
    c.lineWidth = 2.2;
    c.strokeStyle = words.road.branch;
    c.stroke();
    c.restore();
    if (vehicle.slot !== 0 && same && Math.abs(same.at.s - at.s) < vehicle.length) continue;
    const name = vehicle.slot === 0 ? "E" : vehicle.symbol;
    tell(view, x(at.s), [y(at.d) + 5, y(at.d) + h / 2 + 18, y(at.d) - h / 2 - 9], [`${letter}: ${name}`], "#14181d", words.road.branch, true);
  }
}

// A vehicle at its believed position. After a recorded decision, this position moves on at the believed speed for a while.
export function drawBelief(view: View, ghost: BelievedNeighbour, run: Run, words: Words): void {
  const { c, x, y, scale, across, time } = view;
  const age = time - ghost.time_s;
  if (age < -1e-9 || age > GHOST_LASTS) return;
  const middle = x(ghost.s_m + ghost.speed_mps * age);
  const [w, h] = [ghost.length_m * scale, ghost.width_m * across];
  c.save();
  c.globalAlpha = ghost.held ? 0.55 : 1 - 0.6 * (age / GHOST_LASTS);
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
  const ego = pose(run.vehicles[0]!, time / run.interval);
  const rows = [y(ghost.d_m) + h / 2 + 18, y(ghost.d_m) - h / 2 - 9];
  // On the other side than the name of the vehicle.
  if (ego && ghost.d_m < ego.d - SAME_LANE) rows.reverse();
  if (middle > -w && middle < view.width + w) tell(view, middle, rows, beliefLabels(ghost, run), "#ffffff", words.road.glass);
  c.restore();
}

// Texts beside a belief, the longer one first: the name of the vehicle, and the believed and the true gap.
export function beliefLabels(belief: BelievedNeighbour, run: Run): string[] {
  const symbol = run.vehicles.find((vehicle) => vehicle.slot === belief.vehicle)?.symbol;
  const believed = belief.gap_m === null ? "not seen" : `believed ${plain(belief.gap_m, 0)} m`;
  const named = symbol === undefined ? believed : `${symbol} ${believed}`;
  const truth = belief.true_gap_m === null ? ", no vehicle there" : `, true ${plain(belief.true_gap_m, 0)} m`;
  const decided = belief.decision ? ` at ${belief.time_s.toFixed(2)} s` : "";
  return [named + truth + decided, named];
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

// A text on its ground. The places of all are kept, so that none lies on another.
export interface Tag {
  left: number;
  wide: number;
  y: number;
  draw: () => void;
}

const FONT = "600 11px system-ui, sans-serif";
const TALL = 16; // Of a tag [px].
const MOST_WIDTHS = 4000; // Texts have numbers: there are not many more.
const widths = new Map<string, number>();

// To measure a text takes nearly as long as to draw it.
function widthOf(c: CanvasRenderingContext2D, text: string): number {
  let wide = widths.get(text);
  if (wide === undefined) {
    if (widths.size > MOST_WIDTHS) widths.clear();
    c.font = FONT;
    wide = c.measureText(text).width;
    widths.set(text, wide);
  }
  return wide;
}

// Puts the first of some texts that is free in one of some rows; if none is, and it must be told,
// the first one above others. They are drawn when all else is.
export function tell(view: View, x: number, rows: number[], texts: string[], ink: string, ground: string, must = false): void {
  const { c, width, tags } = view;
  const alpha = c.globalAlpha;
  const tagOf = (text: string, y: number): Tag => {
    const wide = widthOf(c, text) + 10;
    const left = Math.min(Math.max(x - wide / 2, 2), width - wide - 2);
    return { left, wide, y, draw: () => drawTag(c, left, wide, y, text, ink, ground, alpha) };
  };
  for (const text of texts) {
    for (const y of rows) {
      const one = tagOf(text, y);
      const isFree = tags.every((other) => one.left >= other.left + other.wide || other.left >= one.left + one.wide || Math.abs(one.y - other.y) >= TALL);
      if (isFree) return void tags.push(one);
    }
  }
  if (must) tags.push(tagOf(texts[0]!, rows[0]!));
}

export function drawTags({ c, tags }: View): void {
  c.save();
  c.font = FONT;
  c.textAlign = "center";
  for (const one of tags.toReversed()) one.draw(); // What was put first, on top.
  c.restore();
}

function drawTag(c: CanvasRenderingContext2D, left: number, wide: number, y: number, text: string, ink: string, ground: string, alpha: number): void {
  c.globalAlpha = alpha;
  c.fillStyle = ground;
  rounded(c, left, y - 12, wide, TALL, 4);
  c.fill();
  c.fillStyle = ink;
  c.fillText(text, left + wide / 2, y);
}

// Who is who, and how fast, above each vehicle: of the ego and its target, or of all others, those
// that are near first. Where there is no room for the speed, the name is told alone.
export function tellVehicles(view: View, here: Placed[], words: Words, target: number | null, isOfOthers: boolean): void {
  const { x, y, across, width } = view;
  const own = here.find((one) => one.vehicle.slot === 0)?.at;
  const isMain = ({ vehicle }: Placed): boolean => vehicle.slot === 0 || vehicle.slot === target;
  const away = ({ at }: Placed): number => Math.abs(at.s - (own?.s ?? 0));
  for (const one of here.filter((other) => isMain(other) !== isOfOthers).toSorted((a, b) => away(a) - away(b))) {
    const { vehicle, at } = one;
    const place = x(at.s);
    const [isEgo, isTarget] = [vehicle.slot === 0, vehicle.slot === target];
    const isIn = place > -20 && place < width + 20;
    if (!isIn && !isTarget) continue;
    const ground = isEgo ? words.road.ego : isTarget ? words.road.target : "#20262ddd";
    const name = isEgo ? "E" : isTarget ? `${vehicle.symbol} target` : vehicle.symbol;
    const arrow = isIn ? "" : place > 0 ? " ▸" : " ◂";
    const whole = `${name}${isOncoming(vehicle) ? " oncoming" : ""} ${Math.round(at.speed * 3.6)} km/h${arrow}`;
    const reach = (vehicle.width / 2) * across + 10;
    const rows = [y(at.d) - reach, y(at.d) + reach + 10];
    // Below those on the ego's right, so that names of neighbours do not lie on each other.
    if (own !== undefined && at.d < own.d - SAME_LANE) rows.reverse();
    tell(view, place, isOfOthers ? rows.slice(0, 1) : rows, isOfOthers ? [whole, name] : [whole], isOfOthers ? "#ffffff" : "#14181d", ground, !isOfOthers);
  }
}
