// What if, at the cursor: buttons for decisions and weathers, and what each branch has changed.

import type { Words } from "./bundle.ts";
import { h, put, refill } from "./dom.ts";
import { type Change, GIVEN, MOST_BRANCHES, MOST_CHANGES } from "./link.ts";
import type { Server } from "./source.ts";
import type { Branch, Shown, Store } from "./state.ts";
import { chip } from "./text.ts";

export const LETTERS = "abcd";

const FANS: Record<(typeof GIVEN)[number], string> = {
  truth: "fan: hindsight",
  belief: "fan: its decision",
};

export interface WhatIf {
  element: HTMLElement;
  tell: (state: Store["state"]) => void;
}

// Adds a change at a time to the course that is chosen.
export function branched(state: Store["state"], change: Change): Pick<Store["state"], "branches"> {
  const before = state.base === null ? [] : (state.branches[state.base] ?? []);
  if (state.branches.length >= MOST_BRANCHES) throw new Error("Four branches are shown: drop one first.");
  if (before.length >= MOST_CHANGES) throw new Error("A branch has four changes at most.");
  return { branches: [...state.branches, [...before, change]] };
}

export function whatIf(server: Server, store: Store, add: (what: string) => void): WhatIf {
  const buttons = Object.entries(server.decisions).map(([name, about]) =>
    h("button", { type: "button", "data-what": name, title: about, "aria-label": `What if: ${about}`, click: () => add(name) }, name.toLowerCase().replace("_", " ")),
  );
  const weather = h("select", { id: "other-weather", "aria-label": "What if: other weather" }, h("option", { value: "" }, "other weather …"), ...server.weathers.map((one) => h("option", { value: one }, one)));
  weather.addEventListener("change", () => {
    if (weather.value) add(weather.value);
    weather.value = "";
  });
  const base = h("select", { id: "base", "aria-label": "What if: the course that goes on otherwise", hidden: true });
  base.addEventListener("change", () => store.change({ base: base.value === "" ? null : Number(base.value) }));
  const fan = h("select", { id: "fan", "aria-label": "What if: it began at another instant", title: "Shares of the classes among 25 futures of a start at each instant, with the others as they are (hindsight), or by what the ego notices (its decision)" }, h("option", { value: "" }, "no fan"), ...GIVEN.map((one) => h("option", { value: one }, FANS[one])));
  fan.addEventListener("change", () => store.change({ fan: GIVEN.find((one) => one === fan.value) ?? null }));
  const element = h("div", { class: "transport", role: "group", "aria-label": "What if, from here on", id: "what-if" }, h("b", {}, "What if, from here on"), base, ...buttons, weather, fan);
  return {
    element,
    tell: (state) => {
      const places = ["", ...state.branches.keys()];
      refill(base, places, String, (k) => h("option", { value: k }, k === "" ? "in the original" : `in branch ${LETTERS[k as number]}`));
      base.hidden = !state.branches.length;
      put(base, String(state.base ?? ""));
      put(fan, state.fan ?? "");
    },
  };
}

// What the branches have changed, in words.
export function tellCards(place: Element, shown: Shown, seek: (frame: number) => void, drop: (one: Branch) => void): void {
  const { branches, words, state } = shown;
  refill(place, branches, (one) => JSON.stringify([one.letter, one.changes, shown.run.values.simulation, state.policy]), (one) => card(one, words, state.policy, seek, drop));
}

function card(one: Branch, words: Words, policy: string, seek: (frame: number) => void, drop: (one: Branch) => void): HTMLElement {
  const time = (frame: number): string => `${(frame * one.run.interval).toFixed(2)} s`;
  const { parts } = one;
  return h(
    "article",
    { class: `branch branch-${one.letter}`, "data-branch": one.letter },
    h("button", { type: "button", class: "close", "aria-label": `Drop branch ${one.letter}`, click: () => drop(one) }, "×"),
    h("h2", {}, h("span", { class: "letter" }, one.letter), ` ${one.title} `, chip(words, one.run.values.policies[policy]!.class)),
    parts === null ? null : h("p", { class: "quiet" }, "It goes another way from ", h("button", { type: "button", class: "moment", click: () => seek(parts) }, time(parts)), " on."),
    h("ul", {}, ...one.said.map((text) => h("li", {}, text))),
  );
}
