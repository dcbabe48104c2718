// The road from above, with what lies over it.

import { isCounted } from "./board.ts";
import { pose } from "./bundle.ts";
import { h, write } from "./dom.ts";
import { fanOverlay } from "./fan.ts";
import { draw, type Size } from "./scene.ts";
import type { Shown } from "./state.ts";
import { brokenAt, describeCourse, describeFrame, type Reader } from "./text.ts";

const still = matchMedia("(prefers-reduced-motion: reduce)");

export interface Stage {
  element: HTMLElement;
  draw: (shown: Shown, reader: Reader, text: string) => void;
}

export function stage(redraw: () => void): Stage {
  const canvas = h("canvas", { role: "img", id: "road" });
  const beside = h("canvas", { role: "img", id: "road-beside", hidden: true });
  const alerts = h("ul", { class: "alerts", "aria-hidden": true });
  const sky = h("p", { class: "sky" });
  const futures = h("div", { class: "futures", hidden: true, "aria-hidden": true });
  const element = h("figure", { class: "stage" }, canvas, h("div", { class: "conditions" }, sky, alerts), futures, beside);
  let size: Size = { width: 0, height: 0 }; // To ask for it would lay the page out anew.
  let told = "";
  new ResizeObserver(([entry]) => {
    size = entry!.contentRect;
    redraw();
  }).observe(canvas);

  function drawAll(shown: Shown, reader: Reader, text: string): void {
    const { run, twin, branches, frame, words, state } = shown;
    const look = { camera: state.cam, stretch: state.stretch, zoom: state.zoom, ghosts: state.ghosts, moving: !still.matches };
    draw(canvas, size, run, words, frame, look, branches);
    canvas.setAttribute("aria-label", `Top view of the road. ${text}`);
    beside.hidden = !twin;
    if (twin) {
      draw(beside, size, twin, words, frame, look);
      beside.setAttribute("aria-label", `Top view of simulation ${state.beside}. ${describeFrame({ ...reader, run: twin }, frame)}`);
    }
    write(sky, air(shown));
    tellAlerts(alerts, reader, frame);
    tellFutures(shown);
  }

  function tellFutures(shown: Shown): void {
    const { fan, words, state } = shown;
    futures.hidden = !fan;
    const place = fan && fan.instants.findLastIndex((one) => one.told_s <= state.t + 1e-6);
    const key = fan ? `${fan.condition_on} ${fan.policy} ${place} ${shown.run.values.simulation}` : "";
    if (key === told) return;
    told = key;
    futures.replaceChildren(...(fan ? fanOverlay(fan, words, state.t) : []));
  }

  return { element, draw: drawAll };
}

function air({ run, frame }: Shown): string {
  const ego = pose(run.vehicles[0]!, frame);
  const sight = run.sight?.[Math.round(frame)];
  const seen = sight === undefined ? [] : [`sees a lit vehicle at ${sight.toFixed(0)} m`];
  return [run.air.text, ...seen, ...(ego ? describeCourse(run, ego.s) : [])].join(" · ");
}

// Whether the simulation has any alert. If so, the space for alerts stays reserved, so that the page does not jump.
function isAnyCounted(reader: Reader): boolean {
  return reader.run.law.some((row) => row.breach !== null && isCounted(reader, row.rule));
}

function tellAlerts(alerts: HTMLElement, reader: Reader, frame: number): void {
  alerts.hidden = !isAnyCounted(reader);
  const counted = brokenAt(reader, frame).filter((breach) => breach.counts);
  const texts = counted.map((breach) => `✗ ${breach.rule} ${breach.margin}`);
  if (texts.join() === [...alerts.children].map((alert) => alert.textContent).join()) return;
  alerts.replaceChildren(...texts.map((text, k) => h("li", { title: counted[k]!.text }, text)));
}
