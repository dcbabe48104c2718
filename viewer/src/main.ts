// The page: state, controls, and the one clock that everything follows.

import { board, type Board } from "./board.ts";
import { open, type Bundle, type Run } from "./bundle.ts";
import { h, write } from "./dom.ts";
import { helpDialog } from "./help.ts";
import { entries, tellList } from "./list.ts";
import { CAMERAS, parse, print, STRETCHES, type Moment } from "./link.ts";
import { draw, type Size, ZOOM } from "./scene.ts";
import { brokenAt, chip, facts, now, numbers, type Reader, ruleCard, sections } from "./text.ts";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 8];
const THEMES = ["system", "light", "dark"] as const;
const LINK_DELAY = 150; // [ms]; browsers refuse addresses that change too often.

const bundle = JSON.parse(document.getElementById("data")!.textContent) as Bundle;
const { words } = bundle;
const still = matchMedia("(prefers-reduced-motion: reduce)");
const night = matchMedia("(prefers-color-scheme: dark)");

const state = {
  sim: bundle.simulations[0]!.number,
  frame: 0,
  playing: false,
  speed: 1,
  zoom: 1,
  policy: bundle.policy,
  cam: "ego" as Moment["cam"],
  stretch: 1,
  ghosts: true,
  filter: "",
  theme: "system" as (typeof THEMES)[number],
};

let run: Run;
let chart: Board;
let rule: string | null = null;
let opening = 0;
let laidOut = 0; // Width of the charts when they were drawn [px].
let linking = 0;
let size: Size = { width: 0, height: 0 }; // Of the canvas: to ask for it would lay the page out anew.
let lastTick = 0;

const make = {
  button: (label: string, text: string, click: () => void, key = ""): HTMLButtonElement =>
    h("button", { type: "button", "aria-label": label, title: key ? `${label} (${key})` : label, click }, text),
  select: (label: string, options: [string, string][], change: (value: string) => void): HTMLSelectElement => {
    const list = h("select", { "aria-label": label, title: label }, ...options.map(([value, text]) => h("option", { value }, text)));
    list.addEventListener("change", () => change(list.value));
    return list;
  },
};

const canvas = h("canvas", { role: "img", id: "road" });
const alerts = h("ul", { class: "alerts", "aria-hidden": true });
const sky = h("p", { class: "sky" });
const play = make.button("Play", "▶", () => setPlaying(!state.playing), "space");
play.id = "play";
const slider = h("input", { type: "range", min: 0, step: 1, id: "slider", "aria-label": "Frame" });
const seconds = h("input", { type: "number", id: "seconds", min: 0, step: 0.05, "aria-label": "Time in seconds" });
const frameField = h("input", { type: "number", id: "frame", min: 0, step: 1, "aria-label": "Frame number" });
const speed = make.select("Speed", SPEEDS.map((one) => [String(one), `${one}×`]), (value) => change({ speed: Number(value) }));
const camera = make.select("Camera", CAMERAS.map((one) => [one, `follow ${one}`.replace("follow all", "show all")]), (value) => change({ cam: value as Moment["cam"] }));
const stretch = make.select("Stretch across the road", STRETCHES.map((one) => [String(one), `across ×${one}`]), (value) => change({ stretch: Number(value) }));
const believed = h("input", { type: "checkbox", id: "ghosts" });
const policy = make.select("Policy: which rules count", Object.keys(words.policies).map((one) => [one, `policy ${one}`]), (value) => change({ policy: value }));
const theme = make.select("Theme", THEMES.map((one) => [one, `${one} theme`]), (value) => change({ theme: value as (typeof THEMES)[number] }));
const filter = h("select", { id: "filter" });
const list = h("ol", { class: "runs" });
const count = h("p", { class: "quiet", role: "status" });
const title = h("h1", { tabindex: -1 });
const about = h("div", { class: "about" });
const said = h("p", { id: "now", role: "status", "aria-live": "polite" });
const boardPlace = h("div", { id: "board" });
const card = h("div", { id: "rule", class: "card", role: "status" });
const table = h("details", { class: "numbers" }, h("summary", {}, "All vehicles at this moment, in numbers"));
const tellings = h("div", { class: "tellings" });
const help = helpDialog();
const drawer = h("details", { class: "drawer", open: true }, h("summary", {}, "Simulations"), h("div", {}, h("label", { for: "filter" }, "Class"), filter, count, list));

function build(): void {
  const transport = h(
    "div",
    { class: "transport", role: "group", "aria-label": "Clock" },
    play,
    make.button("Event before", "⇤", () => jump(-1), "["),
    make.button("One frame back", "‹", () => step(-1), "←"),
    make.button("One frame on", "›", () => step(1), "→"),
    make.button("Event after", "⇥", () => jump(1), "]"),
    h("label", { class: "field" }, seconds, " s"),
    h("label", { class: "field" }, "frame ", frameField),
    speed,
  );
  const view = h(
    "div",
    { class: "transport view", role: "group", "aria-label": "Top view" },
    camera,
    stretch,
    make.button("Zoom out", "−", () => zoom(-1), "−"),
    make.button("Zoom in", "+", () => zoom(1), "+"),
    h("label", { class: "check", for: "ghosts" }, believed, " beliefs"),
  );
  document.body.append(
    h(
      "header",
      { class: "top" },
      h("p", { class: "brand" }, h("b", {}, bundle.title), h("span", {}, " seen by overtaking")),
      h("div", { class: "tools" }, policy, theme, make.button("Help: keys and marks", "?", () => help.showModal(), "?")),
    ),
    h(
      "div",
      { class: "page" },
      h("nav", { "aria-label": "Simulations" }, drawer),
      h(
        "main",
        {},
        h("div", { class: "heading" }, title, about),
        h("div", { class: "clockwork" }, h("figure", { class: "stage" }, canvas, sky, alerts), slider, h("div", { class: "controls" }, transport, view)),
        said,
        boardPlace,
        table,
        tellings,
      ),
    ),
    help,
  );
  slider.addEventListener("input", () => seek(Number(slider.value)));
  seconds.addEventListener("change", () => seek(Number(seconds.value) / run.interval));
  frameField.addEventListener("change", () => seek(Number(frameField.value)));
  believed.addEventListener("change", () => change({ ghosts: believed.checked }));
  filter.addEventListener("change", () => change({ filter: filter.value }));
  table.addEventListener("toggle", () => refresh());
  night.addEventListener("change", paintTheme);
  window.addEventListener("hashchange", () => void follow());
  document.addEventListener("keydown", onKey);
  if (matchMedia("(max-width: 60rem)").matches) drawer.open = false;
  new ResizeObserver(() => {
    if (boardPlace.clientWidth !== laidOut) layOut();
  }).observe(boardPlace);
  new ResizeObserver(([entry]) => {
    size = entry!.contentRect;
    refresh();
  }).observe(canvas);
}

function reader(): Reader {
  return { run, words, policy: state.policy, seek };
}

// What the address says, and the list depends on.
function moment(): Moment {
  return { ...state, t: Math.round(state.frame) * (run?.interval ?? 0) };
}

function refreshList(): void {
  const isThere = bundle.simulations.some((one) => one.classes[state.policy] === state.filter);
  if (!isThere) state.filter = "";
  tellList({ filter, rows: list, count }, bundle, moment());
}

// A change of state, then of all that shows it.
function change(part: Partial<typeof state>): void {
  Object.assign(state, part);
  if (part.theme !== undefined) paintTheme();
  if (part.policy !== undefined || part.filter !== undefined) refreshList();
  if (part.policy !== undefined) tell();
  tellControls();
  refresh();
  link();
}

async function show(number: number, time: number): Promise<void> {
  const entry = bundle.simulations.find((one) => one.number === number) ?? bundle.simulations[0]!;
  const ticket = ++opening;
  setPlaying(false);
  const found = await open(entry);
  if (ticket !== opening) return;
  run = found;
  rule = null;
  state.sim = entry.number;
  state.frame = clamp(Math.round(time / run.interval));
  slider.max = frameField.max = String(run.frames - 1);
  seconds.max = String((run.frames - 1) * run.interval);
  seconds.step = String(run.interval);
  refreshList();
  tell();
  tellControls();
  link();
}

// What does not change with time.
function tell(): void {
  const told = run.values.policies[state.policy]!;
  document.title = `Simulation ${state.sim}, ${told.class} · ${bundle.title}`;
  title.replaceChildren(`Simulation ${state.sim} `, chip(words, told.class));
  about.replaceChildren(h("p", { class: "meaning" }, words.classes[told.class]!.meaning), facts(reader()));
  tellings.replaceChildren(...sections(reader()));
  layOut();
}

// What is said of a rule, below its row; nothing, if none is chosen.
function tellRule(code: string | null): void {
  rule = code;
  const place = boardPlace.querySelector(`[data-rule="${rule}"]`)?.closest(".row");
  if (rule !== null && place) {
    card.replaceChildren(make.button("Close", "×", () => tellRule(null), "Esc"), ...ruleCard(reader(), rule));
    place.after(card);
  } else card.remove();
  for (const one of boardPlace.querySelectorAll("[data-rule]")) {
    one.setAttribute("aria-pressed", String(one.getAttribute("data-rule") === rule));
  }
}

function layOut(): void {
  if (!run) return;
  const held = document.activeElement?.getAttribute("data-rule");
  const gutter = parseFloat(getComputedStyle(boardPlace).getPropertyValue("--gutter"));
  laidOut = boardPlace.clientWidth;
  const width = Math.max(Math.floor(laidOut - gutter), 120);
  chart = board({ run, words, policy: state.policy, width, seek, tellRule });
  boardPlace.replaceChildren(chart.element);
  if (held) boardPlace.querySelector<HTMLElement>(`[data-rule="${held}"]`)?.focus();
  tellRule(rule);
  refresh();
}

// What changes with time.
function refresh(): void {
  if (!run || !chart) return;
  const { frame } = state;
  const moving = !still.matches;
  draw(canvas, size, run, words, frame, { camera: state.cam, stretch: state.stretch, zoom: state.zoom, ghosts: state.ghosts, moving });
  chart.update(frame);
  slider.value = String(Math.round(frame));
  const time = (frame * run.interval).toFixed(2);
  slider.setAttribute("aria-valuetext", `${time} s of ${run.values.duration_s.toFixed(2)} s`);
  if (document.activeElement !== seconds) seconds.value = time;
  if (document.activeElement !== frameField) frameField.value = String(Math.round(frame));
  const text = now(reader(), frame);
  write(said, text);
  canvas.setAttribute("aria-label", `Top view of the road. ${text}`);
  const sight = run.sight?.[Math.round(frame)];
  const weather = run.values.weather;
  const air = !weather ? "weather unknown" : (weather.preset ?? (weather.night ? "night" : "day"));
  write(sky, sight === undefined ? air : `${air}: a lit vehicle is seen at ${sight.toFixed(0)} m`);
  tellAlerts();
  if (table.open && !state.playing) table.replaceChildren(table.firstElementChild!, numbers(reader(), frame));
}

function tellAlerts(): void {
  const broken = brokenAt(reader(), state.frame).filter((one) => one.counts);
  const text = broken.map((one) => one.text);
  if (text.join() === [...alerts.children].map((one) => one.textContent?.slice(2)).join()) return;
  alerts.replaceChildren(...text.map((one) => h("li", {}, `✗ ${one}`)));
}

function tellControls(): void {
  play.textContent = state.playing ? "⏸" : "▶";
  play.setAttribute("aria-label", state.playing ? "Pause" : "Play");
  said.setAttribute("aria-live", state.playing ? "off" : "polite");
  speed.value = String(state.speed);
  camera.value = state.cam;
  stretch.value = String(state.stretch);
  policy.value = state.policy;
  theme.value = state.theme;
  believed.checked = state.ghosts;
}

function clamp(frame: number): number {
  return Math.min(Math.max(Number.isFinite(frame) ? frame : 0, 0), run.frames - 1);
}

function seek(frame: number): void {
  state.frame = clamp(Math.round(frame));
  refresh();
  link();
}

function step(frames: number): void {
  setPlaying(false);
  seek(Math.round(state.frame) + frames);
}

function jump(way: 1 | -1): void {
  const frames = [0, ...run.values.events.map((one) => one.frame), run.frames - 1];
  const beyond = frames.filter((one) => (one - Math.round(state.frame)) * way > 0);
  if (beyond.length) step((way > 0 ? Math.min(...beyond) : Math.max(...beyond)) - Math.round(state.frame));
}

function zoom(way: 1 | -1): void {
  change({ zoom: Math.min(Math.max(state.zoom * ZOOM.step ** way, ZOOM.least), ZOOM.most) });
}

function setPlaying(playing: boolean): void {
  if (playing === state.playing) return;
  if (playing && state.frame >= run.frames - 1) state.frame = 0;
  state.playing = playing;
  lastTick = 0;
  if (playing) requestAnimationFrame(tick);
  else if (run) seek(state.frame);
  tellControls();
}

function tick(at: number): void {
  if (!state.playing) return;
  // A tab that was hidden goes on where it was.
  const passed = lastTick ? Math.min((at - lastTick) / 1000, 0.25) : 0;
  lastTick = at;
  state.frame = clamp(state.frame + (passed * state.speed) / run.interval);
  if (state.frame >= run.frames - 1) setPlaying(false);
  else {
    refresh();
    requestAnimationFrame(tick);
  }
}

function link(): void {
  clearTimeout(linking);
  if (state.playing) return;
  linking = window.setTimeout(() => history.replaceState(null, "", print(moment(), bundle.policy)), LINK_DELAY);
}

// To the moment that the address names.
async function follow(): Promise<void> {
  const said = parse(location.hash);
  clearTimeout(linking);
  state.policy = said.policy && said.policy in words.policies ? said.policy : bundle.policy;
  state.cam = said.cam ?? "ego";
  state.stretch = said.stretch ?? 1;
  state.ghosts = said.ghosts ?? true;
  state.filter = said.filter ?? "";
  await show(said.sim ?? bundle.simulations[0]!.number, said.t ?? 0);
}

function paintTheme(): void {
  const name = state.theme === "system" ? (night.matches ? "dark" : "light") : state.theme;
  const { style, dataset } = document.documentElement;
  dataset["theme"] = name;
  style.colorScheme = name;
  for (const [key, colour] of Object.entries(words.themes[name])) style.setProperty(`--${key}`, colour);
}

function other(way: 1 | -1): void {
  const shown = entries(bundle, moment());
  const place = shown.findIndex((one) => one.number === state.sim);
  const next = shown[(place + way + shown.length) % shown.length];
  if (next) void show(next.number, 0);
}

function after<T>(all: readonly T[], one: T): T {
  return all[(all.indexOf(one) + 1) % all.length]!;
}

const KEYS: Record<string, () => void> = {
  " ": () => setPlaying(!state.playing),
  ArrowLeft: () => step(-1),
  ArrowRight: () => step(1),
  "shift+ArrowLeft": () => step(-Math.round(1 / run.interval)),
  "shift+ArrowRight": () => step(Math.round(1 / run.interval)),
  "[": () => jump(-1),
  "]": () => jump(1),
  Home: () => step(-run.frames),
  End: () => step(run.frames),
  j: () => other(1),
  k: () => other(-1),
  ",": () => change({ speed: SPEEDS[Math.max(SPEEDS.indexOf(state.speed) - 1, 0)]! }),
  ".": () => change({ speed: SPEEDS[Math.min(SPEEDS.indexOf(state.speed) + 1, SPEEDS.length - 1)]! }),
  c: () => change({ cam: after(CAMERAS, state.cam) }),
  s: () => change({ stretch: after<number>(STRETCHES, state.stretch) }),
  "+": () => zoom(1),
  "-": () => zoom(-1),
  g: () => change({ ghosts: !state.ghosts }),
  p: () => change({ policy: after(Object.keys(words.policies), state.policy) }),
  t: () => change({ theme: after(THEMES, state.theme) }),
  l: () => boardPlace.querySelector<HTMLElement>("button.law")?.focus(),
  "/": () => {
    drawer.open = true;
    filter.focus();
  },
  "?": () => help.showModal(),
  Escape: () => tellRule(null),
};

function onKey(event: KeyboardEvent): void {
  if (event.ctrlKey || event.metaKey || event.altKey || help.open || !run) return;
  const from = event.target as HTMLElement;
  const isTyping = from.matches("select, input[type=number]");
  const isPressing = from.matches("button, a, summary, input[type=checkbox]");
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  if (isTyping || (isPressing && key === " ")) return;
  const isArrow = key.startsWith("Arrow");
  const act = KEYS[event.shiftKey && isArrow ? `shift+${key}` : key];
  if (!act) return;
  event.preventDefault();
  act();
}

paintTheme();
build();
void follow();
