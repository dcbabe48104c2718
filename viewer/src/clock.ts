// The one clock that everything follows.

import { frames, type Shown, type Store } from "./state.ts";

const MOST_PASSED = 0.25; // [s]; a tab that was hidden goes on where it was.

export interface Clock {
  play: (playing: boolean) => void;
  seek: (frame: number) => void;
  step: (frames: number) => void;
  jump: (way: 1 | -1) => void;
}

export function clock(store: Store, shown: () => Shown | null): Clock {
  let last = 0;
  let next = 0; // The frame of the browser that is asked for.

  function seek(frame: number): void {
    const here = shown();
    if (here) store.change({ t: clamp(here, Math.round(frame)) * here.run.interval });
  }

  function play(playing: boolean): void {
    const here = shown();
    if (playing === store.state.playing || !here) return;
    last = 0;
    const isOver = here.frame >= frames(here) - 1;
    cancelAnimationFrame(next);
    if (playing) next = requestAnimationFrame(tick);
    const t = (playing && isOver ? 0 : clamp(here, Math.round(here.frame))) * here.run.interval;
    store.change({ playing, t });
  }

  function tick(at: number): void {
    const here = shown();
    if (!store.state.playing || !here) return;
    const passed = last ? Math.min((at - last) / 1000, MOST_PASSED) : 0;
    last = at;
    const frame = clamp(here, here.frame + (passed * store.state.speed) / here.run.interval);
    const isOver = frame >= frames(here) - 1;
    store.change({ t: frame * here.run.interval, playing: !isOver });
    if (!isOver) next = requestAnimationFrame(tick);
  }

  function step(by: number): void {
    const here = shown();
    play(false);
    if (here) seek(Math.round(here.frame) + by);
  }

  function jump(way: 1 | -1): void {
    const here = shown();
    if (!here) return;
    const at = Math.round(here.frame);
    const ends = [0, ...here.run.values.events.map((one) => one.frame), frames(here) - 1];
    const next = ends.filter((one) => (one - at) * way > 0);
    if (next.length) step((way > 0 ? Math.min(...next) : Math.max(...next)) - at);
  }

  return { play, seek, step, jump };
}

export function clamp(shown: Shown, frame: number): number {
  return Math.min(Math.max(Number.isFinite(frame) ? frame : 0, 0), frames(shown) - 1);
}
