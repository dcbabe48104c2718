// What if, at the cursor: buttons for decisions and weathers, and what each branch has changed.

import type { Overlay, Words } from "./bundle.ts";
import { h } from "./dom.ts";
import { MOST_BRANCHES } from "./link.ts";
import type { Branched, Server } from "./source.ts";
import { chip } from "./text.ts";

const LETTERS = "abcd";

export interface Branch extends Branched, Overlay {
  what: string;
}

// The first letter that no branch has.
export function letter(branches: Branch[]): string {
  return [...LETTERS].find((one) => branches.every((other) => other.letter !== one)) ?? LETTERS[0]!;
}

export function controls(server: Server, add: (what: string) => void): HTMLElement {
  const buttons = Object.entries(server.decisions).map(([name, about]) =>
    h("button", { type: "button", "data-what": name, title: about, "aria-label": `What if: ${about}`, click: () => add(name) }, name.toLowerCase().replace("_", " ")),
  );
  const weather = h("select", { id: "other-weather", "aria-label": "What if: other weather" }, h("option", { value: "" }, "other weather …"), ...server.weathers.map((one) => h("option", { value: one }, one)));
  weather.addEventListener("change", () => {
    if (weather.value) add(weather.value);
    weather.value = "";
  });
  return h("div", { class: "transport", role: "group", "aria-label": "What if, from here on", id: "what-if" }, h("b", {}, "What if, from here on"), ...buttons, weather);
}

export function isFull(branches: Branch[]): boolean {
  return branches.length >= MOST_BRANCHES;
}

// What the branches have changed, in words.
export function cards(branches: Branch[], words: Words, policy: string, seek: (frame: number) => void, drop: (one: Branch) => void): HTMLElement[] {
  return branches.map((one) => {
    const time = (frame: number): string => `${(frame * one.run.interval).toFixed(2)} s`;
    const parts = one.parts;
    return h(
      "article",
      { class: `branch branch-${one.letter}`, "data-branch": one.letter },
      h("button", { type: "button", class: "close", "aria-label": `Drop branch ${one.letter}`, click: () => drop(one) }, "×"),
      h("h2", {}, h("span", { class: "letter" }, one.letter), ` ${one.title} at ${time(one.frame)} `, chip(words, one.run.values.policies[policy]!.class)),
      parts === null ? null : h("p", { class: "quiet" }, "It goes another way from ", h("button", { type: "button", class: "moment", click: () => seek(parts) }, time(parts)), " on."),
      h("ul", {}, ...one.said.map((text) => h("li", {}, text))),
    );
  });
}
