// What the state asks for beyond itself: the simulation, its branches, its futures, another one.

import type { Fan, Run } from "./bundle.ts";
import { busy } from "./dom.ts";
import type { Branched, Source } from "./source.ts";
import { type Branch, frameAt, type Shown, type State } from "./state.ts";
import { LETTERS } from "./whatif.ts";

export interface Courses {
  shown: (state: Readonly<State>) => Shown | null;
  // Ask for what the state wants and is not here.
  want: (state: Readonly<State>) => void;
}

// Who is told that something has arrived, or that it cannot be had.
interface Told {
  opened: (run: Run) => void;
  grown: () => void;
  refused: (error: unknown, without: Partial<State>) => void;
}

export function courses(source: Source, waiting: Element, told: Told): Courses {
  let run: Run | null = null;
  let twin: { number: number; run: Run } | null = null;
  let fans = new Map<string, Fan>();
  let branches = new Map<string, Branched>();
  const asked = new Map<string, number>(); // What is awaited, and for which opening.
  let opening = 0;

  // Asks once; what arrives when another simulation is shown is dropped.
  function ask<T>(key: string, answer: () => Promise<T>, arrived: (found: T) => void, without: () => Partial<State> | null): void {
    const ticket = opening;
    if (asked.get(key) === ticket) return;
    asked.set(key, ticket);
    const work = answer().then(
      (found) => {
        if (ticket === opening) arrived(found);
      },
      (error: unknown) => {
        const part = ticket === opening && without();
        if (part) told.refused(error, part);
      },
    );
    void busy([waiting], work).finally(() => asked.get(key) === ticket && asked.delete(key));
  }

  function open(sim: number): void {
    opening += 1;
    const arrived = (found: Run): void => {
      [run, twin, branches, fans] = [found, null, new Map(), new Map()];
      told.opened(found);
      const number = found.values.simulation;
      if (source.server) ask("beliefs", () => source.server!.beliefs(number), (every) => ((found.every = every), told.grown()), () => null);
    };
    ask(`open ${sim}`, () => source.open(sim), arrived, () => ({ sim: run?.values.simulation ?? null, beside: null, branches: [], fan: null }));
  }

  function want(state: Readonly<State>): void {
    const { sim, beside } = state;
    if (sim === null) opening += 1;
    if (sim === null) return;
    if (run?.values.simulation !== sim) {
      if (asked.get(`open ${sim}`) !== opening) open(sim);
      return;
    }
    if (beside === null) twin = null;
    else if (twin?.number !== beside) {
      ask(`beside ${beside}`, () => source.open(beside), (found) => ((twin = { number: beside, run: found }), told.grown()), () => ({ beside: null }));
    }
    const { server } = source;
    if (!server) return;
    for (const changes of state.branches) {
      const key = JSON.stringify(changes);
      if (branches.has(key)) continue;
      const wanted = changes.map(({ what, t }) => ({ what, frame: Math.round(t / run!.interval) }));
      ask(key, () => server.branch(sim, wanted), (found) => (branches.set(key, found), told.grown()), () => ({ branches: state.branches.filter((one) => one !== changes) }));
    }
    if (state.fan && !fans.has(fanKey(state))) {
      const [key, given] = [fanKey(state), state.fan];
      ask(key, () => server.fan(sim, given, state.policy), (found) => (fans.set(key, found), told.grown()), () => ({ fan: null }));
    }
  }

  return {
    want,
    shown: (state) => {
      if (!run || run.values.simulation !== state.sim) return null;
      const made = state.branches.flatMap((changes, k): Branch[] => {
        const found = branches.get(JSON.stringify(changes));
        return found ? [{ ...found, changes, letter: LETTERS[k]! }] : [];
      });
      const beside = twin?.number === state.beside ? twin!.run : null;
      const fan = (state.fan && fans.get(fanKey(state))) || null;
      return { state, words: source.words, run, twin: beside, branches: made, fan, frame: frameAt(run, state.t) };
    },
  };
}

function fanKey(state: Readonly<State>): string {
  return `fan ${state.fan} ${state.policy}`;
}
