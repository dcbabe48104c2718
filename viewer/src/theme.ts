import type { Words } from "./bundle.ts";

export const THEMES = ["system", "light", "dark"] as const;
export type Theme = (typeof THEMES)[number];

const night = matchMedia("(prefers-color-scheme: dark)");

export function paint(words: Words, theme: Theme): void {
  const name = theme === "system" ? (night.matches ? "dark" : "light") : theme;
  const { style, dataset } = document.documentElement;
  dataset["theme"] = name;
  style.colorScheme = name;
  for (const [key, colour] of Object.entries(words.themes[name])) style.setProperty(`--${key}`, colour);
}

export function onSystemChange(act: () => void): void {
  night.addEventListener("change", act);
}
