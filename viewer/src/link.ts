// A moment as the fragment of a link: what `parse` reads is what `print` wrote.

export const CAMERAS = ["ego", "target", "all"] as const;
export const STRETCHES = [1, 2, 3] as const;

export interface Moment {
  sim: number;
  t: number; // [s]
  policy: string;
  cam: (typeof CAMERAS)[number];
  stretch: number;
  ghosts: boolean;
  filter: string; // A class, or empty.
}

export function print(moment: Moment, policy: string): string {
  const parts = [`sim=${moment.sim}`, `t=${moment.t.toFixed(3).replace(/\.?0+$/, "")}`];
  if (moment.policy !== policy) parts.push(`policy=${encodeURIComponent(moment.policy)}`);
  if (moment.cam !== "ego") parts.push(`cam=${moment.cam}`);
  if (moment.stretch !== 1) parts.push(`stretch=${moment.stretch}`);
  if (!moment.ghosts) parts.push("ghosts=0");
  if (moment.filter) parts.push(`class=${encodeURIComponent(moment.filter)}`);
  return `#${parts.join("&")}`;
}

// What a link says; what it leaves open or what cannot be, is left out.
export function parse(hash: string): Partial<Moment> {
  const said = new URLSearchParams(hash.replace(/^#/, ""));
  const found: Partial<Moment> = {};
  const sim = Number(said.get("sim") ?? NaN);
  const t = Number(said.get("t") ?? NaN);
  const stretch = Number(said.get("stretch") ?? 1);
  const cam = CAMERAS.find((one) => one === said.get("cam"));
  if (Number.isInteger(sim)) found.sim = sim;
  if (Number.isFinite(t) && t >= 0) found.t = t;
  if (STRETCHES.some((one) => one === stretch)) found.stretch = stretch;
  if (said.has("policy")) found.policy = said.get("policy")!;
  if (cam) found.cam = cam;
  found.ghosts = said.get("ghosts") !== "0";
  found.filter = said.get("class") ?? "";
  return found;
}
