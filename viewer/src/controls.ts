// What sets the state, and shows what it is.

import { button, field, h, put, select } from "./dom.ts";
import type { Clock } from "./clock.ts";
import { CAMERAS, STRETCHES, type Moment, type Theme, THEMES } from "./link.ts";
import { ZOOM } from "./scene.ts";
import type { Source } from "./source.ts";
import { frames, type Shown, SPEEDS, type State, type Store } from "./state.ts";

export interface Controls {
  tools: HTMLElement;
  slider: HTMLInputElement;
  element: HTMLElement;
  tell: (state: Readonly<State>) => void;
  // What changes with time.
  tellTime: (shown: Shown) => void;
}

export function controls(source: Source, store: Store, clock: Clock, askHelp: () => void): Controls {
  const { change } = store;
  const names = Object.keys(source.words.policies);
  const policy = select("Policy: which rules count", names.map((one) => [one, `policy ${one}`]), (value) => change({ policy: value }));
  const against = select("Another policy beside it", [["", "and no other"], ...names.map((one): [string, string] => [one, `and ${one}`])], (value) => change({ against: value || null }));
  const theme = select("Theme", THEMES.map((one) => [one, `${one} theme`]), (value) => change({ theme: value as Theme }));
  const play = button("Play", "▶", () => clock.play(!store.state.playing), "space");
  play.id = "play";
  const slider = h("input", { type: "range", min: 0, step: 1, id: "slider", "aria-label": "Frame" });
  const seconds = field({ id: "seconds", min: 0, step: 0.05, "aria-label": "Time in seconds" });
  const frameField = field({ id: "frame", min: 0, step: 1, "aria-label": "Frame number" });
  const speed = select("Speed", SPEEDS.map((one) => [String(one), `${one}×`]), (value) => change({ speed: Number(value) }));
  const camera = select("Camera", CAMERAS.map((one) => [one, `follow ${one}`.replace("follow all", "show all")]), (value) => change({ cam: value as Moment["cam"] }));
  const stretch = select("Stretch across the road", STRETCHES.map((one) => [String(one), `across ×${one}`]), (value) => change({ stretch: Number(value) }));
  const believed = h("input", { type: "checkbox", id: "ghosts", change: () => change({ ghosts: believed.checked }) });
  const another = field({ id: "beside", min: 0, "aria-label": "Simulation to show beside this one", placeholder: "none" });
  another.addEventListener("change", () => change({ beside: another.value === "" ? null : Number(another.value) }));
  slider.addEventListener("input", () => clock.seek(Number(slider.value)));
  seconds.addEventListener("change", () => clock.seek(Number(seconds.value) / Number(seconds.step)));
  frameField.addEventListener("change", () => clock.seek(Number(frameField.value)));
  const transport = [
    play,
    button("Event before", "⇤", () => clock.jump(-1), "["),
    button("One frame back", "‹", () => clock.step(-1), "←"),
    button("One frame on", "›", () => clock.step(1), "→"),
    button("Event after", "⇥", () => clock.jump(1), "]"),
    h("label", { class: "field" }, seconds, " s"),
    h("label", { class: "field" }, "frame ", frameField),
    speed,
  ];
  const view = [
    camera,
    stretch,
    button("Zoom out", "−", () => change({ zoom: zoomed(store.state.zoom, -1) }), "−"),
    button("Zoom in", "+", () => change({ zoom: zoomed(store.state.zoom, 1) }), "+"),
    h("label", { class: "check", for: "ghosts" }, believed, " beliefs"),
    source.total > 1 ? h("label", { class: "field", for: "beside" }, "beside ", another) : null,
  ];
  return {
    tools: h("div", { class: "tools" }, policy, against, theme, button("Help: keys and marks", "?", askHelp, "?")),
    slider,
    element: h(
      "div",
      { class: "controls" },
      h("div", { class: "transport", role: "group", "aria-label": "Clock" }, ...transport),
      h("div", { class: "transport view", role: "group", "aria-label": "Top view" }, ...view),
    ),
    tell: (state) => {
      play.textContent = state.playing ? "⏸" : "▶";
      play.setAttribute("aria-label", state.playing ? "Pause" : "Play");
      put(speed, String(state.speed));
      put(camera, state.cam);
      put(stretch, String(state.stretch));
      put(policy, state.policy);
      put(against, state.against ?? "");
      against.hidden = state.sim === null;
      put(theme, state.theme);
      believed.checked = state.ghosts;
      put(another, state.beside === null ? "" : String(state.beside));
    },
    tellTime: (shown) => {
      const { run, frame } = shown;
      const last = frames(shown) - 1;
      if (slider.max !== String(last) || seconds.step !== String(run.interval)) {
        slider.max = frameField.max = String(last);
        seconds.max = String(last * run.interval);
        seconds.step = String(run.interval);
      }
      const time = (frame * run.interval).toFixed(2);
      put(slider, String(Math.round(frame)));
      slider.setAttribute("aria-valuetext", `${time} s of ${run.values.duration_s.toFixed(2)} s`);
      put(seconds, time);
      put(frameField, String(Math.round(frame)));
    },
  };
}

export function zoomed(zoom: number, way: 1 | -1): number {
  return Math.min(Math.max(zoom * ZOOM.step ** way, ZOOM.least), ZOOM.most);
}
