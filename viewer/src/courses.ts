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
  let wanted: number | null = null; // The simulation that is to be shown.
  let twin: { number: number; run: Run } | null = null;
  let fans = new Map<string, Fan>();
  let branches = new Map<string, Branched>();
  const believed = new WeakSet<Run>(); // Whose beliefs were asked for.
  const asked = new Set<string>(); // What is awaited.

  // Asks once. Answers come in any order, and late: what is no longer wanted then is dropped.
  function ask<T>(key: string, isWanted: () => boolean, answer: () => Promise<T>, arrived: (found: T) => void, without: () => Partial<State> | null): void {
    if (asked.has(key)) return;
    asked.add(key);
    const work = answer().then(
      (found) => {
        asked.delete(key);
        if (isWanted()) arrived(found);
      },
      (error: unknown) => {
        asked.delete(key);
        const part = isWanted() && without();
        if (part) told.refused(error, part);
      },
    );
    void busy([waiting], work);
  }

  function open(sim: number): void {
    const arrived = (found: Run): void => {
      [run, twin, branches, fans] = [found, null, new Map(), new Map()];
      told.opened(found);
    };
    ask(`open ${sim}`, () => wanted === sim, () => source.open(sim), arrived, () => ({ sim: run?.values.simulation ?? null, beside: null, branches: [], fan: null }));
  }

  function want(state: Readonly<State>): void {
    const { sim, beside } = state;
    wanted = sim;
    if (sim === null) return;
    if (run?.values.simulation !== sim) return open(sim);
    const here = run;
    const isHere = (): boolean => run === here && wanted === sim;
    if (beside === null) twin = null;
    else if (twin?.number !== beside) {
      ask(`${sim} beside ${beside}`, () => isHere() && state.beside === beside, () => source.open(beside), (found) => ((twin = { number: beside, run: found }), told.grown()), () => ({ beside: null }));
    }
    const { server } = source;
    if (!server) return;
    if (isModelled(here) && !believed.has(here)) {
      believed.add(here);
      ask(`${sim} beliefs`, () => true, () => server.beliefs(here.values.simulation), (every) => ((here.every = every), told.grown()), () => null);
    }
    for (const changes of state.branches) {
      const key = JSON.stringify(changes);
      if (branches.has(key)) continue;
      const isWanted = (): boolean => isHere() && state.branches.some((one) => JSON.stringify(one) === key);
      const framed = changes.map(({ what, t }) => ({ what, frame: Math.round(t / here.interval) }));
      ask(`${sim} ${key}`, isWanted, () => server.branch(sim, framed), (found) => (branches.set(key, found), told.grown()), () => ({ branches: state.branches.filter((one) => JSON.stringify(one) !== key) }));
    }
    if (state.fan && !fans.has(fanKey(state))) {
      const [key, conditionOn] = [fanKey(state), state.fan];
      ask(`${sim} ${key}`, () => isHere() && fanKey(state) === key, () => server.fan(sim, conditionOn, state.policy), (found) => (fans.set(key, found), told.grown()), () => ({ fan: null }));
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

// Whether beliefs can be asked for: not of recordings.
function isModelled({ values }: Run): boolean {
  return !values.not_recorded.length;
}

function fanKey(state: Readonly<State>): string {
  return `fan ${state.fan} ${state.policy}`;
}
