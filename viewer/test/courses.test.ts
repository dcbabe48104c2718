// What is asked for, where answers come in any order.

import assert from "node:assert/strict";
import { test } from "node:test";

import type { Run } from "../src/bundle.ts";
import { courses } from "../src/courses.ts";
import type { Source } from "../src/source.ts";
import { begin, type State } from "../src/state.ts";

interface Asked {
  what: string;
  answer: (found?: unknown) => Promise<void>;
  refuse: () => Promise<void>;
}

// A source that answers when it is told to, and what the page is told.
function staged(): { state: State; asked: (what: string) => Asked; all: Asked[]; told: string[]; want: (part: Partial<State>) => void; beside: () => number | undefined } {
  const [all, told]: [Asked[], string[]] = [[], []];
  const ask = (what: string, found: unknown): Promise<never> =>
    new Promise<unknown>((answer, refuse) => {
      const done = (act: () => void) => async (): Promise<void> => (act(), new Promise((next) => setImmediate(next)));
      all.push({ what, answer: done(() => answer(found)), refuse: done(() => refuse(new Error(what))) });
    }) as Promise<never>;
  const run = (number: number): unknown => ({ values: { simulation: number, not_recorded: [] }, road: { oncoming: null }, frames: 9, interval: 0.05 }) as unknown as Partial<Run>;
  const server = {
    beliefs: (number: number) => ask(`beliefs ${number}`, { interval_ms: 50, roles: [] }),
    branch: (number: number, changes: { what: string }[]) => ask(`branch ${number} ${changes[0]!.what}`, { run: run(number) }),
  };
  const source = { words: {}, server, open: (number: number) => ask(`open ${number}`, run(number)) } as unknown as Source;
  const state = begin("paper");
  const waiting = { setAttribute: () => undefined } as unknown as Element;
  const change = (part: Partial<State>): void => {
    Object.assign(state, part);
    found.want(state);
  };
  const found = courses(source, waiting, {
    opened: (one) => (told.push(`opened ${one.values.simulation}`), found.want(state)),
    grown: () => told.push("grown"),
    refused: (error, without) => (told.push(`refused ${(error as Error).message}`), change(without)),
  });
  const asked = (what: string): Asked => all.findLast((one) => one.what === what)!;
  return { state, asked, all, told, want: change, beside: () => found.shown(state)?.twin?.values.simulation };
}

test("a simulation that is no longer wanted is not opened", async () => {
  const { asked, told, want } = staged();
  want({ sim: 3 });
  await asked("open 3").answer();
  want({ sim: 4 });
  want({ sim: 3 });
  await asked("open 4").answer();
  assert.deepEqual(told, ["opened 3"]);
  want({ sim: 5 });
  want({ sim: 6 });
  await asked("open 6").answer();
  await asked("open 5").answer();
  assert.deepEqual(told, ["opened 3", "opened 6"]);
});

test("beliefs come though the list was shown meanwhile", async () => {
  const { asked, all, told, want } = staged();
  want({ sim: 3 });
  await asked("open 3").answer();
  want({ sim: null });
  await asked("beliefs 3").answer();
  want({ sim: 3 });
  assert.deepEqual(told, ["opened 3", "grown"]);
  assert.equal(all.length, 2);
});

test("the last that is wanted beside it is there", async () => {
  const { asked, want, beside } = staged();
  want({ sim: 3 });
  await asked("open 3").answer();
  want({ beside: 8 });
  want({ beside: 9 });
  await asked("open 9").answer();
  await asked("open 8").answer();
  assert.equal(beside(), 9);
});

test("what is refused is dropped once, and only if it is still wanted", async () => {
  const { state, asked, all, told, want } = staged();
  want({ sim: 3 });
  await asked("open 3").answer();
  const stay = (): State["branches"] => [[{ what: "STAY", t: 1 }]];
  want({ branches: stay() });
  want({ branches: stay() }); // As a link that is followed says it.
  await asked("branch 3 STAY").refuse();
  assert.deepEqual(state.branches, []);
  assert.deepEqual(told.slice(1), ["refused branch 3 STAY"]);
  assert.equal(all.filter((one) => one.what.startsWith("branch")).length, 1);
  want({ beside: 8 });
  want({ beside: null });
  await asked("open 8").refuse();
  assert.equal(told.length, 2);
});
