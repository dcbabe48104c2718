// A simulation in words and on the axis of time: title, board, the chosen rule, branches, tables.

import { board, type Board } from "./board.ts";
import { button, h, write } from "./dom.ts";
import { fanWords } from "./fan.ts";
import { difference } from "./policies.ts";
import { frames, overlays, type Branch, type Shown } from "./state.ts";
import { chip, facts, describeFrame, numbers, type Reader, ruleCard, sections } from "./text.ts";
import { tellCards } from "./whatif.ts";

const LEAST_WIDTH = 120; // [px]

export interface Telling {
  heading: HTMLElement;
  parts: HTMLElement[];
  // All anew; what is told of the moment.
  lay: (shown: Shown, reader: Reader) => void;
  tellTime: (shown: Shown, reader: Reader) => string;
  tellRule: (code: string | null) => void;
}

export function telling(shown: () => Shown | null, redraw: () => void, seek: (frame: number) => void, drop: (one: Branch) => void): Telling {
  const title = h("h1", { tabindex: -1 });
  const about = h("div", { class: "about" });
  const said = h("p", { id: "now", role: "status", "aria-live": "polite" });
  const futures = h("p", { id: "futures", class: "unseen", role: "status", "aria-live": "polite" });
  const changes = h("section", { id: "branches", "aria-label": "What if", "aria-live": "polite" });
  const place = h("div", { id: "board" });
  const card = h("div", { id: "rule", class: "card", role: "status" });
  const table = h("details", { class: "numbers" }, h("summary", {}, "All vehicles at this moment, in numbers"));
  const tellings = h("div", { class: "tellings" });
  let chart: Board | null = null;
  let rule: string | null = null;
  let told: Pick<Shown, "run"> & Pick<Shown["state"], "policy" | "against"> | null = null;
  let width = 0; // Of the board when it was laid out [px].
  let reader: Reader;

  function lay(here: Shown, by: Reader): void {
    const { run, state } = here;
    if (told?.run !== run) rule = null;
    const isTold = told?.run === run && told.policy === state.policy && told.against === state.against;
    reader = by;
    told = { run, policy: state.policy, against: state.against };
    if (!isTold) layWords(here);
    tellCards(changes, here, seek, drop);
    layBoard(here);
  }

  // What does not depend on other courses.
  function layWords({ run, state, words }: Shown): void {
    const name = (policy: string): Node => chip(words, run.values.policies[policy]!.class);
    const both = state.against === null ? [name(state.policy)] : [state.policy, state.against].map((one) => h("span", { class: "pair" }, h("small", {}, one), " ", name(one)));
    title.replaceChildren(`Simulation ${run.values.simulation} `, ...both, state.against === null ? h("small", {}, `under the policy ${state.policy}`) : "");
    const meaning = state.against === null ? h("p", { class: "meaning" }, words.classes[run.values.policies[state.policy]!.class]!.meaning) : difference(reader, state.against);
    about.replaceChildren(meaning, facts(reader));
    tellings.replaceChildren(...sections(reader));
  }

  function layBoard(here: Shown): void {
    const held = document.activeElement?.getAttribute("data-rule");
    const gutter = parseFloat(getComputedStyle(place).getPropertyValue("--gutter"));
    width = place.clientWidth;
    const { run, words, state, fan } = here;
    const plots = Math.max(Math.floor(width - gutter), LEAST_WIDTH);
    const { policy, against } = state;
    chart = board({ run, words, policy, against, fan, width: plots, seek, tellRule, overlays: overlays(here), frames: frames(here) });
    place.replaceChildren(chart.element);
    if (held) place.querySelector<HTMLElement>(`[data-rule="${held}"]`)?.focus();
    tellRule(rule);
  }

  // What is said of a rule, below its row; nothing, if none is chosen.
  function tellRule(code: string | null): void {
    rule = code;
    const row = rule === null ? null : place.querySelector(`[data-rule="${rule}"]`)?.closest(".row");
    if (rule !== null && row) {
      card.replaceChildren(button("Close", "×", () => tellRule(null), "Esc"), ...ruleCard(reader, rule));
      row.after(card);
    } else card.remove();
    for (const one of place.querySelectorAll("[data-rule]")) one.setAttribute("aria-pressed", String(one.getAttribute("data-rule") === rule));
  }

  // The moment in words.
  function tellTime(here: Shown, by: Reader): string {
    chart?.update(here.frame);
    if (!here.state.playing) write(futures, here.fan ? fanWords(here.fan, here.state.t) : "");
    const text = describeFrame(by, here.frame);
    said.setAttribute("aria-live", here.state.playing ? "off" : "polite");
    write(said, text);
    if (table.open && !here.state.playing) table.replaceChildren(table.firstElementChild!, numbers(by, here.frame));
    return text;
  }

  // Here, as the board may be laid out anew while it is held.
  place.addEventListener("pointerdown", (event) => {
    if (!(event.target as Element).closest(".field")) return;
    place.setPointerCapture(event.pointerId);
    chart?.point(event);
  });
  place.addEventListener("pointermove", (event) => {
    if (place.hasPointerCapture(event.pointerId)) chart?.point(event);
  });
  table.addEventListener("toggle", redraw);
  new ResizeObserver(() => {
    const here = shown();
    if (!here || !chart || place.clientWidth === width) return;
    layBoard(here);
    redraw();
  }).observe(place);
  return { heading: h("div", { class: "heading" }, title, about), parts: [said, futures, changes, place, table, tellings], lay, tellTime, tellRule };
}
