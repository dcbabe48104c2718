// Two policies side by side: what each counts, over time and in words.

import { breachSpans, isBroken } from "./board.ts";
import { h, svg, write } from "./dom.ts";
import { type Needs, plot, type Row, row, xOf } from "./row.ts";
import type { Reader } from "./text.ts";

const STRIP = 30;

// When a policy counts something as broken.
export function policyRow(needs: Needs, policy: string): Row {
  const { run, words } = needs;
  const x = xOf(needs);
  const counted = run.law.filter((one) => one.breach && words.policies[policy]!.required.includes(one.rule));
  const spans = counted.flatMap((one) => breachSpans(one).map(([first, last]) => {
    const from = Math.min(x(first), needs.width - 4);
    return svg("rect", { x: from, y: 5, width: Math.max(x(last) - from, 4), height: STRIP - 10, rx: 3, class: "counted" });
  }));
  const value = h("span", { class: "value" });
  const label = h("div", { class: "label" }, h("b", {}, `Policy ${policy}`), value);
  return row(label, plot(needs, STRIP, svg("line", { x1: 0, x2: needs.width, y1: STRIP / 2, y2: STRIP / 2, class: "limit" }), ...spans), "strip policy-row", (frame) => {
    write(value, counted.filter((one) => isBroken(one, frame)).map((one) => `✗ ${one.rule}`).join(" ") || (counted.length ? "none now" : "✓ none"));
  });
}

// In which broken rules two policies differ, and what follows.
export function difference(reader: Reader, against: string): HTMLElement {
  const { run, words, policy } = reader;
  const of = (name: string): { class: string; broken: string[] } => run.values.policies[name]!;
  const named = (rules: string[]): string => rules.map((code) => `${code} ${words.rules[code]!.title}`).join(", ");
  const only = (name: string, other: string): string => {
    const rules = of(name).broken.filter((code) => !of(other).broken.includes(code));
    return rules.length ? `Only ${name} counts ${named(rules)}.` : "";
  };
  const both = of(policy).broken.filter((code) => of(against).broken.includes(code));
  const verdict = of(policy).class === of(against).class ? `Both policies say ${of(policy).class}.` : `${policy} says ${of(policy).class}, ${against} says ${of(against).class}.`;
  const text = [verdict, only(policy, against), only(against, policy), both.length ? `Both count ${named(both)}.` : ""].filter(Boolean);
  return h("p", { class: "difference", id: "difference" }, text.join(" "));
}
