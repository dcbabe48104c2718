// A moment as the fragment of a link: what `parse` reads is what `print` wrote.

export const CAMERAS = ["ego", "target", "all"] as const;
export const STRETCHES = [1, 2, 3] as const;
export const GIVEN = ["truth", "belief"] as const;
export const THEMES = ["system", "light", "dark"] as const;
export type Theme = (typeof THEMES)[number];
export const ORDERS = ["number", "duration", "margin"] as const;

// Properties of which any of the chosen values may be met; of `rules` all must be broken.
export const FACETS = ["classes", "rules", "weather", "light", "ego", "overtaken"] as const;
export type Facet = (typeof FACETS)[number];

const NAMES: Record<Facet, string> = { classes: "class", rules: "rule", weather: "weather", light: "light", ego: "ego", overtaken: "target" };

// Which simulations are listed, and in which order.
export interface Choice extends Record<Facet, string[]> {
  margin: { rule: string; least: number | null; most: number | null } | null;
  sql: string;
  order: (typeof ORDERS)[number];
  descending: boolean;
  first: number;
}

export interface Moment {
  sim: number | null; // None: the list alone.
  t: number; // [s]
  policy: string;
  against: string | null; // Another policy beside it.
  cam: (typeof CAMERAS)[number];
  stretch: number;
  ghosts: boolean;
  theme: Theme;
  choice: Choice;
  branches: Change[][]; // Each has one change, or several in turn.
  beside: number | null; // Another simulation on the same clock.
  fan: (typeof GIVEN)[number] | null; // What the futures of a start at each instant share.
}

// What is otherwise from an instant on: a decision or a weather.
export interface Change {
  what: string;
  t: number; // [s]
}

export const MOST_BRANCHES = 4;
export const MOST_CHANGES = 4; // Of one branch.
const THEN = "~"; // Between the changes of a branch.

export function noChoice(): Choice {
  return { classes: [], rules: [], weather: [], light: [], ego: [], overtaken: [], margin: null, sql: "", order: "number", descending: false, first: 0 };
}

// How many conditions a choice has.
export function conditions(choice: Choice): number {
  return FACETS.filter((one) => choice[one].length).length + (choice.margin ? 1 : 0) + (choice.sql ? 1 : 0);
}

// The moment at which another simulation of the same list begins.
export function beginning(moment: Moment, sim: number | null): Moment {
  return { ...moment, sim, t: 0, branches: [], beside: null, fan: null };
}

export function print(moment: Moment, policy: string): string {
  const parts: string[] = [];
  const say = (name: string, value: string | number): number => parts.push(`${name}=${encodeURIComponent(value).replaceAll("%2C", ",").replaceAll("%40", "@").replaceAll("%3A", ":")}`);
  if (moment.sim !== null) {
    say("sim", moment.sim);
    say("t", short(moment.t));
  }
  if (moment.policy !== policy) say("policy", moment.policy);
  if (moment.against !== null) say("against", moment.against);
  if (moment.cam !== "ego") say("cam", moment.cam);
  if (moment.stretch !== 1) say("stretch", moment.stretch);
  if (!moment.ghosts) say("ghosts", 0);
  if (moment.theme !== "system") say("theme", moment.theme);
  if (moment.branches.length) say("if", moment.branches.map((one) => one.map(({ what, t }) => `${what}@${short(t)}`).join(THEN)).join(","));
  if (moment.beside !== null) say("vs", moment.beside);
  if (moment.fan) say("fan", moment.fan);
  const { choice } = moment;
  for (const facet of FACETS) if (choice[facet].length) say(NAMES[facet], choice[facet].join(","));
  if (choice.margin) say("margin", `${choice.margin.rule}:${choice.margin.least ?? ""}:${choice.margin.most ?? ""}`);
  if (choice.sql) say("sql", choice.sql);
  if (choice.order !== "number" || choice.descending) say("sort", `${choice.descending ? "-" : ""}${choice.order}`);
  if (choice.first) say("from", choice.first);
  return `#${parts.join("&")}`;
}

function short(value: number): string {
  return value.toFixed(3).replace(/\.?0+$/, "");
}

// What a link says; what it leaves open or what cannot be, is left out.
export function parse(hash: string): Partial<Moment> & { choice: Choice; branches: Change[][]; token?: string } {
  const said = new URLSearchParams(hash.replace(/^#/, ""));
  const number = (name: string): number => Number(said.get(name)?.trim() || NaN);
  const whole = (name: string): number | null => (Number.isSafeInteger(number(name)) && number(name) >= 0 ? number(name) : null);
  const found: ReturnType<typeof parse> = { choice: parseChoice(said), branches: parseBranches(said.get("if") ?? "") };
  const cam = CAMERAS.find((one) => one === said.get("cam"));
  const fan = GIVEN.find((one) => one === said.get("fan"));
  const theme = THEMES.find((one) => one === said.get("theme"));
  const stretch = said.has("stretch") ? number("stretch") : 1;
  if (whole("sim") !== null) found.sim = whole("sim");
  if (number("t") >= 0) found.t = number("t");
  if (STRETCHES.some((one) => one === stretch)) found.stretch = stretch;
  if (said.has("policy")) found.policy = said.get("policy")!;
  if (said.has("against")) found.against = said.get("against");
  if (fan) found.fan = fan;
  if (cam) found.cam = cam;
  if (theme) found.theme = theme;
  if (whole("vs") !== null) found.beside = whole("vs");
  if (said.has("token")) found.token = said.get("token")!;
  found.ghosts = said.get("ghosts") !== "0";
  return found;
}

function parseChoice(said: URLSearchParams): Choice {
  const choice = noChoice();
  for (const facet of FACETS) choice[facet] = (said.get(NAMES[facet]) ?? "").split(",").filter(Boolean);
  const [rule, least, most] = (said.get("margin") ?? "").split(":");
  if (rule) choice.margin = { rule, least: bound(least), most: bound(most) };
  choice.sql = said.get("sql") ?? "";
  const sort = said.get("sort") ?? "";
  choice.order = ORDERS.find((one) => one === sort.replace(/^-/, "")) ?? "number";
  choice.descending = sort.startsWith("-");
  const first = Number(said.get("from") ?? 0);
  choice.first = Number.isSafeInteger(first) && first > 0 ? first : 0;
  return choice;
}

export function bound(text: string | undefined): number | null {
  const value = Number(text?.trim() || NaN);
  return Number.isFinite(value) ? value : null;
}

function parseBranches(text: string): Change[][] {
  const branches = text.split(",").map((one) => one.split(THEN).flatMap(parseChange).slice(0, MOST_CHANGES));
  return branches.filter((one) => one.length).slice(0, MOST_BRANCHES);
}

function parseChange(text: string): Change[] {
  const [what, t] = text.split("@");
  const seconds = bound(t);
  return what && /^\w+$/.test(what) && seconds !== null && seconds >= 0 ? [{ what, t: seconds }] : [];
}
