// The page: state in one place; what it asks for; what it shows. Data flows from the state alone.

import { address } from "./address.ts";
import { clamp, clock } from "./clock.ts";
import { controls } from "./controls.ts";
import { courses } from "./courses.ts";
import { busy, h, write } from "./dom.ts";
import { helpDialog } from "./help.ts";
import { commonKeys, runKeys } from "./keymap.ts";
import { listen } from "./keys.ts";
import { beginning, print } from "./link.ts";
import { list } from "./list.ts";
import { overview } from "./overview.ts";
import { importReport } from "./report.ts";
import { connect } from "./source.ts";
import { stage } from "./stage.ts";
import { begin, frameAt, type Shown, type State, store } from "./state.ts";
import { telling } from "./telling.ts";
import type { Reader } from "./text.ts";
import { onSystemChange, paint } from "./theme.ts";
import { branched, LETTERS, whatIf } from "./whatif.ts";

// What the page tells beyond the moment depends on these.
const LASTING: (keyof State)[] = ["sim", "policy", "against", "branches", "beside", "fan"];

const source = await connect();
const { words } = source;
const policies = Object.keys(words.policies);

const content = h("main", {});
const wrong = h("p", { class: "failure", role: "alert" });
const here = store(begin(source.policy), react);
const { state, change } = here;
const shown = (): Shown | null => runs.shown(state);
const time = clock(here, shown);
const link = address(policies, source.policy, content);
const help = helpDialog();
const all = overview(source, here);
const narrow = list(source, here, all);
const tools = controls(source, here, time, () => help.showModal());
const road = stage(refresh);
const told = telling(shown, refresh, time.seek, (gone) => change({ branches: state.branches.filter((_, k) => LETTERS[k] !== gone.letter), base: null }));
const asks = source.server && whatIf(source.server, here, (what) => otherwise(what));
const runs = courses(source, content, {
  opened: (run) => {
    write(wrong, "");
    change({ sim: run.values.simulation, t: Math.round(frameAt(run, state.t)) * run.interval });
    runs.want(state);
    grown();
    reveal();
    void turned.then(() => narrow.around(run.values.simulation)); // While keys turn the list, its part is theirs.
  },
  grown,
  refused: (error, without) => {
    change(without);
    fail(error);
  },
});
const page = h("div", { class: "page", hidden: true }, narrow.element, content);

// When all that is wanted has come, the clock is within it.
function grown(): void {
  const now = shown();
  const isAll = now && now.branches.length === state.branches.length && (now.twin === null) === (state.beside === null);
  if (isAll) change({ t: clamp(now, now.frame) * now.run.interval });
  layAll();
}

// What follows from a change of the state.
function react(before: State): void {
  const changed = (Object.keys(state) as (keyof State)[]).filter((name) => state[name] !== before[name]);
  const has = (...names: (keyof State)[]): boolean => names.some((name) => changed.includes(name));
  if (changed.every((name) => name === "t")) refresh();
  else {
    if (has("theme")) paint(words, state.theme);
    if (has("sim")) reveal();
    if (has("choice")) all.choose(state.choice);
    if (has("choice", "policy", "sim")) narrow.want();
    else narrow.aim();
    runs.want(state);
    tools.tell(state);
    asks?.tell(state);
    if (has(...LASTING)) layAll();
    else refresh();
  }
  if (!state.playing) link.write(() => ({ ...state, t: rounded() }));
}

function rounded(): number {
  const now = shown();
  return now ? Math.round(now.frame) * now.run.interval : state.t;
}

function readerOf(now: Shown): Reader {
  return { run: now.run, words, policy: state.policy, seek: time.seek };
}

function layAll(): void {
  const now = shown();
  if (!now) return;
  document.title = `Simulation ${state.sim}, ${now.run.values.policies[state.policy]!.class} under ${state.policy} · ${source.title}`;
  told.lay(now, readerOf(now));
  refresh();
}

// What changes with time.
function refresh(): void {
  const now = shown();
  if (!now) return;
  const reader = readerOf(now);
  const text = told.tellTime(now, reader);
  road.draw(now, reader, text);
  tools.tellTime(now);
}

// Either a simulation, once it is here, or the list of all.
function reveal(): void {
  if (state.sim === null) document.title = `${source.title} · overtaking`;
  else if (!shown()) return;
  page.hidden = state.sim === null;
  all.element.hidden = state.sim !== null;
}

function otherwise(what: string): void {
  write(wrong, "");
  try {
    change(branched(state, { what, t: rounded() }));
  } catch (error) {
    fail(error);
  }
}

function fail(error: unknown): void {
  write(wrong, (error as Error).message);
  all.refuse((error as Error).message);
}

function follow(): void {
  const said = link.follow();
  change({ ...said, sim: said.sim ?? (source.server ? null : source.first) });
}

let turned = Promise.resolve();

// One after another: each goes on from where the last has led.
function other(way: 1 | -1): Promise<void> {
  return (turned = turned.then(async () => {
    const from = state.sim;
    if (from === null) return all.step(way);
    const sim = await narrow.beside(way);
    if (sim !== undefined && state.sim === from) change({ ...beginning(state, sim), playing: false, base: null });
  }));
}

// A link to what the address says already is no news to the browser; the state may have gone on.
function again(event: Event): void {
  const link = (event.target as Element).closest("a");
  if (link && link.hash === location.hash) follow();
}

function build(): void {
  const brand = h("p", { class: "brand" }, h("b", {}, source.title), h("span", {}, " seen by overtaking"));
  content.append(told.heading, h("div", { class: "clockwork" }, road.element, tools.slider, tools.element), asks?.element ?? "", wrong, ...told.parts, importReport(source.import_report) ?? "");
  document.body.append(h("header", { class: "top" }, brand, tools.tools), page, all.element, help);
  onSystemChange(() => paint(words, state.theme));
  window.addEventListener("hashchange", follow);
  document.addEventListener("click", again);
  const common = {
    ...commonKeys(here, policies),
    j: () => void busy([content], other(1)),
    k: () => void busy([content], other(-1)),
    a: () => source.server && (location.hash = print(beginning(state, null), source.policy)),
    "/": () => (state.sim === null ? all.focus() : narrow.focus()),
    "?": () => help.showModal(),
  };
  listen(common, () => help.open);
  listen({ ...runKeys(here, time, () => shown()!, source.server !== null), Escape: () => told.tellRule(null) }, () => help.open || !shown());
}

paint(words, state.theme);
build();
follow();
reveal();
narrow.want();
