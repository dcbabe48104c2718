// How long simulations are, in words. Recordings of traffic have some that last a few frames.

import type { Row } from "./bundle.ts";

const MIN_DURATION_S = 2; // No overtake fits into less: drivers take some 4 s for a lane change alone.

export function isShort(duration_s: number): boolean {
  return duration_s < MIN_DURATION_S;
}

export function shortnessNote(duration_s: number): string {
  return isShort(duration_s) ? ", very short: no overtake fits into it" : "";
}

export function durationWords({ duration_s, num_frames }: Row): string {
  return isShort(duration_s) ? `very short: ${num_frames} frames, ${duration_s.toFixed(2)} s` : `${duration_s.toFixed(0)} s`;
}
