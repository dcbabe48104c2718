// Where simulations come from: the page itself, or the server that sent it.

import { open, unpack, type Bundle, type Entry, type BeliefColumns, type Fan, type ImportReport, type Packed, type Row, type Run, type Thumbnail, type Words } from "./bundle.ts";
import { h } from "./dom.ts";
import { isShort } from "./durations.ts";
import { FACETS, parse, type Choice, type Facet } from "./link.ts";

// A part of the list; counts by property and value are of what all other properties leave.
export interface Listed {
  rows: Row[];
  first: number;
  found: number;
  read: number;
  total: number;
  counts: Record<Facet, Record<string, number>>;
  failure: string;
}

export interface Branched {
  title: string;
  frame: number;
  parts: number | null; // First frame that differs.
  said: string[];
  run: Run;
}

export interface Answer {
  columns: string[];
  rows: unknown[][];
  num_rows: number;
  is_cut: boolean;
  filters: boolean;
}

export interface Source {
  title: string;
  policy: string;
  words: Words;
  import_report: ImportReport;
  total: number;
  first: number; // The simulation to show where none is named.
  rows: (choice: Choice, policy: string, around?: number) => Promise<Listed>;
  open: (number: number) => Promise<Run>;
  // What only a server can give.
  server: Server | null;
}

export interface Server {
  decisions: Record<string, string>;
  weathers: string[];
  beliefs: (number: number) => Promise<BeliefColumns>;
  branch: (number: number, changes: { what: string; frame: number }[]) => Promise<Branched>;
  fan: (number: number, conditionOn: Fan["condition_on"], policy: string) => Promise<Fan>;
  thumbnail: (number: number) => Promise<Thumbnail>;
  sql: (text: string) => Promise<Answer>;
}

export const PAGE = 50;

// What this page holds, or the server that sent it.
export async function connect(): Promise<Source> {
  const held = document.getElementById("data")?.textContent;
  if (held) return embedded(JSON.parse(held) as Bundle);
  try {
    return await served(parse(location.hash).token);
  } catch (error) {
    document.body.append(h("main", { class: "closed" }, h("h1", {}, "overtaking view"), h("p", { role: "alert" }, (error as Error).message)));
    throw error;
  }
}

function embedded(bundle: Bundle): Source {
  const { simulations } = bundle;
  return {
    ...bundle,
    total: simulations.length,
    first: mostInformative(simulations, bundle.policy, bundle.words).number,
    server: null,
    rows: async (choice, policy) => {
      const values = (one: Entry): Partial<Record<Facet, string[]>> => ({
        classes: [one.classes[policy] ?? ""],
        rules: one.broken,
        weather: [one.weather ?? ""],
        light: [one.night ? "night" : "day"],
      });
      const meets = (one: Entry, facet: Facet): boolean => {
        const [own, wanted] = [values(one)[facet] ?? [], choice[facet]];
        return !wanted.length || (facet === "rules" ? wanted.every((code) => own.includes(code)) : wanted.some((name) => own.includes(name)));
      };
      const rows = simulations.filter((one) => FACETS.every((facet) => meets(one, facet)));
      const counts = {} as Listed["counts"];
      for (const facet of FACETS) {
        counts[facet] = {};
        const rest = simulations.filter((one) => FACETS.every((other) => (other === facet && facet !== "rules") || meets(one, other)));
        for (const name of rest.flatMap((one) => values(one)[facet] ?? [])) counts[facet][name] = (counts[facet][name] ?? 0) + 1;
      }
      const total = simulations.length;
      return { rows, first: 0, found: rows.length, read: total, total, counts, failure: "" };
    },
    open: (number) => open(simulations.find((one) => one.number === number) ?? simulations[0]!),
  };
}

// The simulation with which a page opens: the first attempt that is recorded to its end; without one, the first attempt; without
// one, the first simulation that is long enough for an overtake; else the longest.
export function mostInformative<T extends Row>(rows: T[], policy: string, words: Words): T {
  const long = rows.filter((row) => !isShort(words, row.duration_s));
  const attempts = long.filter((row) => row.classes[policy] !== "No_attempt");
  const longest = rows.reduce((best, row) => (row.duration_s > best.duration_s ? row : best), rows[0]!);
  return attempts.find((row) => row.classes[policy] !== "censored") ?? attempts[0] ?? long[0] ?? longest;
}

// A busy server refuses a request with status 429; the page asks again, at most this often.
const MAX_ATTEMPTS = 10;

async function ask<T>(path: string, body?: unknown, attempt = 1): Promise<T> {
  const sent: RequestInit = body === undefined ? {} : { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) };
  let answer: Response;
  try {
    answer = await fetch(`/api/${path}`, { credentials: "same-origin", ...sent });
  } catch {
    throw new Error("overtaking view has ended: start it again");
  }
  if (answer.status === 429 && attempt < MAX_ATTEMPTS) {
    const pause = Number(answer.headers.get("Retry-After") ?? 1);
    await new Promise((resume) => setTimeout(resume, 1000 * pause));
    return ask(path, body, attempt + 1);
  }
  const told = (await answer.json()) as T & { error?: string };
  if (!answer.ok) throw new Error(told.error ?? answer.statusText);
  return told;
}

type Start = Pick<Source, "title" | "policy" | "words" | "import_report" | "total"> & Pick<Server, "decisions" | "weathers">;

// The server that sent this page. A token opens it, once.
async function served(token: string | undefined): Promise<Source> {
  if (token) {
    history.replaceState(null, "", location.hash.replace(/[#&]token=[^&]*&?/, "#"));
    // Used before, by this browser: then its cookie is enough.
    await ask("session", { token }).catch((error: unknown) => ask("start").catch(() => Promise.reject(error)));
  }
  const start = await ask<Start>("start");
  return {
    ...start,
    first: 0,
    rows: ({ first, ...choice }, policy, around) => ask<Listed>("rows", { ...choice, policy, ...(around === undefined ? { first } : { around }), count: PAGE }),
    open: async (number) => unpack(await ask<Packed>(`runs/${number}`)),
    server: {
      decisions: start.decisions,
      weathers: start.weathers,
      beliefs: (number) => ask(`runs/${number}/beliefs`),
      branch: async (number, changes) => {
        const named = changes.map(({ what, frame }) => ({ frame, ...(what in start.decisions ? { decision: what } : { weather: what }) }));
        const told = await ask<Omit<Branched, "run"> & { run: Packed }>(`runs/${number}/branches`, { changes: named });
        return { ...told, run: unpack(told.run) };
      },
      fan: (number, conditionOn, policy) => ask(`runs/${number}/fan`, { condition_on: conditionOn, policy }),
      thumbnail: (number) => ask(`runs/${number}/thumbnail`),
      sql: (text) => ask("sql", { sql: text }),
    },
  };
}
