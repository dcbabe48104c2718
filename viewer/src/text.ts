// All that is told of a simulation as text: what `overtaking show` prints.

import { breachSpans, isBroken, isCounted, lawRowsInOrder, stageNameAt } from "./board.ts";
import type { Belief, Run, Vehicle, Words } from "./bundle.ts";
import { beliefAbout, isOncoming, pose, recordedFrame, symbolOf } from "./bundle.ts";
import { h, table } from "./dom.ts";
import { shortnessNote } from "./durations.ts";
import { formatMargin, plain, signed } from "./numbers.ts";

const KMH = 3.6;
const WIDEST = 3000; // [m]; a bend of a larger radius is not told.
const FLAT = 0.003; // A slope that is less is not told.
const NEAR_EVENT = 0.26; // [s]

export interface Reader {
  run: Run;
  words: Words;
  policy: string;
  seek: (frame: number) => void;
}

// A description of a frame in one or two sentences.
export function describeFrame(reader: Reader, frame: number): string {
  const { run, words } = reader;
  const time = frame * run.interval;
  const parts = [`${time.toFixed(2)} s, frame ${Math.round(frame)}`];
  const stage = stageNameAt(run, words, frame);
  if (stage) parts.push(stage.toLowerCase());
  const ego = pose(run.vehicles[0]!, frame);
  if (ego) parts.push(`ego ${(ego.speed * KMH).toFixed(0)} km/h`);
  const target = run.vehicles.find((vehicle) => vehicle.slot === run.values.target);
  const targetPose = target && pose(target, frame);
  if (ego && target && targetPose) parts.push(describePosition(run.vehicles[0]!.length, ego.s, targetPose.s, target) + beliefWords(beliefAbout(run, target.slot, frame)));
  const [leader, gap] = [run.leader[recordedFrame(frame)] ?? null, run.gap[recordedFrame(frame)] ?? null];
  if (leader !== null && gap !== null && leader !== target?.slot) {
    parts.push(`next ahead in its lane is ${symbolOf(run, leader)}, ${plain(gap, 1)} m away${beliefWords(beliefAbout(run, leader, frame))}`);
  }
  if (ego) parts.push(...describeCourse(run, ego.s), ...describeOncoming(run, ego.s, frame));
  if (frame > run.frames - 1) parts.push(`this simulation ended at ${run.values.duration_s.toFixed(2)} s`);
  const events = run.values.events.flatMap((event, k) =>
    Math.abs(event.time_s - time) < NEAR_EVENT ? [`E ${run.told.events[k]!.sentence}. `] : [],
  );
  return `${parts.join("; ")}. ${events.join("")}${describeLaw(reader, frame)}`;
}

// Which rules are broken at a frame, and which are broken at other times of the simulation.
export function describeLaw(reader: Reader, frame: number): string {
  const { run, policy } = reader;
  const brokenNow = brokenAt(reader, frame);
  const otherBreaches = lawRowsInOrder(reader).filter((row) => row.breach && !brokenNow.some((one) => one.rule === row.rule));
  const seconds = (at: number): string => `${(at * run.interval).toFixed(2)} s`;
  const [earlier, later]: [string[], string[]] = [[], []];
  for (const row of otherBreaches) {
    const spans = breachSpans(row);
    const past = spans.findLast(([, last]) => last < frame);
    const next = spans.find(([first]) => first > frame);
    const aside = isCounted(reader, row.rule) ? "" : ` (not counted by ${policy})`;
    const preposition = ([first, last]: [number, number], word: string): string => (first === last ? "at" : word);
    if (past) earlier.push(`${row.rule} ${preposition(past, "until")} ${seconds(past[1])}${aside}`);
    else if (next) later.push(`${row.rule} ${preposition(next, "from")} ${seconds(next[0])}${aside}`);
  }
  const sentences = [
    brokenNow.length ? `Broken now: ${brokenNow.map((one) => one.text).join("; ")}.` : "",
    earlier.length ? `Broken before: ${earlier.join(", ")}.` : "",
    later.length ? `Broken later: ${later.join(", ")}.` : "",
  ].filter(Boolean);
  if (!brokenNow.length && sentences.length) sentences.unshift("No rule is broken at this moment.");
  if (sentences.length) return sentences.join(" ");
  const undecidable = run.values.policies[policy]?.undecidable ?? [];
  if (undecidable.length) return `No rule is known to be broken; undecidable: ${undecidable.join(", ")}.`;
  return "No rule is broken in this simulation.";
}

function beliefWords(belief: Belief | null): string {
  if (!belief) return "";
  return belief.gap === null ? ", not seen" : `, believed ${plain(belief.gap, 1)} m`;
}

// Bends and slopes: the road is drawn straight and level.
export function describeCourse({ road: { course } }: Run, s: number): string[] {
  if (!course) return [];
  const at = Math.min(Math.max(Math.round(s / course.every_m), 0), course.grade.length - 1);
  const [bend, slope] = [course.curvature[at]!, course.grade[at]!];
  return [
    ...(Math.abs(bend) > 1 / WIDEST ? [`bend to the ${bend > 0 ? "left" : "right"}, radius ${Math.abs(1 / bend).toFixed(0)} m`] : []),
    ...(Math.abs(slope) > FLAT ? [`${slope > 0 ? "uphill" : "downhill"} ${Math.abs(100 * slope).toFixed(1)} %`] : []),
  ];
}

// The next oncoming vehicle.
function describeOncoming(run: Run, egoS: number, frame: number): string[] {
  const ahead = run.vehicles.filter(isOncoming).flatMap((vehicle) => {
    const at = pose(vehicle, frame);
    const gap = at && at.s - egoS - (vehicle.length + run.vehicles[0]!.length) / 2;
    return gap !== null && gap > 0 ? [{ vehicle, gap }] : [];
  });
  const next = ahead.toSorted((a, b) => a.gap - b.gap)[0];
  if (!next) return [];
  return [`oncoming ${next.vehicle.symbol} is ${next.gap.toFixed(0)} m ahead${beliefWords(beliefAbout(run, next.vehicle.slot, frame))}`];
}

function describePosition(egoLength: number, egoS: number, targetS: number, target: Vehicle): string {
  const distance = targetS - egoS;
  const gap = Math.abs(distance) - (egoLength + target.length) / 2;
  if (gap <= 0) return `alongside target ${target.symbol}`;
  return `target ${target.symbol} is ${gap.toFixed(1)} m ${distance > 0 ? "ahead" : "behind"}`;
}

// The rules that are broken at a frame, those that count first.
export function brokenAt(reader: Reader, frame: number): { rule: string; text: string; margin: string; counts: boolean }[] {
  const { words } = reader;
  return lawRowsInOrder(reader)
    .filter((row) => isBroken(row, frame))
    .map((row) => {
      const { title, unit } = words.rules[row.rule]!;
      const margin = formatMargin(row.margins?.[recordedFrame(frame)] ?? row.margin, unit);
      const counts = isCounted(reader, row.rule);
      const aside = counts ? "" : ` (not counted by ${reader.policy})`;
      return { rule: row.rule, counts, margin, text: `${row.rule} ${title} ${margin}${aside}` };
    });
}

export function facts(reader: Reader): HTMLElement {
  const { run } = reader;
  const { told, values } = run;
  const pairs: [string, string][] = [
    ["Weather", told.weather],
    ["Road", told.road + (run.road.course ? ", drawn straight though it bends or rises" : "")],
    ["Outcome", told.outcome],
    ["Recorded", `${values.duration_s.toFixed(2)} s, ${values.num_frames} frames${shortnessNote(reader.words, values.duration_s)}; profile ${values.profile}, seed ${values.seed}`],
    ["Trace", values.trace_hash],
  ];
  if (told.unknown.length) pairs.push(["Unknown", told.unknown.join(", ")]);
  return h("dl", { class: "facts" }, ...pairs.map(([name, text]) => h("div", {}, h("dt", {}, name), h("dd", {}, text))));
}

export function sections(reader: Reader): HTMLElement[] {
  const beside = [eventSection(reader), decisionSection(reader), vehicleSection(reader)];
  return [lawSection(reader), h("div", { class: "beside" }, ...beside)];
}

function section(title: string, id: string, ...children: (Node | null)[]): HTMLElement {
  return h("section", { id, "aria-labelledby": `${id}-title` }, h("h2", { id: `${id}-title` }, title), ...children);
}

function moment(reader: Reader, seconds: number): HTMLElement {
  return h(
    "button",
    {
      type: "button",
      class: "moment",
      "aria-label": `Go to ${seconds.toFixed(2)} s`,
      click: () => reader.seek(seconds / reader.run.interval),
    },
    `${seconds.toFixed(2)} s`,
  );
}

function eventSection(reader: Reader): HTMLElement {
  const { values, told } = reader.run;
  const events = values.events.map((one, k) =>
    h(
      "li",
      {},
      h("span", { class: "letter", "aria-hidden": true }, told.events[k]!.letter),
      moment(reader, one.time_s),
      h("span", {}, told.events[k]!.sentence),
    ),
  );
  return section(
    "What happened",
    "events",
    h("ol", { class: "events" }, ...events),
    ...told.ending.map((one) => h("p", { class: "ending" }, one)),
  );
}

function lawSection(reader: Reader): HTMLElement {
  const { words, policy } = reader;
  const { values, told } = reader.run;
  const policies = Object.entries(values.policies).map(([name, one]) => {
    const reasons = [
      one.broken.length ? `broken ${one.broken.join(", ")}` : "",
      one.undecidable.length ? `undecidable ${one.undecidable.join(", ")}` : "",
    ].filter(Boolean);
    return h(
      "div",
      { class: name === policy ? "policy chosen" : "policy", "data-policy": name },
      h("dt", {}, name, name === policy ? h("small", {}, " (chosen)") : null),
      h(
        "dd",
        {},
        chip(words, one.class),
        reasons.length ? ` ${reasons.join("; ")}` : null,
        h("p", {}, words.classes[one.class]!.meaning),
        h("p", { class: "quiet" }, words.policies[name]!.meaning),
      ),
    );
  });
  const broken = told.broken.map((_, k) => breach(reader, k));
  const rest: [string, string][] = told.undecidable.map((one) => ["Undecidable", one]);
  if (!broken.length) rest.push(["Broken", "nothing"]);
  if (values.kept.length) rest.push(["Kept", values.kept.join(", ")]);
  if (values.not_applicable.length) rest.push(["Do not apply", values.not_applicable.join(", ")]);
  if (values.text_not_read.length) rest.push(["Text unread", values.text_not_read.join(", ")]);
  return section(
    "The law",
    "law",
    h("p", { class: "quiet" }, `${values.rules_version}, an interpretation, no legal advice`),
    h("dl", { class: "policies" }, ...policies),
    broken.length ? h("h3", {}, "Broken, and what would have been legal") : null,
    ...broken,
    h("dl", { class: "rest" }, ...rest.map(([name, text]) => h("div", {}, h("dt", {}, name), h("dd", {}, text)))),
  );
}

export function chip(words: Words, name: string): HTMLElement {
  const patch = h("span", { class: "patch", "aria-hidden": true, "data-marker": words.classes[name]!.marker });
  patch.style.setProperty("--patch", words.classes[name]!.colour);
  return h("span", { class: "chip" }, patch, name);
}

function breach(reader: Reader, k: number): HTMLElement {
  const { run, words, policy } = reader;
  const [one, told] = [run.values.broken[k]!, run.told.broken[k]!];
  const counts = one.required_by.includes(policy);
  const remedies = told.remedies.map((text, place) => h("li", {}, `${place ? "or" : "needs"} ${text}`));
  return h(
    "article",
    { class: counts ? "rule broken" : "rule aside", "data-rule": one.rule },
    h("h4", {}, `${one.rule} ${told.rule}: ${told.grade}`),
    h("p", {}, told.facts, counts ? null : h("span", { class: "quiet" }, ` Policy ${policy} does not count it.`)),
    h("p", { class: "gloss" }, words.rules[one.rule]!.gloss),
    h("ul", { class: "remedies" }, ...remedies),
  );
}

// What a row of the law strip says when it is chosen.
export function ruleCard(reader: Reader, code: string): Node[] {
  const { run, words } = reader;
  const rule = words.rules[code]!;
  const k = run.values.broken.findIndex((one) => one.rule === code);
  const told = run.told.broken[k];
  const row = run.law.find((one) => one.rule === code);
  const head = `${code} ${rule.title}, ${rule.law}`;
  return [
    h("p", {}, h("b", {}, head), told ? `: ${told.grade}` : `: kept, least margin ${formatMargin(row?.margin ?? 0, rule.unit)}`),
    ...(told ? [h("p", {}, told.facts)] : []),
    h("blockquote", {}, row?.paragraph ?? rule.gloss),
    h("p", { class: "quiet" }, `Checked: ${rule.predicate}`),
  ];
}

function decisionSection(reader: Reader): HTMLElement {
  const { told, values } = reader.run;
  const rows = told.decisions.flatMap((one, k) =>
    one.rows.map((row, place) => [
      place ? null : moment(reader, values.decisions[k]!.time_s),
      place ? null : one.kind,
      ...row,
    ]),
  );
  const head = ["time", "to", "of whom", "gap m", "closing km/h", "the law"];
  const caption = "What the driver believed when deciding (and what was true)";
  const nothing = h("p", {}, values.decisions.length ? "" : "No decision was recorded.");
  return section("Beliefs", "beliefs", rows.length ? table(caption, head, rows) : nothing);
}

function vehicleSection(reader: Reader): HTMLElement {
  const { run } = reader;
  const [ego] = run.vehicles;
  const rows = run.values.vehicles.map((one, k) => {
    const vehicle = run.vehicles[k]!;
    const role = vehicle.slot === 0 ? "ego" : vehicle.slot === run.values.target ? "target" : "";
    const ahead = vehicle.first ? `at ${(vehicle.first * run.interval).toFixed(1)} s` : signed(vehicle.s[0]! - ego!.s[0]!, 1);
    return [
      h("b", {}, vehicle.symbol),
      role,
      run.told.vehicles[k]!,
      `${one.length_m.toFixed(1)}×${one.width_m.toFixed(1)}`,
      one.mass_kg === null ? "?" : one.mass_kg.toFixed(0),
      String(one.start_lane_id),
      vehicle.slot === 0 ? "" : ahead,
      (one.start_speed_mps * KMH).toFixed(0),
      one.desired_speed_mps === null ? "?" : (one.desired_speed_mps * KMH).toFixed(0),
    ];
  });
  const head = ["name", "role", "vehicle", "size m", "mass kg", "lane", "ahead m", "km/h", "wants"];
  return section("Who was there", "vehicles", table("Vehicles as they begin", head, rows));
}

// Every vehicle at an instant: the twin of top view and charts.
export function numbers(reader: Reader, frame: number): HTMLElement {
  const { run } = reader;
  const ego = pose(run.vehicles[0]!, frame);
  const rows = run.vehicles.flatMap((vehicle) => {
    const at = pose(vehicle, frame);
    if (!at) return [];
    const ahead = vehicle.slot === 0 || !ego ? "" : signed(at.s - ego.s, 1);
    const belief = run.every ? [believedGapCell(run, vehicle, frame)] : [];
    return [[h("b", {}, vehicle.symbol, isOncoming(vehicle) ? " oncoming" : null), (at.speed * KMH).toFixed(1), signed(at.accel, 1), ahead, at.d.toFixed(2), ...belief, lamps(at.lights)]];
  });
  const head = ["name", "km/h", "m/s²", "ahead m", "lateral m", ...(run.every ? ["gap m, believed (true)"] : []), "lamps"];
  return table(`All vehicles at ${(frame * run.interval).toFixed(2)} s`, head, rows);
}

function believedGapCell(run: Run, vehicle: Vehicle, frame: number): string {
  const belief = beliefAbout(run, vehicle.slot, frame);
  if (!belief) return "";
  const truth = belief.trueGap === null ? "" : ` (${plain(belief.trueGap, 1)})`;
  return `${belief.gap === null ? "not seen" : plain(belief.gap, 1)}${truth}`;
}

const LAMPS: [number, string][] = [
  [1, "left indicator"],
  [2, "right indicator"],
  [4, "brake"],
  [8, "low beam"],
  [16, "high beam"],
  [32, "rear fog"],
];

function lamps(lights: number): string {
  const on = LAMPS.filter(([bit]) => lights & bit).map(([, name]) => name);
  return on.join(", ") || "–";
}
