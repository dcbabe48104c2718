import { h } from "./dom.ts";

const KEYS: [string, string][] = [
  ["Space", "play or pause"],
  ["← →", "one frame back or on"],
  ["Shift ← →", "one second back or on"],
  ["[ ]", "event before or after"],
  ["Home End", "first or last frame"],
  ["J K", "next or previous simulation"],
  [", .", "slower or faster"],
  ["C", "camera: ego, target, all"],
  ["S", "stretch across the road: ×1, ×2, ×3"],
  ["+ −", "zoom"],
  ["G", "beliefs on or off"],
  ["P", "next policy"],
  ["V", "another policy beside it"],
  ["T", "theme: system, light, dark"],
  ["L", "to the rules; Tab for the next, Esc to close what is said of one"],
  ["B", "to what if, in a served page; Tab goes through its choices"],
  ["F", "fan of futures: hindsight, its decision, none; in a served page"],
  ["A", "to all simulations, in a served page"],
  ["/", "to the filter of the list"],
  ["?", "this help"],
];

export function helpDialog(): HTMLDialogElement {
  const rows = KEYS.map(([key, text]) => {
    const caps = key.split(" ").flatMap((one) => [h("kbd", {}, one), " "]);
    return h("div", {}, h("dt", {}, ...caps), h("dd", {}, text));
  });
  const marks: [string, string][] = [
    ["solid frame, blue", "the ego, whose overtaking is studied"],
    ["dashed frame, orange", "the target, the vehicle to overtake"],
    ["dashed white box", "believed position of the vehicle that is named beside it; hatched if the driver does not see the vehicle"],
    ["▲ ▼ in a chart", "the curve is beyond the axis, and that is its farthest value"],
    ["dashed box with a letter", "a vehicle of that branch, where it is elsewhere than in the original"],
    ["band around a share", "its 95 % interval among the futures; fewer than 20 futures have no share"],
    ["dotted line across the road", "how far the ego sees a lit vehicle"],
    ["✗ and coloured hatching", "a rule is broken, and the policy counts it"],
    ["(✗) and grey hatching", "a rule is broken, and the policy does not count it"],
    ["least, now", "smallest margin of the whole simulation, and margin at the cursor; negative: broken"],
  ];
  const dialog = h(
    "dialog",
    { id: "help", "aria-labelledby": "help-title" },
    h("form", { method: "dialog" }, h("button", { class: "close", "aria-label": "Close help" }, "×")),
    h("h2", { id: "help-title" }, "Keys"),
    h("dl", { class: "keys" }, ...rows),
    h("h2", {}, "Marks"),
    h("dl", { class: "keys marks" }, ...marks.map(([name, text]) => h("div", {}, h("dt", {}, name), h("dd", {}, text)))),
    h("p", { class: "quiet" }, "The address of the page is a link to the moment that it shows."),
  );
  return dialog;
}
