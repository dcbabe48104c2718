// What is shown: all that the page draws and tells follows from it.

import type { Branched } from "./source.ts";
import type { Fan, Overlay, Run, Words } from "./bundle.ts";
import { type Change, type Moment, noChoice } from "./link.ts";

export const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 8];

export interface State extends Moment {
  playing: boolean;
  speed: number;
  zoom: number;
  base: number | null; // Place of the branch that what-if goes on from; null: the original.
}

export interface Store {
  readonly state: Readonly<State>;
  change: (part: Partial<State>) => void;
}

export interface Branch extends Branched, Overlay {
  changes: Change[];
}

// A moment of a simulation with all that lies beside it.
export interface Shown {
  state: Readonly<State>;
  words: Words;
  run: Run;
  twin: Run | null;
  branches: Branch[];
  fan: Fan | null;
  frame: number;
}

export function begin(policy: string): State {
  return {
    ...{ sim: null, t: 0, policy, against: null, cam: "ego", stretch: 1, ghosts: true },
    ...{ choice: noChoice(), branches: [], beside: null, fan: null },
    ...{ playing: false, speed: 1, zoom: 1, theme: "system", base: null },
  };
}

// A store whose owner is told the state before each change.
export function store(state: State, react: (before: State) => void): Store {
  return {
    state,
    change: (part) => {
      const before = { ...state };
      Object.assign(state, part);
      if (state.against === state.policy) state.against = null;
      if (state.base !== null && state.base >= state.branches.length) state.base = null;
      react(before);
    },
  };
}

// The frame of a time; one that differs from a whole one by its rounding alone is whole.
export function frameAt(run: Run, t: number): number {
  const frame = t / run.interval;
  return Math.abs(frame - Math.round(frame)) < 1e-6 ? Math.round(frame) : frame;
}

// Every course on the clock beside the original.
export function overlays(shown: Shown): Overlay[] {
  const { branches, twin, state } = shown;
  return [...branches, ...(twin ? [{ letter: String(state.beside), run: twin, frame: 0 }] : [])];
}

// Of the longest course.
export function frames(shown: Shown): number {
  return Math.max(shown.run.frames, ...overlays(shown).map((one) => one.run.frames));
}
