// What each key does; `help.ts` tells it.

import type { Clock } from "./clock.ts";
import { zoomed } from "./controls.ts";
import type { Acts } from "./keys.ts";
import { CAMERAS, GIVEN, STRETCHES, THEMES } from "./link.ts";
import { frames, type Shown, SPEEDS, type Store } from "./state.ts";

// In a simulation.
export function runKeys({ state, change }: Store, clock: Clock, shown: () => Shown, hasServer: boolean): Acts {
  const focus = (what: string): void => document.querySelector<HTMLElement>(what)?.focus();
  const second = (way: 1 | -1): void => clock.step(way * Math.round(1 / shown().run.interval));
  const faster = (by: 1 | -1): void => change({ speed: SPEEDS[Math.min(Math.max(SPEEDS.indexOf(state.speed) + by, 0), SPEEDS.length - 1)]! });
  return {
    " ": () => clock.play(!state.playing),
    ArrowLeft: () => clock.step(-1),
    ArrowRight: () => clock.step(1),
    "shift+ArrowLeft": () => second(-1),
    "shift+ArrowRight": () => second(1),
    "[": () => clock.jump(-1),
    "]": () => clock.jump(1),
    Home: () => clock.step(-frames(shown())),
    End: () => clock.step(frames(shown())),
    ",": () => faster(-1),
    ".": () => faster(1),
    c: () => change({ cam: after(CAMERAS, state.cam) }),
    s: () => change({ stretch: after<number>(STRETCHES, state.stretch) }),
    "+": () => change({ zoom: zoomed(state.zoom, 1) }),
    "-": () => change({ zoom: zoomed(state.zoom, -1) }),
    g: () => change({ ghosts: !state.ghosts }),
    l: () => focus("button.law"),
    b: () => focus("#what-if button"),
    f: () => hasServer && change({ fan: after([null, ...GIVEN], state.fan) }),
  };
}

// In the list too.
export function commonKeys({ state, change }: Store, policies: string[]): Acts {
  return {
    p: () => change({ policy: after(policies, state.policy) }),
    v: () => change({ against: after([null, ...policies.filter((one) => one !== state.policy)], state.against) }),
    t: () => change({ theme: after(THEMES, state.theme) }),
  };
}

function after<T>(all: readonly T[], one: T): T {
  return all[(all.indexOf(one) + 1) % all.length]!;
}
