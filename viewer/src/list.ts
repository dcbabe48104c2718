// The narrow list beside a simulation: a part of those that the choice leaves.

import type { Row, Words } from "./bundle.ts";
import { h, write } from "./dom.ts";
import { conditions, type Moment, print } from "./link.ts";
import { type Listed, PAGE, type Source } from "./source.ts";
import { chip } from "./text.ts";

export interface List {
  filter: HTMLSelectElement;
  rows: HTMLElement;
  count: HTMLElement;
}

// Fills the list. A class that no simulation has under the policy is not in the filter.
export function tellList(list: List, source: Source, listed: Listed, moment: Moment): void {
  const { words } = source;
  const counts = listed.counts.classes;
  const names = Object.keys(words.classes).filter((name) => counts[name] || moment.choice.classes.includes(name));
  const all = Object.values(counts).reduce((sum, one) => sum + one, 0);
  const several = moment.choice.classes.length > 1;
  list.filter.replaceChildren(
    h("option", { value: "" }, `all (${thousands(all)})`),
    several ? h("option", { value: "several" }, moment.choice.classes.join(", ")) : null!,
    ...names.map((name) => h("option", { value: name }, `${name} (${thousands(counts[name] ?? 0)})`)),
  );
  list.filter.value = several ? "several" : (moment.choice.classes[0] ?? "");
  const others = conditions({ ...moment.choice, classes: [] });
  const more = others ? `, with ${others} more ${others > 1 ? "conditions" : "condition"}` : "";
  const part = listed.found > listed.rows.length ? `${thousands(listed.first + 1)} to ${thousands(listed.first + listed.rows.length)} of ` : "";
  write(list.count, `${part}${thousands(listed.found)} of ${thousands(listed.total)} shown${more}`);
  list.rows.replaceChildren(...listed.rows.map((one) => row(one, words, moment, source.policy)));
  const here = list.rows.querySelector<HTMLElement>("[aria-current]");
  if (here) list.rows.scrollTop = here.offsetTop - list.rows.clientHeight / 2;
}

function row(entry: Row, words: Words, moment: Moment, policy: string): HTMLElement {
  const where = print({ ...moment, sim: entry.number, t: 0, branches: [] }, policy);
  return h(
    "li",
    {},
    h(
      "a",
      { href: where, "aria-current": entry.number === moment.sim ? "true" : undefined, "data-sim": entry.number },
      h("span", { class: "number" }, String(entry.number)),
      chip(words, entry.classes[moment.policy]!),
      h("span", { class: "quiet" }, `${about(entry)}; ${entry.outcome}`),
    ),
  );
}

export function about(entry: Row): string {
  return [entry.weather, `${entry.duration_s.toFixed(0)} s`].filter(Boolean).join(", ");
}

export function thousands(count: number): string {
  return count.toLocaleString("en");
}

// First row of the part before or after; null where there is none.
export function beyond(listed: Listed, way: 1 | -1): number | null {
  const first = listed.first + way * PAGE;
  return first < 0 || first >= listed.found ? null : first;
}
