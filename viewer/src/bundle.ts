// What a page is given: `overtaking.show.view` writes it into a file, `overtaking.show.server` sends it.

export interface Bundle {
  title: string;
  policy: string;
  words: Words;
  import_report: ImportReport;
  simulations: Entry[];
}

// The first findings of the examination of a recording, and the number of all.
export interface ImportReport {
  rows: Finding[];
  num_rows: number;
}

export interface Finding {
  recording: string;
  check: string;
  vehicle: string | null; // Null for the whole file, as the time.
  first_time_s: number | null;
  rows: number;
  consequence: string;
  detail: string;
}

export interface Words {
  classes: Record<string, { title: string; meaning: string; colour: string; marker: string }>;
  policies: Record<string, { meaning: string; required: string[] }>;
  rules: Record<string, RuleWords>;
  stages: Record<string, { title: string; colour: string; ink: string }>;
  themes: Record<"light" | "dark", Record<string, string>>;
  kinds?: Record<string, string>; // Vehicles by name.
  critical_ttc_s: number; // A time to collision that is shorter is critical.
  min_duration_s: number; // No overtake fits into a shorter simulation.
  road: Record<"ego" | "target" | "branch" | "brake" | "indicator" | "tail" | "lamp" | "glass" | "flash", string>;
}

export interface RuleWords {
  title: string;
  law: string;
  gloss: string;
  predicate: string;
  unit: string;
  of_ego: boolean;
}

// A row of the list.
export interface Row {
  number: number;
  classes: Record<string, string>;
  broken: string[];
  weather: string | null;
  night: boolean;
  outcome: string;
  duration_s: number;
  num_frames: number;
}

// The same with a `Packed`, compressed.
export interface Entry extends Row {
  data: string;
}

// Where others are along the road over time, seen from the ego.
export interface Thumbnail {
  lines: { target: boolean; ahead: SparseColumn }[]; // [m]
  lane: number[]; // The ego's way across the road [dm].
  stages: [string, number, number][]; // With its share of the time.
}

// Where the ego believes its neighbours to be, at every decision, in millimetres.
export interface BeliefColumns {
  interval_ms: number;
  roles: { role: string; slot: SparseColumn; seen: number[]; s_mm: SparseColumn; d_mm: SparseColumn; gap_mm: SparseColumn; true_gap_mm: SparseColumn; length_mm: SparseColumn; width_mm: SparseColumn }[];
}

// What becomes of an overtake that is begun at each instant.
export interface Fan {
  condition_on: "truth" | "belief";
  title: string;
  about: string;
  policy: string;
  pulled_out_s: number | null; // As it was.
  instants: Instant[];
}

export interface Instant {
  told_s: number;
  pulls_out_s: number | null;
  futures: number;
  shares: Record<string, { share: number | null; low: number | null; high: number | null }>; // By class; null with too few.
}

export type SparseColumn = (number | null)[];

export interface Packed {
  values: Values;
  told: Told;
  road: { side: number; borders_mm: number[]; lines: string[] | null; verges_mm: number[]; oncoming: (Oncoming & { width_mm: number }) | null; course: Course | null };
  vehicles: PackedVehicle[];
  leader: SparseColumn; // Slots of the vehicles that gaps and times to collision are about, frame by frame.
  follower: SparseColumn;
  gap_mm: SparseColumn;
  inverse_ttc: { ahead: SparseColumn; behind: SparseColumn }; // In steps of 1e-4 per second.
  sight_dm: number[] | null;
  air: { text: string; extinction: number }; // Of fog and rain [1/m]; 0: it hides nothing.
  law: { rule: string; margin: number; breach: [number, number] | null; margins: SparseColumn | null; paragraph: string }[];
  ghosts: BelievedNeighbour[];
}

// The lane of the other direction: the mark of its far edge, those of the line before it and where
// each begins [m]; seen from the lane before.
interface Oncoming {
  edge: string | null;
  marks: [number | null, string][] | null;
}

// Curvature [1/m], positive to the left, and slope at stations from the beginning of the road on.
interface Course {
  every_m: number;
  curvature: number[];
  grade: number[];
}

interface PackedVehicle {
  slot: number;
  symbol: string;
  kind: number;
  paint: string;
  length_mm: number;
  width_mm: number;
  first: number;
  away: number[];
  s: number[];
  d: number[];
  angle: number[];
  speed: number[];
  accel: number[];
  lights: number[];
}

// The parts of `overtaking show --json` that the page reads.
export interface Values {
  simulation: number;
  profile: string;
  seed: number;
  trace_hash: string;
  num_frames: number;
  frame_interval_ms: number;
  duration_s: number;
  road: {
    lane_ids: number[];
    speed_limit_mps: number | null;
    lower_limits?: { from_m: number; to_m: number; speed_limit_mps: number; direction: number }[];
  };
  weather: { preset: string | null; night: boolean; low_sun: boolean; rain_percent: number; puddles_percent: number } | null;
  vehicles: {
    vehicle: number;
    length_m: number;
    width_m: number;
    mass_kg: number | null;
    desired_speed_mps: number | null;
    start_speed_mps: number;
    start_lane_id: number;
  }[];
  stages: { stage: string; from_s: number; to_s: number }[];
  decisions: { kind: string; time_s: number }[];
  target: number | null;
  collision_partner: number | null;
  events: { event: string; frame: number; time_s: number }[];
  not_recorded: string[];
  rules_version: string;
  policies: Record<string, { class: string; broken: string[]; undecidable: string[] }>;
  broken: {
    rule: string;
    required_by: string[];
    margin: number;
    unit: string;
    first_frame: number;
    last_frame: number;
  }[];
  kept: string[];
  not_applicable: string[];
  text_not_read: string[];
}

export interface Told {
  road: string;
  weather: string;
  outcome: string;
  ending: string[];
  unknown: string[];
  vehicles: string[];
  events: { letter: string; name: string; sentence: string }[];
  broken: { rule: string; grade: string; facts: string; remedies: string[] }[];
  undecidable: string[];
  decisions: { kind: string; rows: [string, string, string, string][] }[];
}

export interface BelievedNeighbour {
  held?: boolean; // As it was at the last look.
  time_s: number;
  decision: string;
  vehicle: number | null;
  seen: boolean;
  s_m: number;
  d_m: number;
  speed_mps: number;
  length_m: number;
  width_m: number;
  gap_m: number | null;
  true_gap_m: number | null;
}

// A simulation in SI units, its columns by frame.
export interface Run extends Omit<Packed, "vehicles" | "gap_mm" | "inverse_ttc" | "sight_dm" | "law" | "road"> {
  frames: number;
  interval: number; // [s]
  road: { side: number; borders: number[]; lines: string[] | null; verges: number[]; oncoming: (Oncoming & { width: number }) | null; course: Course | null };
  vehicles: Vehicle[];
  gap: SparseColumn;
  ttc: { ahead: SparseColumn; behind: SparseColumn }; // One over the time to collision [1/s]; 0: never.
  sight: number[] | null;
  law: LawRow[];
  every: BeliefColumns | null; // Once it is there.
}

// Another course on the same clock.
export interface Overlay {
  letter: string;
  run: Run;
  frame: number; // From which on it is drawn.
}

export interface LawRow {
  rule: string;
  margin: number;
  breach: [number, number] | null;
  margins: SparseColumn | null;
  paragraph: string; // To be quoted.
}

export interface Vehicle {
  slot: number;
  symbol: string;
  kind: number;
  paint: string;
  length: number;
  width: number;
  first: number;
  last: number;
  away: Set<number>;
  s: number[];
  d: number[];
  angle: number[];
  speed: number[];
  accel: number[];
  lights: number[];
}

// Whether a vehicle travels against the ego's direction.
export function isOncoming(vehicle: Vehicle): boolean {
  return Math.cos(vehicle.angle[0]!) < 0;
}

export function symbolOf(run: Run, slot: number): string {
  return run.vehicles.find((vehicle) => vehicle.slot === slot)?.symbol ?? "?";
}

// A column from its differences, in steps of `step`.
export function column(differences: number[], step = 1, order = 1): number[] {
  const found = differences.slice();
  for (let pass = 0; pass < order; pass++) {
    for (let k = 1; k < found.length; k++) found[k]! += found[k - 1]!;
  }
  return found.map((one) => one * step);
}

// The same where some frames have no value.
export function sparse(differences: SparseColumn, step: number): SparseColumn {
  let sum = 0;
  return differences.map((one) => (one === null ? null : (sum += one) * step));
}

export function unpack(packed: Packed): Run {
  const { values, road } = packed;
  const metres = (mm: number): number => mm / 1000;
  return {
    ...packed,
    frames: values.num_frames,
    interval: values.frame_interval_ms / 1000,
    road: {
      side: road.side,
      borders: road.borders_mm.map(metres),
      lines: road.lines,
      verges: road.verges_mm.map(metres),
      oncoming: road.oncoming && { ...road.oncoming, width: metres(road.oncoming.width_mm) },
      course: road.course && { ...road.course, curvature: column(road.course.curvature, 1e-5), grade: column(road.course.grade, 1e-5) },
    },
    vehicles: packed.vehicles.map((one) => ({
      slot: one.slot,
      symbol: one.symbol,
      kind: one.kind,
      paint: one.paint,
      length: metres(one.length_mm),
      width: metres(one.width_mm),
      first: one.first,
      last: one.first + one.s.length - 1,
      away: new Set(one.away),
      s: column(one.s, 1e-3, 2),
      d: column(one.d, 1e-3, 2),
      angle: column(one.angle, 1e-4),
      speed: column(one.speed, 1e-3),
      accel: column(one.accel, 1e-3),
      lights: column(one.lights),
    })),
    leader: sparse(packed.leader, 1),
    follower: sparse(packed.follower, 1),
    gap: sparse(packed.gap_mm, 1e-3),
    ttc: { ahead: sparse(packed.inverse_ttc.ahead, 1e-4), behind: sparse(packed.inverse_ttc.behind, 1e-4) },
    sight: packed.sight_dm && column(packed.sight_dm, 0.1),
    law: packed.law.map((one) => ({ ...one, margins: one.margins && sparse(one.margins, 1e-3) })),
    every: null,
  };
}

export async function open(entry: Entry): Promise<Run> {
  const bytes = Uint8Array.from(atob(entry.data), (one) => one.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return unpack((await new Response(stream).json()) as Packed);
}

// The last recorded frame at or before a position between frames. The tolerance absorbs the rounding of whole positions.
export function recordedFrame(frame: number): number {
  return Math.floor(frame + 1e-6);
}

// Index of the decision whose beliefs apply at a frame.
function decisionAt(run: Run, every: BeliefColumns, frame: number): number {
  return Math.floor((recordedFrame(frame) * run.interval * 1000) / every.interval_ms + 1e-6);
}

function metresOf(column: SparseColumn, k: number): number | null {
  const millimetres = column[k] ?? null;
  return millimetres === null ? null : millimetres / 1000;
}

// Where the ego believes its neighbours to be at a frame; null before the beliefs are loaded.
export function believedNeighboursAt(run: Run, frame: number): BelievedNeighbour[] | null {
  const { every } = run;
  if (!every) return null;
  const k = decisionAt(run, every, frame);
  const seconds = frame * run.interval;
  const metres = (column: SparseColumn): number | null => metresOf(column, k);
  return every.roles.flatMap((role) => {
    const [s, d] = [metres(role.s_mm), metres(role.d_mm)];
    if (s === null || d === null) return [];
    return [
      {
        time_s: seconds,
        decision: "",
        held: role.seen[k] === 2,
        vehicle: role.slot[k] ?? null,
        seen: !!role.seen[k],
        s_m: s,
        d_m: d,
        speed_mps: 0,
        length_m: metres(role.length_mm) ?? 0,
        width_m: metres(role.width_mm) ?? 0,
        gap_m: metres(role.gap_mm),
        true_gap_m: metres(role.true_gap_mm),
      },
    ];
  });
}

// The driver's belief about one vehicle.
export interface Belief {
  gap: number | null; // [m]; null: the driver does not see the vehicle.
  trueGap: number | null; // [m]
  isBehind: boolean; // Both gaps are measured behind the ego.
}

// The belief about a vehicle at a frame, in any role; null without one. Beliefs are found by the slot, not by the role: from
// the decision to pull out on, the driver's leader is the vehicle ahead in the new lane.
export function beliefAbout(run: Run, slot: number, frame: number): Belief | null {
  const { every } = run;
  if (!every) return null;
  const k = decisionAt(run, every, frame);
  const roles = every.roles.filter((role) => role.slot[k] === slot);
  // A vehicle between two lanes has two roles. The driver sees it if it sees it in either role.
  const role = roles.find(({ seen }) => seen[k]) ?? roles[0];
  return role ? { gap: metresOf(role.gap_mm, k), trueGap: metresOf(role.true_gap_mm, k), isBehind: role.role.endsWith("follower") } : null;
}

// Where a vehicle is at a frame that may lie between two recorded ones; null if it is not there.
export interface Pose {
  s: number;
  d: number;
  angle: number;
  speed: number;
  accel: number;
  lights: number;
}

export function pose(vehicle: Vehicle, frame: number): Pose | null {
  const at = Math.floor(frame);
  if (at < vehicle.first || at > vehicle.last || vehicle.away.has(at)) return null;
  const here = at - vehicle.first;
  const next = Math.min(here + 1, vehicle.last - vehicle.first);
  const part = frame - at;
  const mix = (of: number[]): number => of[here]! + (of[next]! - of[here]!) * part;
  return {
    s: mix(vehicle.s),
    d: mix(vehicle.d),
    angle: mix(vehicle.angle),
    speed: mix(vehicle.speed),
    accel: vehicle.accel[here]!,
    lights: vehicle.lights[here]!,
  };
}
