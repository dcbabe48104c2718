// The list of simulations: what is asked for, and the narrow one beside a simulation.

import type { Row, Words } from "./bundle.ts";
import { busy, h, put, refill, write } from "./dom.ts";
import { durationWords } from "./durations.ts";
import { beginning, conditions, type Moment, print } from "./link.ts";
import type { Overview } from "./overview.ts";
import { type Listed, PAGE, type Source } from "./source.ts";
import type { Store } from "./state.ts";
import { chip } from "./text.ts";

const READING_DELAY = 400; // [ms]; until the list is asked for again while its data set is read.

export interface List {
  element: HTMLElement;
  // Ask for what the state wants, unless it is there; tell what is there.
  want: () => void;
  // The same, and the part that has a simulation.
  around: (sim: number) => void;
  // Let links lead on from the state: camera, policies and conditions stay.
  aim: () => void;
  // The number of the simulation before or after, also beyond the part that is there.
  beside: (way: 1 | -1) => Promise<number | undefined>;
  focus: () => void;
}

export function list(source: Source, store: Store, all: Overview): List {
  const filter = h("select", { id: "filter" });
  const rows = h("ol", { class: "runs" });
  const count = h("p", { class: "quiet", role: "status" });
  const toAll = h("a", { id: "all", href: "#" }, "‹ All simulations and filters");
  const isWide = !matchMedia("(max-width: 60rem)").matches;
  const drawer = h("details", { class: "drawer", open: isWide }, h("summary", {}, "Simulations"), h("div", {}, source.server ? toAll : null, h("label", { for: "filter" }, "Class"), filter, count, rows));
  filter.addEventListener("change", () => store.change({ choice: { ...store.state.choice, first: 0, classes: filter.value ? [filter.value] : [] } }));
  let listed: Listed | null = null;
  let asked = ""; // What the list was asked for last.
  let asking = 0;
  let latest = Promise.resolve();

  const key = (): string => JSON.stringify([store.state.choice, store.state.policy]);
  const has = (sim: number): boolean => !!listed?.rows.some((one) => one.number === sim);

  async function ask(around?: number): Promise<void> {
    const ticket = ++asking;
    asked = key();
    try {
      const found = await source.rows(store.state.choice, store.state.policy, around);
      if (ticket !== asking) return;
      listed = found;
    } catch (error) {
      if (ticket !== asking) return;
      asked = "";
      all.fail((error as Error).message);
      return;
    }
    if (listed.first !== store.state.choice.first) {
      const choice = { ...store.state.choice, first: listed.first };
      asked = JSON.stringify([choice, store.state.policy]);
      store.change({ choice });
    }
    tell();
    if (listed.read < listed.total && !listed.failure) setTimeout(() => ticket === asking && void again(), READING_DELAY);
  }

  // The part that has the simulation may be another by now.
  function again(): Promise<void> {
    const { sim } = store.state;
    return ask(sim !== null && has(sim) ? sim : undefined);
  }

  const askBusy = (around?: number): Promise<void> => (latest = busy([all.rows, rows], ask(around)));

  function tell(): void {
    if (!listed) return;
    if (store.state.sim === null) all.tell(listed, store.state);
    else tellList({ filter, rows, count }, source, listed, store.state);
    aimAll();
  }

  function aimAll(): void {
    const { state } = store;
    toAll.href = print(beginning(state, null), source.policy);
    aim(state.sim === null ? all.rows : rows, state, source.policy);
  }

  return {
    element: h("nav", { "aria-label": "Simulations" }, drawer),
    want: () => (key() === asked ? tell() : void askBusy()),
    around: async (sim) => {
      await latest; // It may have the simulation.
      if (store.state.sim === sim) void (key() === asked && has(sim) ? tell() : askBusy(sim));
    },
    aim: aimAll,
    beside: async (way) => {
      const { sim } = store.state;
      await latest;
      if (sim !== null && !has(sim)) await askBusy(sim); // The list failed, or is another part.
      if (!listed) return undefined;
      const place = listed.rows.findIndex((one) => one.number === store.state.sim);
      const next = listed.rows[place + way];
      if (next) return next.number;
      const first = beyond(listed, listed.first, way);
      if (first === null) return listed.found <= listed.rows.length ? listed.rows.at(way > 0 ? 0 : -1)?.number : undefined;
      store.change({ choice: { ...store.state.choice, first } });
      await latest;
      return listed.first === first ? listed.rows.at(way > 0 ? 0 : -1)?.number : undefined;
    },
    focus: () => {
      drawer.open = true;
      filter.focus();
    },
  };
}

interface Places {
  filter: HTMLSelectElement;
  rows: HTMLElement;
  count: HTMLElement;
}

// Fills the list. A class that no simulation has under the policy is not in the filter.
function tellList(list: Places, source: Source, listed: Listed, moment: Moment): void {
  const { words } = source;
  const counts = listed.counts.classes;
  const names = Object.keys(words.classes).filter((name) => counts[name] || moment.choice.classes.includes(name));
  const all = Object.values(counts).reduce((sum, one) => sum + one, 0);
  const several = moment.choice.classes.length > 1;
  const texts = new Map([["", `all (${thousands(all)})`]]);
  if (several) texts.set("several", moment.choice.classes.join(", "));
  for (const name of names) texts.set(name, `${name} (${thousands(counts[name] ?? 0)})`);
  refill(list.filter, [...texts.keys()], String, (name) => h("option", { value: name }));
  for (const one of list.filter.options) write(one, texts.get(one.value)!);
  put(list.filter, several ? "several" : (moment.choice.classes[0] ?? ""));
  const others = conditions({ ...moment.choice, classes: [] });
  const more = others ? `, with ${others} more ${others > 1 ? "conditions" : "condition"}` : "";
  const part = listed.found > listed.rows.length ? `${thousands(listed.first + 1)} to ${thousands(listed.first + listed.rows.length)} of ` : "";
  write(list.count, `${part}${thousands(listed.found)} of ${thousands(listed.total)} shown${more}`);
  refill(list.rows, listed.rows, (one) => JSON.stringify([one, moment.policy]), (one) => row(one, words, moment.policy));
  const before = list.rows.querySelector("[aria-current]");
  const here = list.rows.querySelector<HTMLElement>(`[data-sim="${moment.sim}"]`);
  if (before === here) return;
  before?.removeAttribute("aria-current");
  here?.setAttribute("aria-current", "true");
  if (here) list.rows.scrollTop = here.offsetTop - list.rows.clientHeight / 2;
}

// Where the links of a list lead to.
export function aim(rows: Element, moment: Moment, policy: string): void {
  for (const one of rows.querySelectorAll<HTMLAnchorElement>("a[data-sim]")) one.href = print(beginning(moment, Number(one.dataset["sim"])), policy);
}

function row(entry: Row, words: Words, policy: string): HTMLElement {
  return h(
    "li",
    {},
    h(
      "a",
      { "data-sim": entry.number },
      h("span", { class: "number" }, String(entry.number)),
      chip(words, entry.classes[policy]!),
      h("span", { class: "quiet" }, `${about(entry, words)}; ${entry.outcome}`),
    ),
  );
}

function about(entry: Row, words: Words): string {
  return [entry.weather, durationWords(words, entry, 0)].filter(Boolean).join(", ");
}

export function thousands(count: number): string {
  return count.toLocaleString("en");
}

// First row of the part before or after; null where there is none.
export function beyond(listed: Listed, from: number, way: 1 | -1): number | null {
  const first = from + way * PAGE;
  return first < 0 || first >= listed.found ? null : first;
}
