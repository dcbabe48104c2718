// Durations of simulations, in words. Some simulations of recorded traffic last only a few frames.

import type { Row, Words } from "./bundle.ts";

export function isShort({ min_duration_s }: Words, duration_s: number): boolean {
  return duration_s < min_duration_s;
}

export function shortnessNote(words: Words, duration_s: number): string {
  return isShort(words, duration_s) ? ", very short: no overtake fits into it" : "";
}

export function durationWords(words: Words, { duration_s, num_frames }: Row, digits: number): string {
  return isShort(words, duration_s) ? `very short: ${num_frames} frames, ${duration_s.toFixed(2)} s` : `${duration_s.toFixed(digits)} s`;
}
