// All simulations of a data set: filters with counts that follow, a table, SQL.

import type { Row, Thumbnail, Words } from "./bundle.ts";
import { busy, field, h, put, refill, svg, table, write } from "./dom.ts";
import { durationWords, isShort } from "./durations.ts";
import { bound, type Choice, conditions, type Facet, FACETS, noChoice, ORDERS } from "./link.ts";
import { aim, beyond, thousands } from "./list.ts";
import { importReport } from "./report.ts";
import type { Answer, Listed, Source } from "./source.ts";
import type { State, Store } from "./state.ts";
import { chip } from "./text.ts";

const TITLES: Record<Facet, string> = { classes: "Class", rules: "Broken rules, all of them", weather: "Weather", light: "Light", ego: "Ego", overtaken: "Vehicle to overtake" };
const ORDER_WORDS = { number: "number", duration: "duration", margin: "margin of the rule below" };
const THUMB = { width: 150, height: 44 };
const FAR = 80; // [m]

export interface Overview {
  element: HTMLElement;
  rows: HTMLElement;
  // What is chosen, at once; what the answer to it is.
  choose: (choice: Choice) => void;
  tell: (listed: Listed, state: Readonly<State>) => void;
  // Of the list; of something else that was asked for, until the next choice.
  fail: (text: string) => void;
  refuse: (text: string) => void;
  focus: () => void;
  step: (way: 1 | -1) => void;
}

// One value of a property: its box, and how many simulations have it.
interface Value {
  facet: Facet;
  name: string;
  box: HTMLInputElement;
  count: HTMLElement;
  bar: HTMLElement;
  line: HTMLElement;
}

export function overview(source: Source, store: Store): Overview {
  const { words } = source;
  const trouble = h("p", { class: "failure", role: "alert" });
  const choose = (part: Partial<Choice>): void => {
    write(trouble, "");
    // From the state, not from the last answer: people choose faster than servers answer.
    store.change({ choice: { ...store.state.choice, first: 0, ...part } });
  };
  const values = FACETS.flatMap((facet) => names(source, facet).map((name) => value(words, facet, name, (isChosen) => {
    const rest = store.state.choice[facet].filter((one) => one !== name);
    choose({ [facet]: isChosen ? [...rest, name] : rest });
  })));
  const groups = FACETS.map((facet) => {
    const own = values.filter((one) => one.facet === facet);
    return h("fieldset", { class: `facet ${facet}` }, h("legend", {}, TITLES[facet]), h("div", { class: "choices" }, ...own.map((one) => one.line)));
  });
  const margin = marginFields(words, choose);
  const order = h("select", { id: "order" }, ...ORDERS.map((one) => h("option", { value: one }, `by ${ORDER_WORDS[one]}`)));
  const falling = h("input", { type: "checkbox", id: "falling" });
  order.addEventListener("change", () => choose({ order: order.value as Choice["order"] }));
  falling.addEventListener("change", () => choose({ descending: falling.checked }));
  const clear = h("button", { type: "button", id: "clear", click: () => choose(noChoice()) }, "Clear all");
  const count = h("p", { class: "found", role: "status" });
  const reading = h("small", {});
  const failure = h("p", { class: "failure", role: "alert" });
  const body = h("tbody", { role: "rowgroup" });
  const pages = [-1, 1].map((way) => h("button", { type: "button", click: () => turn(way as 1 | -1) }, way < 0 ? "‹ before" : "next ›"));
  const sql = sqlFields(source, choose, (text) => write(failure, text));
  let listed: Listed | null = null;
  let drawing = 0;
  const turn = (way: 1 | -1): void => {
    const first = listed && beyond(listed, store.state.choice.first, way);
    if (first !== null) store.change({ choice: { ...store.state.choice, first } });
  };
  const head = ["", "class", `along the road, ${FAR}\u00a0m ahead of and behind the ego`, "length", "weather", "broken rules (in brackets: not counted)", "outcome"];
  const element = h(
    "div",
    { class: "overview", hidden: true },
    h("aside", { "aria-label": "Filters" }, h("details", { class: "drawer", open: !matchMedia("(max-width: 60rem)").matches }, h("summary", {}, "Filters"), clear, ...groups, margin.element, sql.element)),
    h(
      "main",
      {},
      h("div", { class: "list-head" }, h("h1", { tabindex: -1 }, source.title, " ", reading), count, h("label", { class: "field", for: "order" }, "Sort "), order, h("label", { class: "check", for: "falling" }, falling, " falling")),
      failure,
      trouble,
      h("div", { class: "wide", tabindex: 0, role: "region", "aria-label": "Simulations" }, h("table", { class: "simulations", role: "table" }, h("thead", { role: "rowgroup" }, h("tr", { role: "row" }, ...head.map((one) => h("th", { scope: "col", role: "columnheader" }, one || h("span", { class: "unseen" }, "number"))))), body)),
      h("p", { class: "quiet brackets" }, "Rules in brackets are broken and not counted by the policy."),
      h("nav", { class: "pages", "aria-label": "Parts of the list" }, ...pages),
      importReport(source.import_report),
    ),
  );

  async function thumbnails(rows: Row[]): Promise<void> {
    const ticket = ++drawing;
    for (const one of rows) {
      if (ticket !== drawing || element.hidden) return;
      const place = body.querySelector(`[data-thumb="${one.number}"]:empty`);
      if (!place) continue;
      const found = await source.server!.thumbnail(one.number).catch(() => null);
      if (found) place.replaceChildren(picture(found, words));
    }
  }

  return {
    element,
    rows: body,
    fail: (text) => write(failure, text),
    refuse: (text) => write(trouble, text),
    focus: () => element.querySelector<HTMLElement>(".facet input")?.focus(),
    step: (way) => {
      const links = [...body.querySelectorAll("a")];
      const at = links.indexOf(document.activeElement as HTMLAnchorElement);
      links[Math.min(Math.max(at + way, 0), links.length - 1)]?.focus();
    },
    choose: (choice) => {
      for (const { facet, name, box, line } of values) {
        box.checked = choice[facet].includes(name);
        if (box.checked) line.hidden = false;
      }
      margin.tell(choice);
      sql.tell(choice);
      put(order, choice.order);
      falling.checked = choice.descending;
      clear.hidden = !conditions(choice);
    },
    tell: (found, state) => {
      listed = found;
      tellCounts(values, found);
      const progress = found.read < found.total ? ` (${thousands(found.read)} read so far)` : "";
      write(count, `${thousands(found.found)} of ${thousands(found.total)} simulations${progress}`);
      write(reading, `classes under the policy ${state.policy}`);
      write(failure, found.failure);
      pages.forEach((one, k) => (one.disabled = beyond(found, found.first, k ? 1 : -1) === null));
      const kept = document.activeElement?.getAttribute("data-sim");
      refill(body, found.rows, (one) => JSON.stringify([one, state.policy]), (one) => tableRow(one, words, state.policy));
      aim(body, state, source.policy);
      if (kept) body.querySelector<HTMLElement>(`[data-sim="${kept}"]`)?.focus();
      void thumbnails(found.rows);
    },
  };
}

function names(source: Source, facet: Facet): string[] {
  const { words, server } = source;
  if (facet === "classes") return Object.keys(words.classes);
  if (facet === "rules") return Object.keys(words.rules);
  if (facet === "weather") return [...(server?.weathers ?? []), "drawn freely"];
  return facet === "light" ? ["day", "night"] : Object.keys(words.kinds ?? {});
}

function value(words: Words, facet: Facet, name: string, changed: (isChosen: boolean) => void): Value {
  const box = h("input", { type: "checkbox", id: `${facet}-${name}`, change: () => changed(box.checked) });
  const count = h("span", { class: "many" });
  const bar = h("i", { "aria-hidden": true });
  const rule = facet === "rules" ? words.rules[name] : undefined;
  const text = facet === "classes" ? chip(words, name) : h("span", { class: "name" }, rule ? `${name} ${rule.title}` : (words.kinds?.[name] ?? name), rule ? h("small", {}, ` ${rule.law}`) : null);
  return { facet, name, box, count, bar, line: h("label", { class: "choice", for: box.id, title: rule?.gloss }, box, text, count, bar) };
}

function tellCounts(values: Value[], listed: Listed): void {
  for (const one of values) {
    const counts = listed.counts[one.facet] ?? {};
    const many = counts[one.name] ?? 0;
    const most = Math.max(...Object.values(counts), 1);
    one.line.hidden = !many && !one.box.checked && one.box !== document.activeElement;
    write(one.count, thousands(many));
    one.bar.style.setProperty("--share", String(many / most));
  }
  for (const facet of FACETS) {
    const own = values.filter((one) => one.facet === facet);
    own[0]?.line.closest("fieldset")?.toggleAttribute("hidden", own.every((one) => one.line.hidden));
  }
}

function marginFields(words: Words, choose: (part: Partial<Choice>) => void): { element: HTMLElement; tell: (choice: Choice) => void } {
  const rule = h("select", { id: "margin-rule", "aria-label": "Rule whose margin is bounded" }, h("option", { value: "" }, "no rule"), ...Object.entries(words.rules).map(([code, one]) => h("option", { value: code }, `${code} ${one.title}`)));
  const [least, most] = ["Least margin", "Largest margin"].map((label) => field({ step: "any", "aria-label": label, title: label })) as [HTMLInputElement, HTMLInputElement];
  const unit = h("span", { class: "quiet" });
  const changed = (): void => choose({ margin: rule.value ? { rule: rule.value, least: bound(least.value), most: bound(most.value) } : null });
  for (const one of [rule, least, most]) one.addEventListener("change", changed);
  const element = h("fieldset", { class: "facet" }, h("legend", {}, "Margin of a rule (negative: broken)"), rule, h("div", { class: "between" }, least, " to ", most, " ", unit));
  return {
    element,
    tell: ({ margin }) => {
      put(rule, margin?.rule ?? "");
      put(least, String(margin?.least ?? ""));
      put(most, String(margin?.most ?? ""));
      least.disabled = most.disabled = !margin;
      write(unit, margin ? (words.rules[margin.rule]?.unit ?? "") : "");
    },
  };
}

function sqlFields(source: Source, choose: (part: Partial<Choice>) => void, fail: (text: string) => void): { element: HTMLElement; tell: (choice: Choice) => void } {
  const text = h("textarea", { id: "sql", rows: 4, spellcheck: "false", "aria-label": "Query in SQL", placeholder: "SELECT simulation FROM safety WHERE leader_ttc_s < 1.5" });
  const answer = h("div", { class: "answer" });
  let asking = 0;
  let chosen = ""; // The condition that was put into the text last.
  const run = async (): Promise<void> => {
    const [ticket, asked] = [++asking, text.value];
    fail("");
    answer.replaceChildren(h("p", { class: "quiet" }, "asking …"));
    try {
      const found = await source.server!.sql(asked);
      if (ticket !== asking) return;
      answer.replaceChildren(...told(found));
      if (found.filters) choose({ sql: (chosen = asked) });
    } catch (error) {
      if (ticket !== asking) return;
      answer.replaceChildren();
      fail((error as Error).message);
    }
  };
  const ask = h("button", { type: "button", id: "ask", click: () => void busy([answer], run()) }, "Ask");
  const drop = h("button", { type: "button", hidden: true, click: () => choose({ sql: "" }) }, "Drop this condition");
  const element = h("details", { class: "facet sql" }, h("summary", {}, "SQL"), h("p", { class: "quiet" }, "One SELECT over the tables of the data set. A column named simulation filters the list."), text, h("div", { class: "between" }, ask, drop), answer);
  return {
    element,
    tell: ({ sql }) => {
      drop.hidden = !sql;
      if (sql && sql !== chosen) {
        text.value = sql;
        element.open = true;
      }
      chosen = sql;
    },
  };
}

function told(found: Answer): Node[] {
  const cut = found.is_cut ? "more than " : "";
  const cells = found.rows.slice(0, 20).map((row) => row.map((one) => (one === null ? "–" : String(one))));
  const note = `${cut}${thousands(found.num_rows)} rows${found.filters ? ", which filter the list" : ""}`;
  return [h("p", { class: "quiet" }, note), table("First rows of the answer", found.columns, cells)];
}

function tableRow(one: Row, words: Words, policy: string): HTMLElement {
  // With roles, as rows are laid out as cards on a phone.
  const cell = (name: string, ...content: (Node | string)[]): HTMLElement => h("td", { role: "cell", class: name }, ...content);
  return h(
    "tr",
    { role: "row" },
    h("th", { scope: "row", role: "rowheader" }, h("a", { "data-sim": one.number, "aria-label": `Simulation ${one.number}` }, String(one.number))),
    cell("class", chip(words, one.classes[policy]!)),
    h("td", { role: "cell", class: "thumb", "data-thumb": one.number }),
    cell("figure", h(isShort(words, one.duration_s) ? "small" : "span", { class: "length" }, durationWords(words, one, 1))),
    cell("weather", `${one.night ? "☾" : "☀"} ${one.weather ?? ""}`),
    cell("codes", ...ruleCodes(one.broken, words.policies[policy]!.required)),
    cell("outcome", one.outcome),
  );
}

// The broken rules that the policy counts, then the others in brackets.
function ruleCodes(broken: string[], required: string[]): (Node | string)[] {
  const counted = broken.filter((code) => required.includes(code));
  const others = broken.filter((code) => !required.includes(code));
  const codes = [
    ...counted.map((code) => h("span", { class: "counted-rule" }, code)),
    ...others.map((code) => h("span", { class: "other-rule", title: "broken, not counted by the policy" }, `(${code})`)),
  ];
  return codes.length ? codes.flatMap((code) => [code, " "]) : ["–"];
}

// Time runs to the right, the road upwards; the ego is the line in the middle.
function picture(thumb: Thumbnail, words: Words): SVGElement {
  const { width, height } = THUMB;
  const x = (k: number): number => (k / Math.max(thumb.lane.length - 1, 1)) * width;
  const y = (metres: number): number => height / 2 - (metres / FAR) * (height / 2);
  const lines = thumb.lines.toSorted((a, b) => Number(a.target) - Number(b.target)).map(({ target, ahead }) => {
    let down = false;
    const d = ahead.map((one, k) => {
      const text = one === null ? "" : `${down ? "L" : "M"}${x(k).toFixed(1)} ${y(one).toFixed(1)}`;
      down = one !== null;
      return text;
    });
    return svg("path", { d: d.join(""), class: target ? "curve target" : "curve faint" });
  });
  const stages = thumb.stages.map(([name, from, to]) => svg("rect", { x: from * width, width: Math.max((to - from) * width, 0.5), y: height - 4, height: 4, fill: words.stages[name]?.colour ?? "none" }));
  return svg("svg", { width, height, viewBox: `0 0 ${width} ${height}`, "aria-hidden": "true" }, ...stages, svg("line", { x1: 0, x2: width, y1: height / 2, y2: height / 2, class: "curve ego" }), ...lines);
}
