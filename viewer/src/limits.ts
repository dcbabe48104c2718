// Limits that change along the road, as those who drive along it have them.

import type { SparseColumn, Values } from "./bundle.ts";

type Road = Values["road"];

const own = (road: Road): NonNullable<Road["lower_limits"]> => (road.lower_limits ?? []).filter((one) => one.direction >= 0);

// Posted where the ego is, frame by frame.
export function limitsAlong(road: Road, places: SparseColumn): SparseColumn {
  const lower = own(road);
  return places.map((s) => {
    if (s === null) return null;
    return lower.find((one) => one.from_m <= s && s < one.to_m)?.speed_limit_mps ?? road.speed_limit_mps;
  });
}

// Where another limit begins, and it.
export function signsOf(road: Road): { at: number; limit: number }[] {
  const stations = [...new Set(own(road).flatMap((one) => [one.from_m, one.to_m]))].toSorted((a, b) => a - b);
  return limitsAlong(road, stations).map((limit, k) => ({ at: stations[k]!, limit: limit! }));
}
