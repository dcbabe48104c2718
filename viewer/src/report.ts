// The import report: findings of the examination of the recording.

import type { Finding, ImportReport } from "./bundle.ts";
import { h, table } from "./dom.ts";

const HEAD = ["recording", "check", "vehicle", "first time", "rows", "consequence", "detail"];

// A closed section; null without findings.
export function importReport({ rows, num_rows }: ImportReport): HTMLElement | null {
  if (!num_rows) return null;
  const rest = num_rows - rows.length;
  return h(
    "details",
    { class: "numbers report" },
    h("summary", {}, `Import report: ${num_rows} ${num_rows === 1 ? "finding" : "findings"} in the recording`),
    table("Findings of the examination of the recording", HEAD, rows.map(cells)),
    rest > 0 ? h("p", { class: "quiet" }, `${rest} further findings are in import_report of the data set.`) : null,
  );
}

export function cells(one: Finding): string[] {
  const time = one.first_time_s === null ? "–" : `${one.first_time_s} s`;
  return [one.recording, one.check, one.vehicle ?? "whole file", time, String(one.rows), one.consequence, one.detail];
}
