// The page: state, controls, and the one clock that everything follows.

import { board, type Board } from "./board.ts";
import type { Overlay, Run } from "./bundle.ts";
import { busy, h, write } from "./dom.ts";
import { helpDialog } from "./help.ts";
import { listen } from "./keys.ts";
import { beyond, tellList } from "./list.ts";
import { CAMERAS, type Change, noChoice, parse, print, STRETCHES, type Moment } from "./link.ts";
import { overview } from "./overview.ts";
import { draw, type Size, ZOOM } from "./scene.ts";
import { connect, type Listed } from "./source.ts";
import { brokenAt, chip, facts, now, numbers, type Reader, ruleCard, sections } from "./text.ts";
import { onSystemChange, paint, type Theme, THEMES } from "./theme.ts";
import { type Branch, cards, controls, isFull, letter } from "./whatif.ts";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 8];
const LINK_DELAY = 150; // [ms]; browsers refuse addresses that change too often.
const READING_DELAY = 400; // [ms]; until the list is asked for again while its data set is read.

const still = matchMedia("(prefers-reduced-motion: reduce)");

const source = await connect();
const { words } = source;

const state = {
  sim: null as number | null,
  frame: 0,
  playing: false,
  speed: 1,
  zoom: 1,
  policy: source.policy,
  cam: "ego" as Moment["cam"],
  stretch: 1,
  ghosts: true,
  choice: noChoice(),
  beside: null as number | null,
  theme: "system" as Theme,
};

let run: Run;
let twin: Run | null = null;
let branches: Branch[] = [];
let listed: Listed;
let asking = 0;
let chart: Board;
let rule: string | null = null;
let opening = 0;
let laidOut = 0; // Width of the charts when they were drawn [px].
let linking = 0;
let address = ""; // What the page last followed or wrote.
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
const besideCanvas = h("canvas", { role: "img", id: "road-beside", hidden: true });
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
const theme = make.select("Theme", THEMES.map((one) => [one, `${one} theme`]), (value) => change({ theme: value as Theme }));
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
const wrong = h("p", { class: "failure", role: "alert" });
const changes = h("section", { id: "branches", "aria-label": "What if", "aria-live": "polite" });
const another = h("input", { type: "number", id: "beside", min: 0, "aria-label": "Simulation to show beside this one", placeholder: "none" });
const all = overview(source, (choice) => void change({ choice }));
const help = helpDialog();
const toAll = h("a", { id: "all", href: "#" }, "‹ All simulations and filters");
const content = h("main", {});
const drawer = h("details", { class: "drawer", open: true }, h("summary", {}, "Simulations"), h("div", {}, source.server ? toAll : null, h("label", { for: "filter" }, "Class"), filter, count, list));

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
    source.total > 1 ? h("label", { class: "field", for: "beside" }, "beside ", another) : null,
  );
  const whatIf = source.server && controls(source.server, (what) => void busy([content], branchOff({ what, t: Math.round(state.frame) * run.interval })));
  document.body.append(
    h(
      "header",
      { class: "top" },
      h("p", { class: "brand" }, h("b", {}, source.title), h("span", {}, " seen by overtaking")),
      h("div", { class: "tools" }, policy, theme, make.button("Help: keys and marks", "?", () => help.showModal(), "?")),
    ),
    h(
      "div",
      { class: "page", hidden: true },
      h("nav", { "aria-label": "Simulations" }, drawer),
      content,
    ),
    all.element,
    help,
  );
  content.append(
    h("div", { class: "heading" }, title, about),
    h("div", { class: "clockwork" }, h("figure", { class: "stage" }, canvas, besideCanvas, sky, alerts), slider, h("div", { class: "controls" }, transport, view)),
    whatIf ?? "",
    ...[wrong, said, changes, boardPlace, table, tellings],
  );
  slider.addEventListener("input", () => seek(Number(slider.value)));
  seconds.addEventListener("change", () => seek(Number(seconds.value) / run.interval));
  frameField.addEventListener("change", () => seek(Number(frameField.value)));
  believed.addEventListener("change", () => change({ ghosts: believed.checked }));
  filter.addEventListener("change", () => change({ choice: { ...state.choice, first: 0, classes: filter.value ? [filter.value] : [] } }));
  another.addEventListener("change", () => change({ beside: another.value === "" ? null : Number(another.value) }));
  table.addEventListener("toggle", () => refresh());
  onSystemChange(() => paint(words, state.theme));
  window.addEventListener("hashchange", () => void busy([content], follow()));
  listen(KEYS, () => help.open);
  listen(RUN_KEYS, () => help.open || state.sim === null || !run);
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
  const at = branches.map((one) => ({ what: one.what, t: one.frame * one.run.interval }));
  return { ...state, t: Math.round(state.frame) * (run?.interval ?? 0), branches: at };
}

// Every course on the clock beside the original.
function overlays(): Overlay[] {
  return [...branches, ...(twin ? [{ letter: String(state.beside), run: twin, frame: 0 }] : [])];
}

function frames(): number {
  return Math.max(run.frames, ...overlays().map((one) => one.run.frames));
}

function refreshList(around?: number): Promise<void> {
  return busy([all.rows, list], askList(around));
}

async function askList(around?: number): Promise<void> {
  const ticket = ++asking;
  try {
    const found = await source.rows(state.choice, state.policy, around);
    if (ticket !== asking) return;
    listed = found;
  } catch (error) {
    return all.fail((error as Error).message);
  }
  state.choice = { ...state.choice, first: listed.first };
  tellRows();
  if (listed.read < listed.total && !listed.failure) setTimeout(() => ticket === asking && void refreshList(around), READING_DELAY);
}

function tellRows(): void {
  if (!listed) return;
  if (state.sim === null) all.tell(listed, moment());
  else {
    toAll.href = print({ ...moment(), sim: null, branches: [], beside: null }, source.policy);
    tellList({ filter, rows: list, count }, source, listed, moment());
  }
}

// A change of state, then of all that shows it.
function change(part: Partial<typeof state>): void {
  Object.assign(state, part);
  if (part.theme !== undefined) paint(words, state.theme);
  if (part.policy !== undefined || part.choice !== undefined) void refreshList();
  if (part.policy !== undefined && state.sim !== null) tell();
  if (part.beside !== undefined) void busy([content], showBeside());
  tellControls();
  refresh();
  link();
}

async function show(number: number, time: number, wanted: Change[] = []): Promise<void> {
  const ticket = ++opening;
  setPlaying(false);
  let found: Run;
  try {
    found = await source.open(number);
  } catch (error) {
    return fail(error);
  }
  if (ticket !== opening) return;
  write(wrong, "");
  run = found;
  branches = [];
  rule = null;
  state.sim = run.values.simulation;
  state.frame = clamp(Math.round(time / run.interval));
  seconds.step = String(run.interval);
  reveal(true);
  const isThere = listed?.rows.some((one) => one.number === state.sim);
  if (isThere) tellRows();
  else void refreshList(state.sim);
  tell();
  tellControls();
  await showBeside();
  for (const one of wanted) await branchOff(one);
  link();
  const every = await source.server?.beliefs(state.sim).catch(() => null);
  if (!every || ticket !== opening) return;
  run.every = every;
  layOut();
}

function fail(error: unknown): void {
  write(wrong, (error as Error).message);
  all.fail((error as Error).message);
}

// Either a simulation, or the list of all.
function reveal(isRun: boolean): void {
  document.querySelector<HTMLElement>(".page")!.hidden = !isRun;
  all.element.hidden = isRun;
}

function showAll(): void {
  opening++;
  setPlaying(false);
  state.sim = null;
  document.title = `${source.title} · overtaking`;
  reveal(false);
  void refreshList();
  link();
}

async function branchOff({ what, t }: Change): Promise<void> {
  if (!source.server || isFull(branches)) return fail(new Error("Four branches are shown: drop one first."));
  const ticket = opening;
  try {
    const found = await source.server.branch(state.sim!, Math.round(t / run.interval), what);
    if (ticket !== opening) return;
    branches = [...branches, { ...found, what, letter: letter(branches) }];
    write(wrong, "");
  } catch (error) {
    return fail(error);
  }
  tellBranches();
}

function tellBranches(): void {
  changes.replaceChildren(
    ...cards(branches, words, state.policy, seek, (gone) => {
      branches = branches.filter((one) => one !== gone);
      tellBranches();
    }),
  );
  layOut();
  link();
}

// Another simulation on the same clock.
async function showBeside(): Promise<void> {
  const ticket = opening;
  const found = state.beside === null ? null : await source.open(state.beside).catch((error: unknown) => (fail(error), null));
  if (ticket !== opening) return;
  twin = found;
  if (!twin) state.beside = null;
  besideCanvas.hidden = !twin;
  layOut();
}

// What does not change with time.
function tell(): void {
  const told = run.values.policies[state.policy]!;
  document.title = `Simulation ${state.sim}, ${told.class} · ${source.title}`;
  title.replaceChildren(`Simulation ${state.sim} `, chip(words, told.class));
  about.replaceChildren(h("p", { class: "meaning" }, words.classes[told.class]!.meaning), facts(reader()));
  tellings.replaceChildren(...sections(reader()));
  tellBranches();
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
  slider.max = frameField.max = String(frames() - 1);
  seconds.max = String((frames() - 1) * run.interval);
  chart = board({ run, words, policy: state.policy, width, seek, tellRule, overlays: overlays(), frames: frames() });
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
  const look = { camera: state.cam, stretch: state.stretch, zoom: state.zoom, ghosts: state.ghosts, moving };
  draw(canvas, size, run, words, frame, look, branches);
  if (twin) {
    draw(besideCanvas, size, twin, words, frame, look);
    besideCanvas.setAttribute("aria-label", `Top view of simulation ${state.beside}. ${now({ ...reader(), run: twin }, frame)}`);
  }
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
  another.value = state.beside === null ? "" : String(state.beside);
}

function clamp(frame: number): number {
  return Math.min(Math.max(Number.isFinite(frame) ? frame : 0, 0), frames() - 1);
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
  const ends = [0, ...run.values.events.map((one) => one.frame), frames() - 1];
  const next = ends.filter((one) => (one - Math.round(state.frame)) * way > 0);
  if (next.length) step((way > 0 ? Math.min(...next) : Math.max(...next)) - Math.round(state.frame));
}

function zoom(way: 1 | -1): void {
  change({ zoom: Math.min(Math.max(state.zoom * ZOOM.step ** way, ZOOM.least), ZOOM.most) });
}

function setPlaying(playing: boolean): void {
  if (playing === state.playing) return;
  if (playing && state.frame >= frames() - 1) state.frame = 0;
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
  if (state.frame >= frames() - 1) setPlaying(false);
  else {
    refresh();
    requestAnimationFrame(tick);
  }
}

function link(): void {
  clearTimeout(linking);
  if (state.playing) return;
  content.dataset.address = "behind";
  linking = window.setTimeout(() => {
    // An address that came meanwhile is followed, not written over.
    if (location.hash === address) {
      history.replaceState(null, "", print(moment(), source.policy));
      address = location.hash;
    }
    delete content.dataset.address;
  }, LINK_DELAY);
}

// To the moment that the address names.
async function follow(): Promise<void> {
  const said = parse(location.hash);
  clearTimeout(linking);
  address = location.hash;
  delete content.dataset.address;
  state.policy = said.policy && said.policy in words.policies ? said.policy : source.policy;
  state.cam = said.cam ?? "ego";
  state.stretch = said.stretch ?? 1;
  state.ghosts = said.ghosts ?? true;
  const isSame = JSON.stringify(state.choice) === JSON.stringify(said.choice);
  state.choice = said.choice;
  state.beside = said.beside ?? null;
  const sim = said.sim ?? (source.server ? null : source.first);
  if (sim === null) return showAll();
  if (!isSame && state.sim !== null) void refreshList(sim);
  await show(sim, said.t ?? 0, said.branches);
}

// The simulation before or after in the list, also beyond the part that is shown.
async function other(way: 1 | -1): Promise<void> {
  if (state.sim === null) return all.step(way);
  const place = listed.rows.findIndex((one) => one.number === state.sim);
  let next = listed.rows[place + way];
  const first = next ? null : beyond(listed, way);
  if (first !== null) {
    state.choice = { ...state.choice, first };
    await refreshList();
    next = listed.rows.at(way > 0 ? 0 : -1);
  }
  next ??= listed.found <= listed.rows.length ? listed.rows.at(way > 0 ? 0 : -1) : undefined;
  if (next) await show(next.number, 0);
}

function after<T>(all: readonly T[], one: T): T {
  return all[(all.indexOf(one) + 1) % all.length]!;
}

const RUN_KEYS: Record<string, () => void> = {
  " ": () => setPlaying(!state.playing),
  ArrowLeft: () => step(-1),
  ArrowRight: () => step(1),
  "shift+ArrowLeft": () => step(-Math.round(1 / run.interval)),
  "shift+ArrowRight": () => step(Math.round(1 / run.interval)),
  "[": () => jump(-1),
  "]": () => jump(1),
  Home: () => step(-frames()),
  End: () => step(frames()),
  ",": () => change({ speed: SPEEDS[Math.max(SPEEDS.indexOf(state.speed) - 1, 0)]! }),
  ".": () => change({ speed: SPEEDS[Math.min(SPEEDS.indexOf(state.speed) + 1, SPEEDS.length - 1)]! }),
  c: () => change({ cam: after(CAMERAS, state.cam) }),
  s: () => change({ stretch: after<number>(STRETCHES, state.stretch) }),
  "+": () => zoom(1),
  "-": () => zoom(-1),
  g: () => change({ ghosts: !state.ghosts }),
  l: () => boardPlace.querySelector<HTMLElement>("button.law")?.focus(),
  b: () => document.querySelector<HTMLElement>("#what-if button")?.focus(),
  Escape: () => tellRule(null),
};

const KEYS: Record<string, () => void> = {
  j: () => void busy([content], other(1)),
  k: () => void busy([content], other(-1)),
  p: () => change({ policy: after(Object.keys(words.policies), state.policy) }),
  t: () => change({ theme: after(THEMES, state.theme) }),
  a: () => source.server && (location.hash = print({ ...moment(), sim: null }, source.policy)),
  "/": () => {
    if (state.sim === null) return all.focus();
    drawer.open = true;
    filter.focus();
  },
  "?": () => help.showModal(),
};

paint(words, state.theme);
build();
void busy([content], follow());
