// Bundles the page into the folder that is given: one script, one style sheet.

import { build } from "esbuild";

const common = { bundle: true, minify: true, legalComments: "none", charset: "utf8", logLevel: "warning" };
const target = ["chrome115", "firefox119", "safari17"];
const out = process.argv[2];
await build({ ...common, target, format: "esm", entryPoints: ["src/main.ts"], outfile: `${out}/viewer.js` });
await build({ ...common, target, entryPoints: ["src/page.css"], outfile: `${out}/viewer.css` });
