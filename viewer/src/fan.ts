// Futures of a start at each instant: shares of the classes with their intervals.

import type { Fan, Instant, Words } from "./bundle.ts";
import { h, svg, write } from "./dom.ts";
import { type Needs, plot, type Row, row, xOf } from "./row.ts";
import { chip } from "./text.ts";

const HEIGHT = 128;
const MARK = 2.6; // [px]
const SHARE_FROM = 0.005; // What is rarer is not named in the scene.

// The last instant that is not after a frame.
export function instantAt(fan: Fan, seconds: number): Instant | null {
  return fan.instants.findLast((one) => one.told_s <= seconds + 1e-6) ?? null;
}

export function percent(found: { share: number; low: number; high: number }): string {
  const whole = (share: number): string => (100 * share).toFixed(0);
  return `${whole(found.share)} % (${whole(found.low)}–${whole(found.high)})`;
}

// What an instant says in words, for the line that screen readers read.
export function fanWords(fan: Fan, seconds: number): string {
  const instant = instantAt(fan, seconds);
  if (!instant) return "";
  const begin = `Told to begin at ${instant.told_s.toFixed(2)} s, ${fan.about}: `;
  const named = Object.entries(instant.shares).filter(([, one]) => one.share !== null && one.share >= SHARE_FROM);
  if (!named.length) return `${begin}too few futures.`;
  return `${begin}${named.map(([name, one]) => `${name} ${percent(one as Told)}`).join(", ")}.`;
}

type Told = { share: number; low: number; high: number };

// The same over the scene: a bar of shares, and what it is given.
export function fanOverlay(fan: Fan, words: Words, seconds: number): Node[] {
  const instant = instantAt(fan, seconds);
  if (!instant) return [];
  const named = Object.entries(instant.shares).filter((one): one is [string, Told] => one[1].share !== null && one[1].share >= SHARE_FROM);
  const parts = named.map(([name, one]) => {
    const part = h("i", { title: name });
    part.style.setProperty("--share", String(one.share));
    part.style.setProperty("--patch", words.classes[name]!.colour);
    return part;
  });
  const begun = instant.pulls_out_s === null ? "" : `, pulls out at ${instant.pulls_out_s.toFixed(2)} s`;
  return [
    h("p", {}, h("b", {}, `Had it been told to begin at ${instant.told_s.toFixed(2)} s`), begun),
    named.length ? h("div", { class: "shares" }, ...parts) : h("p", {}, `${instant.futures} futures: too few for a share`),
    h("p", {}, ...named.toSorted((a, b) => b[1].share - a[1].share).map(([name, one]) => h("span", { class: "part" }, chip(words, name), ` ${percent(one)}`))),
    h("p", { class: "given" }, `${fan.about}; ${instant.futures} futures, 95 % intervals`),
  ];
}

// The shares over the instants.
export function fanRow(needs: Needs, fan: Fan): Row {
  const x = xOf(needs);
  const at = (one: Instant): number => x(one.told_s / needs.run.interval);
  const y = (share: number): number => HEIGHT - 6 - share * (HEIGHT - 18);
  const names = Object.keys(fan.instants[0]?.shares ?? {});
  const values = names.map((name) => ({ name, value: h("span", { class: "number" }) }));
  const grid = [0, 0.5, 1].flatMap((share) => [
    svg("line", { x1: 0, x2: needs.width, y1: y(share), y2: y(share), class: "grid" }),
    svg("text", { x: 3, y: y(share) - 3, class: "tick-text" }, `${100 * share} %`),
  ]);
  const began = fan.pulled_out_s === null ? null : svg("line", { x1: x(fan.pulled_out_s / needs.run.interval), x2: x(fan.pulled_out_s / needs.run.interval), y1: 0, y2: HEIGHT, class: "began" });
  const curves = names.flatMap((name) => {
    const there = fan.instants.filter((one) => one.shares[name]!.share !== null);
    const of = (one: Instant): Told => one.shares[name] as Told;
    const line = there.map((one, k) => `${k ? "L" : "M"}${at(one).toFixed(1)} ${y(of(one).share).toFixed(1)}`).join("");
    const edge = [...there.map((one) => [at(one), y(of(one).high)]), ...there.toReversed().map((one) => [at(one), y(of(one).low)])];
    const colour = needs.words.classes[name]!.colour;
    return [
      svg("polygon", { points: edge.map(([px, py]) => `${px!.toFixed(1)},${py!.toFixed(1)}`).join(" "), fill: colour, class: "band" }),
      svg("path", { d: line, stroke: colour, class: "curve share" }),
      ...there.map((one) => mark(needs.words.classes[name]!, at(one), y(of(one).share))),
    ];
  });
  const legend = values.map(({ name, value }) => h("span", { class: "key" }, chip(needs.words, name), " ", value));
  const label = h("div", { class: "label chart" }, h("b", {}, "Begun at t", h("small", {}, ` share, ${fan.policy}`)), ...legend);
  const about = h("p", { class: "fan-about" }, fan.title);
  const found = row(label, plot(needs, HEIGHT, ...grid, began, ...curves), "chart fan", (frame) => {
    const instant = instantAt(fan, frame * needs.run.interval);
    for (const { name, value } of values) {
      const one = instant?.shares[name];
      write(value, one?.share == null ? "–" : percent(one as Told));
    }
  });
  found.element.lastElementChild!.prepend(about);
  return found;
}

// A mark as on a chip: classes are told apart without colour.
function mark(of: { colour: string; marker: string }, x: number, y: number): SVGElement {
  const look = { fill: of.colour, class: "mark" };
  const r = MARK;
  const shapes: Record<string, string> = {
    D: `M${x} ${y - r * 1.3}L${x + r * 1.3} ${y}L${x} ${y + r * 1.3}L${x - r * 1.3} ${y}Z`,
    "^": `M${x} ${y - r}L${x + r} ${y + r}L${x - r} ${y + r}Z`,
    v: `M${x} ${y + r}L${x + r} ${y - r}L${x - r} ${y - r}Z`,
    "<": `M${x - r} ${y}L${x + r} ${y - r}L${x + r} ${y + r}Z`,
    X: `M${x - r} ${y - r}L${x + r} ${y + r}M${x + r} ${y - r}L${x - r} ${y + r}`,
    s: `M${x - r} ${y - r}H${x + r}V${y + r}H${x - r}Z`,
  };
  const shape = shapes[of.marker];
  if (!shape) return svg("circle", { ...look, cx: x, cy: y, r });
  const path = svg("path", { ...look, d: shape });
  return of.marker === "X" ? svg("g", { stroke: of.colour }, svg("path", { class: "mark cross", d: shape })) : path;
}
