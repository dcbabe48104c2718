// The list of simulations, and its filter by class.

import type { Bundle, Entry } from "./bundle.ts";
import { h } from "./dom.ts";
import { type Moment, print } from "./link.ts";
import { chip } from "./text.ts";

export interface List {
  filter: HTMLSelectElement;
  rows: HTMLElement;
  count: HTMLElement;
}

// The simulations that a class leaves.
export function entries(bundle: Bundle, moment: Moment): Entry[] {
  return bundle.simulations.filter((one) => !moment.filter || one.classes[moment.policy] === moment.filter);
}

// Fills the list. A class that no simulation has under the policy is not in the filter.
export function tellList(list: List, bundle: Bundle, moment: Moment): void {
  const counts = new Map<string, number>();
  for (const one of bundle.simulations) {
    const name = one.classes[moment.policy]!;
    counts.set(name, (counts.get(name) ?? 0) + 1);
  }
  const names = Object.keys(bundle.words.classes).filter((name) => counts.has(name));
  list.filter.replaceChildren(
    h("option", { value: "" }, `all (${bundle.simulations.length})`),
    ...names.map((name) => h("option", { value: name }, `${name} (${counts.get(name)})`)),
  );
  list.filter.value = moment.filter;
  const shown = entries(bundle, moment);
  list.count.textContent = `${shown.length} of ${bundle.simulations.length} shown`;
  list.rows.replaceChildren(...shown.map((one) => row(one, bundle, moment)));
}

function row(entry: Entry, bundle: Bundle, moment: Moment): HTMLElement {
  const isHere = entry.number === moment.sim;
  const where = print({ ...moment, sim: entry.number, t: 0 }, bundle.policy);
  const details = [entry.weather, `${entry.duration_s.toFixed(0)} s`].filter(Boolean).join(", ");
  return h(
    "li",
    {},
    h(
      "a",
      { href: where, "aria-current": isHere ? "true" : undefined, "data-sim": entry.number },
      h("span", { class: "number" }, String(entry.number)),
      chip(bundle.words, entry.classes[moment.policy]!),
      h("span", { class: "quiet" }, `${details}; ${entry.outcome}`),
    ),
  );
}
