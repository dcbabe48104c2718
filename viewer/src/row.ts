// What the rows on the axis of time have in common.

import type { Fan, Overlay, Run, Words } from "./bundle.ts";
import { h, svg } from "./dom.ts";

export interface Needs {
  run: Run;
  words: Words;
  policy: string;
  against: string | null;
  fan: Fan | null;
  width: number; // Of the plots [px].
  overlays: Overlay[]; // Other courses on the same clock.
  frames: number; // Of the longest course.
  seek: (frame: number) => void;
  tellRule: (rule: string) => void;
}

export interface Row {
  element: HTMLElement;
  update: (frame: number) => void;
}

export function plot(needs: Needs, height: number, ...children: (Node | null)[]): SVGElement {
  return svg(
    "svg",
    { width: needs.width, height, viewBox: `0 0 ${needs.width} ${height}`, "aria-hidden": "true" },
    ...children,
  );
}

export function xOf(needs: Needs): (frame: number) => number {
  return (frame) => (frame / Math.max(needs.frames - 1, 1)) * needs.width;
}

export function row(label: Node, drawing: SVGElement, kind: string, update: Row["update"] = () => undefined): Row {
  return { element: h("div", { class: `row ${kind}` }, label, h("div", { class: "plot" }, drawing)), update };
}
